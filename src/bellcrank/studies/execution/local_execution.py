"""Runs the designs of a study in threads of this process."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Iterator, Mapping
from typing import Self

import numpy as np

from bellcrank.studies.designs.design_ranges import DesignRange, RangeSize
from bellcrank.studies.execution.design_runner import StudyInterrupted
from bellcrank.studies.execution.execution import Part, Work
from bellcrank.studies.execution.software_and_processor import environment

DESIGNS_A_THREAD = 32  # at least, in one call: four times the widest SIMD lanes, so that few lanes wait at its end


def _processors() -> int:
    """The number of processors that this process may use; all of them where the system does not tell."""
    usable = getattr(os, "sched_getaffinity", None)
    return len(usable(0)) if usable else os.cpu_count() or 1


class LocalExecutor:
    """Runs designs in `threads` threads of this process, by default one a processor."""

    def __init__(self, threads: int | None = None) -> None:
        self.threads = threads or _processors()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    @property
    def environment(self) -> Mapping[str, str]:
        """Versions and processor of this process."""
        return environment()

    def run(self, work: Work) -> Iterator[Part]:
        """Run one range of designs after another; after Ctrl-C, those of the last one that are done are a part too."""
        size = RangeSize(DESIGNS_A_THREAD * self.threads)
        while (designs := work.undone.take(size.count)) is not None:
            begun = time.monotonic()
            values = work.space.values(*designs)
            try:
                columns = work.runner.run(values, threads=self.threads, progress=work.progress)
            except StudyInterrupted as stopped:
                yield from _done(designs, stopped)
                raise
            size.learn(designs.size, time.monotonic() - begun)
            yield Part(designs, columns)


def _done(designs: DesignRange, stopped: StudyInterrupted) -> Iterator[Part]:
    """The parts of a range that were done when it was interrupted."""
    rows, columns = stopped.rows, stopped.columns
    cuts = [0, *(np.flatnonzero(np.diff(rows) != 1) + 1).tolist(), len(rows)]
    for first, stop in itertools.pairwise(cuts):
        if first < stop:
            begin = designs.first + int(rows[first])
            yield Part(DesignRange(begin, begin + stop - first), columns.rows(first, stop))
