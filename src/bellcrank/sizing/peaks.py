"""Largest values and integrals of quantities along a motion, refined between its samples.

The time between samples is divided into parts, at the reversals of every joint too, where friction and the
losses of a gear jump, at the rows of tables of forces, where these may jump, and further where torques change fast
(friction, stiff springs), until halving a part no longer changes the integral of their squares. Integrals are
Gauss-Legendre sums over the three inner points of each part; the local maxima of all points are brackets that are
narrowed until the value no longer changes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bellcrank.motion.motion import Motion

Array = NDArray[np.float64]
Quantities = Callable[[Array, Array, Array, Array], Mapping[str, Array]]  # (t, q, v, a) -> name: (n, k)

Torque = Callable[[Array, Array, Array, Array], Array]  # (t, q, v, a) -> (n, k)

FINEST = 300  # parts of a whole motion that the grid has at least
CANDIDATES = 6  # local maxima that are refined for each quantity
PROBES = 9  # points that divide a bracket
_GAUSS = 0.5 * np.sqrt(0.6)
_NODES = np.array([0.0, 0.5 - _GAUSS, 0.5, 0.5 + _GAUSS, 1.0])
_WEIGHTS = np.array([0.0, 5.0, 8.0, 5.0, 0.0]) / 18.0
HALVINGS = 16  # of a part, at most
SETTLED = 1e-9  # of the whole integral of a squared torque: a part that halving changes by less is fine enough
NOISE = 1e-12  # of the largest integral of a squared torque: smaller ones need not settle
MOST_PARTS = 30_000  # of a motion's grid that halving may lead to
NARROWINGS = 13  # each divides the bracket by (PROBES − 1) / 2
ROUNDING = 4e-16  # of a value: a bracket in which it changes by less is narrow enough
BLOCK_NUMBERS = 1_000_000  # of one quantity, in memory at a time


@dataclass(frozen=True)
class Grid:
    """Points along a motion: time (n,), states q (n, nq), v (n, nv), a (n, nv), and weights (n,) in s of the
    integral. `force_time` (n,) is the time at which forces are meant: just before `time` where a part ends, so that a
    force that jumps there has its limit from before.
    """

    time: Array
    force_time: Array
    position: Array
    velocity: Array
    acceleration: Array
    weight: Array


def grid_along(
    motion: Motion, probes: Array | None = None, breaks: Array | None = None, torque: Torque | None = None
) -> Grid:
    """The grid of a motion; both limits of every jump of acceleration are in it, and of forces at `breaks` (s).

    Its parts are halved where `torque` changes too fast for them.

    `probes` are times (s) to be looked at besides, for instance just beside a reversal; they carry no weight.
    """
    low, high = _parts(motion, np.zeros(0) if breaks is None else breaks)
    if torque is not None:
        low, high = _halved(motion, torque, low, high)
    length, last = high - low, len(_NODES) - 1
    time = (low[:, None] + length[:, None] * _NODES).ravel()
    weight = (length[:, None] * _WEIGHTS).ravel()
    force_time = time.copy()
    time[last :: last + 1] = high
    force_time[last :: last + 1] = np.nextafter(high, -np.inf)
    position, velocity, acceleration = motion.at(time)
    # A part that starts (ends) at a row of the motion takes that row's limit from after (before) a jump.
    for place, edge, side in ((0, low, "right"), (last, high, "left")):
        row = np.searchsorted(motion.time, edge, side="right" if side == "right" else "left")
        row = np.clip(row - 1 if side == "right" else row, 0, len(motion.time) - 1)
        at_row = motion.time[row] == edge
        points = np.arange(len(low))[at_row] * len(_NODES) + place
        position[points], velocity[points] = motion.position[row[at_row]], motion.velocity[row[at_row]]
        acceleration[points] = motion.acceleration[row[at_row]]
    if probes is not None and probes.size:
        probes = np.unique(probes)
        probes = probes[~np.isin(probes, time)]
        at = np.searchsorted(time, probes)
        extra = motion.at(probes)
        time, weight = np.insert(time, at, probes), np.insert(weight, at, 0.0)
        force_time = np.insert(force_time, at, probes)
        position, velocity, acceleration = (
            np.insert(old, at, new, axis=0) for old, new in zip((position, velocity, acceleration), extra, strict=True)
        )
    return Grid(time, force_time, position, velocity, acceleration, weight)


def _parts(motion: Motion, breaks: Array) -> tuple[Array, Array]:
    """Starts and ends (m,), s, of the parts of the grid: samples, divided further, breaks, and reversals of any
    velocity."""
    starts = np.flatnonzero(np.diff(motion.time) > 0.0)
    length = motion.time[starts + 1] - motion.time[starts]
    count = np.maximum(1, np.ceil(FINEST * length / motion.duration - 1e-9)).astype(int)
    place = np.concatenate([np.arange(many) for many in count])
    step = np.repeat(length / count, count)
    breaks = breaks[(breaks > motion.time[0]) & (breaks < motion.time[-1])]
    edges = np.unique(np.concatenate([np.repeat(motion.time[starts], count) + place * step, motion.time, breaks]))
    speed = motion.at(edges)[1]
    row, column = np.nonzero(speed[:-1] * speed[1:] < 0.0)
    low, high = edges[row].copy(), edges[row + 1].copy()
    for _ in range(40 if row.size else 0):  # bisection
        middle = 0.5 * (low + high)
        before = motion.at(middle)[1][np.arange(len(row)), column] * speed[row, column] > 0.0
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    edges = np.unique(np.concatenate([edges, low]))
    return edges[:-1], edges[1:]


def _halved(motion: Motion, torque: Torque, low: Array, high: Array) -> tuple[Array, Array]:
    """The parts, halved until the Gauss-Legendre sum of each squared torque over a part is that over its halves."""

    def squares(low: Array, high: Array) -> Array:
        found = []
        for first in range(0, len(low), step):
            begin, length = low[first : first + step], (high - low)[first : first + step]
            time = (begin[:, None] + length[:, None] * _NODES[1:-1]).ravel()
            values = torque(time, *motion.at(time)).reshape(len(begin), 3, -1)
            found.append(length[:, None] * np.einsum("j,njk->nk", _WEIGHTS[1:-1], values**2))
        return np.concatenate(found)

    step = _rows(motion)
    sums = squares(low, high)
    whole = sums.sum(axis=0)
    whole = np.maximum(whole, NOISE * whole.max(initial=0.0) + 1e-300)
    done: list[tuple[Array, Array]] = []
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        left, right = squares(low, middle), squares(middle, high)
        coarse = (np.abs(left + right - sums) > SETTLED * whole).any(axis=1) & (low < middle) & (middle < high)
        done.append((low[~coarse], high[~coarse]))
        low, middle, high = low[coarse], middle[coarse], high[coarse]
        if not len(low) or sum(len(part) for part, _ in done) + 2 * len(low) > MOST_PARTS:
            break
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        sums = np.concatenate([left[coarse], right[coarse]])
    done.append((low, high))
    low, high = (np.concatenate([part[k] for part in done]) for k in (0, 1))
    order = np.argsort(low)
    return low[order], high[order]


def reversal_times(motion: Motion, rough: Sequence[tuple[int, float]]) -> Array:
    """Times just before and after velocities change sign: 0.3, 1, … 100 friction widths away in speed.

    `rough` are pairs of a velocity coordinate and the width of its friction, rad/s or m/s.
    """
    found = []
    for column, width in rough:
        speed = motion.velocity[:, column]
        for k in np.flatnonzero((speed[:-1] * speed[1:] < 0.0) & (np.diff(motion.time) > 0.0)):
            low, high = float(motion.time[k]), float(motion.time[k + 1])
            rate = (speed[k + 1] - speed[k]) / (high - low)
            zero = low - speed[k] / rate
            for factor in (0.3, 1.0, 3.0, 10.0, 30.0, 100.0):
                offset = factor * width / abs(rate)
                found += [zero - offset, zero + offset]
        found = [time for time in found if motion.time[0] < time < motion.time[-1]]
    return np.array(found, dtype=np.float64)


def maxima(
    motion: Motion, grid: Grid, quantities: Quantities
) -> tuple[dict[str, Array], dict[str, tuple[Array, Array]]]:
    """(values on the grid, and for each quantity the (k,) largest values and their (k,) times), refined.

    `quantities(t, q, v, a)` gives arrays (n, k); what is wanted of a quantity is its maximum.
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
    return values, {name: (top[a:b], when[a:b]) for name, a, b in zip(names, edges[:-1], edges[1:], strict=True)}


def _in_blocks(motion: Motion, grid: Grid, quantities: Quantities) -> dict[str, Array]:
    """The quantities (n, k) on a grid, evaluated in blocks of its rows."""
    step, values = _rows(motion), {}
    for first in range(0, len(grid.time), step):
        part = slice(first, first + step)
        found = quantities(grid.force_time[part], grid.position[part], grid.velocity[part], grid.acceleration[part])
        for name, block in found.items():
            if name not in values:
                values[name] = np.empty((len(grid.time), block.shape[1]))
            values[name][part] = block
    return values


def _probed(motion: Motion, grid: Grid, quantities: Quantities, times: Array, column: NDArray[np.intp]) -> Array:
    """The values (b, PROBES) of each bracket's own column of all quantities at its times (b, PROBES): times that
    brackets share are looked at once, in blocks.
    """
    step = _rows(motion)
    every, place = np.unique(times, return_inverse=True)
    place = place.ravel()
    order, columns = np.argsort(place, kind="stable"), np.repeat(column, PROBES)
    ends = np.searchsorted(place[order], np.arange(0, len(every) + step, step))
    line = np.empty(times.size)
    for block, (begin, end) in enumerate(pairwise(ends)):
        first = block * step
        some, wanted = every[first : first + step], order[begin:end]
        force_times = np.minimum(some, grid.force_time[-1])  # the motion ends before a jump at its end
        found = list(quantities(force_times, *motion.at(some)).values())
        edges = np.cumsum([0, *(part.shape[1] for part in found)])
        of = np.searchsorted(edges, columns[wanted], side="right") - 1
        for k, part in enumerate(found):
            mine = wanted[of == k]
            line[mine] = part[place[mine] - first, columns[mine] - edges[k]]
    return line.reshape(times.shape)


def _rows(motion: Motion) -> int:
    """How many states of a motion's robot are looked at together."""
    return max(PROBES, BLOCK_NUMBERS // max(1, motion.nv))


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
