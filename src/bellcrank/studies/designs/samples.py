"""Points of the unit cube: Sobol points, Latin hypercubes, or independent random points.

Points i to k of a sample are the same whichever range is asked for. Sobol points are scrambled (A. B. Owen, Scrambling
Sobol' and Niederreiter-Xing points, J. Complexity 14 (1998) 466-489) and balanced only where their number is a power of
two. The error of what Sobol points or Latin hypercubes estimate follows from replicates: parts of the sample that are
scrambled independently.

For Sobol indices two samples A and B, and A with one column of B, for each column: A. Saltelli et al., Variance based
sensitivity analysis of model output, Comput. Phys. Commun. 181 (2010) 259-270, section 3: A and B are the halves of the
points of a Sobol sequence of twice the dimensions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array, Indices
from bellcrank.cached_values import Portable, cached_property
from bellcrank.memory import check_memory
from bellcrank.scene.study import METHODS
from bellcrank.studies.results.intervals import LEAST_REPLICATES, SampleLayout

LARGEST_SEED = 2**63 - 1
REPLICATES = 16  # Student's t is 2.13 then; 10 would need 6 % wider intervals
LEAST_PART = 64  # points of a replicate: smaller samples have none
_LEAST, _MOST = 2.0**-54, 1.0 - 2.0**-53  # quantiles of 0 and 1 may be infinite
_HALF_CELL = 2.0**-31  # SciPy's Sobol points are multiples of 2**-30, 0 among them
MOST_REPLICATES = 10_000
LARGEST_SIZE = 2**24


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


@dataclass(frozen=True)
class SensitivitySample(Portable):
    """Blocks of d + 2 points of the unit cube of d dimensions: A, B, and A with column 1, …, d of B.

    Attributes:
        dimensions: d, the number of parameters.
        size: The number of blocks of a replicate, a power of two.
        replicates: The number of independent scramblings of the Sobol sequence; they follow one another.
        seed: Of the scramblings.
    """

    dimensions: int
    size: int
    replicates: int = REPLICATES
    seed: int = 0

    def __post_init__(self) -> None:
        arguments.whole("replicates", self.replicates, least=LEAST_REPLICATES, most=MOST_REPLICATES)
        size = arguments.whole("n", self.size, least=2, most=LARGEST_SIZE)
        if size & (size - 1):
            below = 1 << (size.bit_length() - 1)
            arguments.refuse("n", f"a power of two, such as {below} or {2 * below}", size)

    @property
    def block(self) -> int:
        """The number of points of a block."""
        return self.dimensions + 2

    @property
    def count(self) -> int:
        """The number of points."""
        return self.replicates * self.size * self.block

    @property
    def note(self) -> str:
        """What the user should know about the number of points: nothing, it is balanced."""
        return ""

    @property
    def content(self) -> str:
        """Of which points the sample consists."""
        return (
            f"{self.count} designs: {self.replicates} scramblings of {self.size} Sobol points with "
            f"{self.dimensions} + 2 designs each"
        )

    @property
    def identity(self) -> str:
        """What the points depend on."""
        return f"{self.count} points for Sobol indices in {self.replicates} replicates, seed {self.seed}"

    def points(self, first: int, last: int, dimensions: int) -> Array:
        """Points `first`, …, `last` - 1 as an array (points, dimensions) of numbers between 0 and 1, ends excluded."""
        if dimensions != self.dimensions:
            raise ValueError(f"expected {self.dimensions} dimensions, found {dimensions}")
        rows = np.arange(first, last)
        replicate, inner = np.divmod(rows, self.size * self.block)
        found = np.empty((len(rows), dimensions))
        for number in np.unique(replicate).tolist():
            here = replicate == number
            place, kind = np.divmod(inner[here], self.block)
            halves = self._scrambled(number)[place].reshape(-1, 2, dimensions)
            from_b = (kind[:, None] == 1) | (kind[:, None] == np.arange(2, self.block))
            found[here] = np.where(from_b, halves[:, 1], halves[:, 0])
        return found

    def layout(self) -> SampleLayout:
        """How the points A and B depend on each other, which together are a sample of 2 × size points a replicate."""
        return SampleLayout.sobol(2 * self.replicates * self.size, self.replicates, 2 * self.dimensions)

    def sampled(self) -> Indices:
        """The numbers of the points A and B, replicate by replicate; they follow the distributions, as A_B does not
        independently of them.
        """
        starts = self.block * np.arange(self.replicates * self.size)
        return np.stack([starts, starts + 1], axis=1).ravel()

    def _scrambled(self, replicate: int) -> Array:
        """The points (size, 2 d) of one scrambling; those of the last are kept."""
        if replicate not in self._kept:
            from scipy.stats import qmc

            source = np.random.default_rng([self.seed, replicate])
            self._kept.clear()
            self._kept[replicate] = qmc.Sobol(2 * self.dimensions, seed=source).random(self.size) + _HALF_CELL
        return self._kept[replicate]

    @cached_property
    def _kept(self) -> dict[int, Array]:
        return {}
