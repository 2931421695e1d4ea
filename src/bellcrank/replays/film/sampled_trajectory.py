"""A robot's trajectory as rows with an interpolant between them, and the poses of frames along it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.motion.coordinates import continuous, rates
from bellcrank.motion.kinematics.rotations import from_matrices, make_continuous
from bellcrank.replays.film.decimation import MOST_HALF_TURN, interpolation_error
from bellcrank.robot.model.joints import LENGTHS

if TYPE_CHECKING:
    from bellcrank.codegen.compile import Compiled
    from bellcrank.elements.parameters import Parameter
    from bellcrank.robot.robot import Robot

MOST_HALVINGS = 12  # of the step between two rows
MOST_PARTS = 1000  # of the step between two rows, if joints turn many times in it
MOST_ADDED = 100_000  # rows, approximately: a run that diverges would need any number of them
_POSE_NUMBERS = 12  # for each frame: position 3, rotation 9


@dataclass(frozen=True, eq=False, kw_only=True)
class SampledTrajectory:
    """Rows of increasing times (n,) s, positions (n, nq) and velocities (n, nv) of a robot.

    `interpolate` gives positions and velocities at times (m,) s between the rows. `pose_function` evaluates the poses
    of `frames` for `parameters` (np,).
    """

    robot: Robot
    time: Array
    position: Array
    velocity: Array
    interpolate: Callable[[Array], tuple[Array, Array]]
    frames: tuple[str, ...]
    pose_function: Compiled
    parameters: Array

    def frame_poses(self, position: Array) -> tuple[Array, Array]:
        """Points (m, frames, 3) m and quaternions (m, frames, 4) x y z w of the frames in the world frame.

        `position` is (m, nq). The signs of quaternions are continuous from row to row.
        """
        rows = np.asarray(self.pose_function(position, self.parameters))
        rows = rows.reshape(len(position), len(self.frames), _POSE_NUMBERS)
        rotations = rows[..., 3:].reshape(*rows.shape[:2], 3, 3)
        return rows[..., :3].copy(), make_continuous(from_matrices(rotations))

    @cached_property
    def frame_index(self) -> dict[str, int]:
        """The number of each frame."""
        return {name: k for k, name in enumerate(self.frames)}

    def with_rows(self, times: Array) -> SampledTrajectory:
        """The trajectory with additional rows at times between its own."""
        times = np.setdiff1d(times, self.time)
        if not len(times):
            return self
        at = np.searchsorted(self.time, times)
        q, v = self.interpolate(times)
        return replace(
            self,
            time=np.insert(self.time, at, times),
            position=np.insert(self.position, at, q, axis=0),
            velocity=np.insert(self.velocity, at, v, axis=0),
        )


def frame_pose_function(
    robot: Robot, frames: Sequence[str], parameters: Mapping[str, Parameter] | None = None
) -> Compiled:
    """Compiled (q, p) -> position 3 (m) and rotation 9 (row major) of each frame in the world frame, in order."""
    parameters = dict(parameters or {})

    def build() -> Any:
        import casadi

        from bellcrank.elements.symbols import Symbols

        s = Symbols(robot, parameters, frames)
        rows = [casadi.vertcat(s.frame(name).position, casadi.vec(s.frame(name).rotation.T)) for name in frames]
        return casadi.Function("frame_poses", [s.q, s.p], [casadi.densify(casadi.vertcat(casadi.SX(0, 1), *rows))])

    settings = [(name, parameter.places) for name, parameter in parameters.items()]
    return robot.compiled(f"frame poses {list(frames)!r} {settings!r}", build)


def refine(
    trajectory: SampledTrajectory, bodies: Sequence[int], radii: Array, size: float, bound: float
) -> SampledTrajectory:
    """The trajectory with enough rows for linear interpolation of its poses.

    Between two rows, bodies (numbers of frames, with `radii` (k,) m) stay within `bound` (m) of a straight motion with
    a constant rotation rate, and turn by less than 1.5 rad. `size` (m) is the reach of a turning joint: rows so close
    that nothing can be off by the bound, like those of most runs, are not examined.
    """
    if len(trajectory.time) < 2:
        return trajectory
    deviation, turn = _largest_deviation(trajectory, size)
    parts = np.minimum(np.ceil(turn / MOST_HALF_TURN), MOST_PARTS).astype(np.intp)
    suspect = np.flatnonzero((deviation > bound) | (parts > 1))
    parts = np.maximum(parts[suspect], 1)
    parts = np.maximum((parts * min(1.0, MOST_ADDED / max(parts.sum(), 1))).astype(np.intp), 1)
    rank = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    begin = np.repeat(trajectory.time[suspect], parts)
    step = np.repeat(np.diff(trajectory.time)[suspect] / parts, parts)
    begin, end = begin + rank * step, begin + (rank + 1) * step
    added: list[Array] = [begin[rank > 0]]
    for _ in range(MOST_HALVINGS):
        if not len(begin) or sum(map(len, added)) + 2 * len(begin) > MOST_ADDED:
            break
        times = begin[:, None] + (end - begin)[:, None] * np.linspace(0.0, 1.0, 5)
        points, quaternions = trajectory.frame_poses(trajectory.interpolate(times.ravel())[0])
        rows = np.arange(len(begin))[:, None] * 5 + np.arange(1, 4)
        first = np.repeat(rows[:, 0] - 1, 3)
        error = interpolation_error(
            times.ravel(), points[:, bodies], quaternions[:, bodies], radii, rows.ravel(), first, first + 4
        )
        bad = error.reshape(-1, 3).max(axis=1) > bound
        middle = times[bad, 2]
        added.append(middle)
        begin, end = np.concatenate([begin[bad], middle]), np.concatenate([middle, end[bad]])
    return trajectory.with_rows(np.concatenate(added))


def _largest_deviation(trajectory: SampledTrajectory, size: float) -> tuple[Array, Array]:
    """Estimates (n − 1,) between rows: the deviation of any point from a straight motion (m), the largest turn (rad).

    The deviation counts the curvature of the joint motions, and what a rotation at a constant rate adds to straight
    joint motions.
    """
    joints, h = trajectory.robot.joints, np.diff(trajectory.time)
    q = trajectory.position * continuous(joints, trajectory.position)
    slope = rates(joints, q, trajectory.velocity, np.zeros_like(trajectory.velocity))[0]
    step, deviation = np.diff(q, axis=0), np.zeros(len(h))
    turns = [np.zeros(len(h))]
    for joint in joints:
        for c in range(joint.q, joint.q + joint.nq):
            linear = c - joint.q < LENGTHS.get(joint.kind, 0)
            bend = np.abs(h * slope[:-1, c] - step[:, c]) + np.abs(h * slope[1:, c] - step[:, c])
            deviation += (4.0 / 27.0) * (1.0 if linear else 2.0 * size) * bend
            if not linear:
                turns.append(np.maximum(np.abs(step[:, c]), h * np.abs(slope[:-1, c])))
    each = np.array(turns)
    # the joints of a short chain may all turn in one direction; those of a long one do not
    turn = np.minimum(each.sum(axis=0), 2.5 * np.linalg.norm(each, axis=0))
    return deviation + size * turn**2 / 8.0, each.max(axis=0)
