"""Gradients of the loads of a design along motions through waypoints of its own, with all maxima of its peaks.

The time of a maximum moves with the design, but its value changes, to first order, as at a place that keeps its share
of the way between two waypoints. So does an integral. Designs beside it are evaluated at these places, for central
differences of second order, without a search for their peaks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Indices
from bellcrank.sizing.loads.design_states import WaypointStates
from bellcrank.sizing.loads.series_maxima import vertex_of
from bellcrank.studies.execution.many_sizings import SizingBatch, certain

if TYPE_CHECKING:
    from bellcrank.sizing.loads.design_peaks import DesignMotion
    from bellcrank.studies.execution.shared_sizing import SharedSizing

Whole = Indices
Slopes = list[tuple[float, Array, float]]  # values, slopes (axes,) by shares of widths, and times, s
STEP = 1e-5  # of differences, as a share of the width between the bounds
HIGH = 0.7  # of the largest: lower maxima are not among the rows of a peak
MOST = 16  # maxima of a series
# Where a speed is nearly the largest for some time, as at a limit, a step may raise it anywhere: there every so many
# points of the grid are among the rows too.
FLAT, EVERY = 0.9, 8


def covers(shared: SharedSizing) -> bool:
    """Whether designs are sized together and have waypoints of their own along each motion."""
    return not shared.single_reason and all(shared.entry(motion.name) is not None for motion in shared.motions)


def slopes_of(shared: SharedSizing, values: Array, widths: Array) -> dict[str, Slopes]:
    """Of a design (axes,), in SI units: of its durations and of its joints' peak and RMS torques and peak speeds, the
    functions of which each is the largest; none where designs beside it, by shares of `widths` (axes,), cannot be built
    or are not certain to be.
    """
    count = len(values)
    steps = np.concatenate([np.zeros((1, count)), np.diag(STEP * widths), np.diag(-STEP * widths)])
    batch, good = SizingBatch(shared, values + steps), np.ones(1 + 2 * count, dtype=bool)
    if not certain(shared, batch.values).all():
        return {}
    alone = SizingBatch(shared, values[None]).states(good[:1])  # of the others no grid is needed
    names = [joint.name for joint in shared.mechanism.motors]
    found: dict[str, Slopes] = {}
    for motion, states, own in zip(shared.design_motions, batch.states(good), alone, strict=True):
        assert isinstance(states, WaypointStates)
        beside = _Beside(motion, states, batch.parameters, shared.loads.rotor_inertia)
        found[f"{motion.motion.name}.duration"] = _central(states.duration[:, None], np.zeros(1))
        grid = own.on_grid(0)
        step, share = states.places(0, grid.time)
        moves = np.ones((len(step), 1))
        moves[[0, -1]] = 0.0  # at rest before and after the motion
        tables = [beside.loads(d, step, share, moves) for d in range(len(good))]
        weight = grid.weight * (states.steps[:, step] / states.steps[0, step])
        squares = np.array([weight[d] @ table[:, : len(names)] ** 2 for d, table in enumerate(tables)])
        effective = _central(np.sqrt(squares / states.duration[:, None]), np.zeros(len(names)))
        for name, one in zip(names, effective, strict=True):
            found.setdefault(f"{name}.rms_torque", []).append(one)
        table = np.concatenate([tables[0], -tables[0]], axis=1)
        series, row = _maxima(table, len(names))
        time = _times(grid.time, table, series, row)
        at, part = states.places(0, time)
        sign, column = np.where(series < tables[0].shape[1], 1.0, -1.0), series % tables[0].shape[1]
        there = [beside.loads(d, at, part, moves[row])[np.arange(len(row)), column] for d in range(len(good))]
        for k, one in zip(column.tolist(), _central(sign * np.array(there), time), strict=True):
            kind = "peak_torque" if k < len(names) else "peak_speed"
            found.setdefault(f"{names[k % len(names)]}.{kind}", []).append(one)
    return found


@dataclass(frozen=True, eq=False)
class _Beside:
    """Designs beside one, along a motion."""

    motion: DesignMotion
    states: WaypointStates
    parameters: Array
    rotor_inertia: Array

    def loads(self, design: int, step: Whole, share: Array, moves: Array) -> Array:
        """Torques, then speeds (m, 2 k) of a design at places; `moves` (m, 1) is 0 at rest, else 1."""
        q, v, a = self.states.at_places(design, step, share)
        v, a, columns = moves * v, moves * a, self.motion.columns
        torque = self.motion.torques(np.zeros(len(q)), q, v, a, self.parameters[design])
        return np.concatenate([torque - self.rotor_inertia * a[:, columns], v[:, columns]], axis=1)


def _central(values: Array, times: Array) -> Slopes:
    """The slopes of values (1 + 2 axes, k) of the design and those beside it, at times (k,), s."""
    count = len(values) // 2
    slopes = (values[1 : 1 + count] - values[1 + count :]).T / (2.0 * STEP)
    return list(zip(values[0].tolist(), slopes, times.tolist(), strict=True))


def _maxima(table: Array, motors: int) -> tuple[Whole, Whole]:
    """The series and rows of the high local maxima of a table (n, 4 k) of torques and speeds and their negatives."""
    padded = np.pad(table, ((1, 1), (0, 0)), constant_values=-np.inf)
    size = np.tile(np.maximum(*np.split(np.abs(table).max(axis=0), 2)), 2)
    local = (table >= padded[:-2]) & (table > padded[2:]) & (table >= HIGH * size)
    series, rows = [], []
    for k in range(table.shape[1]):
        own = np.flatnonzero(local[:, k])
        own = own[np.argsort(-table[own, k], kind="stable")[:MOST]]
        if k % (2 * motors) >= motors:
            own = np.union1d(own, np.flatnonzero(table[::EVERY, k] >= FLAT * size[k]) * EVERY)
        series += [k] * len(own)
        rows += own.tolist()
    return np.array(series, dtype=np.intp), np.array(rows, dtype=np.intp)


def _times(time: Array, table: Array, series: Whole, row: Whole) -> Array:
    """The times of rows, s; of maxima those at the vertices of parabolas."""
    near = np.stack([np.maximum(row - 1, 0), row, np.minimum(row + 1, len(time) - 1)], axis=1)
    value = table[near, series[:, None]]
    inner = (near[:, 0] > 0) & (near[:, 2] < len(time) - 1) & (value[:, 1:2] >= value[:, ::2]).all(axis=1)
    return np.where(inner, vertex_of(time[near], value)[0], time[row])
