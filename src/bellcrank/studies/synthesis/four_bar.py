"""Crank-rockers in closed form, many at once: coupler angles, their derivatives, and the fit of a path.

The crank is the unit of length. A shape is (log q, μ₁, ρ): the ratio q of rocker to coupler, the least transmission
angle μ₁, and the share ρ of what is left up to π − τ by which the largest one, μ₂, is above it. With F(μ) = √(1 + q² −
2 q cos μ) the coupler is b = 2 / (F(μ₂) − F(μ₁)), the rocker d = q b and the ground a = b (F(μ₁) + F(μ₂)) / 2: the
distance from the crank's end to the rocker's pivot is b F(μ), and runs from a − 1 to a + 1. So every shape within
τ ≤ μ₁ and 0 < ρ ≤ 1 assembles at each crank angle, has a crank that turns fully (Grashof), never leaves its branch, and
keeps its transmission angle within τ and π − τ.

With the crank's angle θ from the line of the pivots, the coupler's angle φ follows from the loop
e^{iθ} + b e^{iφ} = a + d e^{iψ} (J. M. McCarthy, G. S. Soh, Geometric Design of Linkages, 2nd ed. (2011), chapter 2).
The coupler point z + w e^{iθ} + c e^{iφ} is linear in the complex numbers z (pivot), w (crank: its length and the
direction of the ground) and c (coupler point); they are found by linear least squares inside (variable projection:
G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413-432), with the derivatives of L. Kaufman, BIT 15 (1975)
49-57.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
WIDEST_RATIO = 20.0  # of rocker to coupler, either way
LEAST_SHARE = 0.01  # of ρ: below it the crank is very short
SAFE = 1e-3  # rad: of τ at least, so that no linkage is flat


class Lengths(NamedTuple):
    """Ground a, coupler b and rocker d (n,) over the crank, and their derivatives (n, 3, 3) by the shape."""

    links: Array
    slopes: Array


class Fit(NamedTuple):
    """The best placement of n linkages: residuals (n, points), their derivatives (n, points, angle and shape), z, w and
    c (n, 3), and an orthonormal basis (n, points, 3) of what placements reach.
    """

    residual: Complex
    slopes: Complex
    placement: Complex
    basis: Complex

    def outside(self, slopes: Complex) -> Complex:
        """The part of derivatives (n, points, k) that no placement takes up."""
        return np.asarray(slopes - self.basis @ (self.basis.conj().transpose(0, 2, 1) @ slopes))


def shape_bounds(transmission: float) -> tuple[Array, Array]:
    """Lower and upper bounds (3,) of a shape, for a least transmission angle τ, rad."""
    least = max(transmission, SAFE)
    width = np.log(WIDEST_RATIO)
    return np.array([-width, least, LEAST_SHARE]), np.array([width, np.pi - least - SAFE, 1.0])


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


def fit(shape: Array, crank: Array, branch: Array, points: Complex, transmission: float, slopes: bool = True) -> Fit:
    """Place linkages of shapes (n, 3) with crank angles (n, points) so that their coupler points are nearest to points.

    The derivatives are those by each point's own crank angle (column 0) and by the shape (columns 1 to 3).
    """
    lengths = lengths_of(shape, transmission)
    on_crank, on_coupler = np.exp(1j * crank), coupler_directions(lengths.links, crank, branch)
    basis = np.stack([np.ones_like(on_crank), on_crank, on_coupler], axis=2)
    orthonormal, triangle = np.linalg.qr(basis)
    coordinates = np.einsum("npk,p->nk", orthonormal.conj(), points)
    residual = points - np.einsum("npk,nk->np", orthonormal, coordinates)
    diagonal = np.abs(np.einsum("nkk->nk", triangle))
    flat = diagonal.min(axis=1) < 1e-9 * diagonal.max(axis=1)  # the coupler moves as the crank does: no placement
    triangle[flat] = np.eye(3)
    placement = np.linalg.solve(triangle, coordinates[:, :, None])[:, :, 0]
    residual[flat] = np.inf
    if not slopes:
        return Fit(residual, np.zeros((0, 0, 0), dtype=complex), placement, orthonormal)
    ground, coupler, rocker = (column[:, None] for column in lengths.links.T)
    on_rocker = (on_crank + coupler * on_coupler - ground) / rocker
    between = on_coupler / on_rocker
    lever = coupler * between.imag
    by_angle = -(on_crank / on_rocker).imag / lever
    by_links = np.stack([-on_rocker.real, between.real, -np.ones_like(lever)], axis=2) / lever[:, :, None]
    by_shape = np.einsum("npl,nls->nps", by_links, lengths.slopes)
    turn, swing = (1j * placement[:, 1:2] * on_crank), (1j * placement[:, 2:] * on_coupler)
    moved = np.concatenate([(turn + swing * by_angle)[:, :, None], swing[:, :, None] * by_shape], axis=2)
    moved[flat] = 0.0
    return Fit(residual, -moved, placement, orthonormal)


def coupler_curve(links: Array, branch: float, placement: Complex, crank: Array) -> Complex:
    """The coupler points (n,) of one linkage at crank angles (n,), rad from the line of the pivots."""
    on_coupler = coupler_directions(links[None], crank[None], np.array([branch]))[0]
    found: Complex = placement[0] + placement[1] * np.exp(1j * crank) + placement[2] * on_coupler
    return found
