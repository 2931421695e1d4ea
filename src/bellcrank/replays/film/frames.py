"""What a film is cut from: the poses of bodies and the traces of points along a course, in as few frames as will do."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bellcrank.motion.resampling import NOTHING, OUTSTANDING, extreme_rows
from bellcrank.motion.resampling import SHARE as VALUE_SHARE
from bellcrank.replays.film.decimation import Rows, frame_rows, series_rows
from bellcrank.replays.film.film import Arrow, Body, Trace
from bellcrank.replays.film.sampled_trajectory import Course, densified
from bellcrank.replays.geometry.extents import body_corners, cloud, reaches

Array = NDArray[np.float64]
Point = Callable[[Array, Array], Array]  # points (n, frames, 3) and turns (n, frames, 4) -> a point (n, 3)
SHARE = 1.0 / 2000.0  # of the size of what is shown: half a pixel where it fills a screen of 1,000 lines
BETWEEN = 0.25  # of the bound: what lies between two rows
TRACE = 0.25  # of the bound: traces stand still, and are looked at closely
LEAST_FRAMES = 240  # where there are so many rows
BLOCK = 400_000  # poses in memory at a time
Placed = Callable[[str], tuple[Array, Array]]  # a frame's points (n, 3) m and quaternions (n, 4) in the world
Forces = Callable[[Array, Array, Array, Placed], Iterable[Arrow]]  # times, positions and velocities -> arrows there
MOST_ARROWS = 20_000  # times of arrows, all together
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
    arrows: tuple[Arrow, ...]
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
    forces: Forces | None = None,
) -> Footage:
    """The frames, traces and arrows that show a course, times of `keep` among those of the frames; `progress` hears the
    share that is done.

    At every row no point of a body is further than Footage.bound from where the film has it, and arrows, at times of
    their own, are off by SHARE of the longest at most.
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
    arrows: dict[str, list[Arrow]] = {}
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
        here = [] if forces is None else list(_forces_in(course, a, b, points, turns, forces))
        for arrow in here:
            part = _thinned(arrow, TRACE * bound, max(LEAST_FRAMES, MOST_ARROWS // len(here)))
            arrows.setdefault(arrow.name, []).append(part)
        if progress is not None:
            progress((b + 1) / n)
    at = np.concatenate(rows)
    traces = _unlike([(name, np.concatenate(parts)) for name, parts in points_of.items()], bound)
    points, turns = (np.concatenate(parts) for parts in zip(*frames, strict=True))
    return Footage(
        course, course.time[at], course.position[at], course.velocity[at], points, turns, numbers, tuple(corners),
        traces, _seen([joined_arrows(parts) for parts in arrows.values()]), bound,
    )  # fmt: skip


def _forces_in(course: Course, a: int, b: int, points: Array, turns: Array, forces: Forces) -> Iterable[Arrow]:
    """Arrows at rows a to b of a course, whose frames are at points and quaternions (b − a + 1, frames, …) there."""

    def placed(name: str) -> tuple[Array, Array]:
        return points[:, course.index[name]], turns[:, course.index[name]]

    time = course.time[a : b + 1]
    for arrow in forces(time, course.position[a : b + 1], course.velocity[a : b + 1], placed):
        yield replace(arrow, time=time)


def _thinned(arrow: Arrow, bound: float, most: int) -> Arrow:
    """An arrow at the times that it takes for its point to be within a bound (m), and its vector within VALUE_SHARE of
    the longest, or of OUTSTANDING times what is usual; within more where those are more than `most` times.
    """
    assert arrow.time is not None
    with np.errstate(all="ignore"):
        sizes = np.linalg.norm(arrow.vectors, axis=1)
    sizes = sizes[np.isfinite(sizes)]
    longest = float(sizes.max(initial=0.0))
    usual = OUTSTANDING * float(np.percentile(sizes, 95.0)) if len(sizes) else 0.0
    vector = VALUE_SHARE * (min(longest, usual) or longest)
    table, bounds = np.hstack([arrow.points, arrow.vectors]), np.repeat([bound, vector], 3) / np.sqrt(3.0)
    for coarser in (1.0, 4.0, 16.0, 64.0):
        rows = series_rows(arrow.time, table, coarser * bounds, most)
        if rows is not None:
            break
    else:  # it flies apart
        rows = extreme_rows(table, most)
    return replace(arrow, time=arrow.time[rows], points=arrow.points[rows], vectors=arrow.vectors[rows])


def _seen(arrows: Sequence[Arrow]) -> tuple[Arrow, ...]:
    """The arrows that are ever drawn; of one that is rounding beside others of its unit only the ends, as zero."""
    peaks = [float(np.abs(np.nan_to_num(arrow.vectors)).max(initial=0.0)) for arrow in arrows]
    found = []
    for arrow, peak in zip(arrows, peaks, strict=True):
        largest = max(p for other, p in zip(arrows, peaks, strict=True) if other.unit == arrow.unit)
        if peak > NOTHING * largest:
            found.append(arrow)
        elif peak > 0.0 and arrow.time is not None:
            ends = [0, -1]
            found.append(replace(arrow, time=arrow.time[ends], points=arrow.points[ends], vectors=np.zeros((2, 3))))
    return tuple(found)


def joined_arrows(parts: Sequence[Arrow], shifts: Sequence[float] | None = None) -> Arrow:
    """An arrow's parts one after the other, each so many s later."""
    times = [part.time for part in parts if part.time is not None]
    return replace(
        parts[0],
        time=np.concatenate([time + shift for time, shift in zip(times, shifts or [0.0] * len(parts), strict=True)]),
        points=np.concatenate([part.points for part in parts]),
        vectors=np.concatenate([part.vectors for part in parts]),
    )


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
