"""The Pareto front of the combinations of all axes.

On small catalogues it is exact: the front of an axis and of all axes after it follows from those with each mass that
its actuator can have, because a pair adds to masses, losses and costs, and can only raise the largest utilisation.
Elsewhere the fronts of the axes under the masses of the chosen actuators are combined; of an axis with very many pairs
a sample over the range of masses, and the best pairs, stand for all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bellcrank.arrays import Array, Indices, Mask
from bellcrank.sizing.selection.joint_problem import (
    NO_MASS,
    Choice,
    Masses,
    is_ordered,
    judge_choice,
    masses_of,
    search_order,
)
from bellcrank.sizing.selection.judged_axes import PAIRS_OF_A_JUDGEMENT, JudgedAxes
from bellcrank.sizing.selection.pairs import RankKeys, order_of
from bellcrank.sizing.selection.selection import ParetoPoint, pair_id

MOST_POINTS = 200  # of a front between axes
MOST_OF_AN_AXIS = 40
MOST_JUDGED = 6_000  # pairs of an axis whose utilisations a front is made of, where it is not exact
EXACT = "all combinations that no other one betters, of pairs that are known as well as the chosen ones"
PER_AXIS = (
    "approximate: combined from the best pairs of each axis under the masses of the chosen actuators, of pairs that "
    "are known as well as the chosen ones"
)


def pareto_front(problem: JudgedAxes, choice: Choice, effort: int) -> tuple[tuple[ParetoPoint, ...], str]:
    """Combinations that no other one betters in mass, largest utilisation, loss and cost together.

    Only pairs count that pass and are known at least as well as the chosen pair of their axis: a pair of which little
    is known would seem to have a small utilisation.

    Args:
        problem: The pairs.
        choice: What was chosen.
        effort: How many pairs may be judged for an exact front.

    Returns:
        The points in the order of their mass, and what is proven of them.
    """
    if not all(choice_pair is not None for choice_pair in choice):
        return (), "there is none, because nothing can drive an axis"
    search = _FrontSearch(problem, choice)
    if any(key[0] for key in search.chosen):
        return (), "there is none, because a given pair fails"
    exact = search.exact_effort(effort) <= effort
    front, thinned = (search.exact(0, (NO_MASS,) * len(choice)), False) if exact else search.combined()
    exact = exact or not (problem.influence.any() or thinned)
    places = np.argsort(np.array(search.order))
    points = [_point(problem, point, row[places]) for point, row in zip(front.points, front.pairs, strict=True)]
    return tuple(sorted(points, key=_place)), EXACT if exact else PER_AXIS


class _FrontSearch:
    """The fronts of the axes, from the tip to the base."""

    def __init__(self, problem: JudgedAxes, choice: Choice) -> None:
        self.problem, self.choice = problem, choice
        self.groups = search_order(problem.influence)
        self.order = [axis for group in self.groups for axis in group]
        self.masses = masses_of(problem, choice)
        self.chosen = judge_choice(problem, choice)

    def rows(self, axis: int, masses: Masses, sampled: bool = False) -> tuple[Array, Indices]:
        """The points of an axis's pairs that count, or of a sample of them, and their numbers."""
        wanted = self.sample(axis) if sampled else self.may_count(axis)
        ranks, one = self.problem.ranks(axis, masses, wanted), self.problem.axes[axis]
        pairs = np.flatnonzero(self._counts(axis, ranks.keys))
        columns = (one.bodies.mass, ranks.use, ranks.loss, one.cost)
        points = np.column_stack([np.where(np.isnan(column[pairs]), np.inf, column[pairs]) for column in columns])
        return points, pairs

    def may_count(self, axis: int) -> Mask:
        """Pairs of an axis that may count, under any masses; others need not be judged."""
        return self._counts(axis, self.problem.bounds[axis])

    def sample(self, axis: int) -> Mask:
        """Those pairs that may count, or if they are too many, some evenly over the order of their bounds."""
        may = self.may_count(axis)
        count = np.count_nonzero(may)
        if count <= MOST_JUDGED:
            return may
        order = order_of(self.problem.bounds[axis])
        order = order[may[order]]
        chosen = np.zeros(len(may), dtype=bool)
        chosen[order[np.linspace(0, count - 1, MOST_JUDGED).astype(np.intp)]] = True
        if (pair := self.choice[axis]) is not None:
            chosen[pair] = True
        return chosen

    def _counts(self, axis: int, keys: RankKeys) -> Mask:
        """Whether (m,) pairs of these keys pass and are known at least as well as the chosen pair of the axis."""
        _, partial, unknown, *_ = self.chosen[axis]
        known = (keys[:, 1] < partial) | ((keys[:, 1] == partial) & (keys[:, 2] <= unknown))
        return np.asarray((keys[:, 0] == 0) & known)

    def exact_effort(self, most: int) -> float:
        """How many pairs an exact front would judge; infinite if more than `most`, or where axes load each other."""
        problem, nodes, effort = self.problem, 1, 0
        if not all(is_ordered(problem.influence, group) for group in self.groups):
            return math.inf
        for axis in self.order:
            rows = self.may_count(axis)
            effort += nodes * (int(np.count_nonzero(rows)) + PAIRS_OF_A_JUDGEMENT)
            if effort > most:
                return math.inf
            passing = problem.keys(axis, self.masses, rows)[:, 0] == 0
            nodes *= max(len(np.unique(problem.classes[axis][passing])), 1)
        return effort

    def exact(self, depth: int, masses: Masses) -> Front:
        """The front of an axis and those after it, where the axes before have these masses."""
        if depth == len(self.order):
            return Front.empty()
        axis = self.order[depth]
        points, pairs = self.rows(axis, masses)
        classes = self.problem.classes[axis][pairs]
        fronts = []
        for body in np.unique(classes):
            mine = np.flatnonzero(classes == body)
            mine = mine[non_dominated(points[mine])]
            own = Front(points[mine], pairs[mine][:, None])
            after = self.exact(depth + 1, (*masses[:axis], int(body), *masses[axis + 1 :]))
            fronts.append(own.with_front(after))
        return Front.of(fronts, len(self.order) - depth).non_dominated()

    def combined(self) -> tuple[Front, bool]:
        """The fronts of all axes under the masses of the chosen actuators, combined; whether any was thinned out."""
        front, thinned = Front.empty(), False
        for axis in self.order:
            points, pairs = self.rows(axis, self.masses, sampled=True)
            thinned |= int(np.count_nonzero(self.may_count(axis))) > MOST_JUDGED
            own = Front(points, pairs[:, None]).non_dominated()
            front = front.with_front(own.thinned(MOST_OF_AN_AXIS)).non_dominated()
            thinned |= len(own.points) > MOST_OF_AN_AXIS or len(front.points) > MOST_POINTS
            front = front.thinned(MOST_POINTS)
        return front, thinned


def _point(problem: JudgedAxes, point: Array, pairs: Indices) -> ParetoPoint:
    mass, use, loss, cost = (float(value) if math.isfinite(value) else None for value in point)
    ids = tuple(pair_id(*one.pairs.rows(int(pair))) for one, pair in zip(problem.axes, pairs, strict=True))
    return ParetoPoint(mass, use or 0.0, loss, cost, ids)


def _place(point: ParetoPoint) -> tuple[float, float, tuple[str, ...]]:
    return (math.inf if point.mass is None else point.mass, point.largest_use, point.pairs)


# ---- Combinations of one pair an axis that no other one betters in every respect: the Pareto front.
#
# A point holds the total mass, the largest utilisation, the total loss and the total cost of a combination; all are
# minimised, and an unknown value counts as infinite, so that it betters nothing. A point is dominated by another that
# is nowhere larger and somewhere smaller.


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
