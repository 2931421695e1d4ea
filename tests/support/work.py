"""Counts the work that a test does, so that the first tier stays short: no clock, so no machine and no load matter."""

from __future__ import annotations

import subprocess
from collections import Counter
from collections.abc import Callable
from typing import Any

# What a case of the first tier may do, its fixtures included. About two seconds each on one core of 2025.
BUDGET = {
    "kB of LLVM IR compiled": 4000,
    "evaluations of equations while stepping": 10_000_000,
    "rows evaluated": 2_500_000,
    "drives judged": 1_000_000,
    "passes of the planner": 150,
    "processes started": 3,
    "pictures drawn": 5,
}
done: Counter[str] = Counter()


def excess(before: Counter[str]) -> list[str]:
    """What was done since `before` beyond the budget, in words."""
    spent = {what: done[what] - before[what] for what in BUDGET}
    return [f"{spent[what]:.0f} {what}, budget {most}" for what, most in BUDGET.items() if spent[what] > most]


def watch() -> None:
    """Begin to count. The places are those through which all compiling, stepping and batches go."""
    from matplotlib.figure import Figure

    from bellcrank.codegen import compile as compiling
    from bellcrank.codegen import llvm
    from bellcrank.planning import fastest_pass
    from bellcrank.present import plot_style
    from bellcrank.simulation.integration import ensemble, integration
    from bellcrank.sizing.selection import judge

    _count(llvm, "object_code", "kB of LLVM IR compiled", lambda made, ir, *_: len(ir) / 1000)
    _count(integration, "statistics_of", "evaluations of equations while stepping", lambda made, *_: made.evaluations)
    _count(
        ensemble,
        "integrate_in_lanes",
        "evaluations of equations while stepping",
        lambda columns, *_: columns["evaluations"].sum(),
    )
    _count(compiling, "evaluate_rows", "rows evaluated", lambda made, address, inputs, sizes, samples: samples)
    _count(compiling.Compiled, "_many", "rows evaluated", lambda made, self, values, rows: rows)
    _count(judge, "verdicts", "drives judged", lambda made, *_: len(made[0]))
    for name in ("grid_pass", "refined_pass"):
        _count(fastest_pass, name, "passes of the planner", lambda *_: 1)
    _count(Figure, "savefig", "pictures drawn", lambda *_: 1)
    _count(plot_style, "_save_png", "pictures drawn", lambda *_: 1)
    _count(subprocess.Popen, "__init__", "processes started", lambda *_: 1)


def _count(place: Any, name: str, what: str, amount: Callable[..., float]) -> None:
    """Put a counter around a function of a module or class."""
    counted = getattr(place, name)

    def call(*args: Any, **named: Any) -> Any:
        made = counted(*args, **named)
        done[what] += amount(made, *args, *named.values())  # type: ignore[assignment]
        return made

    setattr(place, name, call)
