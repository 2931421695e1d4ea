"""Small displacements of a position: the convention of all derivatives by q, and the velocity of a displacement.

A displacement δ (nv) is a right increment: the position q ⊕ δ is q moved for a unit of time along E(q) δ, so that δ
is in the axes of the velocity v. For a free base that is a translation (m) and a rotation vector (rad) in the base's
own axes, for a joint of one degree of freedom the change of its coordinate.

If q moves with v, and a neighbouring position q ⊕ δ with v + δv, then δ̇ = δv − ad(v) δ: the axes of δ turn with the
body. Source: Murray, Li & Sastry, A Mathematical Introduction to Robotic Manipulation (1994), 2.4; Selig, Geometric
Fundamentals of Robotics (2005), 4.3.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array

if TYPE_CHECKING:
    from bellcrank.robot.model.joints import RobotJoint
    from bellcrank.robot.robot import Robot


def cross(vector: Array) -> Array:
    """The matrix (3, 3) of the cross product with a vector (3,)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def adjoint(robot: Robot, v: Array) -> Array:
    """ad(v) (nv, nv), joint by joint: the Lie bracket [v, δ] = ad(v) δ; 0 for one degree of freedom."""
    matrix = np.zeros((robot.nv, robot.nv))
    for joint in robot.joints:
        part = slice(joint.v, joint.v + joint.nv)
        matrix[part, part] = _joint_adjoint(joint, v[part])
    return matrix


def _joint_adjoint(joint: RobotJoint, v: Array) -> Array:
    if joint.kind == "spherical":
        return cross(v)
    if joint.kind == "floating":
        spin = cross(v[3:])
        return np.block([[spin, cross(v[:3])], [np.zeros((3, 3)), spin]])
    if joint.kind == "planar":  # (x, y, angle): the plane motions among the spatial ones
        x, y, rate = v
        return np.array([[0.0, -rate, y], [rate, 0.0, -x], [0.0, 0.0, 0.0]])
    return np.zeros((joint.nv, joint.nv))
