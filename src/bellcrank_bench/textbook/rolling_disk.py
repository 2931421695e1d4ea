"""Analytic equations of the rolling disk: with multipliers in six coordinates, and reduced to eight states.

Source: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank_bench.textbook.integrate import Array, solve_with_multipliers


@dataclass(frozen=True)
class SixCoordinateDisk:
    """A thin disk or hoop that rolls on the floor, with multipliers, in the lecture's q = (x, y, z, θ1, θ2, θ3).

    (x, y, z) is the centre, m; heading θ1 about Z, tilt θ2 about X, spin θ3 about Y, about moving axes in that order,
    rad. The diametral inertia is k m r², the axial one 2 k m r². All three rows of the rolling constraint are on
    velocities: the multipliers are the contact force on the disk along X, Y and Z, N.

    Attributes:
        mass: Mass, kg.
        radius: Radius, m.
        k: 1/4 for a disk, 1/2 for a hoop.
        g: Gravity, m/s².
    """

    mass: float = 0.5
    radius: float = 0.1
    k: float = 0.25
    g: float = 9.81

    def rolling(self, q: Array) -> Array:
        """Jacobian Ψ(q) of the constraint, (..., 3, 6): the velocity of the contact point is Ψ q̇."""
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
        """Rates q̇ (..., 6) of a disk that rolls with these rates (..., 3) of heading, tilt and spin."""
        linear = -np.einsum("...ij,...j->...i", self.rolling(q)[..., 3:], rates)
        return np.concatenate([linear, rates], -1)

    def accelerations(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Accelerations q̈ (..., 6) and multipliers λ (..., 3), N, by Lagrange's equations with T = ½ m ẋ·ẋ + ½ I (θ̇2²
        + c2² θ̇1²) + I w², w = θ̇3 + s2 θ̇1, I = k m r².
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
        # −Ψ̇ q̇: the acceleration of the centre at constant rates of the angles
        along, across = w3 * c1 + w1 * c1 * s2, w3 * s1 + w1 * s1 * s2
        right = r * np.stack(
            [
                -w1 * across + w1 * w2 * c1 * c2 + w2 * (w1 * c1 * c2 - w2 * s1 * s2),
                w1 * along + w1 * w2 * s1 * c2 + w2 * (w1 * s1 * c2 + w2 * c1 * s2),
                -(w2**2) * c2,
            ],
            -1,
        )
        return solve_with_multipliers(m, self.rolling(q), force, right)

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
        """The rate Ω, rad/s, of steady rolling with the centre on a circle of radius `path` (m), leaning by `lean`
        (rad) from the vertical: Ω² = g tan α / ((1 + 2k) b + k r sin α). It is undefined if lean and path are both 0.
        """
        reach = (1 + 2 * self.k) * path + self.k * self.radius * np.sin(lean)
        return float(np.sqrt(self.g * np.tan(lean) / reach))

    @property
    def critical_speed(self) -> float:
        """The speed, m/s, above which straight rolling is stable: v² = g r / (2 (1 + 2k))."""
        return float(np.sqrt(self.g * self.radius / (2 * (1 + 2 * self.k))))

    def stiffness(self, speed: float) -> float:
        """n², 1/s², of the tilt θ̈2 = −n² θ2 about straight rolling at a speed (m/s); negative if unstable."""
        return float((2 * (1 + 2 * self.k) * (speed / self.radius) ** 2 - self.g / self.radius) / (1 + self.k))


def _sine_cosine(angle: Array) -> tuple[Array, Array]:
    return np.sin(angle), np.cos(angle)


@dataclass(frozen=True)
class ReducedRollingDisk:
    """A thin disk that rolls on a horizontal plane, without multipliers; radius in m, g in m/s²; any mass.

    The state (..., 8) is (x, y) of the centre, the angles tilt, heading and spin (about X', Z and Y''), and the angular
    velocity in the axes after heading and tilt.
    The equations are the moments about the contact point, and v = ω × (r ẑ').
    """

    radius: float = 0.1
    g: float = 9.81

    def derivative(self, x: NDArray[Any]) -> NDArray[Any]:
        """Rates (..., 8), in the state's own precision."""
        tilt, heading, (wx, wy, wz) = x[..., 2], x[..., 3], np.moveaxis(x[..., 5:], -1, 0)
        s, c, r = np.sin(tilt), np.cos(tilt), self.radius
        turn = wz * s / c  # angular velocity of these axes about the disk's axis
        forward, side = r * wy, -r * wx  # velocity of the centre along X' and Y'
        return np.stack([
            forward * np.cos(heading) - side * np.sin(heading) * c,
            forward * np.sin(heading) + side * np.cos(heading) * c,
            wx, wz / c, wy - turn,
            (6 * wy * wz - turn * wz + 4 * self.g / r * s) / 5,  # about X': inertia (1/4 + 1) m r²
            -2 * wx * wz / 3,  # about the axis: (1/2 + 1) m r²
            wx * (turn - 2 * wy),
        ], -1)  # fmt: skip

    def centre(self, x: NDArray[Any]) -> NDArray[Any]:
        """Position (..., 3) of the centre from (x, y, tilt, ...)."""
        return np.stack([x[..., 0], x[..., 1], self.radius * np.cos(x[..., 2])], -1)

    def free_body(self, state: Array) -> tuple[Array, Array]:
        """A state (8,) as that of a free body: its centre (m) and quaternion w x y z, (7,), and its velocity in world
        axes (m/s) and angular velocity in its own axes (rad/s), (6,).
        """
        tilt, heading = state[2:4]
        (c, s), (d, e) = (cos(0.5 * heading), sin(0.5 * heading)), (cos(0.5 * tilt), sin(0.5 * tilt))
        rates = self.derivative(state)
        fall = -self.radius * sin(tilt) * state[5]
        position = np.array([*self.centre(state), c * d, c * e, s * e, s * d])
        return position, np.array([*rates[:2], fall, *state[5:8]])

    def energy(self, x: NDArray[Any]) -> NDArray[Any]:
        """Kinetic plus potential energy divided by the mass, J/kg, (...)."""
        wx, wy, wz = np.moveaxis(x[..., 5:], -1, 0)
        kinetic = 0.5 * self.radius**2 * (1.25 * wx * wx + 1.5 * wy * wy + 0.25 * wz * wz)
        return np.asarray(kinetic + self.g * self.radius * np.cos(x[..., 2]))


def free_base(q: Array, v: Array) -> tuple[Array, Array]:
    """A floating base's position (n, 7), with quaternion x y z w, and velocity in the body's axes (n, 6), from the
    lecture's coordinates and their rates, (n, 6) each.
    """
    rotation = _rotation(q)
    linear = rotation.apply(v[:, :3], inverse=True)
    return np.concatenate([q[:, :3], rotation.as_quat()], -1), np.concatenate([linear, _angular_velocity(q, v)[0]], -1)


def free_base_rate(q: Array, v: Array, a: Array) -> Array:
    """The rate (n, 6) of that velocity, from the lecture's coordinates, their rates and their accelerations."""
    rotation = _rotation(q)
    omega, centripetal = _angular_velocity(q, v)
    linear = rotation.apply(a[:, :3], inverse=True) - np.cross(omega, rotation.apply(v[:, :3], inverse=True))
    return np.concatenate([linear, _angular_velocity(q, a)[0] + centripetal], -1)


def _rotation(q: Array) -> Any:
    """Rotations from the body to the world: heading about Z, tilt about X, spin about Y, about moving axes."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("ZXY", q[:, 3:])


def _angular_velocity(q: Array, v: Array) -> tuple[Array, Array]:
    """Angular velocity (n, 3) in the body's axes, and its rate when the angles' rates are constant."""
    (s2, c2), (s3, c3) = ((np.sin(x), np.cos(x)) for x in (q[:, 4], q[:, 5]))
    w1, w2, w3 = v[:, 3:].T
    x, y, z = w2, w3 + s2 * w1, c2 * w1  # in the axes after heading and tilt
    omega = np.stack([c3 * x - s3 * z, y, s3 * x + c3 * z], -1)
    dy, dz = c2 * w2 * w1, -s2 * w2 * w1
    rate = np.stack([-s3 * dz - w3 * omega[:, 2], dy, c3 * dz + w3 * omega[:, 0]], -1)
    return omega, rate
