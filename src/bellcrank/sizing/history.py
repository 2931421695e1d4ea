"""Torques over time along a motion, and the files that each motion has of its own."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.motion.csv_file import write_motion

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.sizing.drive import Drive

Array = NDArray[np.float64]


def joint_torque(robot: Robot, joint: RobotJoint, q: Array, v: Array, a: Array, driven: bool) -> Array:
    """The torque (n,) that a joint must be given, N m or N; with a drive that of the gear's output, without the
    rotor's own inertia."""
    torque = np.asarray(robot.inverse_dynamics(q, v, a))[:, joint.v]
    return torque - robot.rotor_inertia[joint.v] * a[:, joint.v] if driven else torque


def write_histories(
    robot: Robot, motions: Sequence[Motion], folder: str | Path, drives: Mapping[str, Drive]
) -> list[Path]:
    """Write history_<motion>.csv for each motion: its rows with the joint torques of the sizing; their paths.

    Such a file can be read as a motion again. Raises InputError where the folder cannot be written.
    """
    joints = [joint for joint in robot.joints if joint.nv == 1]  # those without a motor have torque 0
    names = file_names(motions)
    paths = []
    for motion, name in zip(motions, names, strict=True):
        states = (motion.position, motion.velocity, motion.acceleration)
        torque = [joint_torque(robot, joint, *states, joint.name in drives) for joint in joints]
        paths.append(write_motion(motion, Path(folder) / f"history_{name}.csv", np.column_stack(torque)))
    return paths


def file_names(motions: Iterable[Motion]) -> list[str]:
    """Each motion's name as part of a file name, no two alike."""
    names: list[str] = []
    for motion in motions:
        name, number = file_name(motion.name), 1
        while name in names:
            number += 1
            name = f"{file_name(motion.name)}_{number}"
        names.append(name)
    return names


def file_name(text: str) -> str:
    """A motion's name as part of a file name: letters, digits, . _ and - only."""
    return re.sub(r"[^\w.-]+", "_", text).strip("_.")[:80] or "motion"
