"""The registry of reference problems, by name: tests, `bellcrank bench` and its `--hard` all take them from here."""

from __future__ import annotations

from typing import Final

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank_bench.problems import (
    bricard,
    chains_and_arms,
    five_bar,
    four_bar,
    free_body,
    light_cart_pole,
    n_four_bar,
    pendulum,
    planar_2r,
    rolling_disk,
    spring_pendulum,
    two_wheeler,
)
from bellcrank_bench.problems.problem import Benchmark, Problem

_MODULES = (
    planar_2r,
    spring_pendulum,
    pendulum,
    four_bar,
    rolling_disk,
    bricard,
    n_four_bar,
    two_wheeler,
    five_bar,
    light_cart_pole,
    free_body,
    chains_and_arms,
)
PROBLEMS: Final[dict[str, Problem]] = {problem.name: problem for module in _MODULES for problem in module.PROBLEMS}
BENCHMARKS: Final[dict[str, Benchmark]] = {
    name: problem.benchmark for name, problem in PROBLEMS.items() if problem.benchmark is not None
}
NOT_MEASURED: Final = {  # bundled scenes with constraints that have no benchmark, and why
    "five_bar": "the limits of its motors make kinks, so there is no reference in extended precision"
}


def problem(name: str) -> Problem:
    """The reference problem of that name. Raises InputError for an unknown one."""
    if name not in PROBLEMS:
        raise InputError(unknown_name("problem", name, PROBLEMS))
    return PROBLEMS[name]


def benchmark(name: str) -> Benchmark:
    """What `bellcrank bench` measures on the problem of that name. Raises InputError if there is no such benchmark."""
    if name not in BENCHMARKS:
        raise InputError("bench: " + unknown_name("scene", name, BENCHMARKS))
    return BENCHMARKS[name]


def quick_benchmarks() -> list[str]:
    """The names that `bellcrank bench` takes if none are given: all but the slow ones."""
    return [name for name, each in BENCHMARKS.items() if not each.slow]
