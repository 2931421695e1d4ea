"""Inverse kinematics along paths of a frame: the motion of the joints, on the branch of a start posture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import UnreachableError
from bellcrank.motion.generators.path import (
    FramePath,
    Posture,
    wanted_rotation,
)
from bellcrank.motion.kinematics.continuation import CLOSE_ENOUGH, ContinuationError, Curve, Solver
from bellcrank.motion.kinematics.pose_equations import FrameTask, check_plane, frame_task, vector_text
from bellcrank.motion.kinematics.rotations import angles_to
from bellcrank.motion.limit_checks import limit_notes
from bellcrank.motion.motion import Motion, join
from bellcrank.robot.model.joints import JointLike

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot


# ---- Inverse kinematics along a path: the branch that the start posture lies on, or an error that says why not.

SINGULAR = 1e-6  # smallest over largest singular value of the frame's Jacobian: below, a path is refused
NEAR_SINGULAR = 1e-2  # below, it is followed with a warning


@dataclass(frozen=True)
class FollowedPath:
    """Postures (n, nq) along a path and their first and second derivatives with respect to its length."""

    position: Array
    first: Array
    second: Array
    condition: Array  # smallest over largest singular value of the frame's Jacobian, (n,)


def follow(task: FrameTask, curve: Curve, lengths: Array, times: Array, title: str) -> FollowedPath:
    """Postures that put the task's frame on the curve at `lengths` (n,), increasing, reached at `times` (n,) in s.

    Raises UnreachableError, naming time, pose and how much is missing, where the curve leaves the reach or is singular.
    """
    solver, path = Solver(task), _TimedPath(task, curve, lengths, times, title)
    distinct, back = np.unique(lengths, return_inverse=True)
    try:
        z = solver.to_start(curve(distinct[:1])[0][0])
        knots = solver.along(curve, float(distinct[0]), float(distinct[-1]), z)
        z, first, second = solver.everywhere(curve, distinct, knots)
    except ContinuationError as error:
        raise UnreachableError(path.explanation(solver, error)) from None
    condition = solver.condition(z)
    if np.min(condition) < SINGULAR:
        row = int(np.argmin(condition))
        raise UnreachableError(path.singular(float(distinct[row]), float(condition[row])))
    path.check_orientation(distinct, task.posture(z))
    n = len(task.active)
    full = [np.zeros((len(distinct), len(task.start))) for _ in range(2)]
    for array, part in zip(full, (first, second), strict=True):
        array[:, list(task.active)] = part[:, :n]
    return FollowedPath(task.posture(z)[back], full[0][back], full[1][back], condition[back])


@dataclass(frozen=True)
class _TimedPath:
    """A path to follow, for messages: lengths (n,) in m along the curve, reached at times (n,) in s."""

    task: FrameTask
    curve: Curve
    lengths: Array
    times: Array
    title: str

    def time_of(self, length: float) -> float:
        """The time, s, at which a length is reached."""
        return float(np.interp(length, self.lengths, self.times))

    def explanation(self, solver: Solver, error: ContinuationError) -> str:
        """Why the path cannot be followed past a length: it leaves the reach by so much, or is singular."""
        task, span = self.task, float(self.lengths[-1])
        ahead = np.append(np.linspace(error.where, span, 41), error.where + 1e-3 * span)
        lengths = np.unique(ahead.clip(0.0, span))
        points = self.curve(lengths)[0]
        q = error.z[: solver.joints]
        missing = np.empty(len(lengths))
        for k, target in enumerate(task.target(points)):
            q, missing[k] = solver.nearest(q, target)
        worst = int(np.argmax(missing))
        here = self.curve(np.array([error.where]))[0][0]
        if missing[worst] > CLOSE_ENOUGH:
            unit = "m" if task.rotation is None else "(m and rad together)"
            return (
                f"{self.title}: the path of frame '{task.frame}' leaves the reach of '{task.robot.name}' at "
                f"{self.time_of(error.where):.6g} s, at {vector_text(here)} m; at worst, at "
                f"{self.time_of(float(lengths[worst])):.6g} s, {vector_text(points[worst])} m is "
                f"missed by {missing[worst]:.4g} {unit}"
                + ("" if task.rotation is None else "; move the path or leave the orientation free")
            )
        z = error.z.copy()
        z[: solver.joints] = solver.nearest(z[: solver.joints], task.target(here[None])[0])[0]
        return self.singular(error.where, float(solver.condition(z[None])[0]))

    def singular(self, length: float, condition: float) -> str:
        """That the path cannot be followed at a length, where the Jacobian has this condition."""
        task, point = self.task, self.curve(np.array([length]))[0][0]
        place = f"at {self.time_of(length):.6g} s, at {vector_text(point)} m"
        if condition > 1e-3:
            return (
                f"{self.title}: the posture of '{task.robot.name}' nearest to the start cannot be followed beyond its "
                f"place {place} (smallest over largest singular value of the Jacobian of frame '{task.frame}' "
                f"{condition:.2g}, so the pose itself is regular); choose a start posture nearer to the path"
            )
        return (
            f"{self.title}: the path of frame '{task.frame}' meets a singular posture of '{task.robot.name}' {place}: "
            f"the smallest singular value of the Jacobian is {condition:.2g} of the largest there, and the "
            "speeds grow without bound; move the path or choose another start posture"
        )

    def check_orientation(self, lengths: Array, postures: Array) -> None:
        """Raise UnreachableError where postures (n, nq) at lengths (n,) do not have the orientation wanted."""
        task = self.task
        if task.rotation is None:
            return
        away = angles_to(task.robot.frame_pose(task.frame, postures)[1], task.rotation)
        row = int(np.argmax(away))
        if away[row] > 10.0 * CLOSE_ENOUGH:
            raise UnreachableError(
                f"{self.title}: frame '{task.frame}' of '{task.robot.name}' cannot take the orientation wanted: at "
                f"{self.time_of(float(lengths[row])):.6g} s it is {away[row]:.4g} rad away from it; "
                "choose another orientation or leave it free"
            )


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
