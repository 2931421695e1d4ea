"""The largest factor of a motion's speed, with the peaks of its limits' use between samples.

At the factor found with some samples, the use of the limits (a share, 1 at a limit) may exceed 1 between two of them.
Intervals in which it may, judged by its slopes there and beside, are divided until none of them can exceed 1 by more
than EXCESS. A jump of the use, where the power of a gear changes its direction, is divided in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bellcrank._planner import LimitArrays, excess, largest_factor
from bellcrank.arrays import Array
from bellcrank.motion.motion import Motion
from bellcrank.planning.limits.path_limits import PathLimits

Part = tuple[Array, LimitArrays, list[Array]]
MOST = 1e3  # times faster
FIRST = 8  # intervals between two rows
PARTS = 8  # of an interval that is divided
EXCESS = 1e-10  # that is left between samples, as a share of a limit
LEVELS = 14
DIVIDED = 20_000  # intervals at most, those that may exceed most first


@dataclass(frozen=True)
class FactorFound:
    """The largest factor, and where a limit is reached.

    Attributes:
        factor: The factor, MOST at most.
        time: The time at which a limit is reached, s.
        row: The row of that limit; negative for a limit of a speed.
        samples: Times that were looked at (n,), s.
    """

    factor: float
    time: float
    row: int
    samples: Array


def largest_factor_of(motion: Motion, bounds: PathLimits) -> FactorFound:
    """The largest factor k for which all limits are kept for every factor from 1 to k; below 1 where the motion
    exceeds a limit, 0 where no factor keeps them.
    """
    samples = _Samples(motion, bounds, _first(motion.time))
    found = samples.largest()
    for _ in range(LEVELS):
        if not 0.0 < found.factor < MOST:
            break
        between = samples.between(found.factor)
        if not len(between):
            break
        samples.add(between)
        found = samples.largest()
    return replace(found, samples=samples.time)


def _first(time: Array) -> Array:
    """The rows' times and times between them."""
    between = (time[:-1, None] + np.diff(time)[:, None] * (np.arange(FIRST) / FIRST)).ravel()
    return np.unique(np.concatenate([between, time]))


class _Samples:
    """Limits of a motion at its samples, in the parts in which these were added."""

    def __init__(self, motion: Motion, bounds: PathLimits, time: Array) -> None:
        self._motion, self._bounds = motion, bounds
        self._parts = [self._part(time)]

    @property
    def time(self) -> Array:
        """All samples' times, in their order, s."""
        return np.sort(np.concatenate([time for time, _, _ in self._parts]))

    def add(self, time: Array) -> None:
        self._parts.append(self._part(time))

    def _part(self, time: Array) -> Part:
        """Times, the limits there, and the factors at which limits of speed are reached, by limit."""
        q, v, a = self._motion.at(time)
        speeds = [largest for _, largest in self._bounds.speed_limits(q, v, a)]
        return time, self._bounds.of_motion(q, v, a), speeds

    def largest(self) -> FactorFound:
        """Above 1 each sample has its own factor, and the least counts; below 1 one factor must suit all samples."""
        found = self._least()
        if found.factor < 1.0 and len(self._parts) > 1:
            self._parts = [self._part(self.time)]
            found = self._least()
        return found

    def _least(self) -> FactorFound:
        found = []
        for time, arrays, _ in self._parts:
            factor, place, row = largest_factor(arrays, MOST)
            found.append(FactorFound(factor, float(time[place]), row, time))
        return min(found, key=lambda one: one.factor)

    def between(self, factor: float) -> Array:
        """Times within the intervals in which the limits may be exceeded."""
        time = np.concatenate([part[0] for part in self._parts])
        use = np.concatenate([_use(each, factor) for each in self._parts])
        order = np.argsort(time)
        time, use = time[order], use[order]
        step = np.diff(time)
        slope = np.abs(np.diff(use)) / step
        beside = np.pad(slope, 1, mode="edge")
        more = 0.5 * step * (beside[:-2] + slope + beside[2:])
        over = np.maximum(use[:-1], use[1:]) + more - 1.0
        fine = step > 1e-12 * np.max(np.abs(time))  # its parts are different numbers
        there = np.flatnonzero((over > EXCESS) & (more > EXCESS) & fine)
        there = there[np.argsort(over[there])[::-1][:DIVIDED]]
        return np.sort((time[there, None] + step[there, None] * (np.arange(1, PARTS) / PARTS)).ravel())


def _use(part: Part, factor: float) -> Array:
    """The largest share of a limit that is used at each sample."""
    time, arrays, speeds = part
    used = 1.0 + excess(arrays, np.full(len(time), factor), np.zeros(len(time)))
    return np.asarray(np.max([used, *(factor / largest for largest in speeds)], axis=0))
