"""Ranges of the designs of a study: which are still to be run, and how many are run in one call.

How a study is cut into ranges depends on how long its designs take, and changes nothing else: a row depends on the
values of its own design alone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bellcrank.arrays import Mask

SECONDS = 1.0  # that a range takes: long beside the overhead of a call, short beside what an interruption may lose
LARGEST = 2**15  # designs: bounds the memory of a call
LARGEST_SAVED = 2**16  # designs of one checkpoint
GROWTH = 16  # the first call compiles, so that its time says little


class DesignRange(NamedTuple):
    """The designs `first`, …, `stop` − 1 of a study."""

    first: int
    stop: int

    @property
    def size(self) -> int:
        """The number of designs."""
        return self.stop - self.first


def true_ranges(mask: Mask) -> list[DesignRange]:
    """The ranges in which a mask of designs is true, in increasing order."""
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False)).tolist()
    return [DesignRange(first, stop) for first, stop in zip(edges[::2], edges[1::2], strict=True)]


class UndoneDesigns:
    """Gives out the designs that are still to be run, as ranges in increasing order.

    Attributes:
        count: How many are not given out.
    """

    def __init__(self, done: Mask) -> None:
        self._left = true_ranges(~done)[::-1]
        self.count = int((~done).sum())

    def take(self, most: int) -> DesignRange | None:
        """The next range, of at most `most` designs; None where all are given out."""
        if not self._left:
            return None
        first, stop = self._left.pop()
        if stop - first > most:
            self._left.append(DesignRange(first + most, stop))
            stop = first + most
        self.count -= stop - first
        return DesignRange(first, stop)


class RangeSize:
    """How many designs are run in one call: as many as take about a second, from `least` to `LARGEST`."""

    def __init__(self, least: int) -> None:
        self.least = min(least, LARGEST)
        self.count = self.least

    def learn(self, count: int, seconds: float) -> None:
        """Take into account that `count` designs took `seconds`."""
        fitting = int(count * SECONDS / max(seconds, 1e-6))
        self.count = min(max(fitting, self.least), GROWTH * max(count, self.least), LARGEST)
