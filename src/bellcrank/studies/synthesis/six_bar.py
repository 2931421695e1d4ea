"""Six-bars in closed form, many at once: a crank-rocker whose coupler point carries a dyad to the ground or the rocker.

The crank is the unit of length; ground a, coupler b, rocker d and their angles are those of the crank-rocker. The dyad
begins at P = e^{iθ} + b p e^{iφ} on the coupler and ends at R: on the ground, R = a (1/2 + r) (Stephenson III), or on
the rocker, R = a + d r e^{iψ} (Watt I), with complex numbers p and r. Its links are e from P, which carries the point
that is traced, and f. A shape is that of the crank-rocker, then p, r, λ and ρ: from the least distance D₁ of P and R
over a turn and the largest one D₂, λ and ρ give e and f as in `four_bar_range`. So every shape within the bounds for
which there is such a dyad assembles at each crank angle, never leaves its branch, and keeps the angle between e and f
within τ and π − τ.

The point is z + w P + c e^{iχ} with the angle χ of e (J. M. McCarthy, G. S. Soh, Geometric Design of Linkages, 2nd ed.
(2011), chapter 6).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bellcrank.arrays import Array, Complex
from bellcrank.studies.synthesis.four_bar import CrankRockers, Lengths, lengths_of, rocker_angles, spanning
from bellcrank.studies.synthesis.kinds import Turning, longest_of

GRID = 2.0 * np.pi * np.arange(72) / 72.0  # crank angles between which the distance of P and R has one extreme
ON_COUPLER, ON_GROUND, ON_ROCKER = 1.5, 2.0, 1.5  # how far p and r reach from the middle of their link
SIZE = 9  # of a shape


class Joints(NamedTuple):
    """P and R (n, points), and their derivatives by the crank's angle (n, points) and the shape (n, points, 9)."""

    first: Complex
    last: Complex
    by_angle: tuple[Complex, Complex]
    by_shape: tuple[Complex, Complex]


@dataclass(frozen=True)
class SixBars:
    """Six-bars with a least transmission angle τ, rad; `on_rocker`: Watt I, else Stephenson III.

    A branch is 1 or −1, as that of the crank-rocker, with the dyad on the left of the line from P to R; twice as much
    with it on the right.
    """

    transmission: float
    on_rocker: bool
    effort = 2
    branches = (1.0, -1.0, 2.0, -2.0)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """See `Kind`."""
        lower, upper = CrankRockers(self.transmission).bounds
        end = ON_ROCKER if self.on_rocker else ON_GROUND
        reach = np.array([ON_COUPLER, ON_COUPLER, end, end])
        middle = np.array([0.5, 0.0, 0.0, 0.0])
        ends = np.array([-1.0, 0.0]), np.array([1.0, 1.0])  # of λ and ρ
        return np.concatenate([lower, middle - reach, ends[0]]), np.concatenate([upper, middle + reach, ends[1]])

    def shapes(self, drawn: Array) -> Array:
        """See `Kind`."""
        lower, upper = self.bounds
        rest = lower[3:] + (upper[3:] - lower[3:]) * drawn[:, 3:]
        return np.concatenate([CrankRockers(self.transmission).shapes(drawn[:, :3]), rest], axis=1)

    def ratios(self, shape: Array, branch: Array) -> Array:
        """Ground, coupler, rocker, both links of the dyad (n, 5) over the crank."""
        lengths = lengths_of(shape, self.transmission)
        return np.concatenate([lengths.links, self._dyad(shape, lengths, np.sign(branch))[0]], axis=1)

    def places(self, shape: Array, ratios: Array) -> Complex:
        """The joint on the coupler and the second pivot (2,) of one shape over the crank, as x + i y along the lines of
        their links.
        """
        end = ratios[2] * (shape[5] + 1j * shape[6]) if self.on_rocker else ratios[0] * (0.5 + shape[5] + 1j * shape[6])
        return np.array([ratios[1] * (shape[3] + 1j * shape[4]), end])

    def turning(self, shape: Array, crank: Array, branch: Array, slopes: bool) -> Turning:
        """See `CouplerKind`: the direction of the dyad's first link."""
        lengths, side = lengths_of(shape, self.transmission), np.sign(branch)
        links, by_links = self._dyad(shape, lengths, side)
        near, far = (column[:, None] for column in links.T)
        longest = longest_of(np.concatenate([lengths.links, links], axis=1))
        joints = self._joints(shape, lengths, crank, side, slopes)
        gap = joints.last - joints.first
        distance = np.abs(gap)
        with np.errstate(invalid="ignore"):  # NaN where there is no dyad
            cosine = (near**2 + distance**2 - far**2) / (2.0 * near * distance)
            cosine = np.where(np.abs(cosine) < 1.0, cosine, np.nan)
            left = np.where(np.abs(branch) < 1.5, 1.0, -1.0)[:, None]
            on_link = gap / distance * (cosine + 1j * left * np.sqrt(1.0 - cosine**2))
        if not slopes:
            return Turning(on_link, longest, base=joints.first)
        on_last = (near * on_link - gap) / far
        between = on_link / on_last
        lever = near * between.imag
        by_gap = [last - first for first, last in (joints.by_angle, joints.by_shape)]
        by_angle = -(by_gap[0] * on_last.conj()).real / lever
        by_shape = between.real[:, :, None] * by_links[:, None, 0] - by_links[:, None, 1]
        by_shape = (by_shape - (by_gap[1] * on_last.conj()[:, :, None]).real) / lever[:, :, None]
        return Turning(on_link, longest, by_angle, by_shape, joints.first, joints.by_angle[0], joints.by_shape[0])

    def _dyad(self, shape: Array, lengths: Lengths, side: Array) -> tuple[Array, Array]:
        """Both links of the dyad (n, 2) and their derivatives (n, 2, 9)."""
        found = [self._extreme(shape, lengths, side, sign) for sign in (1.0, -1.0)]
        return spanning(found[0], found[1], shape[:, 7], shape[:, 8], (7, 8), self.transmission)

    def _extreme(self, shape: Array, lengths: Lengths, side: Array, sign: float) -> tuple[Array, Array]:
        """The logarithm (n,) of the least distance of P and R over a turn, or of the largest with `sign` −1, and its
        derivatives (n, 9).
        """

        def square(angles: Array) -> Array:
            joints = self._joints(shape, lengths, angles, side, False)
            return np.asarray(sign * np.abs(joints.last - joints.first) ** 2)

        best, width = GRID[square(np.broadcast_to(GRID, (len(shape), len(GRID)))).argmin(axis=1)], GRID[1]
        for _ in range(3):
            left, here, right = square(best[:, None] + width * np.array([-1.0, 0.0, 1.0])).T
            bend = left - 2.0 * here + right
            best = best + np.clip(0.5 * width * (left - right) / np.where(bend > 0.0, bend, np.inf), -width, width)
            width *= 0.1
        joints = self._joints(shape, lengths, best[:, None], side, True)
        gap, by_gap = joints.last - joints.first, joints.by_shape[1] - joints.by_shape[0]
        distance = np.maximum(np.abs(gap), 1e-300)
        return np.log(distance[:, 0]), (gap.conj()[:, :, None] * by_gap).real[:, 0] / distance**2

    def _joints(self, shape: Array, lengths: Lengths, crank: Array, side: Array, slopes: bool) -> Joints:
        """The dyad's ends at crank angles (n, points)."""
        ground, coupler, rocker = (column[:, None] for column in lengths.links.T)
        p, r = ((shape[:, k] + 1j * shape[:, k + 1])[:, None] for k in (3, 5))
        turning = CrankRockers(self.transmission).turning(shape[:, :3], crank, side, slopes)
        on_coupler, on_crank = turning.directions, np.exp(1j * crank)
        first = on_crank + coupler * p * on_coupler
        if self.on_rocker:
            on_rocker = (on_crank + coupler * on_coupler - ground) / rocker
            last = ground + rocker * r * on_rocker
        else:
            last = ground * (0.5 + r) + 0.0 * on_crank
        none = np.zeros_like(first)
        if not slopes:
            return Joints(first, last, (none, none), (none[:, :, None], none[:, :, None]))
        by_ground, by_coupler, by_rocker = (lengths.slopes[:, None, k] for k in range(3))
        by_first, by_last = (np.zeros((*crank.shape, SIZE), dtype=complex) for _ in range(2))
        arm = (p * on_coupler)[:, :, None]
        by_first[:, :, :3] = arm * (by_coupler + 1j * coupler[:, :, None] * turning.by_shape)
        by_first[:, :, 3], by_first[:, :, 4] = coupler * on_coupler, 1j * coupler * on_coupler
        first_turned = 1j * on_crank + 1j * coupler * p * on_coupler * turning.by_angle
        if not self.on_rocker:
            by_last[:, :, :3] = (0.5 + r)[:, :, None] * by_ground
            by_last[:, :, 5], by_last[:, :, 6] = ground, 1j * ground
            return Joints(first, last, (first_turned, none), (by_first, by_last))
        _, by_angle, by_links = rocker_angles(lengths.links, crank, side)
        swung = np.einsum("npl,nls->nps", by_links, lengths.slopes)
        by_last[:, :, :3] = by_ground + (r * on_rocker)[:, :, None] * (by_rocker + 1j * rocker[:, :, None] * swung)
        by_last[:, :, 5], by_last[:, :, 6] = rocker * on_rocker, 1j * rocker * on_rocker
        last_turned = 1j * rocker * r * on_rocker * by_angle
        return Joints(first, last, (first_turned, last_turned), (by_first, by_last))
