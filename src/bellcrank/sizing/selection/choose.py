"""Choosing one pair an axis: feedback of masses, then the search for something better, and what is proven."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bellcrank.sizing.selection.candidates import without_mass
from bellcrank.sizing.selection.feedback import fixed_point
from bellcrank.sizing.selection.joint_problem import Choice, JointProblem, judge_choice, masses_of
from bellcrank.sizing.selection.joint_search import best_combination
from bellcrank.sizing.selection.judged_axes import JudgedAxes
from bellcrank.sizing.selection.matching_criteria import COMMON_BUS
from bellcrank.sizing.selection.one_bus import best_on_one_bus
from bellcrank.sizing.selection.ranking import total
from bellcrank.sizing.selection.selection import CriterionResult
from bellcrank.sizing.selection.system_criteria import judge_system

OPTIMAL = "optimal: every combination was excluded or tried"


@dataclass(frozen=True, kw_only=True)
class Chosen:
    """What was chosen.

    Attributes:
        choice: Number of the pair of each axis; None where nothing can drive it.
        passes: What each pass of the feedback chose.
        proof: How far the choice is proven to be the best.
        notes: Sentences about how it was found.
    """

    choice: Choice
    passes: tuple[Choice, ...]
    proof: str
    notes: tuple[str, ...]


def choose(problem: JudgedAxes, effort: int) -> Chosen:
    """Choose one pair an axis.

    Args:
        problem: The pairs.
        effort: How many pairs the search may judge.
    """
    greedy = fixed_point(problem)
    found = best_combination(problem, effort, greedy.choice if greedy.satisfied else None)
    choice = greedy.choice if found is None else found.choice
    notes = []
    permitted: JointProblem = problem
    if found is not None and COMMON_BUS in _exceeded(problem, choice):
        on_one_bus = best_on_one_bus(problem, effort)
        if on_one_bus is not None:
            permitted, found = on_one_bus
            choice = found.choice
            notes.append("the best pairs of the axes need different buses; the chosen ones are the best for one bus")
    if found is not None and not system_kept(problem, choice):
        exceeded = " and ".join(_exceeded(problem, choice))
        other = best_combination(permitted, effort, accept=lambda each: system_kept(problem, each))
        if other is None:
            notes.append(f"{exceeded} of all axes together is exceeded, and no combination that was tried keeps it")
        else:
            notes.append(
                f"the best pairs of the axes exceed {exceeded} of all axes together; the chosen ones are the best that "
                "keep it"
            )
            found, choice = other, other.choice
    if greedy.cycle:
        notes.append(
            f"feedback of the actuators' masses does not settle: {len(greedy.cycle)} combinations repeat; "
            + ("the best of all combinations was searched for" if found else "none of them satisfies its own loads")
        )
    if found is None:
        proof = "no combination was found in which every axis passes with the masses of its own actuators"
    elif found.open:
        proof = f"best found: {found.open:.4g} combinations were neither tried nor excluded"
    else:
        proof = OPTIMAL
    before = total(judge_choice(problem, greedy.choice), problem.largest)
    if found is not None and greedy.satisfied and total(judge_choice(problem, choice), problem.largest) < before:
        notes.append("the search over all axes found a better combination than choosing each axis for itself")
    return Chosen(choice=choice, passes=greedy.passes, proof=proof, notes=tuple(notes))


def system_results(problem: JudgedAxes, choice: Choice) -> tuple[CriterionResult, ...]:
    """The criteria of all axes together; none where nothing can drive an axis."""
    masses = masses_of(problem, choice)
    pairs = [
        one.pairs.take(np.array([pair])) for one, pair in zip(problem.axes, choice, strict=True) if pair is not None
    ]
    if len(pairs) < len(choice):
        return ()
    loads = [problem.axis_loads(axis, masses) for axis in range(len(choice))]
    results = judge_system(pairs, loads, problem.common)
    unknown = sorted({name for axis in range(len(choice)) for name in problem.unknown_masses(axis, masses)})
    return tuple(without_mass(result, unknown) for result in results) if unknown else results


def _exceeded(problem: JudgedAxes, choice: Choice) -> list[str]:
    """Names of the criteria of all axes together that are exceeded."""
    return [one.name for one in system_results(problem, choice) if one.verdict == "exceeded"]


def system_kept(problem: JudgedAxes, choice: Choice) -> bool:
    """Whether no criterion of all axes together is exceeded."""
    return not _exceeded(problem, choice)
