"""The lecture's planar 2R arm in closed form, with the interface of a Robot that sizing uses.

Ghosal, lecture 18: gravity along −y, both joints about z, the second angle relative to the first link.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

L1 = L2 = 1.0
M1 = M2 = 12.456
R1, R2 = 0.773, 0.583
I1 = I2 = 1.042
G = 9.81

CONTINUOUS = {  # N m: min and max of the shoulder's, then of the elbow's torque round the circle
    -1: (71.868232191, 168.284704373, 62.907986073, 71.606360251),
    1: (210.418440357, 242.272603138, 0.824956317, 33.254249576),
}


@dataclass(frozen=True)
class PlainJoint:
    """One revolute joint's name and place."""

    name: str
    q: int
    v: int
    kind: str = "revolute"
    nq: int = 1
    nv: int = 1


class TwoLink:
    """Analytic stand-in for the 2R robot; see robot.py for what the names mean."""

    name = "two link"
    file = None
    notes = ()

    def __init__(self, viscous: float = 0.0, coulomb: float = 0.0, rotor: tuple[float, float] = (0.0, 0.0)) -> None:
        self.joints = (PlainJoint("shoulder", 0, 0), PlainJoint("elbow", 1, 1))
        self.joint_names = self.all_joint_names = ("shoulder", "elbow")
        self.nq = self.nv = 2
        self.neutral = np.zeros(2)
        self.lower, self.upper = np.full(2, -np.pi), np.full(2, np.pi)
        self.effort_limit, self.velocity_limit = np.array([250.0, np.inf]), np.array([np.inf, 2.0])
        self.viscous, self.coulomb = np.full(2, viscous), np.full(2, coulomb)
        self.friction_width = 1e-3
        self.rotor_inertia = np.array(rotor)
        self.findings: tuple[str, ...] = ()
        self.inertia_warnings: tuple[str, ...] = ()
        self.singular_joints: dict[str, str] = {}
        self.gravity, self.payloads = np.array([0.0, -G, 0.0]), ()

    def mimics(self) -> tuple[Any, ...]:
        """No joint follows another."""
        return ()

    def moved_by(self, joints: Any, set_masses: Any = None) -> tuple[tuple[str, ...], float]:
        """The shoulder moves both links, the elbow the second."""
        return (("upper", "fore"), M1 + M2) if "shoulder" in joints else (("fore",), M2)

    def posture(self, given: Any) -> Any:
        """(2,) posture."""
        if isinstance(given, dict):
            return np.array([given.get("shoulder", 0.0), given.get("elbow", 0.0)])
        return np.asarray(given, dtype=float)

    def link_torques(self, q: Any, v: Any, a: Any) -> Any:
        """(n, 2 links, 2 joints): Lagrange's equations of each link alone."""
        q, v, a = (np.atleast_2d(x) for x in (q, v, a))
        c2, s2 = np.cos(q[:, 1]), np.sin(q[:, 1])
        c1, c12 = np.cos(q[:, 0]), np.cos(q[:, 0] + q[:, 1])
        first = np.stack([(I1 + M1 * R1**2) * a[:, 0] + M1 * G * R1 * c1, 0 * c1], axis=1)
        h = M2 * L1 * R2
        m11 = I2 + M2 * (L1**2 + R2**2) + 2 * h * c2
        m12, m22 = I2 + M2 * R2**2 + h * c2, I2 + M2 * R2**2
        second = np.stack(
            [
                m11 * a[:, 0]
                + m12 * a[:, 1]
                - h * s2 * (2 * v[:, 0] + v[:, 1]) * v[:, 1]
                + M2 * G * (L1 * c1 + R2 * c12),
                m12 * a[:, 0] + m22 * a[:, 1] + h * s2 * v[:, 0] ** 2 + M2 * G * R2 * c12,
            ],
            axis=1,
        )
        return np.stack([first, second], axis=1)

    def friction_torque(self, v: Any) -> Any:
        """Viscous and smoothed Coulomb friction."""
        v = np.asarray(v)
        return self.viscous * v + self.coulomb * v / np.sqrt(v**2 + self.friction_width**2)

    def inverse_dynamics(self, q: Any, v: Any, a: Any) -> Any:
        """(n, 2) torques, N m."""
        return self.link_torques(q, v, a).sum(axis=1) + self.rotor_inertia * a + self.friction_torque(v)

    def link_gravity_torques(self, q: Any) -> Any:
        """(n, 2, 2) shares at rest."""
        rest = np.zeros_like(np.atleast_2d(q))
        return self.link_torques(q, rest, rest)

    def gravity_torque(self, q: Any) -> Any:
        """(n, 2) at rest."""
        rest = np.zeros_like(np.atleast_2d(q))
        return self.link_torques(q, rest, rest).sum(axis=1)

    def mass_matrix(self, q: Any) -> Any:
        """(n, 2, 2) from unit accelerations."""
        q = np.atleast_2d(q)
        rest = np.zeros_like(q)
        columns = [
            (self.link_torques(q, rest, rest + np.eye(2)[k]) - self.link_torques(q, rest, rest)).sum(axis=1)
            for k in range(2)
        ]
        return np.stack(columns, axis=2) + np.diag(self.rotor_inertia)

    def joint_axis(self, name: str) -> Any:
        """Both axes are z."""
        return np.array([0.0, 0.0, 1.0])

    def joint_reactions(self, q: Any, v: Any, a: Any) -> Any:
        """(n, 2, 6): Newton's law of the links; the moment is the joint's torque, about z."""
        q, v, a = (np.atleast_2d(x) for x in (q, v, a))

        def arm(radius: float, angle: Any, rate: Any, second: Any) -> Any:
            x, y = np.cos(angle), np.sin(angle)
            return radius * np.stack([-second * y - rate**2 * x, second * x - rate**2 * y], axis=1)

        one = arm(1.0, q[:, 0], v[:, 0], a[:, 0])
        two = arm(R2, q.sum(axis=1), v.sum(axis=1), a.sum(axis=1))
        weight = np.array([0.0, G])
        elbow = M2 * (L1 * one + two + weight)
        shoulder = elbow + M1 * (R1 * one + weight)
        torque = self.inverse_dynamics(q, v, a)
        result = np.zeros((len(q), 2, 6))
        result[:, 0, :2], result[:, 1, :2] = shoulder, elbow
        result[:, 0, 5], result[:, 1, 5] = torque[:, 0], torque[:, 1]
        return result


def inverse_kinematics(x: Any, y: Any, branch: int) -> Any:
    """(…, 2) angles that put the tip at (x, y), m; branch is the sign of the elbow's angle."""
    second = branch * np.arccos((x * x + y * y - L1**2 - L2**2) / (2 * L1 * L2))
    first = np.arctan2(y, x) - np.arctan2(L2 * np.sin(second), L1 + L2 * np.cos(second))
    return np.stack([first, second], axis=-1)


def circle_states(phi: Any, branch: int, duration: float = 10.0) -> Any:
    """(q, v, a), each (n, 2), round the lecture's circle at the angles phi (n,), rates from J q̇ = ẋ."""
    rate = 2 * np.pi / duration
    x, y = 1.2 + 0.2 * np.cos(phi), 1.2 + 0.2 * np.sin(phi)
    q = inverse_kinematics(x, y, branch)
    speed = 0.2 * rate * np.stack([-np.sin(phi), np.cos(phi)], axis=-1)
    rise = 0.2 * rate**2 * np.stack([-np.cos(phi), -np.sin(phi)], axis=-1)
    s1, c1 = np.sin(q[:, 0]), np.cos(q[:, 0])
    s12, c12 = np.sin(q.sum(axis=1)), np.cos(q.sum(axis=1))
    jacobian = np.stack([np.stack([-s1 - s12, -s12], axis=-1), np.stack([c1 + c12, c12], axis=-1)], axis=1)
    v = np.linalg.solve(jacobian, speed[..., None])[..., 0]
    w1, w12 = v[:, 0], v.sum(axis=1)
    drift = np.stack([-c1 * w1**2 - c12 * w12**2, -s1 * w1**2 - s12 * w12**2], axis=-1)
    a = np.linalg.solve(jacobian, (rise - drift)[..., None])[..., 0]
    return q, v, a
