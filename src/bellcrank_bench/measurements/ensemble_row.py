"""The record of a timed ensemble, study or call; times are of the wall clock, and CPU times of the process."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from bellcrank.codegen.full_tier import wait_for_optimised_code
from bellcrank_bench.measurements.row import finite

BUDGET = 20.0  # s for which the functions of a table are repeated


@dataclass(frozen=True)
class Duration:
    """How long something took.

    Attributes:
        seconds: By the wall clock, s.
        cpu: CPU time of all threads of the process, s: on a machine with other work it is what the call costs. Infinite
            where it is not measured.
    """

    seconds: float = math.inf
    cpu: float = math.inf

    def best(self, other: Duration) -> Duration:
        """The shorter one of each."""
        return Duration(min(self.seconds, other.seconds), min(self.cpu, other.cpu))

    def __truediv__(self, count: int) -> Duration:
        return Duration(self.seconds / count, self.cpu / count)


@dataclass(frozen=True, kw_only=True)
class EnsembleRow:
    """What a design or a call costs, next to what it is compared with.

    Attributes:
        subject: The scene or robot.
        tool: What was timed.
        setting: Threads, tolerance or step.
        time: Best times of a design or call.
        base: The times that ratios are relative to.
        error: Largest difference from the reference that `note` names; None where it is not measured.
        note: What is compared, what the clock covers, or why there is no time.
    """

    subject: str
    tool: str
    setting: str = ""
    time: Duration = Duration()
    base: Duration = Duration()
    error: float | None = None
    note: str = ""

    @property
    def timed(self) -> bool:
        """Whether there is a time."""
        return math.isfinite(self.time.seconds)

    def data(self) -> dict[str, Any]:
        """The row as JSON can hold it."""
        data = {**asdict(self), **asdict(self.time)}
        del data["time"], data["base"]
        return finite(
            data | {"ratio": self.time.seconds / self.base.seconds, "cpu_ratio": self.time.cpu / self.base.cpu}
        )


def clocked(function: Callable[[], object]) -> Duration:
    """How long a call takes."""
    cpu, begun = time.process_time(), time.perf_counter()
    function()
    return Duration(time.perf_counter() - begun, time.process_time() - cpu)


def best_in_turns(functions: Sequence[Callable[[], Duration]], repeats: int) -> list[Duration]:
    """The best of several times of each, in turns, so that disturbances of the machine affect all alike.

    It stops early once it has taken longer than BUDGET.
    """
    best, begun = [Duration()] * len(functions), time.perf_counter()
    for _ in range(repeats):
        best = [known.best(function()) for known, function in zip(best, functions, strict=True)]
        wait_for_optimised_code()  # which the next turns run
        if time.perf_counter() - begun > BUDGET:
            break
    return best


def thread_count(threads: int) -> str:
    """The number of threads in words."""
    return f"{threads} thread{'s' * (threads > 1)}"
