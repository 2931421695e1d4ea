"""Postures drawn at random, and which coordinates are lengths."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def lengths_in_velocity(robot: Robot) -> Mask:
    """Which entries of v (nv) are in m/s; the others are in rad/s."""
    far = np.zeros(robot.nv, dtype=bool)
    for j in robot.joints:
        far[j.v : j.v + {"prismatic": 1, "planar": 2, "floating": 3}.get(j.kind, 0)] = True
    return far


def lengths_in_position(robot: Robot) -> Mask:
    """Which entries of q (nq) are in m; the others are in rad, or parts of a unit vector."""
    far = np.zeros(robot.nq, dtype=bool)
    for j in robot.joints:
        far[j.q : j.q + {"prismatic": 1, "planar": 2, "floating": 3}.get(j.kind, 0)] = True
    return far


def random_posture(robot: Robot, random: np.random.Generator, length: float = 1.0) -> Array:
    """A position (nq,) with every joint within 1.5 rad or 1.5 `length` of its zero, and unit rotations."""
    return np.asarray(postures(robot, random.uniform(-1.5, 1.5, (1, robot.nq)), length)[0])


def postures(robot: Robot, moves: Array, length: float) -> Array:
    """Positions (n, nq) moved from 0 by so much, rad or `length`, with unit rotations."""
    q = robot.neutral + np.where(lengths_in_position(robot), length * moves, moves)
    for j in robot.joints:
        part = {"floating": slice(j.q + 3, j.q + 7), "planar": slice(j.q + 2, j.q + 4)}.get(j.kind)
        if part is not None:
            q[:, part] /= np.linalg.norm(q[:, part], axis=1, keepdims=True)
    return np.asarray(q)
