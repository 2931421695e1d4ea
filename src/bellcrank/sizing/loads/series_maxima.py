"""The largest values of many series over time, refined between points where the series are known.

The series are those of one motion, or of many designs.

The largest local maxima of each series are bracketed between their neighbours. A bracket is narrowed to the vertex of
the parabola through its three points, until the values no longer differ: for a smooth maximum the width falls by 20 in
each round, and what is left of the value with its square. Where that does not help, as at a corner, the bracket is
divided evenly.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bellcrank.arrays import Array, Indices, Mask
from bellcrank.motion.motion import Motion
from bellcrank.sizing.loads.motion_grid import Grid, blocks

Whole = Indices
Values = Callable[[Whole, Whole, Array], Array]  # (designs (m,), series (m,), times (m,)) -> values (m,)
Quantities = Callable[[Array, Array, Array, Array], Mapping[str, Array]]  # (t, q, v, a) -> name: (n, k)

CANDIDATES = 6  # local maxima of a series that are refined
TOP = 0.02  # of a series' range: lower local maxima are not refined
NARROW = 0.05  # of a bracket: how far from the vertex it is narrowed to
INWARD = 1e-3  # of a bracket whose largest value is at an end: how far from the end it is narrowed to
LEVEL = 1e-6  # of the value at an end: so little less next to it says that there is no jump, and the maximum is there
FLAT = 1e-12  # of the value: a bracket in which it changes by less is narrow enough
GAIN = 1e-14  # of the value: a vertex that is higher by less is not looked at, where the bracket is
ALMOST_FLAT = 1e-8  # by this share
SHORTEST = 4e-16  # of the latest time of a bracket: a shorter one holds no time between
MOST_ROUNDS = 60


@dataclass(frozen=True, eq=False)
class Maxima:
    """Largest values of series, of any shape, and the times, s, at which they occur."""

    value: Array
    time: Array


def maxima(motion: Motion, grid: Grid, values: Mapping[str, Array], quantities: Quantities) -> dict[str, Maxima]:
    """The largest values (k,) of each quantity along a motion, from its `values` (n, k) on the motion's grid."""
    search = MaximaSearch(1, sum(each.shape[1] for each in values.values()))
    search.add(0, grid.time, np.concatenate(list(values.values()), axis=1).T)

    def between(_: Whole, series: Whole, times: Array) -> Array:
        found = np.empty(len(times))
        for part in blocks(motion, len(times)):
            forces = np.minimum(times[part], grid.force_time[-1])  # the motion ends before a jump at its end
            every = quantities(forces, *grid.at(motion, times[part]))
            found[part] = np.concatenate(list(every.values()), axis=1)[np.arange(len(forces)), series[part]]
        return found

    largest = search.largest(between)
    edges = np.cumsum([each.shape[1] for each in values.values()])[:-1]
    both = zip(np.split(largest.value[0], edges), np.split(largest.time[0], edges), strict=True)
    return {name: Maxima(*each) for name, each in zip(values, both, strict=True)}


def on_grid(motion: Motion, grid: Grid, quantities: Quantities) -> dict[str, Array]:
    """The values (n, k) of each quantity on the grid of a motion."""
    found = [
        quantities(grid.force_time[part], grid.position[part], grid.velocity[part], grid.acceleration[part])
        for part in blocks(motion, len(grid.time))
    ]
    return {name: np.concatenate([block[name] for block in found]) for name in found[0]}


class MaximaSearch:
    """The search for the largest values of c series of each of n designs. Each is found from its own values alone,
    whatever the others are.
    """

    def __init__(self, n: int, c: int) -> None:
        self._value, self._time = np.zeros((n, c)), np.zeros((n, c))
        self._found: list[_Brackets] = []

    def add(self, design: int, time: Array, table: Array) -> None:
        """Take the series (c, n) of one design at times (n,)."""
        best = table.argmax(axis=1)
        self._value[design], self._time[design] = table[np.arange(len(table)), best], time[best]
        self._found.append(_brackets(time, table, design))

    def largest(self, values: Values) -> Maxima:
        """The largest values (n, c) between all times, 0 for designs without series."""
        if self._found:
            design, series, time, value = (np.concatenate(parts) for parts in zip(*self._found, strict=True))

            def at(which: Whole, times: Array) -> Array:
                rows = np.repeat(which, times.shape[1])
                return values(design[rows], series[rows], times.ravel()).reshape(times.shape)

            best, when = _refined(time, value, at)
            order = np.argsort(best, kind="stable")
            order = order[best[order] > self._value[design[order], series[order]]]
            place = design[order], series[order]  # of several brackets of a series the last counts, with the largest
            self._value[place], self._time[place] = best[order], when[order]
        return Maxima(self._value, self._time)


class _Brackets(NamedTuple):
    """Local maxima (b,): the numbers of the design and the series, the times (b, 3) of the highest point and its
    neighbours, and the values (b, 3) there.
    """

    design: Whole
    series: Whole
    time: Array
    value: Array


def _brackets(time: Array, table: Array, design: int) -> _Brackets:
    """The local maxima of series (c, n) at times (n,) that may hold a series' largest value between the points."""
    highest = table.max(axis=1, keepdims=True)
    spread = highest - table.min(axis=1, keepdims=True)
    near = table >= highest - TOP * spread
    near &= spread > 1e-14 * np.abs(highest)
    series, place = np.nonzero(near)
    last = len(time) - 1
    before, after = np.maximum(place - 1, 0), np.minimum(place + 1, last)
    value = np.stack([table[series, before], table[series, place], table[series, after]], axis=1)
    local = (value[:, 1] >= value[:, 0]) & (value[:, 1] >= value[:, 2])
    drop = 2.0 * (value[:, 1] - np.minimum(value[:, 0], value[:, 2]))  # what the maximum may be higher by
    local &= (drop > 0.0) & (value[:, 1] + drop >= highest[series, 0])
    kept = np.flatnonzero(local)
    kept = kept[_first(series[kept], value[kept, 1])]
    times = np.stack([time[before[kept]], time[place[kept]], time[after[kept]]], axis=1)
    return _Brackets(np.full(len(kept), design), series[kept], times, value[kept])


def _first(series: Whole, value: Array) -> Whole:
    """Where the `CANDIDATES` largest values of each series are, in the order of series and values."""
    order = np.lexsort((-value, series))
    begin = np.searchsorted(series[order], series[order])
    return order[np.arange(len(order)) - begin < CANDIDATES]


def _refined(time: Array, value: Array, values: Callable[[Whole, Array], Array]) -> tuple[Array, Array]:
    """The largest value (b,) in each bracket, with times and values (b, 3), and its time; `values` are those of
    brackets (m,) at times (m, 3).
    """
    best, when = value[:, 1].copy(), time[:, 1].copy()
    which, late = np.arange(len(best)), np.abs(time).max(axis=1)
    even = np.zeros(len(which), dtype=bool)
    for _ in range(MOST_ROUNDS):
        level = np.abs(value[:, 1])
        drop = value[:, 1] - value.min(axis=1)
        vertex, gain = vertex_of(time, value)
        done = (drop <= FLAT * level) | ((drop <= ALMOST_FLAT * level) & (gain <= GAIN * level))
        done |= time[:, 2] - time[:, 0] <= SHORTEST * late[which]  # next to a jump
        go = ~done
        which, time, value, vertex, even = which[go], time[go], value[go], vertex[go], even[go]
        if not len(which):
            break
        probes = _probes(time, vertex, even)
        found = values(which, probes)
        width = time[:, 2] - time[:, 0]
        at_end = (time[:, 1] == time[:, 0]) | (time[:, 1] == time[:, 2])
        time, value = _narrowed(np.concatenate([time, probes], axis=1), np.concatenate([value, found], axis=1))
        even = time[:, 2] - time[:, 0] > 0.5 * width
        rises = value[:, 1] > best[which]
        best[which[rises]], when[which[rises]] = value[rises, 1], time[rises, 1]
        stays = at_end & ((time[:, 1] == time[:, 0]) | (time[:, 1] == time[:, 2]))
        stays &= value[:, 1] - value.min(axis=1) <= LEVEL * np.abs(value[:, 1])  # the maximum is at the end itself
        which, time, value, even = which[~stays], time[~stays], value[~stays], even[~stays]
    return best, when


def vertex_of(time: Array, value: Array) -> tuple[Array, Array]:
    """The vertex (b,) of the parabolas through three points, kept inside, and how much higher it is; the middle point
    where there is no parabola.
    """
    left, right = time[:, 1] - time[:, 0], time[:, 2] - time[:, 1]
    with np.errstate(all="ignore"):
        first, second = (value[:, 1] - value[:, 0]) / left, (value[:, 2] - value[:, 1]) / right
        curvature = (second - first) / (left + right)
        slope = (first * right + second * left) / (left + right)
        step, gain = -0.5 * slope / curvature, -0.25 * slope * slope / curvature
    good = np.isfinite(step) & (curvature < 0.0)
    reach = 0.98 * np.where(step < 0.0, -left, right)
    step = np.where(good, np.where(np.abs(step) > np.abs(reach), reach, step), 0.0)
    return time[:, 1] + step, np.where(good, gain, np.inf)


def _probes(time: Array, vertex: Array, even: Mask) -> Array:
    """Three times (b, 3) in each bracket at which its series is evaluated."""
    low, high = time[:, :1], time[:, 2:]
    width = high - low
    around = vertex[:, None] + width * np.array([-NARROW, 0.0, NARROW])
    around = np.where(around < low, 0.5 * (low + vertex[:, None]), around)
    around = np.where(around > high, 0.5 * (high + vertex[:, None]), around)
    shares = np.array([0.25, 0.5, 0.75])
    around = np.where(even[:, None], low + width * shares, around)
    inward = width * np.array([INWARD, 0.1, 0.4])
    around = np.where(time[:, 1:2] == low, low + inward, around)
    return np.asarray(np.where(time[:, 1:2] == high, high - inward, around))


def _narrowed(time: Array, value: Array) -> tuple[Array, Array]:
    """The highest of several points (b, m) and its neighbours in time, (b, 3) each."""
    order = np.argsort(time, axis=1, kind="stable")
    time, value = np.take_along_axis(time, order, axis=1), np.take_along_axis(value, order, axis=1)
    top = value.argmax(axis=1)
    near = np.stack([np.maximum(top - 1, 0), top, np.minimum(top + 1, time.shape[1] - 1)], axis=1)
    return np.take_along_axis(time, near, axis=1), np.take_along_axis(value, near, axis=1)
