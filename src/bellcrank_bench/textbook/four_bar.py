"""Analytic equations of the planar four-bar linkage: with multipliers, and reduced to the crank's angle.

Source: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank_bench.textbook.integrate import Array, solve_with_multipliers


@dataclass(frozen=True)
class FourBarParameters:
    """The lecture's four-bar without gravity: crank, coupler and rocker, and a spring that drives the crank.

    Attributes:
        ground: Distance between the pivots of crank and rocker, m.
        length: Lengths of crank, coupler and rocker, m.
        mass: Their masses, kg.
        center: Distances of their centres of gravity from their frames, m: crank's pivot, crank's tip, rocker's
            pivot.
        inertia: Their inertias about the centre of gravity, kg m².
        preload: Torque of the spring at angle 0 of the crank, N m.
        stiffness: Decrease of that torque with the angle, N m/rad.
    """

    ground: float = 1.241
    length: tuple[float, float, float] = (1.241, 1.2, 1.2)
    mass: tuple[float, float, float] = (20.15, 8.25, 8.25)
    center: tuple[float, float, float] = (1.2, 0.6, 0.6)
    inertia: tuple[float, float, float] = (9.6, 0.06, 0.06)
    preload: float = 1.96
    stiffness: float = 0.1


@dataclass(frozen=True)
class FourBarWithMultipliers(FourBarParameters):
    """The four-bar in q = (θ1, φ2, φ1): crank, coupler relative to the crank, rocker, rad.

    M q̈ = f + Ψᵀ λ, Ψ q̈ = −Ψ̇ q̇; λ (2) is the force on the coupler's tip, N.
    """

    def mass_matrix(self, q: Array) -> Array:
        """M(q), (..., 3, 3): the coupler's absolute angle is θ1 + φ2."""
        (l1, _, _), (m1, m2, m3), (r1, r2, r3), (i1, i2, i3) = self.length, self.mass, self.center, self.inertia
        outer = i2 + m2 * r2**2
        both = m2 * l1 * r2 * np.cos(q[..., 1])
        m = np.zeros((*q.shape[:-1], 3, 3))
        m[..., 0, 0] = i1 + m1 * r1**2 + m2 * l1**2 + outer + 2 * both
        m[..., 0, 1] = m[..., 1, 0] = outer + both
        m[..., 1, 1], m[..., 2, 2] = outer, i3 + m3 * r3**2
        return m

    def constraint(self, q: Array) -> Array:
        """Position of the coupler's tip minus that of the rocker's, (..., 2), m."""
        l1, l2, l3 = self.length
        t, a, p = q[..., 0], q[..., 0] + q[..., 1], q[..., 2]
        x = l1 * np.cos(t) + l2 * np.cos(a) - l3 * np.cos(p) - self.ground
        return np.stack([x, l1 * np.sin(t) + l2 * np.sin(a) - l3 * np.sin(p)], -1)

    def jacobian(self, q: Array) -> Array:
        """Jacobian Ψ(q) of the constraint, (..., 2, 3)."""
        l1, l2, l3 = self.length
        t, a, p = q[..., 0], q[..., 0] + q[..., 1], q[..., 2]
        outer, rocker = _across(a, l2), -_across(p, l3)
        return np.stack([_across(t, l1) + outer, outer, rocker], -1)

    def accelerations(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Accelerations q̈ (..., 3), rad/s², and multipliers λ (..., 2), N."""
        l1, l2, l3 = self.length
        w, o, u = v[..., 0], v[..., 0] + v[..., 1], v[..., 2]
        h = self.mass[1] * l1 * self.center[1] * np.sin(q[..., 1])
        force = np.stack(
            [
                self.preload - self.stiffness * q[..., 0] + h * (2 * w + v[..., 1]) * v[..., 1],
                -h * w * w,
                np.zeros_like(w),
            ],
            -1,
        )
        t, a, p = q[..., 0], q[..., 0] + q[..., 1], q[..., 2]
        right = _along(t, l1 * w * w) + _along(a, l2 * o * o) - _along(p, l3 * u * u)
        return solve_with_multipliers(self.mass_matrix(q), self.jacobian(q), force, right)

    def derivative(self, x: Array) -> Array:
        """Rates (..., 6) of the state (q, v)."""
        return np.concatenate([x[..., 3:], self.accelerations(x[..., :3], x[..., 3:])[0]], -1)

    def energy(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Kinetic energy, and the spring's (zero where its torque is), (...) each, J."""
        kinetic = 0.5 * np.einsum("...i,...ij,...j->...", v, self.mass_matrix(q), v)
        return kinetic, 0.5 * (self.preload - self.stiffness * q[..., 0]) ** 2 / self.stiffness

    def closed(self, crank: Array, rate: Array, branch: Array) -> tuple[Array, Array]:
        """Position and velocity (..., 3) of the closed loop at an angle and rate of the crank.

        `branch` (±1) is the side, seen from the crank's tip to the rocker's pivot, on which coupler and rocker meet.
        """
        (_, l2, l3), tip = self.length, _along(crank, self.length[0])
        way = np.array([self.ground, 0.0]) - tip
        distance = np.linalg.norm(way, axis=-1)
        bend = np.arccos((distance**2 + l2**2 - l3**2) / (2 * l2 * distance))
        coupler = np.arctan2(way[..., 1], way[..., 0]) + branch * bend
        apex = tip + _along(coupler, l2) - np.array([self.ground, 0.0])
        q = np.stack([crank, coupler - crank, np.arctan2(apex[..., 1], apex[..., 0])], -1)
        j = self.jacobian(q)
        others = np.linalg.solve(j[..., 1:], -(j[..., 0] * rate[..., None])[..., None])[..., 0]
        return q, np.concatenate([rate[..., None], others], -1)

    @property
    def lock_angle(self) -> float:
        """The crank's angle, rad, at which coupler and rocker line up; NaN if there is none with these lengths."""
        l0, (l1, l2, l3) = self.ground, self.length
        with np.errstate(invalid="ignore"):
            return float(np.arccos((l0**2 + l1**2 - (l2 + l3) ** 2) / (2 * l0 * l1)))


def _along(angle: Array, length: Any) -> Array:
    return np.stack([length * np.cos(angle), length * np.sin(angle)], -1)


def _across(angle: Array, length: float) -> Array:
    return np.stack([-length * np.sin(angle), length * np.cos(angle)], -1)


@dataclass(frozen=True)
class ReducedFourBar(FourBarParameters):
    """The four-bar reduced to one coordinate: the state is (crank's angle, its rate), (..., 2), rad and rad/s.

    The cosine rule closes the loop, on the branch whose closing joint lies to the left of the line from the crank's tip
    to the rocker's pivot.
    """

    def directions(self, crank: NDArray[Any]) -> NDArray[Any]:
        """Unit vectors along crank, coupler and rocker, (3, ..., 2), at angles of the crank (...)."""
        l1, l2, l3 = self.length
        first = np.stack([np.cos(crank), np.sin(crank)], -1)
        way = np.array([self.ground, 0.0]) - l1 * first  # from the crank's tip to the rocker's pivot
        distance = np.sqrt((way * way).sum(-1))[..., None]
        along = way / distance
        cosine = (distance * distance + l2 * l2 - l3 * l3) / (2.0 * l2 * distance)
        left = np.stack([-along[..., 1], along[..., 0]], -1)
        second = cosine * along + np.sqrt(1.0 - cosine * cosine) * left
        return np.stack([first, second, (l2 * second - way) / l3])

    def derivative(self, x: NDArray[Any]) -> NDArray[Any]:
        """Rates (..., 2) of the state, in its own precision, by Jourdain's principle."""
        e = self.directions(x[..., 0])
        w, bend = self._rates(e, x[..., 1])
        k, _ = self._rates(e, np.ones_like(x[..., 1]))
        m, h = self._inertial(e, w)
        spring = self.preload - self.stiffness * x[..., 0]
        force = spring - (k * (np.einsum("ij...,j...->i...", m, bend) + h)).sum(0)
        return np.stack([x[..., 1], force / np.einsum("i...,ij...,j...->...", k, m, k)], -1)

    def angles(self, x: NDArray[Any]) -> NDArray[Any]:
        """Crank, coupler (relative to it, in [0, 2π)) and rocker, rad, and their rates, rad/s, (..., 6)."""
        e = self.directions(x[..., 0])
        w, _ = self._rates(e, x[..., 1])
        second, third = (np.arctan2(d[..., 1], d[..., 0]) for d in e[1:])
        # pi as exact as the state: numpy's constant is a double
        coupler = np.mod(second - x[..., 0], 8 * np.arctan(np.ones((), x.dtype)))
        return np.stack([x[..., 0], coupler, third, w[0], w[1] - w[0], w[2]], -1)

    def energy(self, x: NDArray[Any]) -> NDArray[Any]:
        """Kinetic energy plus the spring's potential energy (zero at angle 0), J, (...)."""
        e = self.directions(x[..., 0])
        w, _ = self._rates(e, x[..., 1])
        m, _ = self._inertial(e, w)
        kinetic = 0.5 * np.einsum("i...,ij...,j...->...", w, m, w)
        return np.asarray(kinetic - self.preload * x[..., 0] + 0.5 * self.stiffness * x[..., 0] ** 2)

    def _rates(self, e: NDArray[Any], rate: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Angular velocities (3, ...) of the links, and their angular accelerations where the crank's is zero."""
        l1, l2, l3 = self.length
        s12, s13, s23 = (_sine(e[i], e[j]) for i, j in ((0, 1), (0, 2), (1, 2)))
        c12, c13, c23 = ((e[i] * e[j]).sum(-1) for i, j in ((0, 1), (0, 2), (1, 2)))
        w = np.stack([rate, -rate * l1 * s13 / (l2 * s23), -rate * l1 * s12 / (l3 * s23)])
        q1, q2, q3 = w * w
        second = (l3 * q3 - l1 * q1 * c13 - l2 * q2 * c23) / (l2 * s23)
        third = (l3 * q3 * c23 - l1 * q1 * c12 - l2 * q2) / (l3 * s23)
        return w, np.stack([np.zeros_like(rate), second, third])

    def _inertial(self, e: NDArray[Any], w: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Mass matrix (3, 3, ...) and centrifugal torques (3, ...) in the links' absolute angles."""
        (l1, _, _), (m1, m2, m3), (r1, r2, r3) = self.length, self.mass, self.center
        i1, i2, i3 = self.inertia
        coupling = m2 * l1 * r2
        c, s = coupling * (e[0] * e[1]).sum(-1), coupling * _sine(e[0], e[1])
        none, one = np.zeros_like(c), np.ones_like(c)
        crank, coupler, rocker = i1 + m1 * r1 * r1 + m2 * l1 * l1, i2 + m2 * r2 * r2, i3 + m3 * r3 * r3
        matrix = np.array([[crank * one, c, none], [c, coupler * one, none], [none, none, rocker * one]])
        return matrix, np.stack([s * w[1] * w[1], -s * w[0] * w[0], none])


def _sine(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """sin(α − β) of unit vectors (..., 2) at the angles α and β."""
    return np.asarray(a[..., 1] * b[..., 0] - a[..., 0] * b[..., 1])
