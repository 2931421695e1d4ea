"""Slider-cranks in closed form, many at once: how coupler and slider move, and their derivatives.

The crank is the unit of length, and its angle θ is from the direction of the guide. The slider moves on a line beside
the crank's pivot, at an offset e to the left. The coupler's angle φ and the slider's position x follow from the loop
e^{iθ} + b e^{iφ} = x + i e with cos φ > 0 (J. M. McCarthy, G. S. Soh, Geometric Design of Linkages, 2nd ed. (2011),
chapter 2); with cos φ < 0 it is the same linkage, turned by half a turn. The transmission angle μ is that between
coupler and the normal of the guide, cos μ = |sin φ| = |e − sin θ| / b.

A shape is (log g, σ): the coupler is b = (1 + g) / cos τ and the offset e = σ g. With g > 0 and |σ| ≤ 1 it is
1 + |e| ≤ b cos τ: every shape within the bounds has a crank that turns fully, never leaves its branch, and keeps μ ≥ τ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bellcrank.arrays import Array
from bellcrank.studies.synthesis.kinds import SAFE, SynthesisOutput, Turning, longest_of

LEAST, MOST = 0.005, 40.0  # of g: the shortest coupler, and one of which the slider's motion is nearly a sine


@dataclass(frozen=True)
class SliderCranks:
    """Slider-cranks with a least transmission angle τ, rad."""

    transmission: float
    effort = 1
    branches = (1.0,)
    angular = False

    @property
    def bounds(self) -> tuple[Array, Array]:
        """See `Kind`."""
        return np.array([np.log(LEAST), -1.0]), np.array([np.log(MOST), 1.0])

    def shapes(self, drawn: Array) -> Array:
        """See `Kind`."""
        lower, upper = self.bounds
        return np.asarray(lower + (upper - lower) * drawn)

    def ratios(self, shape: Array, branch: Array) -> Array:
        """Coupler and offset (n, 2) over the crank."""
        return self.lengths(shape)[0]

    def lengths(self, shape: Array) -> tuple[Array, Array]:
        """Coupler and offset (n, 2) over the crank, and their derivatives (n, 2, 2) by the shape."""
        g, share = np.exp(shape[:, 0]), shape[:, 1]
        edge = np.cos(max(self.transmission, SAFE))
        by_coupler = np.stack([g / edge, np.zeros_like(g)], axis=1)
        by_offset = np.stack([share * g, g], axis=1)
        return np.stack([(1.0 + g) / edge, share * g], axis=1), np.stack([by_coupler, by_offset], axis=1)

    def turning(self, shape: Array, crank: Array, branch: Array, slopes: bool) -> Turning:
        """See `CouplerKind`."""
        links, by_shape = self.lengths(shape)
        coupler, offset = (column[:, None] for column in links.T)
        sine = (offset - np.sin(crank)) / coupler
        cosine = np.sqrt(1.0 - sine**2)
        if not slopes:
            return Turning(cosine + 1j * sine, longest_of(links))
        lever = coupler * cosine
        by_links = np.stack([-sine, np.ones_like(sine)], axis=2) / lever[:, :, None]
        changed = np.einsum("npl,nls->nps", by_links, by_shape)
        return Turning(cosine + 1j * sine, longest_of(links), -np.cos(crank) / lever, changed)

    def output(self, shape: Array, crank: Array, branch: Array, slopes: bool) -> SynthesisOutput:
        """See `OutputKind`: the slider's position."""
        found = self.turning(shape, crank, branch, slopes)
        links, by_shape = self.lengths(shape)
        coupler, sine = links[:, :1], found.directions.imag
        value = np.cos(crank) + coupler * found.directions.real
        if not slopes:
            return SynthesisOutput(value)
        by_start = -np.sin(crank) - coupler * sine * found.by_angle
        changed = by_shape[:, None, 0, :] * found.directions.real[:, :, None]
        return SynthesisOutput(value, by_start, changed - (coupler * sine)[:, :, None] * found.by_shape)
