"""Points for Sobol indices: two samples A and B of the unit cube, and A with one column of B, for each column.

A. Saltelli et al., Variance based sensitivity analysis of model output, Comput. Phys. Commun. 181 (2010) 259-270,
section 3: A and B are the halves of the points of a Sobol sequence of twice the dimensions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array, Indices
from bellcrank.cached_values import Portable, cached_property
from bellcrank.studies.designs.samples import REPLICATES
from bellcrank.studies.results.intervals import LEAST_REPLICATES, SampleLayout

MOST_REPLICATES = 10_000
LARGEST_SIZE = 2**24
_HALF_CELL = 2.0**-31  # Sobol points of 30 bits are the lower ends of their cells; 0 would be an infinite quantile


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
