"""Choosing one pair an axis: feedback of masses, then the search for something better, and what is proven."""

from __future__ import annotations

from dataclasses import dataclass

from bellcrank.sizing.selection.feedback import fixed_point
from bellcrank.sizing.selection.joint_problem import Choice, judge_choice
from bellcrank.sizing.selection.joint_search import best_combination
from bellcrank.sizing.selection.judged_axes import JudgedAxes
from bellcrank.sizing.selection.ranking import total

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
