"""Time series of joints and motors over motions, sampled so that linear interpolation between rows is accurate."""

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
    """Increasing times (n,) s of one motion, and tables (n, lines) of groups of lines over them.

    A jump at t has rows at the last number before t and at t. `error` is the largest error of linear interpolation
    between rows, relative to the range of a line, where it exceeds the bound.
    """

    time: Array
    groups: tuple[Array, ...]
    error: float


def motion_series(motions: Sequence[Motion], functions: Sequence[Function], jumps: Array) -> list[MotionSeries]:
    """The series of each motion: position, velocity, acceleration, and the groups that its function returns.

    Linear interpolation between rows is within the bound that follows from the range of a line over all motions
    (BETWEEN * SHARE), or within `error` if that takes too many rows. Forces jump at the times `jumps` (k,) s.
    """
    group_functions = [_groups(motion, function) for motion, function in zip(motions, functions, strict=True)]
    times = [_times(motion, jumps) for motion in motions]
    tables = [groups(time) for groups, time in zip(group_functions, times, strict=True)]
    widths = [table.shape[1] for table in tables[0]]
    reach = np.concatenate([ranges(np.concatenate(group)) for group in zip(*tables, strict=True)])
    found = []
    for time, table, groups in zip(times, tables, group_functions, strict=True):

        def lines(t: Array, groups: Callable[[Array], list[Array]] = groups) -> Array:
            return np.concatenate(groups(t), axis=1)

        every, rows, left = refined(time, np.concatenate(table, axis=1), lines, BETWEEN * SHARE * reach)
        error = float((left / np.where(reach > 0.0, reach, 1.0)).max(initial=0.0))
        found.append(MotionSeries(every, tuple(np.split(rows, np.cumsum(widths)[:-1], axis=1)), error))
    return found


def _times(motion: Motion, jumps: Array) -> Array:
    """The times of a motion's rows and of jumps; the first of two rows of one time is just before it."""
    twin = np.append(np.diff(motion.time) == 0.0, False)
    inside = jumps[(jumps > motion.time[0]) & (jumps < motion.time[-1])]
    return np.unique(np.concatenate([np.where(twin, before(motion.time), motion.time), before(inside), inside]))


def _groups(motion: Motion, function: Function) -> Callable[[Array], list[Array]]:
    def at(time: Array) -> list[Array]:
        q, v, a = motion.at(time)
        return [q, v, a, *function(time, q, v, a)]

    return at
