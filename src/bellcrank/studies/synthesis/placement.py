"""Linkages placed at best: what is linear is found by least squares inside (variable projection).

The coupler point z + w e^{iθ} + c e^{iφ} of a linkage whose crank is at θ and whose coupler is at φ is linear in the
complex numbers z (pivot), w (crank: its length and the direction of the ground) and c (coupler point). Where the
coupler's directions e^{iα} are given too, they are u e^{iφ} with a fourth number u, linear as well. The position of a
slider is linear in the length of the crank and an offset; an angle has an offset alone.

Variable projection: G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413-432, with the derivatives of
L. Kaufman, BIT 15 (1975) 49-57.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Array, Complex, Mask
from bellcrank.studies.synthesis.kinds import CouplerKind, LinkageKind, OutputKind

Numbers = NDArray[Any]  # real or complex


class Fit(NamedTuple):
    """The best placement of n linkages: residuals (n, targets), their derivatives (n, targets, angle and shape), the
    placement (n, numbers), and an orthonormal basis (n, targets, numbers) of what placements reach.
    """

    residual: Numbers
    slopes: Numbers
    placement: Numbers
    basis: Numbers

    def outside(self, slopes: Numbers) -> Numbers:
        """The part of derivatives (n, targets, k) that no placement takes up."""
        return np.asarray(slopes - self.basis @ (self.basis.conj().transpose(0, 2, 1) @ slopes))


class Task(Protocol):
    """What linkages of a kind are to do."""

    @property
    def kind(self) -> LinkageKind:
        """Their kind."""

    @property
    def targets(self) -> Numbers:
        """What is to be reached (targets,)."""

    def fit(self, shape: Array, crank: Array, branch: Array, slopes: bool = True) -> Fit:
        """Place linkages of shapes (n, k) with crank angles (n, points) so that they are nearest to the targets.

        The derivatives are those by each target's own crank angle (column 0; by a common change of all of them where
        they are prescribed) and by the shape (the other columns).
        """


@dataclass(frozen=True, eq=False)
class PointTask:
    """A coupler point passes points (points,), and the coupler has directions e^{iα} (points,) where these are given:
    the numbers of a placement are z, w, c, and u.
    """

    kind: CouplerKind
    points: Complex
    directions: Complex | None = None
    longest: float = np.inf  # length of a link

    @property
    def targets(self) -> Complex:
        """The points, then the directions."""
        return self.points if self.directions is None else np.concatenate([self.points, self.directions])

    def fit(self, shape: Array, crank: Array, branch: Array, slopes: bool = True) -> Fit:
        """See `Task`."""
        turning = self.kind.turning(shape, crank, branch, slopes)
        on_coupler = turning.directions
        base = np.exp(1j * crank) if turning.base is None else turning.base
        basis = np.stack([np.ones_like(base), base, on_coupler], axis=2)
        turned = self.directions is not None
        if turned:
            none = np.zeros_like(on_coupler)
            below = np.stack([none, none, none, on_coupler], axis=2)
            basis = np.concatenate([np.concatenate([basis, none[:, :, None]], axis=2), below], axis=1)
        found, flat = _placed(basis, self.targets)
        if self.longest < np.inf:
            found.residual[np.abs(found.placement[:, 1]) * turning.longest > self.longest] = np.inf
        if not slopes:
            return found
        placement = found.placement
        by_angle, by_shape = turning.by_angle, turning.by_shape
        swing = 1j * placement[:, 2:3] * on_coupler
        turn = 1j * placement[:, 1:2] * base if turning.base is None else placement[:, 1:2] * turning.base_by_angle
        moved = np.concatenate([(turn + swing * by_angle)[:, :, None], swing[:, :, None] * by_shape], axis=2)
        if turning.base is not None:
            moved[:, :, 1:] += placement[:, 1:2, None] * turning.base_by_shape
        if turned:
            swing = 1j * placement[:, 3:] * on_coupler
            below = np.concatenate([(swing * by_angle)[:, :, None], swing[:, :, None] * by_shape], axis=2)
            moved = np.concatenate([moved, below], axis=1)
        moved[flat] = 0.0
        return found._replace(slopes=-moved)


@dataclass(frozen=True, eq=False)
class FunctionTask:
    """The output is a function of the crank's angle (points,): an angle up to a common offset, which is the number of a
    placement, or a position up to an offset and a factor, which are its two.
    """

    kind: OutputKind
    targets: Array

    def fit(self, shape: Array, crank: Array, branch: Array, slopes: bool = True) -> Fit:
        """See `Task`."""
        output = self.kind.output(shape, crank, branch, slopes)
        if not self.kind.angular:
            basis = np.stack([np.ones_like(output.value), output.value], axis=2)
            found, flat = _placed(basis, self.targets)
            factor = np.where(flat, 0.0, found.placement[:, 1])
        else:
            ahead = np.exp(1j * (output.value - self.targets))
            mean = ahead.sum(axis=1, keepdims=True)
            error = np.angle(ahead * mean.conj())  # at most π: turns do not count
            offset = np.angle(mean) + error.mean(axis=1, keepdims=True)
            basis = np.full((*crank.shape, 1), 1.0 / np.sqrt(crank.shape[1]))
            found = Fit(error.mean(axis=1, keepdims=True) - error, np.zeros((0, 0, 0)), offset, basis)
            factor = np.ones(len(crank))
        if not slopes:
            return found
        moved = np.concatenate([output.by_start[:, :, None], output.by_shape], axis=2)
        return found._replace(slopes=-factor[:, None, None] * moved)


def _placed(basis: Numbers, targets: Numbers) -> tuple[Fit, Mask]:
    """The least squares of targets (targets,) by bases (n, targets, numbers), without derivatives; and which of them
    have no placement, since their columns depend on each other.
    """
    orthonormal, triangle = np.linalg.qr(basis)
    coordinates = np.einsum("npk,p->nk", orthonormal.conj(), targets)
    residual = targets - np.einsum("npk,nk->np", orthonormal, coordinates)
    diagonal = np.abs(np.einsum("nkk->nk", triangle))
    flat = diagonal.min(axis=1) < 1e-9 * diagonal.max(axis=1)  # the coupler moves as the crank does, for example
    triangle[flat] = np.eye(triangle.shape[1])
    placement = np.linalg.solve(triangle, coordinates[:, :, None])[:, :, 0]
    residual[flat] = np.inf
    return Fit(residual, np.zeros((0, 0, 0), dtype=basis.dtype), placement, orthonormal), flat
