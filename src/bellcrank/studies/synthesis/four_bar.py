"""Four-bars in closed form, many at once: crank-rockers by their transmission angles, and how coupler and rocker turn.

The crank is the unit of length. A shape is (log q, μ₁, ρ): the ratio q of rocker to coupler, the least transmission
angle μ₁, and the share ρ of what is left up to π − τ by which the largest one, μ₂, is above it. With F(μ) = √(1 + q² −
2 q cos μ) the coupler is b = 2 / (F(μ₂) − F(μ₁)), the rocker d = q b and the ground a = b (F(μ₁) + F(μ₂)) / 2: the
distance from the crank's end to the rocker's pivot is b F(μ), and runs from a − 1 to a + 1. So every shape within
τ ≤ μ₁ and 0 < ρ ≤ 1 assembles at each crank angle, has a crank that turns fully (Grashof), never leaves its branch, and
keeps its transmission angle within τ and π − τ.

With the crank's angle θ from the line of the pivots, the angles φ of the coupler and ψ of the rocker follow from the
loop e^{iθ} + b e^{iφ} = a + d e^{iψ} (J. M. McCarthy, G. S. Soh, Geometric Design of Linkages, 2nd ed. (2011),
chapter 2).

The crank is the unit of length, and need not turn fully. A shape is (log a, λ, ρ) with the ground a. From the crank's
end to the rocker's pivot it is √(1 + a² − 2 a cos θ), which has the least value D₁ and the largest value D₂ in the
range of θ. With the ratio q of rocker to coupler and F(μ) = √(1 + q² − 2 q cos μ), the transmission angle is within τ
and π − τ where the coupler b is from D₂ / F(π − τ) to D₁ / F(τ). There is such a coupler where |log q| ≤ W, with
cosh W = cos τ coth log(D₂ / D₁); so log q = λ W with −1 ≤ λ ≤ 1, and b is between its two ends by the share ρ of the
logarithms. Every shape within the bounds for which there is a W assembles in the whole range, on one branch.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bellcrank.arrays import Array, Complex
from bellcrank.studies.synthesis.kinds import SAFE, SynthesisOutput, Turning, longest_of

WIDEST_RATIO = 20.0  # of rocker to coupler, either way
LEAST_SHARE = 0.01  # of ρ: below it the crank is very short
WIDE = np.log(WIDEST_RATIO)  # of the ground, of rocker to coupler, and of the coupler to D₂


class Lengths(NamedTuple):
    """Ground a, coupler b and rocker d (n,) over the crank, and their derivatives (n, 3, 3) by the shape."""

    links: Array
    slopes: Array


@dataclass(frozen=True)
class CrankRockers:
    """Crank-rockers with a least transmission angle τ, rad."""

    transmission: float
    effort = 1
    branches = (1.0, -1.0)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """See `Kind`."""
        least = max(self.transmission, SAFE)
        width = np.log(WIDEST_RATIO)
        return np.array([-width, least, LEAST_SHARE]), np.array([width, np.pi - least - SAFE, 1.0])

    def shapes(self, drawn: Array) -> Array:
        """See `Kind`: small shares are drawn more often."""
        lower, upper = self.bounds
        return np.asarray(lower + (upper - lower) * np.c_[drawn[:, 0], drawn[:, 1], drawn[:, 2] ** 2])

    def ratios(self, shape: Array, branch: Array) -> Array:
        """Ground, coupler and rocker (n, 3) over the crank."""
        return lengths_of(shape, self.transmission).links

    def turning(self, shape: Array, crank: Array, branch: Array, slopes: bool) -> Turning:
        """See `CouplerKind`."""
        lengths = lengths_of(shape, self.transmission)
        on_coupler = coupler_directions(lengths.links, crank, branch)
        if not slopes:
            return Turning(on_coupler, longest_of(lengths.links))
        on_crank = np.exp(1j * crank)
        ground, coupler, rocker = (column[:, None] for column in lengths.links.T)
        on_rocker = (on_crank + coupler * on_coupler - ground) / rocker
        between = on_coupler / on_rocker
        lever = coupler * between.imag
        by_angle = -(on_crank / on_rocker).imag / lever
        by_links = np.stack([-on_rocker.real, between.real, -np.ones_like(lever)], axis=2) / lever[:, :, None]
        by_shape = np.einsum("npl,nls->nps", by_links, lengths.slopes)
        return Turning(on_coupler, longest_of(lengths.links), by_angle, by_shape)


def lengths_of(shape: Array, transmission: float) -> Lengths:
    """The lengths of shapes (n, 3)."""
    q, first, share = np.exp(shape[:, 0]), shape[:, 1], shape[:, 2]
    top = np.pi - max(transmission, SAFE)
    second = first + share * (top - first)
    near, far = (np.sqrt(1.0 + q * q - 2.0 * q * np.cos(angle)) for angle in (first, second))
    zero = np.zeros_like(q)
    d_near = np.stack([q * (q - np.cos(first)) / near, q * np.sin(first) / near, zero], axis=1)
    by_second = q * np.sin(second) / far
    d_far = np.stack([q * (q - np.cos(second)) / far, by_second * (1.0 - share), by_second * (top - first)], axis=1)
    coupler = 2.0 / (far - near)
    d_coupler = -0.5 * (coupler**2)[:, None] * (d_far - d_near)
    ground = 0.5 * coupler * (near + far)
    d_ground = 0.5 * (near + far)[:, None] * d_coupler + 0.5 * coupler[:, None] * (d_near + d_far)
    d_rocker = q[:, None] * d_coupler
    d_rocker[:, 0] += q * coupler
    links = np.stack([ground, coupler, q * coupler], axis=1)
    return Lengths(links, np.stack([d_ground, d_coupler, d_rocker], axis=1))


def coupler_directions(links: Array, crank: Array, branch: Array) -> Complex:
    """e^{iφ} (n, points) at crank angles (n, points), on the branch +1 or −1 (n,)."""
    ground, coupler, rocker = (column[:, None] for column in links.T)
    reach = ground - np.exp(1j * crank)
    distance = np.abs(reach)
    cosine = np.clip((coupler**2 + distance**2 - rocker**2) / (2.0 * coupler * distance), -1.0, 1.0)
    found: Complex = reach / distance * (cosine + 1j * branch[:, None] * np.sqrt(1.0 - cosine**2))
    return found


def rocker_angles(links: Array, crank: Array, branch: Array) -> tuple[Array, Array, Array]:
    """The rocker's angles ψ (n, points) at crank angles (n, points), and their derivatives by the crank's angle
    (n, points) and by ground, coupler and rocker (n, points, 3).
    """
    ground, coupler, rocker = (column[:, None] for column in links.T)
    with np.errstate(invalid="ignore"):  # NaN of linkages that do not assemble
        on_crank, on_coupler = np.exp(1j * crank), coupler_directions(links, crank, branch)
        on_rocker = (on_crank + coupler * on_coupler - ground) / rocker
        between = on_rocker / on_coupler
        lever = rocker * between.imag
        by_links = np.stack([on_coupler.real, -np.ones_like(lever), between.real], axis=2) / lever[:, :, None]
        return np.angle(on_rocker), (on_crank / on_coupler).imag / lever, by_links


@dataclass(frozen=True)
class FourBarsOverRange:
    """Four-bars with a least transmission angle τ, rad, while the crank turns from its first angle to its last."""

    transmission: float
    effort = 1
    branches = (1.0, -1.0)
    angular = True

    @property
    def bounds(self) -> tuple[Array, Array]:
        """See `Kind`."""
        return np.array([-WIDE, -1.0, 0.0]), np.array([WIDE, 1.0, 1.0])

    def shapes(self, drawn: Array) -> Array:
        """See `Kind`."""
        lower, upper = self.bounds
        return np.asarray(lower + (upper - lower) * drawn)

    def output(self, shape: Array, crank: Array, branch: Array, slopes: bool) -> SynthesisOutput:
        """See `OutputKind`: the rocker's angle."""
        links, by_shape = self.links(shape, crank)
        angle, by_angle, by_links = rocker_angles(links, crank, branch)
        if not slopes:
            return SynthesisOutput(angle)
        changed = np.einsum("npl,nls->nps", by_links, by_shape)
        return SynthesisOutput(angle, by_angle + changed[:, :, 3], changed[:, :, :3])

    def links(self, shape: Array, crank: Array) -> tuple[Array, Array]:
        """Ground, coupler and rocker (n, 3), NaN where there are none, and their derivatives (n, 3, 4) by the shape and
        by a common change of the crank's angles.
        """
        ground = np.exp(shape[:, 0])
        near, far = (_distance(ground, *end) for end in _ends(crank))
        links, by_links = spanning(near, far, shape[:, 1], shape[:, 2], (1, 2), self.transmission)
        by_ground = np.zeros((len(shape), 1, 4))
        by_ground[:, 0, 0] = ground
        return np.c_[ground, links], np.concatenate([by_ground, by_links], axis=1)


def spanning(
    near: tuple[Array, Array],
    far: tuple[Array, Array],
    skew: Array,
    share: Array,
    places: tuple[int, int],
    transmission: float,
) -> tuple[Array, Array]:
    """Two links (n, 2) that span all distances from D₁ to D₂ with an angle from τ to π − τ between them, NaN where
    there are none, and their derivatives (n, 2, k); `near` and `far` are log D₁ and log D₂ (n,) with theirs (n, k),
    `skew` and `share` are λ and ρ, the numbers `places` of a shape.
    """
    edge = np.cos(max(transmission, SAFE))
    (d_1, by_1), (d_2, by_2) = near, far
    spread, by_spread = d_2 - d_1, by_2 - by_1
    with np.errstate(all="ignore"):
        cosh = edge / np.tanh(spread)
        width = np.arccosh(cosh)  # NaN where no links span both distances
        rise = -edge / (np.sinh(spread) ** 2 * np.sqrt(cosh**2 - 1.0))
    capped = width > WIDE
    width, rise = np.where(capped, WIDE, width), np.where(capped, 0.0, rise)
    ratio = skew * width
    by_ratio = (skew * rise)[:, None] * by_spread
    by_ratio[:, places[0]] += width
    q = np.exp(ratio)
    ends = []
    for cosine, distance, by in ((-edge, d_2, by_2), (edge, d_1, by_1)):
        square = 1.0 + q * q - 2.0 * q * cosine
        steep = q * (q - cosine) / square
        ends.append((distance - 0.5 * np.log(square), by - steep[:, None] * by_ratio))
    (low, by_low), (high, by_high) = ends
    most = WIDE + d_2
    high, by_high = np.where(high > most, most, high), np.where((high > most)[:, None], by_2, by_high)
    first = (1.0 - share) * low + share * high
    by_first = (1.0 - share)[:, None] * by_low + share[:, None] * by_high
    by_first[:, places[1]] += high - low
    links = np.exp(np.stack([first, first + ratio], axis=1))
    return links, links[:, :, None] * np.stack([by_first, by_first + by_ratio], axis=1)


def _ends(crank: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """The crank's angles (n,) nearest to the line of the pivots and farthest from it, between the first and the last of
    (n, points), and how each changes with all of these: 1 at an end, 0 on that line.
    """
    first, last = crank[:, 0], crank[:, -1]
    low, high = np.minimum(first, last), np.maximum(first, last)
    found = []
    for line, best in ((0.0, np.argmax), (np.pi, np.argmin)):
        next_one = line + 2.0 * np.pi * np.ceil((low - line) / (2.0 * np.pi))
        inside = next_one <= high
        end = np.where(best(np.cos(np.stack([low, high])), axis=0) == 0, low, high)
        found.append((np.where(inside, next_one, end), np.where(inside, 0.0, 1.0)))
    return found[0], found[1]


def _distance(ground: Array, angle: Array, moves: Array) -> tuple[Array, Array]:
    """The logarithm (n,) of the distance from the crank's end to the rocker's pivot, and its derivatives (n, 4) by
    log a, λ, ρ and the crank's angles.
    """
    square = np.maximum(1.0 + ground * ground - 2.0 * ground * np.cos(angle), 1e-300)
    none = np.zeros_like(ground)
    by_ground, by_angle = ground * (ground - np.cos(angle)) / square, ground * np.sin(angle) * moves / square
    return 0.5 * np.log(square), np.stack([by_ground, none, none, by_angle], axis=1)
