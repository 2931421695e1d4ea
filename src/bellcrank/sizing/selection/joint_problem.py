"""What the search for the best combination needs to know of the pairs of each axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from bellcrank.arrays import Indices, Mask
from bellcrank.sizing.selection.pairs import NOTHING, RankKey, RankKeys, as_key, order_of

UNKNOWN_MASS = -1  # class of an actuator whose mass is not stated, and of an axis without an actuator
FIRST_BLOCK = 256  # pairs that are judged at once; then twice as many each time
NO_MASS = -2  # class of an actuator that is not there
Choice = tuple[int | None, ...]  # number of the pair of each axis; None where nothing can drive it
Masses = tuple[int, ...]  # class of the actuator of each axis


class JointProblem(Protocol):
    """The pairs of each of k axes, and their ranks under the loads that the actuators' masses cause.

    Pairs of an axis are numbered in the order of their ids. Pairs with the same mass and inertia are of one class,
    because they load other axes alike.
    """

    @property
    def influence(self) -> Mask:
        """(k, k) whether the mass of the actuator of axis j (column) changes the load of axis i (row)."""

    @property
    def classes(self) -> Sequence[Indices]:
        """Per axis the class (m,) of each pair, `UNKNOWN_MASS` where its mass is unknown."""

    @property
    def bounds(self) -> Sequence[RankKeys]:
        """Per axis the keys (m, 6) that the pairs' keys do not fall below under any masses."""

    @property
    def kept(self) -> Sequence[bool]:
        """Per axis whether its pair is given, so that it is chosen even where it fails."""

    @property
    def largest(self) -> bool:
        """Whether the objective of a combination is the largest of its pairs', not their sum."""

    @property
    def effort(self) -> int:
        """The effort spent so far, in pairs judged."""

    def keys(self, axis: int, masses: Masses, rows: Mask | None = None) -> RankKeys:
        """The keys (m, 6) of an axis where the actuators are of these classes; only those that load it matter.

        Only the pairs `rows` (m,) need to be judged; the keys of others may be `NOT_JUDGED`.
        """


def masses_of(problem: JointProblem, choice: Choice) -> Masses:
    """The class of each axis's actuator."""
    return tuple(
        UNKNOWN_MASS if pair is None else int(classes[pair])
        for pair, classes in zip(choice, problem.classes, strict=True)
    )


def best_pair(problem: JointProblem, axis: int, masses: Masses) -> int | None:
    """The best pair of an axis under given masses; None where none passes and none is given."""
    ranked = best_pairs(problem, axis, masses, 1)
    if len(ranked):
        return int(ranked[0])
    return int(order_of(problem.keys(axis, masses))[0]) if problem.kept[axis] else None


def best_pairs(problem: JointProblem, axis: int, masses: Masses, most: int) -> Indices:
    """The best pairs of an axis that pass under given masses, best first, at most so many.

    Pairs are judged in the order of their bounds, until no bound of those that are left is below what was found.
    """
    bounds = problem.bounds[axis]
    order = order_of(bounds)
    passing, done, block = order[:0], 0, FIRST_BLOCK
    while done < len(order):
        rows = np.zeros(len(order), dtype=bool)
        judged = order[done : done + block]
        rows[judged] = True
        keys = problem.keys(axis, masses, rows)
        passing = np.sort(np.concatenate([passing, judged[keys[judged, 0] == 0]]))  # equal keys: in the order of ids
        passing = passing[order_of(keys[passing])][:most]
        done, block = done + block, 2 * block
        if len(passing) == most and done < len(order) and as_key(bounds[order[done]]) > as_key(keys[passing[-1]]):
            break
    return passing


def judge_choice(problem: JointProblem, choice: Choice) -> list[RankKey]:
    """The key of each axis where all actuators have the masses of the choice."""
    masses = masses_of(problem, choice)
    keys = []
    for axis, pair in enumerate(choice):
        if pair is None:
            keys.append(NOTHING)
        else:
            rows = np.zeros(len(problem.classes[axis]), dtype=bool)
            rows[pair] = True
            keys.append(as_key(problem.keys(axis, masses, rows)[pair]))
    return keys


def search_order(influence: Mask) -> list[list[int]]:
    """Groups of axes, each after those that load it: from the tip to the base.

    Axes that load each other are one group: the strongly connected components of the influence.
    """
    reach = influence | np.eye(len(influence), dtype=bool)
    for _ in range(max(len(influence), 1).bit_length()):
        reach = (reach.astype(np.intp) @ reach) > 0
    groups = sorted({tuple(np.flatnonzero(row).tolist()) for row in reach & reach.T}, reverse=True)
    ordered: list[list[int]] = []
    placed: set[int] = set()
    while groups:
        ready = next(g for g in groups if set(np.flatnonzero(reach[g[0]]).tolist()) <= placed | set(g))
        groups.remove(ready)
        placed |= set(ready)
        ordered.append(list(ready))
    return ordered


def is_ordered(influence: Mask, group: Sequence[int]) -> bool:
    """Whether a group is one axis whose own mass does not load it."""
    return len(group) == 1 and not influence[group[0], group[0]]


def components(influence: Mask) -> list[list[int]]:
    """Axes that do not load each other, directly or through others, apart: such as those of two arms."""
    reach = influence | influence.T | np.eye(len(influence), dtype=bool)
    for _ in range(max(len(influence), 1).bit_length()):
        reach = (reach.astype(np.intp) @ reach) > 0
    return [list(group) for group in sorted({tuple(np.flatnonzero(row).tolist()) for row in reach})]
