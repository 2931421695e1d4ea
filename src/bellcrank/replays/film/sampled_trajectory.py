"""The way of a robot through its postures, as rows and what lies between them, and the frames' places along it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.derived import cached_property
from bellcrank.motion.coordinates import continuous, rates
from bellcrank.replays.film.decimation import MOST_HALF_TURN, interpolation_error
from bellcrank.replays.geometry.rotations import continued, quaternions

if TYPE_CHECKING:
    from bellcrank.codegen.compile import Compiled
    from bellcrank.elements.parameters import Parameter
    from bellcrank.robot.robot import Robot

Array = NDArray[np.float64]
FINEST = 12  # halvings of a row's step, at most
MOST_PARTS = 1000  # parts of a row's step, where joints turn many times in it
MOST_ADDED = 100_000  # rows, about: a run that flies apart would need any number of them
_PLACE = 12  # numbers a frame: position 3, rotation 9


@dataclass(frozen=True, eq=False)
class Course:
    """Rows of increasing times (n,) s, positions (n, nq) and velocities (n, nv) of a robot.

    `between` gives both at times (m,) s within them. `frames` are those that can be placed, `parameters` (np,) the
    numbers that `placing` takes.
    """

    robot: Robot
    time: Array
    position: Array
    velocity: Array
    between: Callable[[Array], tuple[Array, Array]]
    frames: tuple[str, ...]
    placing: Compiled
    parameters: Array

    def places(self, position: Array) -> tuple[Array, Array]:
        """Points (m, frames, 3) m and quaternions (m, frames, 4) x y z w of the frames in the world at positions (m,
        nq); quaternions continue from row to row.
        """
        rows = np.asarray(self.placing(position, self.parameters)).reshape(len(position), len(self.frames), _PLACE)
        return rows[..., :3].copy(), continued(quaternions(rows[..., 3:].reshape(*rows.shape[:2], 3, 3)))

    @cached_property
    def index(self) -> dict[str, int]:
        """The number of each frame."""
        return {name: k for k, name in enumerate(self.frames)}

    def with_rows(self, times: Array) -> Course:
        """The course with rows more, at times between its own."""
        times = np.setdiff1d(times, self.time)
        if not len(times):
            return self
        at = np.searchsorted(self.time, times)
        q, v = self.between(times)
        return Course(
            self.robot, np.insert(self.time, at, times), np.insert(self.position, at, q, axis=0),
            np.insert(self.velocity, at, v, axis=0), self.between, self.frames, self.placing, self.parameters,
        )  # fmt: skip


def placing(robot: Robot, frames: Sequence[str], parameters: Mapping[str, Parameter] | None = None) -> Compiled:
    """(q, p) -> each frame's position 3 (m) and rotation 9 (row major) in the world, frame after frame."""
    parameters = dict(parameters or {})

    def build() -> Any:
        import casadi

        from bellcrank.elements.symbols import Symbols

        s = Symbols(robot, parameters, frames)
        rows = [casadi.vertcat(s.frame(name).position, casadi.vec(s.frame(name).rotation.T)) for name in frames]
        return casadi.Function("places", [s.q, s.p], [casadi.densify(casadi.vertcat(casadi.SX(0, 1), *rows))])

    settings = [(name, parameter.places) for name, parameter in parameters.items()]
    return robot.compiled(f"places {list(frames)!r} {settings!r}", build)


def densified(course: Course, bodies: Sequence[int], reach: Array, size: float, bound: float) -> Course:
    """The course with rows enough that between two of them bodies (numbers of frames, with their `reach` (k,) m) stay
    within `bound` (m) of going straight and turning evenly, and turn by less than a radian and a half.

    `size` (m) is how far a turning joint reaches: rows that are so close that nothing there can be off by the bound,
    as those of most runs, are not looked at.
    """
    if len(course.time) < 2:
        return course
    bend, turn = _may_bend(course, size)
    parts = np.minimum(np.ceil(turn / MOST_HALF_TURN), MOST_PARTS).astype(np.intp)
    suspect = np.flatnonzero((bend > bound) | (parts > 1))
    parts = np.maximum(parts[suspect], 1)
    parts = np.maximum((parts * min(1.0, MOST_ADDED / max(parts.sum(), 1))).astype(np.intp), 1)
    rank = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    begin = np.repeat(course.time[suspect], parts)
    step = np.repeat(np.diff(course.time)[suspect] / parts, parts)
    begin, end = begin + rank * step, begin + (rank + 1) * step
    more: list[Array] = [begin[rank > 0]]
    for _ in range(FINEST):
        if not len(begin) or sum(map(len, more)) + 2 * len(begin) > MOST_ADDED:
            break
        times = begin[:, None] + (end - begin)[:, None] * np.linspace(0.0, 1.0, 5)
        points, turns = course.places(course.between(times.ravel())[0])
        rows = np.arange(len(begin))[:, None] * 5 + np.arange(1, 4)
        first = np.repeat(rows[:, 0] - 1, 3)
        here, there = points[:, bodies], turns[:, bodies]
        error = interpolation_error(times.ravel(), here, there, reach, rows.ravel(), first, first + 4)
        bad = error.reshape(-1, 3).max(axis=1) > bound
        middle = times[bad, 2]
        more.append(middle)
        begin, end = np.concatenate([begin[bad], middle]), np.concatenate([middle, end[bad]])
    return course.with_rows(np.concatenate(more))


def _may_bend(course: Course, size: float) -> tuple[Array, Array]:
    """How far (n − 1,) m, about, any point may be off a straight way between rows: by the joints' own bends, and by
    what turning at an even rate makes of a straight joint motion; and how far a joint turns at most (n − 1,) rad.
    """
    joints, h = course.robot.joints, np.diff(course.time)
    q = course.position * continuous(joints, course.position)
    slope = rates(joints, q, course.velocity, np.zeros_like(course.velocity))[0]
    step, away = np.diff(q, axis=0), np.zeros(len(h))
    turns = [np.zeros(len(h))]
    for joint in joints:
        for c in range(joint.q, joint.q + joint.nq):
            straight = joint.kind == "prismatic" or (
                joint.nq > 1 and c - joint.q < joint.nq - (4 if joint.nq > 4 else 2)
            )
            bend = np.abs(h * slope[:-1, c] - step[:, c]) + np.abs(h * slope[1:, c] - step[:, c])
            away += (4.0 / 27.0) * (1.0 if straight else 2.0 * size) * bend
            if not straight:
                turns.append(np.maximum(np.abs(step[:, c]), h * np.abs(slope[:-1, c])))
    each = np.array(turns)
    # the joints of a short chain may all turn one way; those of a long one do not
    turn = np.minimum(each.sum(axis=0), 2.5 * np.linalg.norm(each, axis=0))
    return away + size * turn**2 / 8.0, each.max(axis=0)
