"""The Pareto front of the combinations of all axes."""

from __future__ import annotations

from bellcrank.sizing.selection.joint_problem import Choice
from bellcrank.sizing.selection.judged_axes import JudgedAxes
from bellcrank.sizing.selection.selection import ParetoPoint


def pareto_front(problem: JudgedAxes, choice: Choice) -> tuple[tuple[ParetoPoint, ...], str]:
    """The front and what is proven of it."""
    return (), ""
