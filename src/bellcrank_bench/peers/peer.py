"""What every peer hands over: runs of a benchmark that can be timed, and their outcomes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from bellcrank_bench.problems.checks import Array
from bellcrank_bench.problems.problem import OUTPUT_TIMES, Benchmark


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One run that was made.

    Attributes:
        seconds: Time on the tool's own clock, s.
        position: The compared positions, (k, compared_count).
        time: Their times, (k,), s; None if they are the benchmark's output times.
        evaluations: Number of evaluations of the equations, if the tool tells it.
        steps: Number of accepted steps, likewise.
        rejected: Number of rejected steps, likewise.
        whole: Time of the user's whole call, s, if it is measured apart.
    """

    seconds: float
    position: Array
    time: Array | None = None
    evaluations: int | None = None
    steps: int | None = None
    rejected: int | None = None
    whole: float | None = None


@dataclass(frozen=True, kw_only=True)
class Run:
    """A tool with a method and a setting that can be run repeatedly; `note` says what its clock covers."""

    tool: str
    method: str
    setting: str
    note: str
    once: Callable[[], Outcome]


@dataclass(frozen=True)
class Peer:
    """A tool that bellcrank is compared with; each module of this package has one, `PEER`.

    Attributes:
        name: Its name, which is its key in settings.yaml.
        package: Its distribution, whose version is reported.
        runs: Function that returns its runs of a benchmark with every setting. Raises ImportError if the tool is not
            installed.
    """

    name: str
    package: str
    runs: Callable[[Benchmark, Mapping[str, Any]], Iterator[Run]]


def substeps(benchmark: Benchmark, step: float) -> tuple[int, float]:
    """The number of equal steps of about `step` s between two output times, and their length, s."""
    interval = benchmark.duration / (OUTPUT_TIMES - 1)
    count = max(1, round(interval / step))
    return count, interval / count
