"""Runs a study: its designs, in ranges, on an executor, kept in a folder as they are done."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bellcrank.errors import InputError
from bellcrank.simulation.files.checkpoints import CHECKPOINT_EVERY
from bellcrank.studies.designs.design_space import UndoneDesigns
from bellcrank.studies.execution.design_runner import DesignRunner
from bellcrank.studies.execution.execution import Designs, Executor, LocalExecutor, Work
from bellcrank.studies.execution.study_folder import StudyFolder, StudyRows
from bellcrank.studies.results.study_columns import StudyColumns

SPACING = 20.0  # times as long as writing takes: at most a twentieth of the time is spent on it


@dataclass(frozen=True, eq=False, kw_only=True)
class StudyRun:
    """The rows of a study.

    Attributes:
        columns: The rows of the designs that are done.
        designs: Their numbers, increasing (n,).
        complete: Whether all designs are done; False after Ctrl-C.
        found: How many of them an earlier process had done.
    """

    columns: StudyColumns
    designs: NDArray[np.int64]
    complete: bool
    found: int


def run_study(
    space: Designs,
    runner: DesignRunner,
    executor: Executor | None = None,
    *,
    folder: StudyFolder | None = None,
    progress: Callable[[int, int], object] | None = None,
    checkpoint_every: float = CHECKPOINT_EVERY,
) -> StudyRun:
    """Run all designs, those that the folder holds excepted.

    A study that takes less than `checkpoint_every` seconds writes nothing into the folder. After Ctrl-C, and after an
    error of the runner, the designs that are done are kept in the folder; after Ctrl-C they are returned too.

    Args:
        space: The designs.
        runner: What is done with each.
        executor: What runs them; by default a thread a processor.
        folder: Where rows are kept and found; its checkpoints are removed by the caller, once the results are written.
        progress: Called with the number of designs done and of all.
        checkpoint_every: Seconds between two checkpoints.

    Raises:
        InputError: The folder holds another study, or the designs do not fit into the memory.
    """
    rows = StudyRows(space.count, list(runner.units))
    with executor or LocalExecutor() as running:
        if folder is not None:
            folder.resume({**runner.identity, **space.identity, **running.environment}, rows)
        keeper = _Keeper(rows, folder, checkpoint_every)
        found = done = int(rows.done.sum())
        complete = True

        def report(beyond: int) -> None:
            if progress is not None:
                progress(min(done + beyond, space.count), space.count)

        work = Work(space=space, runner=runner, undone=UndoneDesigns(rows.done), progress=report)
        try:
            report(0)
            for part in running.run(work):
                rows.add(*part)
                done += part.designs.size
                keeper.look()
                report(0)
        except KeyboardInterrupt:
            complete = False
            keeper.write()
        except Exception:
            keeper.write()
            raise
    return StudyRun(
        columns=rows.columns(),
        designs=np.flatnonzero(rows.done),
        complete=complete or bool(rows.done.all()),
        found=found,
    )


class _Keeper:
    """Writes the rows that are done into a folder about every `every` seconds."""

    def __init__(self, rows: StudyRows, folder: StudyFolder | None, every: float) -> None:
        self.rows, self.folder, self.every = rows, folder, every
        self.saved = rows.done.copy()
        self.next = time.monotonic() + every
        self._warned = False

    def look(self) -> None:
        """Write if it is time."""
        if time.monotonic() >= self.next:
            self.write()

    def write(self) -> None:
        """Write what is not yet written; what cannot be written now is written with the next."""
        unsaved = self.rows.done & ~self.saved
        if self.folder is None or not unsaved.any():
            return
        begun = time.monotonic()
        try:
            self.folder.write(self.rows, unsaved)
            self.saved |= unsaved
        except InputError as error:
            if not self._warned:
                self._warned = True
                self.folder.notify(f"{error}; the study goes on, and is kept as soon as there is room")
        now = time.monotonic()
        self.next = now + max(self.every, SPACING * (now - begun))
