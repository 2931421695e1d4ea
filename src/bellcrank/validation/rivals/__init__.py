"""The tools that people use today, each set up as fast as it goes; a module a tool, with `runs(problem, settings)`.

Every module raises ImportError where its tool is not installed. What each clock covers is in the runs' notes.
"""

from __future__ import annotations

from bellcrank.validation.bench_problem import OUTPUTS, Problem


def substeps(problem: Problem, step: float) -> tuple[int, float]:
    """How many equal steps of about `step` s go between two outputs, and their length, s."""
    interval = problem.duration / (OUTPUTS - 1)
    count = max(1, round(interval / step))
    return count, interval / count
