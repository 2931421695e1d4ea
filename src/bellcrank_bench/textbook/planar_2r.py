"""Analytic equations of the planar 2R arm, derived by hand.

Source: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank_bench.textbook.integrate import Array


@dataclass(frozen=True)
class PlanarTwoLink:
    """A planar 2R arm in a vertical plane, gravity along -y, the second angle relative to the first link.

    Lengths and CG distances from the joint in m, masses in kg, inertias about the CG in kg m², g in m/s².
    States are (..., 2) arrays in rad, rad/s and rad/s², torques in N m.
    """

    l1: float = 1.0
    l2: float = 1.0
    m1: float = 12.456
    m2: float = 12.456
    r1: float = 0.773
    r2: float = 0.583
    i1: float = 1.042
    i2: float = 1.042
    g: float = 9.81

    def mass_matrix(self, q: Array) -> Array:
        """M(q), (..., 2, 2)."""
        c2 = np.cos(q[..., 1])
        still = self.i1 + self.i2 + self.m2 * self.l1**2 + self.m1 * self.r1**2 + self.m2 * self.r2**2
        m11 = still + 2 * self.m2 * self.l1 * self.r2 * c2
        m12 = self.i2 + self.m2 * self.r2**2 + self.m2 * self.l1 * self.r2 * c2
        m22 = np.full_like(c2, self.i2 + self.m2 * self.r2**2)
        return np.stack([np.stack([m11, m12], -1), np.stack([m12, m22], -1)], -2)

    def bias(self, q: Array, v: Array) -> Array:
        """Coriolis, centrifugal and gravity torques C(q, v) + G(q), (..., 2)."""
        h = self.m2 * self.l1 * self.r2 * np.sin(q[..., 1])
        c1, c12 = np.cos(q[..., 0]), np.cos(q[..., 0] + q[..., 1])
        outer = self.m2 * self.g * self.r2 * c12
        inner = (self.m2 * self.l1 + self.m1 * self.r1) * self.g * c1
        first = -h * (2 * v[..., 0] + v[..., 1]) * v[..., 1] + inner + outer
        return np.stack([first, h * v[..., 0] ** 2 + outer], -1)

    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        """Torques M a + C + G, (..., 2)."""
        return np.asarray(np.einsum("...ij,...j->...i", self.mass_matrix(q), a) + self.bias(q, v))

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        """Accelerations under torques, (..., 2)."""
        return _solve(self.mass_matrix(q), tau - self.bias(q, v))

    def derivative(self, x: NDArray[Any]) -> NDArray[Any]:
        """Rates (..., 4) of the state x = (q, v), (..., 4), without torques, in x's own precision (Cramer's rule)."""
        q2, v1, v2 = x[..., 1], x[..., 2], x[..., 3]
        c2, c1, c12 = np.cos(q2), np.cos(x[..., 0]), np.cos(x[..., 0] + q2)
        m22 = self.i2 + self.m2 * self.r2**2
        coupling = self.m2 * self.l1 * self.r2
        m12 = m22 + coupling * c2
        m11 = self.i1 + self.m1 * self.r1**2 + self.m2 * self.l1**2 + m12 + coupling * c2
        h = coupling * np.sin(q2)
        outer = self.m2 * self.g * self.r2 * c12
        f1 = h * (2 * v1 + v2) * v2 - outer - (self.m2 * self.l1 + self.m1 * self.r1) * self.g * c1
        f2 = -h * v1 * v1 - outer
        determinant = m11 * m22 - m12 * m12
        return np.stack([v1, v2, (m22 * f1 - m12 * f2) / determinant, (m11 * f2 - m12 * f1) / determinant], -1)

    def energy(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Kinetic energy, and potential energy (zero at the height of the first joint), (...) each, J."""
        kinetic = 0.5 * np.einsum("...i,...ij,...j->...", v, self.mass_matrix(q), v)
        s1, s12 = np.sin(q[..., 0]), np.sin(q[..., 0] + q[..., 1])
        potential = self.g * (self.m1 * self.r1 * s1 + self.m2 * (self.l1 * s1 + self.r2 * s12))
        return kinetic, potential

    def inverse_kinematics(self, tip: Array, elbow: int) -> Array:
        """Joint angles (..., 2) that put the tip (..., 2) there, with the sign of `elbow` for the second."""
        x, y = tip[..., 0], tip[..., 1]
        cosine = (x * x + y * y - self.l1**2 - self.l2**2) / (2 * self.l1 * self.l2)
        second = np.sign(elbow) * np.arccos(cosine)
        first = np.arctan2(y, x) - np.arctan2(self.l2 * np.sin(second), self.l1 + self.l2 * np.cos(second))
        return np.stack([first, second], -1)

    def circle(
        self, phi: Array, rate: float, elbow: int, center: Any = (1.2, 1.2), radius: float = 0.2
    ) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration (n, 2) while the tip follows a circle at the angles `phi`, dφ/dt = rate.

        The rates differentiate the closed forms: v = J⁻¹ ẋ and a = J⁻¹ (ẍ - J̇ v).
        """
        c, s = np.cos(phi), np.sin(phi)
        q = self.inverse_kinematics(np.stack([center[0] + radius * c, center[1] + radius * s], -1), elbow)
        dx = radius * rate * np.stack([-s, c], -1)
        ddx = -radius * rate * rate * np.stack([c, s], -1)
        angle = q[..., 0] + q[..., 1]
        s1, c1 = self.l1 * np.sin(q[..., 0]), self.l1 * np.cos(q[..., 0])
        s12, c12 = self.l2 * np.sin(angle), self.l2 * np.cos(angle)
        jacobian = np.stack([np.stack([-s1 - s12, -s12], -1), np.stack([c1 + c12, c12], -1)], -2)
        v = _solve(jacobian, dx)
        w1, w12 = v[..., 0], v[..., 0] + v[..., 1]
        jdot_v = np.stack([-c1 * w1 * w1 - c12 * w12 * w12, -s1 * w1 * w1 - s12 * w12 * w12], -1)
        return q, v, _solve(jacobian, ddx - jdot_v)


def _solve(matrix: Array, right: Array) -> Array:
    return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0], dtype=np.float64)
