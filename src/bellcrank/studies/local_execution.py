"""Runs the designs of a study in threads of this process."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping
from typing import Self

from bellcrank.studies.design_ranges import RangeSize
from bellcrank.studies.environment import environment
from bellcrank.studies.execution import Part, Work

DESIGNS_A_THREAD = 32  # at least, in one call: four times the widest SIMD lanes, so that few lanes wait at its end


class LocalExecutor:
    """Runs designs in `threads` threads of this process, by default one a processor."""

    def __init__(self, threads: int | None = None) -> None:
        self.threads = threads or len(os.sched_getaffinity(0))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    @property
    def environment(self) -> Mapping[str, str]:
        """Versions and processor of this process."""
        return environment()

    def run(self, work: Work) -> Iterator[Part]:
        """Run one range of designs after another."""
        size = RangeSize(DESIGNS_A_THREAD * self.threads)
        while (designs := work.undone.take(size.count)) is not None:
            begun = time.monotonic()
            values = work.space.values(*designs)
            columns = work.runner.run(values, threads=self.threads, progress=work.progress)
            size.learn(designs.size, time.monotonic() - begun)
            yield Part(designs, columns)
