"""Coordinates of a position, joint by joint: names, units, and rates q̇, q̈ from v, a and back.

A one-degree-of-freedom joint has one number (rad or m; rad for a screw) and its rate is its velocity. A planar joint
has x, y (m), cos θ, sin θ; a floating one x, y, z (m, in the parent's frame) and a quaternion x y z w, a spherical one
the quaternion alone; their velocities are written in the moving frame (linear first), so that ẋ = R v and, for the
quaternion, q̇ = ½ q ⊗ ω.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bellcrank.arrays import Array
from bellcrank.motion.kinematics.rotations import conjugate, cross, multiply, rotate
from bellcrank.robot.model.joints import JointLike, quaternion_part


def sizes(joints: Sequence[JointLike]) -> tuple[int, int]:
    """Lengths (nq, nv) of the position and velocity vectors."""
    return sum(joint.nq for joint in joints), sum(joint.nv for joint in joints)


def position_labels(joints: Sequence[JointLike]) -> list[tuple[str, str]]:
    """(name, unit) of each of the nq position coordinates, such as ("shoulder position", "rad")."""
    shapes = {
        "revolute": [("position", "rad")],
        "prismatic": [("position", "m")],
        "screw": [("position", "rad")],
        "planar": [("position x", "m"), ("position y", "m"), ("position cos", "1"), ("position sin", "1")],
        "spherical": [(f"position q{c}", "1") for c in "xyzw"],
        "floating": [(f"position {c}", "m") for c in "xyz"] + [(f"position q{c}", "1") for c in "xyzw"],
    }
    return [(f"{joint.name} {label}", unit) for joint in joints for label, unit in shapes[joint.kind]]


def velocity_labels(joints: Sequence[JointLike], order: int = 1) -> list[tuple[str, str]]:
    """(name, unit) of each of the nv velocity (order 1) or acceleration (order 2) coordinates."""
    what, per = ("velocity", "s") if order == 1 else ("acceleration", "s^2")
    shapes = {
        "revolute": [(what, f"rad/{per}")],
        "prismatic": [(what, f"m/{per}")],
        "screw": [(what, f"rad/{per}")],
        "spherical": [(f"{what} r{c}", f"rad/{per}") for c in "xyz"],
        "planar": [(f"{what} x", f"m/{per}"), (f"{what} y", f"m/{per}"), (f"{what} angle", f"rad/{per}")],
        "floating": [(f"{what} {c}", f"m/{per}") for c in "xyz"] + [(f"{what} r{c}", f"rad/{per}") for c in "xyz"],
    }
    return [(f"{joint.name} {label}", unit) for joint in joints for label, unit in shapes[joint.kind]]


def rates(joints: Sequence[JointLike], q: Array, v: Array, a: Array) -> tuple[Array, Array]:
    """First and second time derivatives (n, nq) of the position coordinates, from velocity and acceleration
    (n, nv).
    """
    qd, qdd = np.zeros_like(q), np.zeros_like(q)
    for joint in joints:
        i, k = joint.q, joint.v
        if joint.kind == "floating":
            quaternion, linear, angular = q[:, i + 3 : i + 7], v[:, k : k + 3], v[:, k + 3 : k + 6]
            turned = cross(angular, linear) + a[:, k : k + 3]
            qd[:, i : i + 3], qdd[:, i : i + 3] = rotate(quaternion, linear), rotate(quaternion, turned)
            qd[:, i + 3 : i + 7], qdd[:, i + 3 : i + 7] = _quaternion_rates(quaternion, angular, a[:, k + 3 : k + 6])
        elif joint.kind == "spherical":
            qd[:, i : i + 4], qdd[:, i : i + 4] = _quaternion_rates(q[:, i : i + 4], v[:, k : k + 3], a[:, k : k + 3])
        elif joint.kind == "planar":
            c, s, w = q[:, i + 2], q[:, i + 3], v[:, k + 2]
            vx, vy = v[:, k], v[:, k + 1]
            ax, ay, aw = a[:, k] - w * vy, a[:, k + 1] + w * vx, a[:, k + 2]
            qd[:, i : i + 4] = np.stack([c * vx - s * vy, s * vx + c * vy, -s * w, c * w], axis=1)
            qdd[:, i : i + 4] = np.stack(
                [c * ax - s * ay, s * ax + c * ay, -s * aw - c * w * w, c * aw - s * w * w], axis=1
            )
        else:
            qd[:, i], qdd[:, i] = v[:, k], a[:, k]
    return qd, qdd


def from_rates(joints: Sequence[JointLike], q: Array, qd: Array, qdd: Array) -> tuple[Array, Array, Array]:
    """Inverse of `rates`: (position, velocity, acceleration); rotation numbers of any length come back
    normalised.
    """
    nv = sizes(joints)[1]
    q, v, a = q.copy(), np.zeros((len(q), nv)), np.zeros((len(q), nv))
    for joint in joints:
        i, k = joint.q, joint.v
        if joint.kind == "floating":
            part = slice(i + 3, i + 7)
            quaternion, angular, a[:, k + 3 : k + 6] = _angular_rates(q[:, part], qd[:, part], qdd[:, part])
            v[:, k + 3 : k + 6] = angular
            back = conjugate(quaternion)
            linear = rotate(back, qd[:, i : i + 3])
            v[:, k : k + 3] = linear
            a[:, k : k + 3] = rotate(back, qdd[:, i : i + 3]) - cross(angular, linear)
            q[:, part] = quaternion
        elif joint.kind == "spherical":
            part, turn = slice(i, i + 4), slice(k, k + 3)
            q[:, part], v[:, turn], a[:, turn] = _angular_rates(q[:, part], qd[:, part], qdd[:, part])
        elif joint.kind == "planar":
            c, s, cd, sd = q[:, i + 2], q[:, i + 3], qd[:, i + 2], qd[:, i + 3]
            square = c * c + s * s
            w = (c * sd - s * cd) / square
            aw = (c * qdd[:, i + 3] - s * qdd[:, i + 2]) / square - 2.0 * w * (c * cd + s * sd) / square
            c, s = c / np.sqrt(square), s / np.sqrt(square)
            vx, vy = c * qd[:, i] + s * qd[:, i + 1], c * qd[:, i + 1] - s * qd[:, i]
            ax, ay = c * qdd[:, i] + s * qdd[:, i + 1], c * qdd[:, i + 1] - s * qdd[:, i]
            v[:, k : k + 3] = np.stack([vx, vy, w], axis=1)
            a[:, k : k + 3] = np.stack([ax + w * vy, ay - w * vx, aw], axis=1)
            q[:, i + 2], q[:, i + 3] = c, s
        else:
            v[:, k], a[:, k] = qd[:, i], qdd[:, i]
    return q, v, a


def continuous(joints: Sequence[JointLike], q: Array) -> Array:
    """Signs (n, nq) that make every quaternion continue the one before it (q and −q are the same
    rotation).
    """
    signs = np.ones_like(q)
    for joint in joints:
        if (part := quaternion_part(joint)) is not None:
            block = q[:, part]
            follow = np.where(np.sum(block[1:] * block[:-1], axis=1) < 0.0, -1.0, 1.0)
            signs[1:, part] = np.cumprod(follow)[:, None]
    return signs


def _quaternion_rates(quaternion: Array, angular: Array, acceleration: Array) -> tuple[Array, Array]:
    """q̇ and q̈ (n, 4) of a unit quaternion, from angular velocity and acceleration (n, 3) in the body's axes."""
    rate = 0.5 * multiply(quaternion, _pure(angular))
    return rate, 0.5 * (multiply(rate, _pure(angular)) + multiply(quaternion, _pure(acceleration)))


def _angular_rates(raw: Array, rate: Array, second: Array) -> tuple[Array, Array, Array]:
    """The unit quaternion, angular velocity and acceleration (body's axes) of a quaternion of any length, q̇ and q̈."""
    square = np.sum(raw * raw, axis=1, keepdims=True)
    inverse = conjugate(raw)
    angular = 2.0 * multiply(inverse, rate)[:, :3] / square
    growth = 2.0 * np.sum(raw * rate, axis=1, keepdims=True) / square
    acceleration = 2.0 * multiply(inverse, second)[:, :3] / square - growth * angular
    return raw / np.sqrt(square), angular, acceleration


def _pure(vector: Array) -> Array:
    return np.concatenate([vector, np.zeros((len(vector), 1))], axis=1)
