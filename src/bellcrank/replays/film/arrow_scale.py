"""How long arrows are drawn: one scale a unit, linear for what is usual, and logarithmic above it.

A lock or a blow lasts for a few steps and pulls a hundred times harder than all else; on one linear scale nothing but
the blow would be seen.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bellcrank.replays.film.film import Array, Film

LONGEST = 0.45  # arrow, as a share of half the height of the view
USUAL = 95.0  # percentile of the magnitudes up to which the scale is linear
OUTSTANDING = 3.0  # times the usual: below it the scale is linear all the way
LINEAR = 0.7  # share of the longest arrow that the linear part takes, where there is a logarithmic one
NOTHING = 1e-9  # of the peak: rounding, not a force


def arrow_scales(film: Film) -> list[dict[str, Any]]:
    """One scale a unit: `length` (m) of an arrow of `usual` magnitude, and `decade` (m) more for each factor of ten."""
    camera = film.camera
    distance = float(np.linalg.norm(np.subtract(camera.position, camera.target)))
    longest = LONGEST * distance * float(np.tan(np.deg2rad(20.0)))
    scales = []
    for unit in dict.fromkeys(arrow.unit for arrow in film.arrows):
        numbers = [k for k, arrow in enumerate(film.arrows) if arrow.unit == unit]
        sizes = np.concatenate([_magnitudes(film.arrows[k].vectors) for k in numbers])
        scales.append({"unit": unit, "arrows": numbers, **_scale(sizes, longest)})
    return scales


def _magnitudes(vectors: Array) -> Array:
    with np.errstate(over="ignore", invalid="ignore"):
        sizes = np.linalg.norm(vectors, axis=1)
    return np.asarray(sizes[np.isfinite(sizes)])


def _scale(sizes: Array, longest: float) -> dict[str, float]:
    peak = float(sizes.max(initial=0.0))
    if peak == 0.0:
        return {"usual": 1.0, "length": longest, "decade": 0.0, "peak": 0.0}
    usual = float(np.percentile(sizes[sizes > NOTHING * peak], USUAL))
    if peak <= OUTSTANDING * usual:
        return {"usual": peak, "length": longest, "decade": 0.0, "peak": peak}
    decade = (1.0 - LINEAR) * longest / float(np.log10(peak / usual))
    return {"usual": usual, "length": LINEAR * longest, "decade": decade, "peak": peak}
