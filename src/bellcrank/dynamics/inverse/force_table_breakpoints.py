"""Times at which tabulated forces of a scene are not smooth, and on which side of a jump they are evaluated."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.elements.signals import SMALL_JUMP

if TYPE_CHECKING:
    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.motion.motion import Motion

SAME_TIME = 1e-12  # s, or of a time beyond 1 s: the rounding between a row of a motion and one of a table
LEAST_APART = 1e-9  # the same, between a row of a motion and a row of a table that is added to it


def force_times(time: Array, end: float | None = None) -> Array:
    """Times (n,) s at which tables are evaluated for the rows of a motion with times `time` (n,).

    Where a time occurs twice, tables are evaluated before their jump for the first row and after it for the second. A
    table that jumps at the end of the motion, at `end` s, is evaluated before its jump.
    """
    repeated = np.diff(time) == 0.0
    width = SAME_TIME * np.maximum(1.0, np.abs(time))
    sided = time - width * np.append(repeated, False) + width * np.insert(repeated, 0, False)
    return np.asarray(sided if end is None else np.minimum(sided, end - SAME_TIME * max(1.0, abs(end))))


def force_breaks(mechanism: Mechanism) -> Array:
    """Times (m,) s at which a table of the scene has a row, where its value or a derivative may jump."""
    sources = [force.source for force in mechanism.equations.forces if force.source is not None]
    return np.unique(np.concatenate([np.zeros(0), *[source.signal.breaks for source in sources]]))


def with_force_rows(mechanism: Mechanism, motion: Motion) -> Motion:
    """The motion with additional rows at the rows of the scene's tables; two rows where a table jumps.

    Files and plots of the motion's rows then show the effect of these forces. A row whose time differs from a table's
    only by rounding gets the table's time, so that their jumps coincide.
    """
    breaks = force_breaks(mechanism)
    motion = _at_table_times(motion, breaks)
    breaks = breaks[(breaks > motion.time[0]) & (breaks < motion.time[-1])]
    row = np.searchsorted(motion.time, breaks)
    near = np.where(
        breaks - motion.time[np.maximum(row - 1, 0)] < motion.time[row] - breaks, np.maximum(row - 1, 0), row
    )
    apart = np.abs(motion.time[near] - breaks) / np.maximum(1.0, breaks)
    there, jumps = apart <= SAME_TIME, _jumps(mechanism, breaks)
    rows = np.unique(near[there & jumps])  # to be repeated
    rows = rows[(rows > 0) & (rows < len(motion) - 1) & ~np.isin(motion.time[rows], _repeated_times(motion))]
    new = apart > LEAST_APART
    added = np.concatenate([motion.time[rows], breaks[new], breaks[new & jumps]])
    if not len(added):
        return motion
    added = np.sort(added)
    at = np.searchsorted(motion.time, added, side="right")
    time = np.insert(motion.time, at, added)
    states = zip((motion.position, motion.velocity, motion.acceleration), motion.at(added), strict=True)
    q, v, a = (np.insert(old, at, more, axis=0) for old, more in states)
    return replace(motion, time=time, position=q, velocity=v, acceleration=a)


def _at_table_times(motion: Motion, breaks: Array) -> Motion:
    """The motion, times of its rows that differ from breaks (s) only by rounding set to these."""
    if not len(breaks):
        return motion
    after = np.clip(np.searchsorted(breaks, motion.time), 1, len(breaks) - 1)
    low, high = breaks[after - 1], breaks[after]
    nearest = np.where(motion.time - low < high - motion.time, low, high)
    apart = np.abs(nearest - motion.time)
    time = np.where(apart <= SAME_TIME * np.maximum(1.0, np.abs(motion.time)), nearest, motion.time)
    return motion if np.array_equal(time, motion.time) else replace(motion, time=time)


def _repeated_times(motion: Motion) -> Array:
    """The times that occur twice."""
    return np.asarray(motion.time[1:][np.diff(motion.time) == 0.0])


def _jumps(mechanism: Mechanism, times: Array) -> Mask:
    """Whether a table jumps at each of these times."""
    found = np.zeros(len(times), dtype=bool)
    for force in mechanism.equations.forces:
        if force.source is not None:
            signal = force.source.signal
            before, after = signal.at(np.nextafter(times, -np.inf)), signal.at(times)
            scale = np.abs(signal.at(signal.breaks)).max(initial=0.0)
            found |= (np.abs(after - before) > SMALL_JUMP * scale).any(axis=1)
    return found
