"""Rotation matrices (3, 3): from roll, pitch and yaw; between two rotations; angles between rotations.

scipy's Rotation does the same, but importing it takes longer than loading a robot.
"""

from __future__ import annotations

import numpy as np

from bellcrank.arrays import Array


def from_rpy(rpy: Array) -> Array:
    """The matrix of roll, pitch, yaw (3,) in rad about the fixed x, y, z axes in that order, as in a URDF."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def between(begin: Array, end: Array, part: float) -> Array:
    """The rotation at a part (0 to 1) of the shortest way from one rotation to another."""
    relative = begin.T @ end
    angle = float(angles_to(relative[None], np.eye(3))[0])
    if angle < 1e-12:
        return end if part >= 1.0 else begin
    if part >= 1.0:
        return end
    skew = np.array([relative[2, 1] - relative[1, 2], relative[0, 2] - relative[2, 0], relative[1, 0] - relative[0, 1]])
    size = np.linalg.norm(skew)  # zero at half a turn, where the axis is the eigenvector of 1
    axis = skew / size if size > 1e-6 else np.linalg.svd(relative - np.eye(3))[2][-1]
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + np.sin(part * angle) * cross + (1.0 - np.cos(part * angle)) * (cross @ cross)
    return np.asarray(begin @ turn)


def angles_to(rotations: Array, wanted: Array) -> Array:
    """The angles (n,) in rad between rotations (n, 3, 3) and one rotation (3, 3)."""
    relative = np.swapaxes(rotations, 1, 2) @ wanted
    skew = np.stack(
        [
            relative[:, 2, 1] - relative[:, 1, 2],
            relative[:, 0, 2] - relative[:, 2, 0],
            relative[:, 1, 0] - relative[:, 0, 1],
        ],
        axis=1,
    )
    return np.asarray(np.arctan2(np.linalg.norm(skew, axis=1), np.trace(relative, axis1=1, axis2=2) - 1.0))
