"""What runs the designs of a study: threads of this process, or other processes and machines."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import NamedTuple, Protocol, Self

import numpy as np

from bellcrank.arrays import Array
from bellcrank.studies.designs.design_space import DesignRange, RangeSize, UndoneDesigns
from bellcrank.studies.execution.design_runner import DesignRunner, StudyInterrupted
from bellcrank.studies.execution.software_and_processor import environment
from bellcrank.studies.results.study_columns import StudyColumns

DESIGNS_A_THREAD = 32  # at least, in one call: four times the widest SIMD lanes, so that few lanes wait at its end


class Designs(Protocol):
    """The designs of a study, numbered from 0 on."""

    @property
    def count(self) -> int:
        """The number of designs."""
        ...

    @property
    def identity(self) -> Mapping[str, str]:
        """What the values depend on, by a name that a user understands: axes, values, distributions, seed, method."""
        ...

    def values(self, first: int, stop: int) -> Array:
        """The values (stop − first, axes) of the designs `first`, …, `stop` − 1, in the units of the axes."""
        ...


class Part(NamedTuple):
    """The rows of a range of designs."""

    designs: DesignRange
    columns: StudyColumns


@dataclass(frozen=True, eq=False, kw_only=True)
class Work:
    """What is to be computed.

    Attributes:
        space: The designs.
        runner: What is done with each.
        undone: The designs that are still to be run.
        progress: Called with the number of designs that are done beyond those of the parts.
    """

    space: Designs
    runner: DesignRunner
    undone: UndoneDesigns
    progress: Callable[[int], object]


class Executor(AbstractContextManager["Executor"], Protocol):
    """Runs designs; a context manager, in whose block its processes exist."""

    def __enter__(self) -> Self: ...

    @property
    def environment(self) -> Mapping[str, str]:
        """What results depend on besides the runner and the designs: versions and the processor of what runs them."""
        ...

    def run(self, work: Work) -> Iterator[Part]:
        """Run all designs that are undone; parts come in any order. KeyboardInterrupt ends it."""
        ...


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
