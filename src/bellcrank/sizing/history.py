"""Torques over time along a motion, and the files that each motion has of its own."""

from __future__ import annotations

import functools
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.mechanism import force_times, mechanism_of
from bellcrank.errors import InputError
from bellcrank.motion.csv_file import write_motion
from bellcrank.sizing.histories import MotionHistory, motion_history
from bellcrank.text import file_name_here

if TYPE_CHECKING:
    from bellcrank.actuators.actuator import Drive
    from bellcrank.dynamics.mechanism import Mechanism
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.sizing.result import Sizing

Array = NDArray[np.float64]
_UNUSUAL = re.compile(r"[^\w.-]+")  # in names of files


def joint_torques(
    robot: Robot | Mechanism,
    joints: Sequence[RobotJoint],
    drives: Mapping[str, Drive],
    time: Array,
    q: Array,
    v: Array,
    a: Array,
    end: float | None = None,
) -> Array:
    """The torques (n, len(joints)) that motors must give at times (n,) s, N m or N, 0 at joints without a motor; with a
    drive that of the gear's output, without the rotor's own inertia. Where a time stands twice, its first row is the
    limit from before, and so is what acts at `end` s, where a motion ends.
    """
    mechanism = mechanism_of(robot)
    every = mechanism.torques(force_times(time, end), q, v, a)[0]
    places = {joint.name: k for k, joint in enumerate(mechanism.motors)}
    found = np.zeros((len(time), len(joints)))
    for k, joint in enumerate(joints):
        if joint.name in places:
            rotor = mechanism.robot.rotor_inertia[joint.v] if joint.name in drives else 0.0
            found[:, k] = every[:, places[joint.name]] - rotor * a[:, joint.v]
    return found


def sizing_histories(sizing: Sizing) -> dict[str, MotionHistory]:
    """The histories of the joints that a sizing sized, by motion. Raises InputError where it does not hold motions."""
    if sizing.study is None:
        raise InputError(f"sizing of {sizing.robot}: it does not hold its motions; make it with bellcrank.size")
    mechanism, motions, drives = sizing.study
    joints = mechanism.motors
    torques = functools.partial(joint_torques, mechanism, joints, drives)
    return {
        motion.name: motion_history(motion, joints, drives, functools.partial(torques, end=float(motion.time[-1])))
        for motion in motions
    }


def write_histories(
    robot: Robot | Mechanism, motions: Sequence[Motion], folder: str | Path, drives: Mapping[str, Drive]
) -> list[Path]:
    """Write history_<motion>.csv for each motion: its rows with the joint torques of the sizing and, with drives, what
    the motors' shafts deliver; their paths.

    Such a file can be read as a motion again. Raises InputError where the folder cannot be written.
    """
    mechanism = mechanism_of(robot)
    joints = [joint for joint in mechanism.robot.joints if joint.nv == 1]
    names = file_names(motions)
    paths = []
    for motion, name in zip(motions, names, strict=True):
        torques = functools.partial(joint_torques, mechanism, joints, drives, end=float(motion.time[-1]))
        history = motion_history(motion, joints, drives, torques)
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
    return file_name_here(_UNUSUAL.sub("_", text).strip("_.")[:80]) or "motion"
