"""What runs the designs of a study: threads of this process, or other processes and machines."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import NamedTuple, Protocol, Self

from bellcrank.arrays import Array
from bellcrank.studies.designs.design_ranges import DesignRange, UndoneDesigns
from bellcrank.studies.execution.design_runner import DesignRunner
from bellcrank.studies.results.study_columns import StudyColumns


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
