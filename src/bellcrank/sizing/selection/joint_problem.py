"""What the search for the best combination needs to know of the pairs of each axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bellcrank.sizing.selection.ranking import NOTHING, Indices, RankKey, RankKeys, as_key, order_of

UNKNOWN_MASS = -1  # class of an actuator whose mass is not stated, and of an axis without an actuator
NO_MASS = -2  # class of an actuator that is not there
Choice = tuple[int | None, ...]  # number of the pair of each axis; None where nothing can drive it
Masses = tuple[int, ...]  # class of the actuator of each axis


class JointProblem(Protocol):
    """The pairs of each of k axes, and their ranks under the loads that the actuators' masses cause.

    Pairs of an axis are numbered in the order of their ids. Pairs with the same mass and inertia are of one class,
    because they load other axes alike.
    """

    @property
    def influence(self) -> NDArray[np.bool_]:
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

    def keys(self, axis: int, masses: Masses, rows: NDArray[np.bool_] | None = None) -> RankKeys:
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
    keys = problem.keys(axis, masses)
    order = order_of(keys)
    if len(order) and (keys[order[0], 0] == 0 or problem.kept[axis]):
        return int(order[0])
    return None


def judge_choice(problem: JointProblem, choice: Choice) -> list[RankKey]:
    """The key of each axis where all actuators have the masses of the choice."""
    masses = masses_of(problem, choice)
    return [NOTHING if pair is None else as_key(problem.keys(axis, masses)[pair]) for axis, pair in enumerate(choice)]


def search_order(influence: NDArray[np.bool_]) -> list[list[int]]:
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


def is_ordered(influence: NDArray[np.bool_], group: Sequence[int]) -> bool:
    """Whether a group is one axis whose own mass does not load it."""
    return len(group) == 1 and not influence[group[0], group[0]]


def components(influence: NDArray[np.bool_]) -> list[list[int]]:
    """Axes that do not load each other, directly or through others, apart: such as those of two arms."""
    reach = influence | influence.T | np.eye(len(influence), dtype=bool)
    for _ in range(max(len(influence), 1).bit_length()):
        reach = (reach.astype(np.intp) @ reach) > 0
    return [list(group) for group in sorted({tuple(np.flatnonzero(row).tolist()) for row in reach})]
