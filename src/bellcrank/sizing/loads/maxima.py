"""Largest values of quantities along a motion, refined between the points of its grid.

The largest local maxima of all points are bracketed, and the brackets are narrowed until the value no longer changes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bellcrank.motion.motion import Motion
from bellcrank.sizing.loads.motion_grid import Grid, rows_at_once

Array = NDArray[np.float64]
Quantities = Callable[[Array, Array, Array, Array], Mapping[str, Array]]  # (t, q, v, a) -> name: (n, k)

CANDIDATES = 6  # local maxima that are refined for each quantity
PROBES = 9  # points that divide a bracket
NARROWINGS = 13  # each divides the bracket by (PROBES − 1) / 2
ROUNDING = 4e-16  # of a value: a bracket in which it changes by less is narrow enough


@dataclass(frozen=True, eq=False)
class Maxima:
    """Largest values (k,) of a quantity's columns, and the times (k,), s, at which they occur."""

    value: Array
    time: Array


def maxima(motion: Motion, grid: Grid, quantities: Quantities) -> tuple[dict[str, Array], dict[str, Maxima]]:
    """The values (n, k) of each quantity on the grid, and its maxima, refined between the grid's points.

    `quantities(t, q, v, a)` gives arrays (n, k) by name.
    """
    values = _in_blocks(motion, grid, quantities)
    names = list(values)
    edges = np.cumsum([0, *(values[name].shape[1] for name in names)])
    top, when = np.zeros(edges[-1]), np.zeros(edges[-1])
    found: list[tuple[NDArray[np.intp], Array, Array]] = []
    for name, begin, end in zip(names, edges[:-1], edges[1:], strict=True):
        best = values[name].argmax(axis=0)
        top[begin:end], when[begin:end] = values[name][best, np.arange(end - begin)], grid.time[best]
        column, low, high = _brackets(grid.time, values[name])
        found.append((column + begin, low, high))
    column, low, high = (np.concatenate(parts) for parts in zip(*found, strict=True))
    for _ in range(NARROWINGS):
        if not column.size:
            break
        times = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, PROBES)
        line = _probed(motion, grid, quantities, times, column)
        here = line.argmax(axis=1)
        each = np.arange(len(column))
        for c, value, time in zip(column, line[each, here], times[each, here], strict=True):
            if value > top[c]:
                top[c], when[c] = value, time
        low, high = times[each, np.maximum(here - 1, 0)], times[each, np.minimum(here + 1, PROBES - 1)]
        level = line.max(axis=1)
        rising = level - line.min(axis=1) > ROUNDING * np.abs(level)
        column, low, high = column[rising], low[rising], high[rising]
    return values, {name: Maxima(top[a:b], when[a:b]) for name, a, b in zip(names, edges[:-1], edges[1:], strict=True)}


def _in_blocks(motion: Motion, grid: Grid, quantities: Quantities) -> dict[str, Array]:
    """The quantities (n, k) on a grid, evaluated in blocks of its rows."""
    step, values = rows_at_once(motion), {}
    for first in range(0, len(grid.time), step):
        part = slice(first, first + step)
        found = quantities(grid.force_time[part], grid.position[part], grid.velocity[part], grid.acceleration[part])
        for name, block in found.items():
            if name not in values:
                values[name] = np.empty((len(grid.time), block.shape[1]))
            values[name][part] = block
    return values


def _probed(motion: Motion, grid: Grid, quantities: Quantities, times: Array, column: NDArray[np.intp]) -> Array:
    """The values (b, PROBES) of each bracket's own column at its times (b, PROBES); a time that several brackets share
    is evaluated once, and times are evaluated in blocks.
    """
    step = rows_at_once(motion)
    every, place = np.unique(times, return_inverse=True)
    place = place.ravel()
    order, columns = np.argsort(place, kind="stable"), np.repeat(column, PROBES)
    ends = np.searchsorted(place[order], np.arange(0, len(every) + step, step))
    line = np.empty(times.size)
    for block, (begin, end) in enumerate(pairwise(ends)):
        first = block * step
        some, wanted = every[first : first + step], order[begin:end]
        force_times = np.minimum(some, grid.force_time[-1])  # the motion ends before a jump at its end
        found = list(quantities(force_times, *grid.at(motion, some)).values())
        edges = np.cumsum([0, *(part.shape[1] for part in found)])
        of = np.searchsorted(edges, columns[wanted], side="right") - 1
        for k, part in enumerate(found):
            mine = wanted[of == k]
            line[mine] = part[place[mine] - first, columns[mine] - edges[k]]
    return line.reshape(times.shape)


def _brackets(time: Array, table: Array) -> tuple[NDArray[np.intp], Array, Array]:
    """Columns and time brackets of the largest local maxima of each column of a table (n, k)."""
    padded = np.pad(table, ((1, 1), (0, 0)), mode="edge")
    local = (table >= padded[:-2]) & (table >= padded[2:])
    highest, lowest = table.max(axis=0), table.min(axis=0)
    local &= table >= highest - 0.02 * (highest - lowest)
    local &= highest - lowest > 1e-14 * np.maximum(np.abs(highest), np.abs(lowest))
    columns: list[int] = []
    rows: list[int] = []
    for k in np.flatnonzero(local.any(axis=0)):
        candidates = np.flatnonzero(local[:, k])
        if len(candidates) > CANDIDATES:
            candidates = candidates[np.argsort(table[candidates, k])[-CANDIDATES:]]
        columns += [int(k)] * len(candidates)
        rows += candidates.tolist()
    row = np.array(rows, dtype=np.intp)
    last = len(time) - 1
    return np.array(columns, dtype=np.intp), time[np.maximum(row - 1, 0)], time[np.minimum(row + 1, last)]
