"""Lengths of drawn arrows: one scale for each unit, linear up to the usual magnitude and logarithmic above it.

An impact lasts for a few steps, with forces a hundred times larger than all others; on a linear scale nothing else
would be visible.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bellcrank.arrays import Array
from bellcrank.replays.film.film import Arrow, Film

LONGEST = 0.45  # arrow, as a share of half the height of the view
USUAL = 95.0  # percentile of the magnitudes up to which the scale is linear
OUTSTANDING = 3.0  # ratio of peak to usual magnitude below which the scale is linear throughout
LINEAR = 0.7  # share of the longest arrow for the linear part, if there is a logarithmic one
ROUNDING = 1e-9  # of the peak: smaller magnitudes are rounding errors


@dataclass(frozen=True, kw_only=True)
class ArrowScale:
    """The scale of the arrows (by number) of one unit.

    An arrow of the `usual` magnitude is `length` (m) long; each factor of ten above it adds `decade` (m). `peak` is the
    largest magnitude.
    """

    unit: str
    arrows: tuple[int, ...]
    usual: float
    length: float
    decade: float
    peak: float

    def lengths(self, magnitudes: Array) -> Array:
        """The lengths (n,) m of arrows of magnitudes (n,), as the page draws them."""
        above = np.log10(np.maximum(magnitudes / self.usual, 1.0))
        return np.asarray(self.length * np.minimum(magnitudes / self.usual, 1.0) + self.decade * above)


def arrow_scales(film: Film) -> list[ArrowScale]:
    """The scales of a film's arrows, one for each unit."""
    camera = film.camera
    distance = float(np.linalg.norm(np.subtract(camera.position, camera.target)))
    return scales_up_to(film.arrows, LONGEST * distance * float(np.tan(np.deg2rad(20.0))))


def scales_up_to(arrows: Sequence[Arrow], longest: float) -> list[ArrowScale]:
    """The scales of arrows, one for each unit, of which the longest arrow has a length (m)."""
    scales = []
    for unit in dict.fromkeys(arrow.unit for arrow in arrows):
        numbers = tuple(k for k, arrow in enumerate(arrows) if arrow.unit == unit)
        sizes = np.concatenate([_magnitudes(arrows[k].vectors) for k in numbers])
        scales.append(_scale(unit, numbers, sizes, longest))
    return scales


def _magnitudes(vectors: Array) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):
        sizes = np.linalg.norm(vectors, axis=1)
    return np.asarray(sizes[np.isfinite(sizes)])


def _scale(unit: str, arrows: tuple[int, ...], sizes: Array, longest: float) -> ArrowScale:
    usual, length, decade, peak = 1.0, longest, 0.0, float(sizes.max(initial=0.0))
    if peak > 0.0:
        usual = float(np.percentile(sizes[sizes > ROUNDING * peak], USUAL))
        if peak <= OUTSTANDING * usual:
            usual = peak
        else:
            length, decade = LINEAR * longest, (1.0 - LINEAR) * longest / float(np.log10(peak / usual))
    return ArrowScale(unit=unit, arrows=arrows, usual=usual, length=length, decade=decade, peak=peak)
