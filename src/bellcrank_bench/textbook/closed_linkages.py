"""Analytic equations of closed linkages and rolling disks, written by hand with multipliers, and closed forms.

Source: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18: M q̈ = f + Ψᵀ λ, Ψ q̈ = −Ψ̇ q̇.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ClosedFourBar:
    """The lecture's four-bar in q = (θ1, φ2, φ1): crank, coupler relative to the crank, rocker, rad; no gravity.

    Lengths (ground, crank, coupler, rocker) and CG distances in m, masses in kg, inertias about the CG in kg m²; the
    crank's torque is preload − stiffness θ1, N m. λ (2) is the force on the coupler's tip, N.
    """

    ground: float = 1.241
    length: tuple[float, float, float] = (1.241, 1.2, 1.2)
    mass: tuple[float, float, float] = (20.15, 8.25, 8.25)
    center: tuple[float, float, float] = (1.2, 0.6, 0.6)
    inertia: tuple[float, float, float] = (9.6, 0.06, 0.06)
    preload: float = 1.96
    stiffness: float = 0.1

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
        """Tip of the coupler less tip of the rocker, (..., 2), m."""
        l1, l2, l3 = self.length
        t, a, p = q[..., 0], q[..., 0] + q[..., 1], q[..., 2]
        x = l1 * np.cos(t) + l2 * np.cos(a) - l3 * np.cos(p) - self.ground
        return np.stack([x, l1 * np.sin(t) + l2 * np.sin(a) - l3 * np.sin(p)], -1)

    def jacobian(self, q: Array) -> Array:
        """Ψ(q), (..., 2, 3)."""
        l1, l2, l3 = self.length
        t, a, p = q[..., 0], q[..., 0] + q[..., 1], q[..., 2]
        outer, rocker = _across(a, l2), -_across(p, l3)
        return np.stack([_across(t, l1) + outer, outer, rocker], -1)

    def accelerations(self, q: Array, v: Array) -> tuple[Array, Array]:
        """q̈ (..., 3) rad/s² and λ (..., 2) N."""
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
        return _constrained(self.mass_matrix(q), self.jacobian(q), force, right)

    def derivative(self, x: Array) -> Array:
        """Rates (..., 6) of the state (q, v)."""
        return np.concatenate([x[..., 3:], self.accelerations(x[..., :3], x[..., 3:])[0]], -1)

    def energy(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Kinetic energy, and the spring's (zero where its torque is), (...) each, J."""
        kinetic = 0.5 * np.einsum("...i,...ij,...j->...", v, self.mass_matrix(q), v)
        return kinetic, 0.5 * (self.preload - self.stiffness * q[..., 0]) ** 2 / self.stiffness

    def closed(self, crank: Array, rate: Array, branch: Array) -> tuple[Array, Array]:
        """q and v (..., 3) on the constraint at an angle and rate of the crank; `branch` (±1) is the side of the line from
        the crank's tip to the rocker's pivot on which coupler and rocker meet.
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
        """The crank's angle, rad, at which coupler and rocker line up; NaN where these lengths have none."""
        l0, (l1, l2, l3) = self.ground, self.length
        with np.errstate(invalid="ignore"):
            return float(np.arccos((l0**2 + l1**2 - (l2 + l3) ** 2) / (2 * l0 * l1)))


@dataclass(frozen=True)
class SixCoordinateDisk:
    """A thin disk or hoop that rolls on the floor, in the lecture's q = (x, y, z, θ1, θ2, θ3).

    (x, y, z) is the centre, m; heading θ1 about Z, tilt θ2 about X, spin θ3 about Y, moving axes in that order, rad.
    mass kg, radius m, g m/s²; the diametral inertia is k m r², the axial one 2 k m r²: k = 1/4 for a disk, 1/2 for a
    hoop. All three rows of rolling keep velocities: the multipliers are the contact's force on the disk, X, Y, Z, N.
    """

    mass: float = 0.5
    radius: float = 0.1
    k: float = 0.25
    g: float = 9.81

    def rolling(self, q: Array) -> Array:
        """Ψ(q), (..., 3, 6): the velocity of the contact point is Ψ q̇."""
        r, (s1, c1), (s2, c2) = self.radius, _sine_cosine(q[..., 3]), _sine_cosine(q[..., 4])
        none = np.zeros_like(s1)
        turning = -r * np.stack(
            [
                np.stack([c1 * s2, s1 * c2, c1], -1),
                np.stack([s1 * s2, -c1 * c2, s1], -1),
                np.stack([none, -s2, none], -1),
            ],
            -2,
        )
        return np.concatenate([np.broadcast_to(np.eye(3), (*s1.shape, 3, 3)), turning], -1)

    def velocity(self, q: Array, rates: Array) -> Array:
        """q̇ (..., 6) of a disk that rolls with these rates (..., 3) of heading, tilt and spin."""
        linear = -np.einsum("...ij,...j->...i", self.rolling(q)[..., 3:], rates)
        return np.concatenate([linear, rates], -1)

    def accelerations(self, q: Array, v: Array) -> tuple[Array, Array]:
        """q̈ (..., 6) and λ (..., 3) N, by Lagrange's equations with T = ½ m ẋ·ẋ + ½ I (θ̇2² + c2² θ̇1²) + I w²,
        w = θ̇3 + s2 θ̇1, I = k m r².
        """
        r, inertia = self.radius, self.k * self.mass * self.radius**2
        (s1, c1), (s2, c2) = _sine_cosine(q[..., 3]), _sine_cosine(q[..., 4])
        w1, w2, w3 = v[..., 3], v[..., 4], v[..., 5]
        w = w3 + s2 * w1
        m = np.zeros((*s1.shape, 6, 6))
        m[..., 0, 0] = m[..., 1, 1] = m[..., 2, 2] = self.mass
        m[..., 3, 3] = inertia * (c2**2 + 2 * s2**2)
        m[..., 3, 5] = m[..., 5, 3] = 2 * inertia * s2
        m[..., 4, 4], m[..., 5, 5] = inertia, 2 * inertia
        none = np.zeros_like(s1)
        force = np.stack(
            [
                none, none, none - self.mass * self.g,
                2 * inertia * w2 * w1 * c2 * s2 - 2 * inertia * c2 * w2 * (w + s2 * w1),
                -inertia * c2 * s2 * w1**2 + 2 * inertia * w * c2 * w1,
                -2 * inertia * c2 * w2 * w1,
            ],
            -1,
        )  # fmt: skip
        # −Ψ̇ q̇: what the centre's acceleration is at constant rates
        along, across = w3 * c1 + w1 * c1 * s2, w3 * s1 + w1 * s1 * s2
        right = r * np.stack(
            [
                -w1 * across + w1 * w2 * c1 * c2 + w2 * (w1 * c1 * c2 - w2 * s1 * s2),
                w1 * along + w1 * w2 * s1 * c2 + w2 * (w1 * s1 * c2 + w2 * c1 * s2),
                -(w2**2) * c2,
            ],
            -1,
        )
        return _constrained(m, self.rolling(q), force, right)

    def derivative(self, x: Array) -> Array:
        """Rates (..., 12) of the state (q, v)."""
        return np.concatenate([x[..., 6:], self.accelerations(x[..., :6], x[..., 6:])[0]], -1)

    def energy(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Kinetic energy, and gravity's (zero at the floor), (...) each, J."""
        s2, c2 = _sine_cosine(q[..., 4])
        turning = v[..., 4] ** 2 + (c2 * v[..., 3]) ** 2 + 2 * (v[..., 5] + s2 * v[..., 3]) ** 2
        moving = (v[..., :3] ** 2).sum(-1)
        return 0.5 * self.mass * (moving + self.k * self.radius**2 * turning), self.mass * self.g * q[..., 2]

    def circle_rate(self, lean: float, path: float) -> float:
        """The rate Ω, rad/s, at which a disk goes round steadily, its centre on a circle of radius `path` (m), leaning
        by `lean` (rad) from the vertical: Ω² = g tan α / ((1 + 2k) b + k r sin α). For lean and path 0 it is 0/0.
        """
        reach = (1 + 2 * self.k) * path + self.k * self.radius * np.sin(lean)
        return float(np.sqrt(self.g * np.tan(lean) / reach))

    @property
    def critical_speed(self) -> float:
        """The speed, m/s, above which straight rolling is stable: v² = g r / (2 (1 + 2k))."""
        return float(np.sqrt(self.g * self.radius / (2 * (1 + 2 * self.k))))

    def stiffness(self, speed: float) -> float:
        """n², 1/s², of the tilt about straight rolling at a speed (m/s), θ̈2 = −n² θ2; below 0 it grows, at √−n²."""
        return float((2 * (1 + 2 * self.k) * (speed / self.radius) ** 2 - self.g / self.radius) / (1 + self.k))


@dataclass(frozen=True)
class ParallelCranks:
    """The N four-bar mechanism on its parallel branch, which has one degree of freedom: all cranks at the angle θ.

    N + 1 cranks and N couplers, uniform rods of 1 m and 1 kg; θ from horizontal, rad, g in m/s²:
    θ̈ = −(G/I) g cos θ, I = (N + 1)/3 + N, G = (N + 1)/2 + N. Source: IFToMM library of computational benchmark
    problems, A02, for the mechanism.
    """

    loops: int
    g: float = 9.81

    def derivative(self, x: Array) -> Array:
        """Rates (..., 2) of (θ, θ̇)."""
        n = self.loops
        factor = ((n + 1) / 2 + n) / ((n + 1) / 3 + n)
        return np.stack([x[..., 1], -factor * self.g * np.cos(x[..., 0])], -1)


def solve_along(derivative: Any, start: Array, times: Array) -> Array:
    """States (n, k) of analytic equations at times (n,) s from a start (k,), by SciPy's DOP853 as fine as it goes."""
    from scipy.integrate import solve_ivp

    span = (0.0, float(times[-1]))
    found = solve_ivp(lambda _, x: derivative(x), span, start, "DOP853", times, rtol=1e-13, atol=1e-14)
    return np.asarray(found.y.T)


def _constrained(mass: Array, rows: Array, force: Array, right: Array) -> tuple[Array, Array]:
    """q̈ and λ of M q̈ = f + Ψᵀ λ, Ψ q̈ = right."""
    n, m = mass.shape[-1], rows.shape[-2]
    matrix = np.zeros((*mass.shape[:-2], n + m, n + m))
    matrix[..., :n, :n], matrix[..., :n, n:], matrix[..., n:, :n] = mass, -np.swapaxes(rows, -1, -2), rows
    x = np.linalg.solve(matrix, np.concatenate([force, right], -1)[..., None])[..., 0]
    return x[..., :n], x[..., n:]


def _along(angle: Array, length: Any) -> Array:
    return np.stack([length * np.cos(angle), length * np.sin(angle)], -1)


def _across(angle: Array, length: float) -> Array:
    return np.stack([-length * np.sin(angle), length * np.cos(angle)], -1)


def _sine_cosine(angle: Array) -> tuple[Array, Array]:
    return np.sin(angle), np.cos(angle)
