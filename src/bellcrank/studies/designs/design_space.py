"""The designs of a study: all combinations of the values of some axes, with samples of the others.

Designs are run in ranges. How a study is cut into ranges depends on how long its designs take, and changes nothing
else: a row depends on the values of its own design alone.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bellcrank.arrays import Array, Indices, Mask
from bellcrank.cached_values import Portable, cached_property
from bellcrank.errors import InputError
from bellcrank.memory import check_memory
from bellcrank.studies.designs.axes import StudyAxis
from bellcrank.studies.designs.samples import PointSet

SECONDS = 1.0  # that a range takes: long beside the overhead of a call, short beside what an interruption may lose
LARGEST = 2**15  # designs: bounds the memory of a call
LARGEST_SAVED = 2**16  # designs of one checkpoint
GROWTH = 16  # the first call compiles, so that its time says little
MOST_DESIGNS = 10**7
MOST_DIMENSIONS = 21_201  # of SciPy's Sobol points
BYTES_PER_NUMBER, BYTES_PER_DESIGN = 8.0, 400.0  # of a design with its measures, of which a small scene has 35


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


@dataclass(frozen=True, eq=False)
class DesignSpace(Portable):
    """Designs over a grid of the axes with values, the last axis fastest; each grid point gets all points of the sample
    of the axes with distributions.

    Attributes:
        axes: What is varied.
        sample: The points at which the distributions are sampled; None where no axis has one.

    Raises:
        InputError: Axes with distributions need a sample, a sample needs axes with distributions, and there are at most
            `MOST_DESIGNS` designs.
    """

    axes: tuple[StudyAxis, ...]
    sample: PointSet | None = None

    def __post_init__(self) -> None:
        drawn = [axis.path for axis in self.axes if axis.distribution is not None]
        if drawn and self.sample is None:
            raise InputError(f"'{drawn[0]}' has a distribution: say how many designs are drawn, such as sample 1024")
        if self.sample is not None and not drawn:
            raise InputError("a sample needs a parameter with a distribution, such as normal(1.241 m, 1 mm)")
        if len(drawn) > MOST_DIMENSIONS:
            raise InputError(f"expected at most {MOST_DIMENSIONS} parameters with distributions, found {len(drawn)}")
        if len(self) > MOST_DESIGNS:
            what = "grid" if self.sample is None else "study"
            raise InputError(
                f"the {what} has {len(self)} designs, and a sweep takes at most {MOST_DESIGNS}; vary fewer values"
            )
        check_memory(len(self), BYTES_PER_DESIGN + BYTES_PER_NUMBER * len(self.axes), "designs")

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """The number of values along each axis with values, then the number of points of the sample if there is one."""
        grid = tuple(len(axis) for axis in self.axes if axis.distribution is None)
        return grid if self.sample is None else (*grid, self.sample.count)

    def __len__(self) -> int:
        return self.count

    @property
    def count(self) -> int:
        """The number of designs."""
        return math.prod(self.shape)

    def values(self, first: int = 0, last: int | None = None) -> Array:
        """The values (designs, axes) of designs `first` to `last` (excluded), in the axes' units.

        They do not depend on the range that is asked for.
        """
        last = len(self) if last is None else last
        found = np.empty((max(last - first, 0), len(self.axes)))
        rest = np.arange(first, last)
        if self.sample is not None:
            rest, point = np.divmod(rest, self.sample.count)
            drawn = [k for k, axis in enumerate(self.axes) if axis.distribution is not None]
            for k, coordinate in zip(drawn, self._points(point, len(drawn)).T, strict=True):
                distribution = self.axes[k].distribution
                assert distribution is not None
                found[:, k] = distribution.quantiles(coordinate)
        for k in reversed([k for k, axis in enumerate(self.axes) if axis.distribution is None]):
            rest, place = np.divmod(rest, len(self.axes[k]))
            found[:, k] = self.axes[k].numbers[place]
        return found

    def _points(self, point: Indices, dimensions: int) -> Array:
        """The points of the sample with these numbers, which follow one another and begin again after the last one."""
        assert self.sample is not None
        count = self.sample.count
        if not len(point):
            return np.zeros((0, dimensions))
        if point[0] + len(point) <= count:
            return self.sample.points(int(point[0]), int(point[0]) + len(point), dimensions)
        return self.sample.points(0, count, dimensions)[point]

    @property
    def identity(self) -> Mapping[str, str]:
        """What the designs depend on, by a name that a user understands."""
        found = {}
        for axis in self.axes:
            if axis.distribution is not None:
                found[axis.path] = str(axis.distribution)
                continue
            ends = [axis.shown(axis.numbers[0]), axis.shown(axis.numbers[-1])]
            digest = hashlib.sha256(axis.numbers.tobytes() + repr(axis.choices).encode("utf-8", "replace")).hexdigest()
            values = f"{len(axis)} values from {ends[0]} to {ends[1]} {axis.unit}".strip()
            found[axis.path] = f"{values} ({digest[:12]})"
        if self.sample is not None:
            found["sample"] = self.sample.identity
        return found
