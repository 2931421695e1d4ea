"""Combinations of one pair an axis that no other one betters in every respect: the Pareto front.

A point holds the total mass, the largest utilisation, the total loss and the total cost of a combination; all are
minimised, and an unknown value counts as infinite, so that it betters nothing. A point is dominated by another that is
nowhere larger and somewhere smaller.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
MASS, USE, LOSS, COST = range(4)


def non_dominated(points: Array) -> Indices:
    """Row numbers, rising, of the points (n, d) that no other one dominates; of equal ones the first."""
    order = np.lexsort((np.arange(len(points)), *points.T[::-1]))
    remaining, found = order, []
    while len(remaining):  # the lexicographically smallest one is dominated by none
        first, remaining = remaining[0], remaining[1:]
        found.append(first)
        remaining = remaining[(points[remaining] < points[first]).any(axis=1)]
    return np.sort(np.array(found, dtype=np.intp))


@dataclass(frozen=True, eq=False)
class Front:
    """Some combinations of the first axes, or of all.

    Attributes:
        points: (n, 4) mass, largest utilisation, loss and cost.
        pairs: (n, axes) number of the pair of each axis, in the order in which the axes were added.
    """

    points: Array
    pairs: Indices

    @classmethod
    def empty(cls) -> Front:
        """The combination of no axis."""
        return cls(np.zeros((1, 4)), np.zeros((1, 0), dtype=np.intp))

    def non_dominated(self) -> Front:
        """Without the dominated ones."""
        rows = non_dominated(self.points)
        return Front(self.points[rows], self.pairs[rows])

    def with_front(self, other: Front) -> Front:
        """Each combination with each of another front, which is over other axes."""
        n, m = len(self.points), len(other.points)
        return Front(
            joined(np.repeat(self.points, m, axis=0), np.tile(other.points, (n, 1))),
            np.column_stack([np.repeat(self.pairs, m, axis=0), np.tile(other.pairs, (n, 1))]).astype(np.intp),
        )

    def thinned(self, most: int) -> Front:
        """At most so many of the combinations, spread evenly over the order of their points."""
        if len(self.points) <= most:
            return self
        order = np.lexsort(self.points.T[::-1])
        rows = np.sort(order[np.unique(np.linspace(0, len(order) - 1, most).round().astype(np.intp))])
        return Front(self.points[rows], self.pairs[rows])

    @classmethod
    def of(cls, fronts: Sequence[Front], axes: int) -> Front:
        """All combinations of several fronts over the same axes; there may be none."""
        none = Front(np.zeros((0, 4)), np.zeros((0, axes), dtype=np.intp))
        every = [none, *fronts]
        return cls(np.concatenate([one.points for one in every]), np.concatenate([one.pairs for one in every]))


def joined(first: Array, second: Array) -> Array:
    """Points (…, 4) of combinations of two: masses, losses and costs add up, the larger utilisation counts."""
    total = first + second
    total[..., USE] = np.maximum(first[..., USE], second[..., USE])
    return total
