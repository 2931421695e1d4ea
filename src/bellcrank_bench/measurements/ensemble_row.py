"""The record of a timed ensemble, study or call; times are of the wall clock, and CPU times of the process."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from bellcrank_bench.measurements.row import finite


@dataclass(frozen=True)
class Duration:
    """How long something took.

    Attributes:
        seconds: By the wall clock, s.
        cpu: CPU time of all threads of the process, s: on a machine with other work it is what the call costs.
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
        base: The time that ratios are relative to, s; that of the subject's first row unless the note says otherwise.
        error: Largest difference from the reference that `note` names; None where it is not measured.
        note: What is compared, what the clock covers, or why there is no time.
    """

    subject: str
    tool: str
    setting: str = ""
    time: Duration = Duration()
    base: float = math.inf
    error: float | None = None
    note: str = ""

    @property
    def timed(self) -> bool:
        """Whether there is a time."""
        return math.isfinite(self.time.seconds)

    def data(self) -> dict[str, Any]:
        """The row as JSON can hold it."""
        data = {**asdict(self), **asdict(self.time)}
        del data["time"]
        ratios = {"ratio": self.time.seconds / self.base, "cpu_ratio": self.time.cpu / self.base}
        return finite(data | (ratios if self.timed else {}))


def clocked(function: Callable[[], object]) -> Duration:
    """How long a call takes."""
    cpu, begun = time.process_time(), time.perf_counter()
    function()
    return Duration(time.perf_counter() - begun, time.process_time() - cpu)


def best_in_turns(functions: Sequence[Callable[[], Duration]], repeats: int) -> list[Duration]:
    """The best of several times of each, in turns, so that disturbances of the machine affect all alike."""
    best = [Duration()] * len(functions)
    for _ in range(repeats):
        best = [known.best(function()) for known, function in zip(best, functions, strict=True)]
    return best


def thread_count(threads: int) -> str:
    """The number of threads in words."""
    return f"{threads} thread{'s' * (threads > 1)}"
