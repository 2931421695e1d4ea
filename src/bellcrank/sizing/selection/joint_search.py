"""The best combination of one pair an axis, where the mass of each actuator loads other axes.

The axes are chosen one after the other, each after those whose masses load it (from the tip to the base), so that the
loads of an axis are known when its pairs are judged. This is a depth-first branch and bound (Land and Doig, 1960): a
branch is left out where the best that its remaining axes could reach is no better than what was found. Pairs of one
axis with the same mass and inertia load the others alike, so only the best of them is followed.

Axes that load each other, or themselves, cannot be ordered: their masses are assumed, one combination after the other,
and their pairs of these masses judged together. The effort is limited; `SearchResult.open` is the number
of combinations that were then neither tried nor excluded.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from bellcrank.arrays import Indices, Mask
from bellcrank.sizing.selection.joint_problem import (
    NO_MASS,
    UNKNOWN_MASS,
    Choice,
    JointProblem,
    best_pair,
    components,
    is_ordered,
    judge_choice,
    masses_of,
    search_order,
)
from bellcrank.sizing.selection.pairs import NOTHING, RankKey, RankKeys, as_key, less_than, order_of, smallest, total

Pair = int | None


@dataclass(frozen=True)
class SearchResult:
    """The best combination found; `open` combinations were neither tried nor excluded."""

    choice: Choice
    open: int


def best_combination(
    problem: JointProblem,
    effort: int,
    start: Choice | None = None,
    accept: Callable[[Choice], bool] | None = None,
) -> SearchResult | None:
    """The best combination.

    Args:
        problem: The pairs and their keys.
        effort: How much effort the search may spend, after a first combination has been found.
        start: A combination known beforehand, found again where none is better.
        accept: Whether a combination is permitted; all pairs are then followed, not the best of each mass.

    Returns:
        The result; None where no combination was found.
    """
    parts = [list(range(len(problem.classes)))] if accept else components(problem.influence)
    groups = search_order(problem.influence)
    choice: list[Pair] = [None] * len(problem.classes)
    count, limit = 1, problem.effort + effort
    exact = True
    for axes in parts:
        if accept is None and is_ordered(problem.influence, axes):  # nothing else loads it: its best pair is the best
            choice[axes[0]] = best_pair(problem, axes[0], (NO_MASS,) * len(choice))
            continue
        search = _Search(problem, [g for g in groups if g[0] in axes], limit, accept, start)
        search.descend(0, [])
        if search.best is None:
            return None
        for axis in axes:
            choice[axis] = search.found[axis]
        exact &= search.open == 0
        count *= search.open + 1  # the one found, and those that are open
    return SearchResult(tuple(choice), 0 if exact else count - 1)


@dataclass
class _Search:
    """The branch and bound over some groups of axes."""

    problem: JointProblem
    groups: list[list[int]]
    limit: int
    accept: Callable[[Choice], bool] | None
    start: Choice | None
    open: int = 0
    best: RankKey | None = None
    pairs: list[Pair] = field(init=False)

    def __post_init__(self) -> None:
        problem = self.problem
        self.axes = [axis for group in self.groups for axis in group]
        least = [smallest(problem.bounds[axis]) for axis in self.axes]
        self.rest = [least[depth:] for depth in range(len(least) + 1)]
        self.pairs = [None] * len(problem.classes)
        self.masses = [UNKNOWN_MASS] * len(problem.classes)
        self.found: Choice = tuple(self.pairs)
        if self.start is not None and (self.accept is None or self.accept(self.start)):
            self.found = self.start
            for axis in self.axes:
                self._take(axis, self.start[axis])
            keys = judge_choice(problem, self.start)
            self.best = total([keys[axis] for axis in self.axes], problem.largest)

    def descend(self, group: int, keys: list[RankKey]) -> None:
        """Choose the axes of a group and of those after it; `keys` are those of the axes before."""
        if group == len(self.groups):
            self._finish(keys)
        elif not is_ordered(self.problem.influence, self.groups[group]):
            self._assume(group, keys, [])
        else:
            self._choose(group, keys)

    def _choose(self, group: int, keys: list[RankKey]) -> None:
        """Choose an axis whose loads are known."""
        (axis,) = self.groups[group]
        axis_keys = self._keys(axis, self._promising(axis, keys))
        pairs = self._options(axis, axis_keys, order_of(axis_keys))
        for place in range(max(len(pairs), 1)):
            pair = int(pairs[place]) if len(pairs) else None
            extended = [*keys, NOTHING if pair is None else as_key(axis_keys[pair])]
            if self._excluded(extended):
                return  # the pairs are ranked, so the others are no better
            if self._exhausted():
                self._leave(keys, axis_keys[pairs[place:]])
                return
            self._take(axis, pair)
            self.descend(group + 1, extended)

    def _options(self, axis: int, keys: RankKeys, ranked: Indices) -> Indices:
        """Those of ranked pairs that are followed: that pass, and of each mass the best."""
        passing = ranked[keys[ranked, 0] == 0]
        if not len(passing) and self.problem.kept[axis]:
            return ranked[:1]
        return passing if self.accept else self._one_a_class(axis, passing)

    def _one_a_class(self, axis: int, ranked: Indices) -> Indices:
        _, first = np.unique(self.problem.classes[axis][ranked], return_index=True)
        return ranked[np.sort(first)]

    def _assume(self, group: int, keys: list[RankKey], assumed: list[Indices]) -> None:
        """Assume the masses of a group's axes one after the other, then judge their pairs of these masses."""
        if len(assumed) == len(self.groups[group]):
            self._judge_assumed(group, keys[: len(keys) - len(assumed)], assumed)
            return
        axis = self.groups[group][len(assumed)]
        bounds, classes = self.problem.bounds[axis], self.problem.classes[axis]
        ranked = order_of(bounds)
        for pair in self._one_a_class(axis, ranked).tolist():
            extended = [*keys, as_key(bounds[pair])]
            if self._excluded(extended):
                return
            same = np.flatnonzero(classes == classes[pair])
            if self._exhausted():
                self._leave(keys, bounds[ranked[int(np.flatnonzero(ranked == pair)[0]) :]])
                return
            self._take(axis, pair)
            self._assume(group, extended, [*assumed, same])

    def _judge_assumed(self, group: int, keys: list[RankKey], assumed: list[Indices]) -> None:
        """Judge the pairs of assumed masses; where none passes on an axis, these masses are impossible."""
        options: list[tuple[Indices, RankKeys]] = []
        for axis, same in zip(self.groups[group], assumed, strict=True):
            axis_keys = self._keys(axis)
            options.append((self._options(axis, axis_keys, same[order_of(axis_keys[same])]), axis_keys))
        if all(len(pairs) for pairs, _ in options):
            self._combine(group, keys, options)

    def _combine(self, group: int, keys: list[RankKey], options: Sequence[tuple[Indices, RankKeys]]) -> None:
        """Go on with each combination of a group's pairs."""
        axes = self.groups[group]
        if not options:
            self.descend(group + 1, keys)
            return
        pairs, axis_keys = options[0]
        for pair in pairs.tolist():
            extended = [*keys, as_key(axis_keys[pair])]
            if self._excluded(extended):
                return
            self.pairs[axes[len(axes) - len(options)]] = pair
            self._combine(group, extended, options[1:])

    def _take(self, axis: int, pair: Pair) -> None:
        self.pairs[axis] = pair
        self.masses[axis] = UNKNOWN_MASS if pair is None else int(self.problem.classes[axis][pair])

    def _keys(self, axis: int, rows: Mask | None = None) -> RankKeys:
        return self.problem.keys(axis, tuple(self.masses), rows)

    def _promising(self, axis: int, keys: list[RankKey]) -> Mask | None:
        """Pairs of an axis that may lead to something better than what was found; None: all."""
        if self.best is None or self.problem.kept[axis]:
            return None
        others = [*keys, *self.rest[len(keys) + 1]]
        return less_than(self.problem.bounds[axis], others, self.best, self.problem.largest)

    def _exhausted(self) -> bool:
        return self.best is not None and self.problem.effort >= self.limit

    def _excluded(self, keys: list[RankKey]) -> bool:
        """Whether what the remaining axes could reach at best is no better than what was found."""
        return self.best is not None and total([*keys, *self.rest[len(keys)]], self.problem.largest) >= self.best

    def _leave(self, keys: list[RankKey], ranked: RankKeys) -> None:
        """Count the combinations of ranked keys of an axis, and of all pairs of the axes after it, as open."""
        count = 0
        while count < len(ranked) and not self._excluded([*keys, as_key(ranked[count])]):
            count += 1
        after = self.axes[len(keys) + 1 :]
        self.open += count * math.prod(int(np.count_nonzero(self.problem.bounds[a][:, 0] == 0)) or 1 for a in after)

    def _finish(self, keys: list[RankKey]) -> None:
        key, choice = total(keys, self.problem.largest), tuple(self.pairs)
        if (self.best is None or key < self.best) and (self.accept is None or self.accept(choice)):
            self.best, self.found = key, choice


# ---- The feedback of the actuators' masses: a chosen actuator loads other axes, whose choice may then change.
#
# Each pass chooses the axes from the tip to the base, with the masses that were chosen last. Without axes that load
# each other, the first pass is final. Otherwise the passes may repeat without end: the best of the repeating
# combinations that satisfies its own loads is then taken.


MOST_PASSES = 60


@dataclass(frozen=True, kw_only=True)
class Feedback:
    """What the passes chose.

    Attributes:
        choice: The fixed point, or the best of the repeating combinations.
        passes: What each pass chose.
        cycle: The combinations that repeat; empty where a fixed point was reached.
        satisfied: Whether every axis of the choice passes, or has nothing to drive it, under the choice's own masses.
    """

    choice: Choice
    passes: tuple[Choice, ...]
    cycle: tuple[Choice, ...]
    satisfied: bool


def fixed_point(problem: JointProblem) -> Feedback:
    """Choose repeatedly, from the tip to the base, until a choice repeats."""
    order = [axis for group in search_order(problem.influence) for axis in group]
    chosen: list[int | None] = [None] * len(order)
    masses = [NO_MASS] * len(order)
    passes: list[Choice] = []
    while len(passes) < MOST_PASSES:
        for axis in order:
            chosen[axis] = best_pair(problem, axis, tuple(masses))
            masses[axis] = masses_of(problem, tuple(chosen))[axis]
        if tuple(chosen) in passes:
            break
        passes.append(tuple(chosen))
    repeating = tuple(passes[passes.index(tuple(chosen)) :])
    best = min(repeating, key=lambda one: total(judge_choice(problem, one), problem.largest))
    return Feedback(
        choice=best,
        passes=tuple(passes),
        cycle=repeating if len(repeating) > 1 else (),
        satisfied=_satisfied(problem, best),
    )


def _satisfied(problem: JointProblem, choice: Choice) -> bool:
    """Whether no pair fails under the choice's own masses; an axis that nothing can drive, or whose pair is given, does
    not count."""
    keys = judge_choice(problem, choice)
    return all(key[0] == 0 or pair is None or kept for pair, key, kept in zip(choice, keys, problem.kept, strict=True))
