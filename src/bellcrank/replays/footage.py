"""What a film is cut from: the poses of bodies and the traces of points along a course, in as few frames as will do."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bellcrank.replays.course import Course, densified
from bellcrank.replays.extents import body_corners, cloud, reaches
from bellcrank.replays.film import Body, Trace
from bellcrank.replays.thinning import Rows, frame_rows

Array = NDArray[np.float64]
Point = Callable[[Array, Array], Array]  # points (n, frames, 3) and turns (n, frames, 4) -> a point (n, 3)
SHARE = 1.0 / 2000.0  # of the size of what is shown: half a pixel where it fills a screen of 1,000 lines
BETWEEN = 0.25  # of the bound: what lies between two rows
TRACE = 0.25  # of the bound: traces stand still, and are looked at closely
LEAST_FRAMES = 240  # where there are so many rows: arrows change between frames that hardly move
BLOCK = 400_000  # poses in memory at a time
SAMPLED = 100  # rows from which the size is taken


@dataclass(frozen=True, eq=False)
class Footage:
    """Frames of a film: times (n,) s, positions (n, nq) and velocities (n, nv) of the robot, points (n, frames, 3) m
    and quaternions (n, frames, 4) of the course's frames, of which `bodies` are the numbers of the bodies'.
    """

    course: Course
    time: Array
    position: Array
    velocity: Array
    points: Array
    turns: Array
    bodies: tuple[int, ...]
    corners: tuple[Array, ...]
    traces: tuple[Trace, ...]
    bound: float

    @property
    def poses(self) -> Array:
        """Poses (n, bodies, 7)."""
        return np.concatenate([self.points[:, self.bodies], self.turns[:, self.bodies]], axis=2)

    def placed(self, name: str) -> tuple[Array, Array]:
        """Points (n, 3) m and quaternions (n, 4) of a frame."""
        k = self.course.index[name]
        return self.points[:, k], self.turns[:, k]

    @property
    def cloud(self) -> Array:
        """Points (m, 3) m between which all bodies are at a good hundred of the frames, and those of traces."""
        some = np.unique(np.linspace(0, len(self.time) - 1, SAMPLED + 1).astype(int))
        traced = [trace.points for trace in self.traces]
        points = np.concatenate([cloud(self.poses[some], self.corners).reshape(-1, 3), *traced])
        return np.asarray(points[np.isfinite(points).all(axis=1)])


def footage(
    course: Course,
    bodies: Sequence[Body],
    traced: Mapping[str, Point],
    keep: Iterable[float] = (),
    progress: Callable[[float], None] | None = None,
) -> Footage:
    """The frames and traces that show a course, times of `keep` among them; `progress` hears the share that is done.

    At every row no point of a body is further than Footage.bound from where the film has it.
    """
    corners = body_corners(bodies)
    reach, numbers = reaches(corners), tuple(course.index[body.name] for body in bodies)
    size = _size(course, numbers, corners) or 1.0
    bound = SHARE * size
    course = densified(course, numbers, reach, size, BETWEEN * bound)
    n = len(course.time)
    wanted = np.concatenate([np.linspace(course.time[0], course.time[-1], LEAST_FRAMES + 1), list(keep)])
    kept = np.unique(np.clip(np.searchsorted(course.time, wanted), 0, n - 1))
    block = max(64, BLOCK // max(1, len(course.frames)))
    rows: list[Rows] = []
    frames: list[tuple[Array, Array]] = []
    points_of: dict[str, list[Array]] = {name: [] for name in traced}
    before = None
    for a in range(0, max(n - 1, 1), block):
        b = min(a + block, n - 1)
        time = course.time[a : b + 1]
        points, turns = course.places(course.position[a : b + 1])
        if before is not None:
            turns *= np.where(np.einsum("kc,kc->k", turns[0], before) < 0.0, -1.0, 1.0)[:, None]
        before = turns[-1]
        mine = kept[(kept >= a) & (kept <= b)] - a
        found = frame_rows(time, points[:, numbers], turns[:, numbers], reach, (1.0 - BETWEEN) * bound, mine)[
            a > 0 :
        ]  # the row that two blocks share is the first one's
        rows.append(found + a)
        frames.append((points[found], turns[found]))
        for name, point in traced.items():
            way = point(points, turns)
            some = frame_rows(time, way[:, None], np.zeros((len(way), 1, 4)), np.zeros(1), TRACE * bound)[a > 0 :]
            points_of[name].append(np.column_stack([time[some], way[some]]))
        if progress is not None:
            progress((b + 1) / n)
    at = np.concatenate(rows)
    traces = _unlike([(name, np.concatenate(parts)) for name, parts in points_of.items()], bound)
    points, turns = (np.concatenate(parts) for parts in zip(*frames, strict=True))
    return Footage(
        course, course.time[at], course.position[at], course.velocity[at], points, turns, numbers, tuple(corners),
        traces, bound,
    )  # fmt: skip


def _size(course: Course, numbers: Sequence[int], corners: Sequence[Array]) -> float:
    """The largest diagonal (m) of a box around all bodies, at one time."""
    some = np.unique(np.linspace(0, len(course.time) - 1, SAMPLED).astype(int))
    points, turns = course.places(course.position[some])
    poses = np.concatenate([points[:, numbers], turns[:, numbers]], axis=2)
    boxes = np.ptp(cloud(poses, corners), axis=1) if len(numbers) else np.zeros((1, 3))
    return float(np.linalg.norm(boxes, axis=1).max())


def _unlike(traces: Sequence[tuple[str, Array]], bound: float) -> tuple[Trace, ...]:
    """The traces (m, 4) of time and point, but for those that one before draws already, as frames of one point do."""
    found: list[tuple[str, Array]] = []
    for name, rows in traces:
        for _, other in found:
            there = np.stack([np.interp(rows[:, 0], other[:, 0], other[:, c]) for c in (1, 2, 3)], axis=1)
            if np.abs(there - rows[:, 1:]).max() <= bound:
                break
        else:
            found.append((name, rows))
    return tuple(Trace(name, rows[:, 0], rows[:, 1:]) for name, rows in found)
