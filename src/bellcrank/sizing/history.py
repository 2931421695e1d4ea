"""Torques over time along a motion, and the files that each motion has of its own."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.errors import InputError
from bellcrank.motion.csv_file import write_motion
from bellcrank.sizing.histories import MotionHistory, motion_history
from bellcrank.sizing.linkage import motors_of

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.sizing.drive import Drive
    from bellcrank.sizing.result import Sizing

Array = NDArray[np.float64]


def joint_torques(
    robot: Robot,
    joints: Sequence[RobotJoint],
    drives: Mapping[str, Drive],
    time: Array,
    q: Array,
    v: Array,
    a: Array,
) -> Array:
    """The torques (n, len(joints)) that joints must be given at times (n,) s, N m or N; with a drive that of the gear's
    output, without the rotor's own inertia.
    """
    found = [joint_torque(robot, joint, q, v, a, joint.name in drives) for joint in joints]
    return np.column_stack(found)


def joint_torque(robot: Robot, joint: RobotJoint, q: Array, v: Array, a: Array, driven: bool) -> Array:
    """The torque (n,) that a joint must be given, N m or N; with a drive that of the gear's output, without the
    rotor's own inertia."""
    torque = np.asarray(robot.inverse_dynamics(q, v, a))[:, joint.v]
    return torque - robot.rotor_inertia[joint.v] * a[:, joint.v] if driven else torque


def sizing_histories(sizing: Sizing) -> dict[str, MotionHistory]:
    """The histories of the joints that a sizing sized, by motion. Raises InputError where it does not hold motions."""
    if sizing.study is None:
        raise InputError(f"sizing of {sizing.robot}: it does not hold its motions; make it with bellcrank.size")
    robot, motions, drives = sizing.study
    joints = motors_of(robot)
    torques = functools.partial(joint_torques, robot, joints, drives)
    return {motion.name: motion_history(motion, joints, drives, torques) for motion in motions}


def write_histories(
    robot: Robot, motions: Sequence[Motion], folder: str | Path, drives: Mapping[str, Drive]
) -> list[Path]:
    """Write history_<motion>.csv for each motion: its rows with the joint torques of the sizing and, with drives, what
    the motors' shafts deliver; their paths.

    Such a file can be read as a motion again. Raises InputError where the folder cannot be written.
    """
    joints = [joint for joint in robot.joints if joint.nv == 1]  # those without a motor have torque 0
    names = file_names(motions)
    paths = []
    for motion, name in zip(motions, names, strict=True):
        history = motion_history(motion, joints, drives, functools.partial(joint_torques, robot, joints, drives))
        torque = np.column_stack([line.torque for line in history.joints])
        paths.append(write_motion(motion, Path(folder) / f"history_{name}.csv", torque, _shaft_columns(history)))
    return paths


def _shaft_columns(history: MotionHistory) -> dict[tuple[str, str], Array]:
    """The columns of the motors' shafts: (title, unit) and values (n,)."""
    columns: dict[tuple[str, str], Array] = {}
    for joint in history.joints:
        if joint.shaft is not None:
            columns[f"{joint.name} shaft torque", "N m"] = joint.shaft.torque
            columns[f"{joint.name} shaft speed", "rad/s"] = joint.shaft.speed
            columns[f"{joint.name} shaft power", "W"] = joint.shaft.power
    return columns


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
