"""Analytic equations of the spring pendulum, derived by hand.

Source: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank_bench.textbook.integrate import Array


@dataclass(frozen=True)
class SpringPendulum:
    """A point mass on a massless spring that rotates in a vertical plane about a fixed point.

    q = (θ, r): angle from hanging in rad, then length in m; v their rates. Mass in kg, stiffness in N/m, free length
    in m, g in m/s². m r̈ = m r θ̇² + m g cos θ - k (r - l); m r θ̈ = -2 m ṙ θ̇ - m g sin θ.
    """

    mass: float = 2.0
    stiffness: float = 15.0
    free_length: float = 5.0
    g: float = 9.81

    def forward_dynamics(self, q: NDArray[Any], v: NDArray[Any]) -> NDArray[Any]:
        """Accelerations (θ̈, r̈), (..., 2), in rad/s² and m/s²."""
        angle, r, rate, speed = q[..., 0], q[..., 1], v[..., 0], v[..., 1]
        turning = -(2 * speed * rate + self.g * np.sin(angle)) / r
        spring = self.stiffness / self.mass * (r - self.free_length)
        return np.stack([turning, r * rate * rate + self.g * np.cos(angle) - spring], -1)

    def derivative(self, x: NDArray[Any]) -> NDArray[Any]:
        """Rates (..., 4) of the state x = (q, v), (..., 4), in x's own precision."""
        return np.concatenate([x[..., 2:], self.forward_dynamics(x[..., :2], x[..., 2:])], -1)

    def energy(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Kinetic energy, and potential energy of gravity (zero at the fixed point) plus spring, (...) each, J."""
        r = q[..., 1]
        kinetic = 0.5 * self.mass * (v[..., 1] ** 2 + (r * v[..., 0]) ** 2)
        potential = 0.5 * self.stiffness * (r - self.free_length) ** 2 - self.mass * self.g * r * np.cos(q[..., 0])
        return np.asarray(kinetic), np.asarray(potential)

    def accelerations(self, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """Coriolis 2 ṙ θ̇, centrifugal r θ̇² and tangential r θ̈ acceleration, (...) each, m/s²."""
        r, rate, speed = q[..., 1], v[..., 0], v[..., 1]
        return 2 * speed * rate, r * rate * rate, r * self.forward_dynamics(q, v)[..., 0]


def cartesian(start: tuple[float, ...]) -> tuple[list[float], list[float]]:
    """Position (x, y) and velocity of the spring pendulum's mass, gravity along -y, from (θ, r, θ̇, ṙ)."""
    angle, r, rate, speed = start
    s, c = sin(angle), cos(angle)
    return [r * s, -r * c], [speed * s + r * rate * c, -speed * c + r * rate * s]


def polar(xy: NDArray[Any]) -> Array:
    """Angle from hanging (unwrapped) and length, (k, 2), from the mass's x and y, (k, 2)."""
    return np.column_stack([np.unwrap(np.arctan2(xy[:, 0], -xy[:, 1])), np.hypot(xy[:, 0], xy[:, 1])])
