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
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bellcrank.arrays import Array, Complex
from bellcrank.studies.synthesis.kinds import SAFE, Turning, longest_of

WIDEST_RATIO = 20.0  # of rocker to coupler, either way
LEAST_SHARE = 0.01  # of ρ: below it the crank is very short


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
