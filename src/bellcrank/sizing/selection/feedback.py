"""The feedback of the actuators' masses: a chosen actuator loads other axes, whose choice may then change.

Each pass chooses the axes from the tip to the base, with the masses that were chosen last. Without axes that load each
other, the first pass is final. Otherwise the passes may repeat without end: the best of the repeating combinations
that satisfies its own loads is then taken.
"""

from __future__ import annotations

from dataclasses import dataclass

from bellcrank.sizing.selection.joint_problem import (
    NO_MASS,
    Choice,
    JointProblem,
    best_pair,
    judge_choice,
    masses_of,
    search_order,
)
from bellcrank.sizing.selection.ranking import total

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
