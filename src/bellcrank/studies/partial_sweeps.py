"""Hands over the designs that are done while a sweep goes on."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Self

import numpy as np

from bellcrank.simulation.checkpoints import SPACING
from bellcrank.studies.columns import Columns
from bellcrank.studies.execution import Executor, Part, Work
from bellcrank.studies.sweep_result import Sweep


class WatchedExecutor:
    """An executor that calls a function with the designs that it has run, about every `seconds`.

    Args:
        executor: What runs the designs.
        sweep: The sweep without rows.
        keep: The function; calls take a small share of the time.
        seconds: s.
    """

    def __init__(self, executor: Executor, sweep: Sweep, keep: Callable[[Sweep], object], seconds: float) -> None:
        self.executor, self.sweep, self.keep, self.seconds = executor, sweep, keep, seconds

    def __enter__(self) -> Self:
        self.executor.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self.executor.__exit__(*error)  # type: ignore[arg-type]

    @property
    def environment(self) -> Mapping[str, str]:
        """That of the executor."""
        return self.executor.environment

    def run(self, work: Work) -> Iterator[Part]:
        """The parts of the executor."""
        parts: list[Part] = []
        due = time.monotonic() + self.seconds
        for part in self.executor.run(work):
            parts.append(part)
            if (begun := time.monotonic()) >= due:
                self.keep(self._so_far(parts))
                now = time.monotonic()
                due = now + max(self.seconds, SPACING * (now - begun))
            yield part

    def _so_far(self, parts: list[Part]) -> Sweep:
        parts.sort(key=lambda part: part.designs.first)
        index = np.concatenate([np.arange(*part.designs) for part in parts])
        return replace(self.sweep, columns=Columns.joined([part.columns for part in parts]), index=index)
