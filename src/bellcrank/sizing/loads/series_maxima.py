"""The largest values of many series over time, refined between points where the series are known.

The largest local maxima of each series are bracketed between their neighbours. A bracket is narrowed to the vertex of
the parabola through its three points, until the values no longer differ: for a smooth maximum the width falls by 20 in
each round, and what is left of the value with its square. Where that does not help, as at a corner, the bracket is
divided evenly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Whole = NDArray[np.intp]
Values = Callable[[Whole, Array], Array]  # (brackets (b,), times (b, 3)) -> the values (b, 3) of their series

CANDIDATES = 6  # local maxima of a series that are refined
TOP = 0.02  # of a series' range: lower local maxima are not refined
NARROW = 0.05  # of a bracket: how far from the vertex it is narrowed to
INWARD = 1e-3  # of a bracket whose largest value is at an end: how far from the end it is narrowed to
LEVEL = 1e-6  # of the value at an end: so little less next to it says that there is no jump, and the maximum is there
FLAT = 1e-12  # of the value: a bracket in which it changes by less is narrow enough
GAIN = 1e-14  # of the value: a vertex that is higher by less is not looked at, where the bracket is
ALMOST_FLAT = 1e-8  # by this share
MOST_ROUNDS = 60


@dataclass(frozen=True, eq=False)
class Brackets:
    """Local maxima (b,) of series: the number of the series, the times (b, 3) of the highest point and its
    neighbours, and the values (b, 3) there.
    """

    series: Whole
    time: Array
    value: Array

    def __len__(self) -> int:
        return len(self.series)


def brackets_of(time: Array, table: Array) -> Brackets:
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
    return Brackets(series[kept], times, value[kept])


def _first(series: Whole, value: Array) -> Whole:
    """Where the `CANDIDATES` largest values of each series are, in the order of series and values."""
    order = np.lexsort((-value, series))
    begin = np.searchsorted(series[order], series[order])
    return order[np.arange(len(order)) - begin < CANDIDATES]


def refined(brackets: Brackets, values: Values) -> Array:
    """The largest value (b,) in each bracket. Each is found from its own values alone, whatever the others are."""
    best = brackets.value[:, 1].copy()
    which = np.arange(len(brackets))
    time, value = brackets.time.copy(), brackets.value.copy()
    even = np.zeros(len(which), dtype=bool)
    for _ in range(MOST_ROUNDS):
        level = np.abs(value[:, 1])
        drop = value[:, 1] - value.min(axis=1)
        vertex, gain = vertex_of(time, value)
        done = (drop <= FLAT * level) | ((drop <= ALMOST_FLAT * level) & (gain <= GAIN * level))
        done |= time[:, 2] - time[:, 0] <= 4e-16 * np.abs(time[:, 1])
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
        best[which] = np.maximum(best[which], value[:, 1])
        stays = at_end & ((time[:, 1] == time[:, 0]) | (time[:, 1] == time[:, 2]))
        stays &= value[:, 1] - value.min(axis=1) <= LEVEL * np.abs(value[:, 1])  # the maximum is at the end itself
        which, time, value, even = which[~stays], time[~stays], value[~stays], even[~stays]
    return best


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


def _probes(time: Array, vertex: Array, even: NDArray[np.bool_]) -> Array:
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
