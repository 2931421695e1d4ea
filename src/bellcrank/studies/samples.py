"""Points of the unit cube: Sobol points, a Latin hypercube, or independent random points.

Points i to k of a sample can be computed without those before, and are the same whichever range is asked for. Sobol
points are scrambled (Owen, J. Complexity 14, 1998) and balanced only where their number is a power of two.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bellcrank.cached_values import Portable, cached_property
from bellcrank.memory import check_memory

Array = NDArray[np.float64]
METHODS = ("sobol", "latin", "random")
LARGEST_SEED = 2**63 - 1
MOST_DIMENSIONS = 21_201  # of SciPy's Sobol points
_LEAST, _MOST = 2.0**-54, 1.0 - 2.0**-53  # quantiles of 0 and 1 may be infinite
_HALF_CELL = 2.0**-31  # SciPy's Sobol points are multiples of 2**-30, 0 among them


@dataclass(frozen=True)
class Sample(Portable):
    """Points of a unit cube.

    Attributes:
        count: The number of points.
        method: One of `METHODS`.
        seed: Of the random numbers.
    """

    count: int
    method: str = "sobol"
    seed: int = 0

    @property
    def note(self) -> str:
        """Advice about the number of points; empty where there is none."""
        if self.method != "sobol" or self.count & (self.count - 1) == 0:
            return ""
        below = 1 << (self.count.bit_length() - 1)
        return (
            f"{self.count} Sobol points are not balanced: their means have larger errors than those of a power of two, "
            f"such as {below} or {2 * below}"
        )

    def points(self, first: int, last: int, dimensions: int) -> Array:
        """Points `first` to `last` (excluded) as an array (points, dimensions) of numbers between 0 and 1 (excluded)."""
        if self.method == "random":
            bits = np.random.PCG64(self.seed).advance(first * dimensions)
            found = np.random.Generator(bits).random((last - first, dimensions))
        elif self.method == "latin":
            found = self._hypercube(dimensions)[first:last]
        else:
            from scipy.stats import qmc

            engine = qmc.Sobol(dimensions, scramble=True, seed=np.random.default_rng(self.seed))
            start = engine.random(1)  # by itself: otherwise SciPy warns of counts that `note` is about
            if first:
                engine.fast_forward(first - 1)
            found = engine.random(last - max(first, 1))
            found = (found if first else np.concatenate([start, found])[:last]) + _HALF_CELL
        return np.clip(found, _LEAST, _MOST)

    def _hypercube(self, dimensions: int) -> Array:
        """All points, since a point of a Latin hypercube depends on all others."""
        if dimensions not in self._kept:
            from scipy.stats import qmc

            check_memory(self.count, 24.0 * dimensions, "points of a Latin hypercube")
            engine = qmc.LatinHypercube(dimensions, seed=np.random.default_rng(self.seed))
            self._kept[dimensions] = engine.random(self.count)
        return self._kept[dimensions]

    @cached_property
    def _kept(self) -> dict[int, Array]:
        return {}
