"""Frames of a film: poses, traces and arrows along a trajectory, at as few times as the error bound allows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bellcrank.arrays import Array
from bellcrank.motion.sampled.resampling import NOTHING, OUTSTANDING, extreme_rows
from bellcrank.motion.sampled.resampling import SHARE as VALUE_TOLERANCE
from bellcrank.replays.film.decimation import Rows, frame_rows, series_rows
from bellcrank.replays.film.film import Arrow, Trace
from bellcrank.replays.film.sampled_trajectory import SampledTrajectory, refine
from bellcrank.replays.geometry.shapes import DrawnBody, body_radii, bounding_boxes, outlines, world_corners

PointFunction = Callable[[Array, Array], Array]  # points (n, frames, 3), quaternions (n, frames, 4) -> points (n, 3)
FramePose = Callable[[str], tuple[Array, Array]]  # name of a frame -> points (n, 3) m, quaternions (n, 4), in the world
ArrowFunction = Callable[[Array, Array, Array, FramePose], Iterable[Arrow]]  # times, positions, velocities, frames
TOLERANCE = 1.0 / 2000.0  # of the size of what is shown: half a pixel on a screen of 1,000 lines
REFINEMENT = 0.25  # share of the bound for the error between two rows of the trajectory
TRACE = 0.25  # share of the bound for traces, which do not move and are examined closely
LEAST_FRAMES = 240  # if there are that many rows
BLOCK = 400_000  # poses in memory at a time
MOST_ARROWS = 20_000  # times of all arrows in total
SIZE_SAMPLES = 100  # rows from which the size is computed


@dataclass(frozen=True, eq=False, kw_only=True)
class SampledFrames:
    """Frames of a film at times (n,) s, with the robot's positions (n, nq) and velocities (n, nv).

    `points` (n, frames, 3) m and `quaternions` (n, frames, 4) are those of all frames of the trajectory; `bodies` are
    the numbers of the frames that carry bodies, and `outlines` points of their surfaces.
    """

    trajectory: SampledTrajectory
    time: Array
    position: Array
    velocity: Array
    points: Array
    quaternions: Array
    bodies: tuple[int, ...]
    outlines: tuple[Array, ...]
    traces: tuple[Trace, ...]
    arrows: tuple[Arrow, ...]
    error_bound: float

    @property
    def poses(self) -> Array:
        """Poses (n, bodies, 7) of the bodies."""
        return np.concatenate([self.points[:, self.bodies], self.quaternions[:, self.bodies]], axis=2)

    def frame_pose(self, name: str) -> tuple[Array, Array]:
        """Points (n, 3) m and quaternions (n, 4) of a frame in the world frame."""
        k = self.trajectory.frame_index[name]
        return self.points[:, k], self.quaternions[:, k]

    @property
    def visible_points(self) -> Array:
        """Points (m, 3) m: the outlines of all bodies at about a hundred of the frames, and the traces."""
        some = np.unique(np.linspace(0, len(self.time) - 1, SIZE_SAMPLES + 1).astype(int))
        traced = [trace.points for trace in self.traces]
        points = np.concatenate([world_corners(self.poses[some], self.outlines).reshape(-1, 3), *traced])
        return np.asarray(points[np.isfinite(points).all(axis=1)])


def sample_frames(
    trajectory: SampledTrajectory,
    bodies: Sequence[DrawnBody],
    traced: Mapping[str, PointFunction],
    keep: Iterable[float] = (),
    progress: Callable[[float], None] | None = None,
    arrows: ArrowFunction | None = None,
) -> SampledFrames:
    """The frames, traces and arrows that show a trajectory within an error bound.

    At every row no point of a body is further than the bound from where the film shows it. Arrows have their own times;
    their error is at most VALUE_TOLERANCE of the longest.

    Args:
        trajectory: Rows of the robot's motion, whose frames include the bodies'.
        bodies: Bodies to show, named after frames.
        traced: Points whose paths are drawn, by name.
        keep: Times that must be among those of the frames, s.
        progress: Called with the completed share.
        arrows: Computes the arrows at rows of the trajectory.
    """
    corners = bounding_boxes(bodies)
    radii, numbers = body_radii(corners), tuple(trajectory.frame_index[body.name] for body in bodies)
    size = _size(trajectory, numbers, corners) or 1.0
    bound = TOLERANCE * size
    trajectory = refine(trajectory, numbers, radii, size, REFINEMENT * bound)
    n = len(trajectory.time)
    wanted = np.concatenate([np.linspace(trajectory.time[0], trajectory.time[-1], LEAST_FRAMES + 1), list(keep)])
    kept = np.unique(np.clip(np.searchsorted(trajectory.time, wanted), 0, n - 1))
    block = max(64, BLOCK // max(1, len(trajectory.frames)))
    rows: list[Rows] = []
    frames: list[tuple[Array, Array]] = []
    trace_rows: dict[str, list[Array]] = {name: [] for name in traced}
    arrow_parts: dict[str, list[Arrow]] = {}
    last = None
    for a in range(0, max(n - 1, 1), block):
        b = min(a + block, n - 1)
        time = trajectory.time[a : b + 1]
        points, quaternions = trajectory.frame_poses(trajectory.position[a : b + 1])
        if last is not None:
            quaternions *= np.where(np.einsum("kc,kc->k", quaternions[0], last) < 0.0, -1.0, 1.0)[:, None]
        last = quaternions[-1]
        # the row that two blocks share belongs to the first one
        found = frame_rows(
            time, points[:, numbers], quaternions[:, numbers], radii, (1.0 - REFINEMENT) * bound,
            kept[(kept >= a) & (kept <= b)] - a,
        )[a > 0 :]  # fmt: skip
        rows.append(found + a)
        frames.append((points[found], quaternions[found]))
        for name, point in traced.items():
            path = point(points, quaternions)
            some = frame_rows(time, path[:, None], np.zeros((len(path), 1, 4)), np.zeros(1), TRACE * bound)[a > 0 :]
            trace_rows[name].append(np.column_stack([time[some], path[some]]))
        here = [] if arrows is None else list(_arrows_between(trajectory, a, b, points, quaternions, arrows))
        for arrow in here:
            part = _decimate_arrow(arrow, TRACE * bound, max(LEAST_FRAMES, MOST_ARROWS // len(here)))
            arrow_parts.setdefault(arrow.name, []).append(part)
        if progress is not None:
            progress((b + 1) / n)
    at = np.concatenate(rows)
    points, quaternions = (np.concatenate(parts) for parts in zip(*frames, strict=True))
    return SampledFrames(
        trajectory=trajectory,
        time=trajectory.time[at],
        position=trajectory.position[at],
        velocity=trajectory.velocity[at],
        points=points,
        quaternions=quaternions,
        bodies=numbers,
        outlines=tuple(outlines(bodies)),
        traces=_distinct_traces([(name, np.concatenate(parts)) for name, parts in trace_rows.items()], bound),
        arrows=_visible_arrows([join_arrows(parts) for parts in arrow_parts.values()]),
        error_bound=bound,
    )


def _arrows_between(
    trajectory: SampledTrajectory, a: int, b: int, points: Array, quaternions: Array, arrows: ArrowFunction
) -> Iterable[Arrow]:
    """Arrows at rows a to b of a trajectory; points and quaternions (b − a + 1, frames, …) are those of its frames."""

    def frame_pose(name: str) -> tuple[Array, Array]:
        return points[:, trajectory.frame_index[name]], quaternions[:, trajectory.frame_index[name]]

    time = trajectory.time[a : b + 1]
    for arrow in arrows(time, trajectory.position[a : b + 1], trajectory.velocity[a : b + 1], frame_pose):
        yield replace(arrow, time=time)


def _decimate_arrow(arrow: Arrow, bound: float, most: int) -> Arrow:
    """An arrow at the times that keep its point within a bound (m) and its vector within VALUE_TOLERANCE.

    The tolerance is relative to the longest vector, or to OUTSTANDING times the usual length if that is less. Larger
    bounds are used if more than `most` times are needed.
    """
    assert arrow.time is not None
    with np.errstate(all="ignore"):
        sizes = np.linalg.norm(arrow.vectors, axis=1)
    sizes = sizes[np.isfinite(sizes)]
    longest = float(sizes.max(initial=0.0))
    usual = OUTSTANDING * float(np.percentile(sizes, 95.0)) if len(sizes) else 0.0
    vector = VALUE_TOLERANCE * (min(longest, usual) or longest)
    table, bounds = np.hstack([arrow.points, arrow.vectors]), np.repeat([bound, vector], 3) / np.sqrt(3.0)
    for factor in (1.0, 4.0, 16.0, 64.0):
        rows = series_rows(arrow.time, table, factor * bounds, most)
        if rows is not None:
            break
    else:  # the run diverges
        rows = extreme_rows(table, most)
    return replace(arrow, time=arrow.time[rows], points=arrow.points[rows], vectors=arrow.vectors[rows])


def _visible_arrows(arrows: Sequence[Arrow]) -> tuple[Arrow, ...]:
    """The arrows that are not always zero; one that is only rounding beside others of its unit becomes zero."""
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


def join_arrows(parts: Sequence[Arrow], shifts: Sequence[float] | None = None) -> Arrow:
    """The parts of an arrow one after the other, each shifted by a time (s)."""
    times = [part.time for part in parts if part.time is not None]
    return replace(
        parts[0],
        time=np.concatenate([time + shift for time, shift in zip(times, shifts or [0.0] * len(parts), strict=True)]),
        points=np.concatenate([part.points for part in parts]),
        vectors=np.concatenate([part.vectors for part in parts]),
    )


def _size(trajectory: SampledTrajectory, numbers: Sequence[int], corners: Sequence[Array]) -> float:
    """The largest diagonal (m) of the box around all bodies at any time."""
    some = np.unique(np.linspace(0, len(trajectory.time) - 1, SIZE_SAMPLES).astype(int))
    points, quaternions = trajectory.frame_poses(trajectory.position[some])
    poses = np.concatenate([points[:, numbers], quaternions[:, numbers]], axis=2)
    boxes = np.ptp(world_corners(poses, corners), axis=1) if len(numbers) else np.zeros((1, 3))
    return float(np.linalg.norm(boxes, axis=1).max())


def _distinct_traces(traces: Sequence[tuple[str, Array]], bound: float) -> tuple[Trace, ...]:
    """Traces of rows (m, 4), time and point, without those that coincide with an earlier one within a bound (m)."""
    found: list[tuple[str, Array]] = []
    for name, rows in traces:
        for _, other in found:
            there = np.stack([np.interp(rows[:, 0], other[:, 0], other[:, c]) for c in (1, 2, 3)], axis=1)
            if np.abs(there - rows[:, 1:]).max() <= bound:
                break
        else:
            found.append((name, rows))
    return tuple(Trace(name, rows[:, 0], rows[:, 1:]) for name, rows in found)
