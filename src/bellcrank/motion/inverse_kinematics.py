"""Inverse kinematics along a path: the branch that the start posture lies on, or an error that says why."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bellcrank.errors import UnreachableError
from bellcrank.motion.continuation import CLOSE_ENOUGH, Curve, Lost, Solver
from bellcrank.motion.coordinates import Array
from bellcrank.motion.frame_task import FrameTask, vector_text
from bellcrank.motion.rotations import angles_to

SINGULAR = 1e-6  # smallest over largest singular value of the frame's Jacobian: below, a path is refused
NEAR_SINGULAR = 1e-2  # below, it is followed with a warning


@dataclass(frozen=True)
class Followed:
    """Postures (n, nq) along a path and their first and second derivatives with respect to its length."""

    position: Array
    first: Array
    second: Array
    condition: Array  # smallest over largest singular value of the frame's Jacobian, (n,)


def follow(task: FrameTask, curve: Curve, lengths: Array, times: Array, title: str) -> Followed:
    """Postures that put the task's frame on the curve at `lengths` (n,), increasing, reached at `times` (n,)
    in s.

    Raises UnreachableError, naming time, pose and how much is missing, where the curve leaves the reach or is
    singular.
    """
    solver = Solver(task)
    distinct, back = np.unique(lengths, return_inverse=True)
    try:
        z = solver.to_start(curve(distinct[:1])[0][0])
        knots = solver.along(curve, float(distinct[0]), float(distinct[-1]), z)
        z, first, second = solver.everywhere(curve, distinct, knots)
    except Lost as lost:
        raise UnreachableError(_explain(solver, curve, lengths, times, title, lost)) from None
    condition = solver.condition(z)
    if np.min(condition) < SINGULAR:
        row = int(np.argmin(condition))
        raise UnreachableError(
            _singular(task, curve, lengths, times, title, float(distinct[row]), float(condition[row]))
        )
    _check_orientation(task, solver, curve, distinct, lengths, times, title, z)
    n = len(task.active)
    full = [np.zeros((len(distinct), len(task.start))) for _ in range(2)]
    for array, part in zip(full, (first, second), strict=True):
        array[:, list(task.active)] = part[:, :n]
    return Followed(task.posture(z)[back], full[0][back], full[1][back], condition[back])


def _time_of(length: float, lengths: Array, times: Array) -> float:
    return float(np.interp(length, lengths, times))


def _explain(solver: Solver, curve: Curve, lengths: Array, times: Array, title: str, lost: Lost) -> str:
    """One sentence on why a path cannot be followed past a length: out of reach by so much, or singular."""
    task = solver.task
    span = float(lengths[-1])
    ahead = np.unique(np.concatenate([[lost.where + 1e-3 * span], np.linspace(lost.where, span, 41)]).clip(0.0, span))
    points = curve(ahead)[0]
    q = lost.z[: solver.joints]
    missing = np.empty(len(ahead))
    for k, target in enumerate(task.target(points)):
        q, missing[k] = solver.nearest(q, target)
    worst = int(np.argmax(missing))
    here = curve(np.array([lost.where]))[0][0]
    when = _time_of(lost.where, lengths, times)
    if missing[worst] > CLOSE_ENOUGH:
        unit = "m" if task.rotation is None else "(m and rad together)"
        return (
            f"{title}: the path of frame '{task.frame}' leaves the reach of '{task.robot.name}' at "
            f"{when:.6g} s, at {vector_text(here)} m; at worst, at "
            f"{_time_of(float(ahead[worst]), lengths, times):.6g} s, {vector_text(points[worst])} m is "
            f"missed by {missing[worst]:.4g} {unit}"
            + ("" if task.rotation is None else "; move the path or leave the orientation free")
        )
    z = lost.z.copy()
    z[: solver.joints] = solver.nearest(z[: solver.joints], task.target(here[None])[0])[0]
    return _singular(task, curve, lengths, times, title, lost.where, float(solver.condition(z[None])[0]))


def _singular(
    task: FrameTask, curve: Curve, lengths: Array, times: Array, title: str, where: float, condition: float
) -> str:
    point = curve(np.array([where]))[0][0]
    place = f"at {_time_of(where, lengths, times):.6g} s, at {vector_text(point)} m"
    if condition > 1e-3:
        return (
            f"{title}: the posture of '{task.robot.name}' nearest to the start cannot be followed beyond its "
            f"place {place} (smallest over largest singular value of the Jacobian of frame '{task.frame}' "
            f"{condition:.2g}, so the pose itself is regular); choose a start posture nearer to the path"
        )
    return (
        f"{title}: the path of frame '{task.frame}' meets a singular posture of '{task.robot.name}' {place}: "
        f"the smallest singular value of the Jacobian is {condition:.2g} of the largest there, and the "
        "speeds grow without bound; move the path or choose another start posture"
    )


def _check_orientation(
    task: FrameTask,
    solver: Solver,
    curve: Curve,
    distinct: Array,
    lengths: Array,
    times: Array,
    title: str,
    z: Array,
) -> None:
    if task.rotation is None:
        return
    away = angles_to(task.robot.frame_pose(task.frame, task.posture(z))[1], task.rotation)
    row = int(np.argmax(away))
    if away[row] > 10.0 * CLOSE_ENOUGH:
        raise UnreachableError(
            f"{title}: frame '{task.frame}' of '{task.robot.name}' cannot take the orientation wanted: at "
            f"{_time_of(float(distinct[row]), lengths, times):.6g} s it is {away[row]:.4g} rad away from it; "
            "choose another orientation or leave it free"
        )
