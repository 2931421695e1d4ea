"""The motion of joints along a path with its timing, and by how much it exceeds the limits between its rows.

A quintic over a time Δt turns an error δ of a position into an error of about 60 δ/Δt² of an acceleration. Cells that
were halved around a change of the acceleration take nanoseconds; as rows they would be noise. So cells that are shorter
than a least time become a jump of the acceleration, or are joined to the next one where the acceleration changes no
faster than beside them; and of the remaining cells as many are joined as one quintic reproduces.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from bellcrank.arrays import Array, Indices
from bellcrank.motion.motion import Motion
from bellcrank.planning.fastest_motion import LimitExcess
from bellcrank.planning.fastest_pass import PathTiming, fastest_on_grid
from bellcrank.planning.jerk.jerk_pass import JerkTiming, jerk_excess
from bellcrank.planning.joint_path import JointPath
from bellcrank.planning.limits.path_limits import PathLimits
from bellcrank.planning.speed_scaling import scaled_motion

SHORTEST = (1e-7, 3e-8, 1e-8, 3e-9, 3e-7, 1e-6)  # of the whole time: shorter cells become a jump; the usual one first
LEAST = 1e-4  # of the whole time: a row is closer to the next one only in shorter pieces, or where more are needed
ROUNDING = 60.0 * float(np.finfo(np.float64).eps)  # of the path's length over Δt²: rounding of an acceleration
LONGEST = 2e-3  # of the whole time: a row is not further from the next
STEADY = 3.0  # times the rate of change of the acceleration in the cells beside short ones: a faster change is a jump
SMOOTH = 1e-5  # of the largest acceleration: a larger change from one cell to the next is a jump
NOWHERE: Array = np.zeros(0)
REPRODUCED = 3e-7  # of the largest acceleration: by how much a quintic may differ
CHECKED_SHARES = (0.0, 0.13, 0.37, 0.5, 0.63, 0.87, 1.0)  # of the time between two rows
KEPT = 7e-7  # share of a limit: a motion that exceeds none by more is not slowed
AIMED = 3e-7  # share of a limit that a slowed motion may exceed
MOST_SLOWED = 2e-3  # of the speed
TOLERATED = 1e-3  # share of a limit: where more is exceeded, a motion on a grid is tried
LASTING = 1e-5  # of the whole time: not where it is exceeded for a shorter time
CELLS = 4000  # of that grid
EXCEEDED = 1e-6  # share of a limit: a motion that exceeds it by less keeps it
SIGN_KNOWN = 1e-9  # of a joint's largest speed: below, the sign of a speed is rounding


class PathRow(NamedTuple):
    """Time, path parameter, speed and acceleration."""

    time: float
    s: float
    speed: float
    acceleration: float


@dataclass(frozen=True, eq=False)
class _Cells:
    """Cells that are long enough: times, and the states at their two ends."""

    begin: Array  # (n, 4) rows of time, s, speed, acceleration
    end: Array


def motion_rows(timing: PathTiming, shortest: float = SHORTEST[0], turning: Array = NOWHERE) -> list[PathRow]:
    """Rows of a motion; where the acceleration jumps there are two of one time. Cells that take less than a share of
    the whole time become a jump: a larger share moves the limits, a smaller one leaves more rounding. A jump next to a
    place (n,) at which a joint turns is there: the loss of its gear changes with its direction.
    """
    cells = _long_cells(timing, shortest, turning)
    scale = float(np.max(np.abs(np.concatenate([cells.begin[:, 3], cells.end[:, 3]]))))
    jump = np.abs(cells.end[:-1, 3] - cells.begin[1:, 3]) > SMOOTH * scale
    jump |= cells.end[:-1, 0] != cells.begin[1:, 0]
    edges = [0, *(np.flatnonzero(jump) + 1).tolist(), len(cells.begin)]
    rows: list[PathRow] = []
    whole = float(cells.end[-1, 0])
    for first, last in pairwise(edges):
        nodes = np.concatenate([cells.begin[first:last], cells.end[last - 1 : last]])
        nodes = nodes[_spread(nodes, LEAST * whole, REPRODUCED * scale, ROUNDING * timing.s[-1])]
        if rows:
            nodes[0, 0] = rows[-1].time
        kept = nodes[_kept(nodes, LONGEST * whole, REPRODUCED * scale)]
        rows.append(PathRow(*kept[0].tolist()))
        for before, after in pairwise(kept):
            rows += [PathRow(*row.tolist()) for row in (*_divided(before, after, LONGEST * whole), after)]
    return rows


def _long_cells(timing: PathTiming, shortest: float, turning: Array) -> _Cells:
    length = np.diff(timing.s)
    duration = np.where(length > 0.0, timing.durations, 0.0)
    time = np.concatenate([[0.0], np.cumsum(duration)])
    long = np.flatnonzero(duration > shortest * time[-1])
    begin = np.column_stack([time[long], timing.s[long], timing.speed[long], timing.begin[long]])
    end = np.column_stack([time[long + 1], timing.s[long + 1], timing.speed[long + 1], timing.end[long]])
    begin[0] = _moved(begin[0], timing.s[0], rest=True)
    end[-1] = _moved(end[-1], timing.s[-1], rest=True)
    for k in np.flatnonzero(long[1:] != long[:-1] + 1).tolist():  # short cells between two long ones
        if _steady(timing, duration, long[k], long[k + 1]):
            end[k] = begin[k + 1]
            continue
        between = slice(long[k] + 1, long[k + 1] + 1)
        if len(at := np.flatnonzero(np.isclose(timing.s[between, None], turning, rtol=ROUNDING, atol=0.0).any(axis=1))):
            node = long[k] + 1 + int(at[0])
            end[k, :3] = begin[k + 1, :3] = time[node], timing.s[node], timing.speed[node]
            continue
        inside = (begin[k, 1] + end[k, 1]) / 2.0, (begin[k + 1, 1] + end[k + 1, 1]) / 2.0
        place = _meeting(end[k], begin[k + 1], inside)
        end[k], begin[k + 1] = _moved(end[k], place), _moved(begin[k + 1], place)
    shift = np.concatenate([[0.0], np.cumsum(begin[1:, 0] - end[:-1, 0])]) + begin[0, 0]
    begin[:, 0] -= shift
    end[:, 0] -= shift
    return _Cells(begin, end)


def _steady(timing: PathTiming, duration: Array, before: int, after: int) -> bool:
    """Whether the acceleration changes between two cells that are not neighbours about as fast as in them."""
    between = slice(before + 1, after)
    rates = [abs(timing.end[k] - timing.begin[k]) / duration[k] for k in (before, after)]
    change = np.sum(np.abs(timing.end[between] - timing.begin[between]))
    change += np.sum(np.abs(timing.begin[before + 1 : after + 1] - timing.end[before:after]))
    return bool(change <= STEADY * max(rates) * np.sum(duration[between]))


def _meeting(before: Array, after: Array, inside: tuple[float, float]) -> float:
    """The place at which two arcs of constant acceleration, from states on either side, have the same speed; the place
    of the state before where that is not close by, or not between two places in the cells that the states bound.
    """
    (_, s0, y0, u0), (_, s1, y1, u1) = before, after
    if u0 == u1:
        return float(s0)
    place = (y0 * y0 - y1 * y1 - 2.0 * u0 * s0 + 2.0 * u1 * s1) / (2.0 * (u1 - u0))
    close = abs(place - (s0 + s1) / 2.0) <= s1 - s0 and inside[0] <= place <= inside[1]
    return float(place if close else s0)


def _moved(row: Array, s: float, rest: bool = False) -> Array:
    """A state moved to another place close by, with its acceleration; with `rest` to one without speed."""
    time, place, speed, acceleration = row
    if s == place:
        return row
    there = 0.0 if rest else float(np.sqrt(max(0.0, speed * speed + 2.0 * acceleration * (s - place))))
    return np.array([time + 2.0 * (s - place) / (speed + there), s, there, acceleration])


def _spread(nodes: Array, least: float, tolerance: float, rounding: float) -> list[int]:
    """Numbers of those of the nodes (n, 4) that are at least a least time apart; first the ends, then the nodes of the
    shortest cells, which lie where the acceleration has a corner. Where quintics between them are off by more than
    rounding over a shorter time would be, nodes between them are taken too.
    """
    time, last = nodes[:, 0], len(nodes) - 1
    cell = np.minimum(np.diff(time)[:-1], np.diff(time)[1:])
    kept = [0, last]
    for k in (np.argsort(cell, kind="stable") + 1).tolist():
        place = bisect_left(kept, k)
        if time[k] - time[kept[place - 1]] >= least and time[kept[place]] - time[k] >= least:
            kept.insert(place, k)
    open_intervals = list(pairwise(kept))
    while open_intervals:
        first, second = open_intervals.pop()
        if second <= first + 1 or (off := _difference(nodes, first, second)) <= tolerance:
            continue
        middle = first + 1 + int(np.argmin(np.abs(2.0 * time[first + 1 : second] - time[first] - time[second])))
        shortest = min(time[middle] - time[first], time[second] - time[middle])
        if rounding < off * shortest * shortest:
            insort(kept, middle)
            open_intervals += [(first, middle), (middle, second)]
    return kept


def _kept(nodes: Array, longest: float, tolerance: float) -> list[int]:
    """Numbers of the nodes (n, 4) between which quintics reproduce the accelerations at the others."""
    kept = [0]
    last = len(nodes) - 1
    while kept[-1] < last:
        here, step = kept[-1], 1
        while here + step < last and _reproduces(nodes, here, min(here + 2 * step, last), longest, tolerance):
            step = min(2 * step, last - here)
        low, high = step, min(2 * step, last - here)
        while low < high:  # the furthest node that the quintic reaches
            middle = (low + high + 1) // 2
            if _reproduces(nodes, here, here + middle, longest, tolerance):
                low = middle
            else:
                high = middle - 1
        kept.append(here + low)
    return kept


def _reproduces(nodes: Array, first: int, last: int, longest: float, tolerance: float) -> bool:
    if last == first + 1:
        return True
    return bool(nodes[last, 0] - nodes[first, 0] <= longest and _difference(nodes, first, last) <= tolerance)


def _difference(nodes: Array, first: int, last: int) -> float:
    """The largest difference of accelerations between a quintic from one node to another and the nodes between them."""
    inner = nodes[first + 1 : last]
    share = (inner[:, 0] - nodes[first, 0]) / (nodes[last, 0] - nodes[first, 0])
    return float(np.max(np.abs(_quintic(nodes[first], nodes[last], share)[:, 3] - inner[:, 3])))


def _divided(begin: Array, end: Array, longest: float) -> Array:
    """States (n, 4) between two that are further apart than a longest time, so that the joints follow the path."""
    parts = int(np.ceil((end[0] - begin[0]) / longest))
    return _quintic(begin, end, np.arange(1, parts) / parts)


def _quintic(begin: Array, end: Array, share: Array) -> Array:
    """States (n, 4) at shares (n,) of the time between two, on the quintic that joins them."""
    (t0, s0, y0, u0), (t1, s1, y1, u1) = begin, end
    t = t1 - t0
    length, v0, v1, a0, a1 = s1 - s0, y0 * t, y1 * t, u0 * t * t, u1 * t * t
    c3 = 10.0 * length - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15.0 * length + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    c5 = 6.0 * length - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1
    place = s0 + v0 * share + a0 / 2.0 * share**2 + c3 * share**3 + c4 * share**4 + c5 * share**5
    speed = (v0 + a0 * share + 3.0 * c3 * share**2 + 4.0 * c4 * share**3 + 5.0 * c5 * share**4) / t
    acceleration = (a0 + 6.0 * c3 * share + 12.0 * c4 * share**2 + 20.0 * c5 * share**3) / (t * t)
    return np.column_stack([t0 + share * t, place, speed, acceleration])


@dataclass(frozen=True, eq=False)
class TimedMotion:
    """A motion along a path.

    Attributes:
        motion: The motion.
        factor: The factor, at most 1, by which it is faster than its timing, so that it keeps the limits between rows.
        excess: The largest share by which it exceeds a limit.
        before: By how much it would exceed a limit if it were not slower; None where it is not.
    """

    motion: Motion
    factor: float
    excess: float
    before: LimitExcess | None = None


def timed_motion(path: JointPath, timing: PathTiming | JerkTiming, bounds: PathLimits, refined: bool) -> TimedMotion:
    """The motion of the joints along one path, with the rows between which it exceeds the limits least. A refined one
    is slowed where it still exceeds them.
    """
    if isinstance(timing, JerkTiming):
        best = timing.motion("part")
        least = limit_excess(bounds, best)
    else:
        best, least = None, np.inf
        for shortest in SHORTEST if refined else SHORTEST[:1]:
            motion = _sampled(path, timing, shortest)
            if (excess := limit_excess(bounds, motion)) < least or best is None:
                best, least = motion, excess
            if least <= KEPT:
                break
    assert best is not None
    return _slowed(best, least, bounds) if refined and least > KEPT else TimedMotion(best, 1.0, least)


def take_grid(
    paths: Sequence[JointPath], timings: list[PathTiming | JerkTiming], parts: list[TimedMotion], bounds: PathLimits
) -> list[str]:
    """Replace the timings and motions along paths where a motion on a grid exceeds the limits much less, as where the
    allowed accelerations have holes; a warning for each.
    """
    warnings = []
    for k, (path, timing, part) in enumerate(zip(paths, timings, parts, strict=True)):
        if isinstance(timing, JerkTiming) or part.excess <= TOLERATED:
            continue
        if time_above(bounds, part.motion, TOLERATED) <= LASTING * part.motion.duration:
            continue
        coarse = fastest_on_grid(path, bounds, CELLS)
        on_grid = timed_motion(path, coarse, bounds, refined=False)
        if on_grid.excess < 0.5 * part.excess:
            timings[k], parts[k] = coarse, on_grid
            warnings.append(
                f"cells that adapt themselves lead to a motion of {timing.duration:.6g} s, which exceeds a limit by "
                f"{100.0 * part.excess:.2g} %; this one has {CELLS} equal cells"
            )
    return warnings


def _slowed(motion: Motion, excess: float, bounds: PathLimits) -> TimedMotion:
    """A motion, slower by so little that it keeps the limits; as it is where that is not enough."""
    factor, slope, before = 1.0, 3.0, excess  # a jerk falls with the third power of the factor, others by less
    while slope > 0.0 and (factor := factor - (excess - AIMED) / slope) > 1.0 - MOST_SLOWED:
        slower = scaled_motion(motion, factor)
        excess = limit_excess(bounds, slower)
        if excess <= KEPT:
            return TimedMotion(slower, factor, excess, worst_excess(bounds, motion))
        slope = (before - excess) / (1.0 - factor)
    return TimedMotion(motion, 1.0, before)


def _sampled(path: JointPath, timing: PathTiming, shortest: float) -> Motion:
    rows = np.array(motion_rows(timing, shortest, path.turning_points()))
    q, first, second = path.at(np.clip(rows[:, 1], 0.0, path.length))
    y, u = rows[:, 2:3], rows[:, 3:4]
    return Motion(path.joints, rows[:, 0], q, first * y, first * u + second * y * y, "part")


def limit_excess(bounds: PathLimits, motion: Motion) -> float:
    """The largest share by which a motion exceeds a limit, at its rows and between them."""
    wide = np.flatnonzero(np.diff(motion.time) > 0.0)
    worst = max(float(np.max(_excess_at(bounds, motion, wide, share))) for share in CHECKED_SHARES)
    return max(worst, jerk_excess(motion, bounds.largest_jerk)[0]) if bounds.jerk_groups else worst


def worst_excess(bounds: PathLimits, motion: Motion) -> LimitExcess:
    """The limit that a motion exceeds most, at its rows and between them, and for how long limits are exceeded."""
    wide = np.flatnonzero(np.diff(motion.time) > 0.0)
    table = np.stack([_excess_at(bounds, motion, wide, share) for share in CHECKED_SHARES])
    place, row = np.unravel_index(int(np.argmax(table)), table.shape)
    worst, share = float(table[place, row]), CHECKED_SHARES[int(place)]
    lasting = time_above(bounds, motion, EXCEEDED) if worst > EXCEEDED else 0.0
    if bounds.jerk_groups and (jerk := jerk_excess(motion, bounds.largest_jerk))[0] > worst:
        return LimitExcess(f"jerk of {jerk[1]}", jerk[0], jerk[2], lasting)
    time, *states = _states(motion, wide[[row]], share)
    by_limit = {name: float(one[0]) for name, one in bounds.excess_by_limit(*states).items()}
    return LimitExcess(max(by_limit, key=lambda name: by_limit[name]), worst, float(time[0]), lasting)


def time_above(bounds: PathLimits, motion: Motion, excess: float) -> float:
    """The time, s, in which a motion exceeds a limit other than of jerk by more than a share, between its rows."""
    step = np.diff(motion.time)
    wide = np.flatnonzero(step > 0.0)
    inner = CHECKED_SHARES[1:-1]
    ends = [0.0, *((a + b) / 2.0 for a, b in pairwise(inner)), 1.0]
    return sum(
        (end - begin) * float(np.sum(step[wide][_excess_at(bounds, motion, wide, share) > excess]))
        for share, (begin, end) in zip(inner, pairwise(ends), strict=True)
    )


def _excess_at(bounds: PathLimits, motion: Motion, rows: Indices, share: float) -> Array:
    """The shares by which limits are exceeded after a share of the time from rows (n,) to the next ones."""
    return bounds.excess_of_motion(*_states(motion, rows, share)[1:])


def _states(motion: Motion, rows: Indices, share: float) -> tuple[Array, Array, Array, Array]:
    """Times (n,) after a share of the time from rows (n,) to the next ones, and the states there. A speed that is 0 but
    for rounding has the direction that it has between the rows, on which friction and the losses of gears depend.
    """
    step = np.diff(motion.time)[rows]
    time = motion.time[rows] + share * step
    q, v, a = motion.at(time, side="after" if share < 1.0 else "before")
    middle = motion.at(motion.time[rows] + 0.5 * step)[1]
    least = SIGN_KNOWN * np.abs(motion.velocity).max(axis=0)
    return time, q, np.where(np.abs(v) < least, np.copysign(np.minimum(np.abs(middle), least), middle), v), a
