"""Analytic equations of Bricard's mechanism, reduced to one coordinate.

Source of the mechanism: IFToMM library of computational benchmark problems, A04.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class BricardRing:
    """Six rods of 1 m and 1 kg with a square section, hinged in a ring at right angles; one is the ground. Gravity g in
    m/s² acts along -y; `side` is the side of the section, m.

    The angles between successive rods are in turn θ and φ, and the ring closes if cos θ + cos φ + cos θ cos φ = 0
    (Y. Chen, Z. You and T. Tarnai, Int. J. Solids Struct. 42 (2005) 2287, at a twist of 90°). With p = (φ + θ)/2 and
    m = (φ − θ)/2 that is cos p + cos m = 1, so one parameter s covers all postures: sin(p/2) = sin(s)/√2,
    sin(m/2) = cos(s)/√2. The state (..., 2) is (s, ṡ); s = π/2 is the start, six edges of a cube.
    """

    side: float = 0.1
    g: float = 9.81

    @property
    def rods(self) -> NDArray[np.float64]:
        """The five moving rods at the start, (5, 3), m, from P0 = 0; hinges along y, z, x, y, z and, at P5, x."""
        return np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, 1], [-1, 0, 0], [0, 1, 0]])

    @property
    def inertias(self) -> NDArray[np.float64]:
        """Inertias (5, 3, 3) of the moving rods about their centres at the start, kg m²."""
        across, axial = (1 + self.side**2) / 12, self.side**2 / 6
        return np.array([across * np.eye(3) - (across - axial) * np.outer(rod, rod) for rod in self.rods])

    def derivative(self, x: NDArray[Any]) -> NDArray[Any]:
        """Rates (..., 2), in the state's own precision, by Jourdain's principle along the one degree of freedom."""
        inertia, bias, weight = self._sums(x[..., 0])
        return np.stack([x[..., 1], -(weight + bias * x[..., 1] ** 2) / inertia], -1)

    def energy(self, x: NDArray[Any]) -> NDArray[Any]:
        """Kinetic plus potential energy (the latter zero at the start, s = π/2), J, (...)."""
        rods, _ = _rods(self._five(x[..., 0])[0])
        middle = (np.cumsum(rods, 0) - rods / 2)[..., 1].sum(0)
        return np.asarray(0.5 * self._sums(x[..., 0])[0] * x[..., 1] ** 2 + self.g * (middle + 3.5))

    def corner(self, x: NDArray[Any]) -> NDArray[Any]:
        """The point P3 (..., 3), m, between the third and the fourth rod, from states (..., 1 or 2)."""
        return np.asarray(_rods(self._five(x[..., 0])[0])[0][:3].sum(0))

    def hinges(self, x: NDArray[Any]) -> NDArray[Any]:
        """Angles (..., 5) of the hinges from P0 on, rad, 0 at the start, from states (..., 1 or 2)."""
        return np.moveaxis(np.pi / 2 - self._five(x[..., 0])[0], 0, -1)

    def corner_of(self, hinges: NDArray[Any]) -> NDArray[Any]:
        """The point P3 (..., 3), m, from the angles (..., 5) of the hinges from P0 on, rad, 0 at the start."""
        rods, _ = _rods(np.moveaxis(np.pi / 2 - hinges, -1, 0))
        return np.asarray(rods[:3].sum(0))

    def _five(self, s: NDArray[Any]) -> NDArray[Any]:
        """The angles θ, φ, θ, φ, θ between rods and their first and second derivatives by s, (3, 5, ...)."""
        root = np.sqrt(np.full_like(s, 2.0))
        sine, cosine = np.sin(s), np.cos(s)
        a, b = np.sqrt(1 - sine**2 / 2), np.sqrt(1 - cosine**2 / 2)  # cos(p/2) and cos(m/2)
        p = np.stack([2 * np.arcsin(sine / root), root * cosine / a, -sine / (root * a**3)])
        m = np.stack([2 * np.arcsin(cosine / root), -root * sine / b, -cosine / (root * b**3)])
        return np.stack([p - m, p + m], 1)[:, [0, 1, 0, 1, 0]]

    def _sums(self, s: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """I, half its derivative, and the derivative of the potential V with respect to s: I s̈ + ½ I' ṡ² + V' = 0."""
        angle, first, second = self._five(s)
        rods, axes = _rods(angle)
        first, second = first[..., None], second[..., None]
        turning = -(first * axes).cumsum(0)
        turning_rate = -(second * axes + first * _cross(turning, axes)).cumsum(0)
        along = _cross(turning, rods)
        bending = _cross(turning_rate, rods) + _cross(turning, along)
        moving, moving_rate = along.cumsum(0) - along / 2, bending.cumsum(0) - bending / 2
        across = (1 + self.side**2) / 12
        momentum = across * turning - (across - self.side**2 / 6) * (rods * turning).sum(-1, keepdims=True) * rods
        inertia = (moving * moving + turning * momentum).sum((0, -1))
        bias = (moving * moving_rate + momentum * turning_rate).sum((0, -1))
        return inertia, bias, self.g * moving[..., 1].sum(0)


def _rods(angle: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Unit vectors (5, ..., 3) along the moving rods and along the hinges at which they begin, from the angles (5, ...)
    between successive rods.
    """
    cosines, sines, identity = np.cos(angle)[..., None], np.sin(angle)[..., None], np.eye(3, dtype=angle.dtype)
    # the ground, from P5 to P0; the hinge at P5; normal = rod × axis
    rod, axis, normal = -identity[2], identity[0], -identity[1]
    rods, axes = [], []
    for k, (c, s) in enumerate(zip(cosines, sines, strict=True)):
        sign = 1 if k % 2 else -1
        turned = sign * axis
        rod, axis, normal = c * rod - s * turned, sign * normal, -(c * turned + s * rod)
        rods.append(rod)
        axes.append(axis)
    axes[0] = np.broadcast_to(axes[0], rods[0].shape)
    return np.array(rods), np.array(axes)


def _cross(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """a × b of vectors (..., 3); faster than numpy's for few vectors."""
    one, two = np.array([1, 2, 0]), np.array([2, 0, 1])
    return np.asarray(a.take(one, -1) * b.take(two, -1) - a.take(two, -1) * b.take(one, -1))
