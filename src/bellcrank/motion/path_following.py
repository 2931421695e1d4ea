"""Inverse kinematics along paths of a frame: the motion of the joints, on the branch of a start posture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.motion.coordinates import Array
from bellcrank.motion.frame_task import check_plane, frame_task
from bellcrank.motion.inverse_kinematics import NEAR_SINGULAR, follow
from bellcrank.motion.limit_notes import limit_notes
from bellcrank.motion.motion import Motion, join
from bellcrank.motion.path import (
    FramePath,
    Posture,
    wanted_rotation,
)
from bellcrank.robot.joints import JointLike

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot


def follow_paths(robot: Robot, paths: Sequence[FramePath], start: Array) -> Motion:
    """The motion along paths, one after the other, from the branch of the posture `start` (nq,). Raises
    BellcrankError.
    """
    motions: list[Motion] = []
    for path in paths:
        motions.append(follow_path(robot, path, motions[-1].position[-1] if motions else start))
    return motions[0] if len(motions) == 1 else join(*motions, name=paths[0].name)


def follow_path(robot: Robot, path: FramePath, start: Array) -> Motion:
    """The motion along a path, on the branch of the posture `start` (nq,). Raises BellcrankError."""
    title, frame, curve, name = f"motion '{path.name}'", path.frame, path.curve, path.name
    time, s, speed, growth = path.rows()
    rotation = wanted_rotation(path, robot.frame_pose(frame, start)[1])
    task = frame_task(robot, frame, start, rotation, title, path.coordinates)
    check_plane(task, curve(s)[0], time, title)
    found = follow(task, curve, s, time, title)
    velocity, acceleration = np.zeros((len(s), robot.nv)), np.zeros((len(s), robot.nv))
    single: list[JointLike] = [joint for joint in robot.joints if joint.nq == 1]
    rows, columns = [joint.q for joint in single], [joint.v for joint in single]
    first, second = found.first[:, rows], found.second[:, rows]
    velocity[:, columns] = first * speed[:, None]
    acceleration[:, columns] = second * (speed * speed)[:, None] + first * growth[:, None]
    notes = limit_notes(robot, name, time, found.position)
    worst = int(np.argmin(found.condition))
    if found.condition[worst] < NEAR_SINGULAR:
        notes += (
            f"{title} passes near a singular posture at {time[worst]:.6g} s: the smallest singular value of "
            f"the Jacobian of frame '{frame}' is {found.condition[worst]:.2g} of the largest; small changes "
            "of the path change the speeds much",
        )
    return Motion(robot.joints, time, found.position, velocity, acceleration, name, notes)


def start_posture(robot: Robot, start: Posture | None) -> Array:
    """The posture (nq,) that `start` gives; the neutral one for None. Raises InputError."""
    return np.array(robot.posture({} if start is None else start), dtype=np.float64)
