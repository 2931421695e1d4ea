"""What joints and motors do over motions, as rows between which straight lines are right."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.motion.resampling import BETWEEN, SHARE, before, ranges, refined

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion

Array = NDArray[np.float64]
Function = Callable[[Array, Array, Array, Array], Sequence[Array]]  # t, q, v, a -> tables (n, lines), one a group


@dataclass(frozen=True, eq=False)
class MotionSeries:
    """Times (n,) s of one motion, increasing, and tables (n, lines) of groups of lines over them. A jump at t has rows
    at the last number before t and at t; `off` is by how much of its range a line may be off that goes straight between
    rows.
    """

    time: Array
    groups: tuple[Array, ...]
    off: float


def motion_series(motions: Sequence[Motion], functions: Sequence[Function], jumps: Array) -> list[MotionSeries]:
    """Each motion's series: of position, velocity and acceleration, and of what its function gives more; lines that are
    straight between rows are off by BETWEEN of the bound that goes with the range that they have over all motions, or
    by `off` where that takes too many. Forces jump at the times `jumps` (k,) s of a motion.
    """
    ats = [_groups_at(motion, function) for motion, function in zip(motions, functions, strict=True)]
    times = [_times(motion, jumps) for motion in motions]
    tables = [at(time) for at, time in zip(ats, times, strict=True)]
    widths = [table.shape[1] for table in tables[0]]
    reach = np.concatenate([ranges(np.concatenate(group)) for group in zip(*tables, strict=True)])
    found = []
    for time, table, at in zip(times, tables, ats, strict=True):

        def lines(t: Array, at: Callable[[Array], list[Array]] = at) -> Array:
            return np.concatenate(at(t), axis=1)

        every, rows, left = refined(time, np.concatenate(table, axis=1), lines, BETWEEN * SHARE * reach)
        off = float((left / np.where(reach > 0.0, reach, 1.0)).max(initial=0.0))
        found.append(MotionSeries(every, tuple(np.split(rows, np.cumsum(widths)[:-1], axis=1)), off))
    return found


def _times(motion: Motion, jumps: Array) -> Array:
    """The times of a motion's rows, and of jumps; of two rows of one time the first is just before it."""
    twin = np.append(np.diff(motion.time) == 0.0, False)
    inside = jumps[(jumps > motion.time[0]) & (jumps < motion.time[-1])]
    return np.unique(np.concatenate([np.where(twin, before(motion.time), motion.time), before(inside), inside]))


def _groups_at(motion: Motion, function: Function) -> Callable[[Array], list[Array]]:
    def at(time: Array) -> list[Array]:
        q, v, a = motion.at(time)
        return [q, v, a, *function(time, q, v, a)]

    return at
