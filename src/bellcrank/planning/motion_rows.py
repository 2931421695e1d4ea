"""The rows of a motion along a path: few enough that rounding does not matter, enough that quintics between them keep
the limits.

A quintic over a time Δt turns an error δ of a position into an error of about 60 δ/Δt² of an acceleration. Cells that
were halved around a change of the acceleration take nanoseconds; as rows they would be noise. So cells that are shorter
than a least time become a jump of the acceleration, and of the remaining ones as many are joined as one quintic
reproduces.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank.planning.fastest_pass import PathTiming

Array = NDArray[np.float64]
SHORTEST = (1e-7, 3e-8, 1e-8, 3e-9, 3e-7, 1e-6)  # of the whole time: shorter cells become a jump; the usual one first
LEAST = 1e-4  # of the whole time: a row is not closer to the next one of its piece, except in shorter pieces
LONGEST = 2e-3  # of the whole time: a row is not further from the next
SMOOTH = 1e-5  # of the largest acceleration: a larger change from one cell to the next is a jump
REPRODUCED = 3e-7  # of the largest acceleration: by how much a quintic may differ


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


def motion_rows(timing: PathTiming, shortest: float = SHORTEST[0]) -> list[PathRow]:
    """Rows of a motion; where the acceleration jumps there are two of one time. Cells that take less than a share of
    the whole time become a jump: a larger share moves the limits, a smaller one leaves more rounding.
    """
    cells = _long_cells(timing, shortest)
    scale = float(np.max(np.abs(np.concatenate([cells.begin[:, 3], cells.end[:, 3]]))))
    jump = np.abs(cells.end[:-1, 3] - cells.begin[1:, 3]) > SMOOTH * scale
    jump |= cells.end[:-1, 0] != cells.begin[1:, 0]
    edges = [0, *(np.flatnonzero(jump) + 1).tolist(), len(cells.begin)]
    rows: list[PathRow] = []
    whole = float(cells.end[-1, 0])
    for first, last in pairwise(edges):
        nodes = _spread(np.concatenate([cells.begin[first:last], cells.end[last - 1 : last]]), LEAST * whole)
        if rows:
            nodes[0, 0] = rows[-1].time
        rows += [PathRow(*nodes[k].tolist()) for k in _kept(nodes, LONGEST * whole, REPRODUCED * scale)]
    return rows


def _long_cells(timing: PathTiming, shortest: float) -> _Cells:
    length = np.diff(timing.s)
    duration = np.where(length > 0.0, timing.durations, 0.0)
    time = np.concatenate([[0.0], np.cumsum(duration)])
    long = np.flatnonzero(duration > shortest * time[-1])
    begin = np.column_stack([time[long], timing.s[long], timing.speed[long], timing.begin[long]])
    end = np.column_stack([time[long + 1], timing.s[long + 1], timing.speed[long + 1], timing.end[long]])
    begin[0] = _moved(begin[0], timing.s[0], rest=True)
    end[-1] = _moved(end[-1], timing.s[-1], rest=True)
    for k in np.flatnonzero(long[1:] != long[:-1] + 1).tolist():  # short cells between two long ones
        place = _meeting(end[k], begin[k + 1])
        end[k], begin[k + 1] = _moved(end[k], place), _moved(begin[k + 1], place)
    shift = np.concatenate([[0.0], np.cumsum(begin[1:, 0] - end[:-1, 0])]) + begin[0, 0]
    begin[:, 0] -= shift
    end[:, 0] -= shift
    return _Cells(begin, end)


def _meeting(before: Array, after: Array) -> float:
    """The place at which two arcs of constant acceleration, from states on either side, have the same speed; the place
    of the state before where that is not close by.
    """
    (_, s0, y0, u0), (_, s1, y1, u1) = before, after
    if u0 == u1:
        return float(s0)
    place = (y0 * y0 - y1 * y1 - 2.0 * u0 * s0 + 2.0 * u1 * s1) / (2.0 * (u1 - u0))
    return float(place) if abs(place - (s0 + s1) / 2.0) <= s1 - s0 else float(s0)


def _moved(row: Array, s: float, rest: bool = False) -> Array:
    """A state moved to another place close by, with its acceleration; with `rest` to one without speed."""
    time, place, speed, acceleration = row
    if s == place:
        return row
    there = 0.0 if rest else float(np.sqrt(max(0.0, speed * speed + 2.0 * acceleration * (s - place))))
    return np.array([time + 2.0 * (s - place) / (speed + there), s, there, acceleration])


def _spread(nodes: Array, least: float) -> Array:
    """Those of the nodes (n, 4) that are at least a least time apart; first the ends, then the nodes of the shortest
    cells, which lie where the acceleration has a corner.
    """
    time, last = nodes[:, 0], len(nodes) - 1
    cell = np.minimum(np.diff(time)[:-1], np.diff(time)[1:])
    kept = [0, last]
    for k in (np.argsort(cell, kind="stable") + 1).tolist():
        place = bisect_left(kept, k)
        if time[k] - time[kept[place - 1]] >= least and time[kept[place]] - time[k] >= least:
            kept.insert(place, k)
    return nodes[kept]


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
    (t0, s0, y0, u0), (t1, s1, y1, u1) = nodes[first], nodes[last]
    t = t1 - t0
    if t > longest:
        return False
    length, v0, v1, a0, a1 = s1 - s0, y0 * t, y1 * t, u0 * t * t, u1 * t * t
    c3 = 10.0 * length - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15.0 * length + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    c5 = 6.0 * length - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1
    inner = nodes[first + 1 : last]
    share = (inner[:, 0] - t0) / t
    acceleration = (a0 + 6.0 * c3 * share + 12.0 * c4 * share**2 + 20.0 * c5 * share**3) / (t * t)
    return bool(np.max(np.abs(acceleration - inner[:, 3])) <= tolerance)
