"""Points of the unit cube: Sobol points, Latin hypercubes, or independent random points.

Points i to k of a sample are the same whichever range is asked for. Sobol points are scrambled (A. B. Owen, Scrambling
Sobol' and Niederreiter-Xing points, J. Complexity 14 (1998) 466-489) and balanced only where their number is a power of
two. The error of what Sobol points or Latin hypercubes estimate follows from replicates: parts of the sample that are
scrambled independently.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import Portable, cached_property
from bellcrank.memory import check_memory
from bellcrank.scene.study import METHODS

LARGEST_SEED = 2**63 - 1
REPLICATES = 16  # Student's t is 2.13 then; 10 would need 6 % wider intervals
LEAST_PART = 64  # points of a replicate: smaller samples have none
_LEAST, _MOST = 2.0**-54, 1.0 - 2.0**-53  # quantiles of 0 and 1 may be infinite
_HALF_CELL = 2.0**-31  # SciPy's Sobol points are multiples of 2**-30, 0 among them


class PointSet(Protocol):
    """Points of unit cubes."""

    @property
    def count(self) -> int:
        """The number of points."""

    @property
    def note(self) -> str:
        """What the user should know about the number of points; empty where there is nothing."""

    @property
    def identity(self) -> str:
        """What the points depend on, in words."""

    def points(self, first: int, last: int, dimensions: int) -> Array:
        """Points `first` to `last` (excluded), (points, dimensions), with numbers between 0 and 1 (excluded)."""


@dataclass(frozen=True)
class Sample(Portable):
    """Points of a unit cube.

    Attributes:
        count: The number of points.
        method: One of `METHODS`.
        seed: Of the random numbers.
        replicates: The number of parts of equal size that are scrambled independently; they follow one another.
    """

    count: int
    method: str = "sobol"
    seed: int = 0
    replicates: int = 1

    def __post_init__(self) -> None:
        if self.method not in METHODS or self.count < 1 or self.replicates < 1 or self.count % self.replicates:
            raise ValueError(f"{self.count} points cannot be {self.replicates} replicates of method {self.method}")

    @classmethod
    def of(cls, count: int, method: str = "sobol", seed: int = 0) -> Sample:
        """A sample with 16 replicates where each has at least 64 points, else with one."""
        many = method != "random" and count % REPLICATES == 0 and count >= REPLICATES * LEAST_PART
        return cls(count, method, seed, REPLICATES if many else 1)

    @property
    def note(self) -> str:
        """Advice about the number of Sobol points; empty where there is none."""
        part = self.count // self.replicates
        if self.method != "sobol" or part & (part - 1) == 0:
            return ""
        below = 1 << (self.count.bit_length() - 1)
        return (
            f"{self.count} Sobol points are not balanced, so that estimates from them have larger errors; choose a "
            f"power of two, such as {below} or {2 * below}"
        )

    @property
    def identity(self) -> str:
        """What the points depend on, in words."""
        parts = f" in {self.replicates} replicates" if self.replicates > 1 else ""
        return f"{self.count} points{parts}, method {self.method}, seed {self.seed}"

    def points(self, first: int, last: int, dimensions: int) -> Array:
        """Points `first` to `last` (excluded) as an array (points, dimensions) with numbers between 0 and 1."""
        if self.method == "random":
            bits = np.random.PCG64(self.seed).advance(first * dimensions)
            found = np.random.Generator(bits).random((last - first, dimensions))
            return np.clip(found, _LEAST, _MOST)
        part, parts = self.count // self.replicates, []
        for replicate in range(first // part, -(-last // part)):
            begin = replicate * part
            found = self._replicate(replicate, dimensions, max(first - begin, 0), min(last - begin, part))
            parts.append(found)
        return np.clip(np.concatenate(parts) if parts else np.zeros((0, dimensions)), _LEAST, _MOST)

    def _replicate(self, replicate: int, dimensions: int, first: int, last: int) -> Array:
        from scipy.stats import qmc

        source = np.random.default_rng([self.seed, replicate])
        if self.method == "sobol":
            engine = qmc.Sobol(dimensions, scramble=True, seed=source)
            start = engine.random(1)  # by itself: otherwise SciPy warns of counts, which `note` tells of
            if first:
                engine.fast_forward(first - 1)
            found = engine.random(last - max(first, 1))
            return np.asarray((found if first else np.concatenate([start, found])[:last]) + _HALF_CELL)
        key = (replicate, dimensions)
        if key not in self._kept:  # a point of a Latin hypercube depends on all others
            check_memory(self.count // self.replicates, 24.0 * dimensions, "points of a Latin hypercube")
            self._kept.clear()
            self._kept[key] = qmc.LatinHypercube(dimensions, seed=source).random(self.count // self.replicates)
        return self._kept[key][first:last]

    @cached_property
    def _kept(self) -> dict[tuple[int, int], Array]:
        return {}
