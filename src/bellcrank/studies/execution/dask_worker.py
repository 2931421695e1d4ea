"""What a Dask worker does: it runs one range of designs. Nothing here needs Dask."""

from __future__ import annotations

import os
import pickle
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass

from bellcrank.arrays import Array
from bellcrank.errors import BellcrankError
from bellcrank.studies.execution.design_runner import DesignRunner
from bellcrank.studies.execution.software_and_processor import TARGETS_ALIKE, differences, environment
from bellcrank.studies.results.study_columns import StudyColumns

_kept: dict[str, DesignRunner] = {}  # the runner of the last range, with its compiled code, by its key
_loading = threading.Lock()


@dataclass(frozen=True, eq=False, kw_only=True)
class RangeTask:
    """A range of designs to be run.

    Attributes:
        key: Of the runner, unique.
        runner: Its pickle, which holds recipes and graphs, and no machine code.
        values: Of the designs (n, axes).
        threads: The number of threads.
        environment: What the environment of every worker must be.
    """

    key: str
    runner: bytes
    values: Array
    threads: int
    environment: Mapping[str, str]


def run_range(task: RangeTask) -> tuple[StudyColumns, float]:
    """The rows of a range, and the seconds that they took. Raises BellcrankError where this worker's results differ."""
    found = differences(task.environment, environment(), ("the other workers", "this one"))
    if found:
        raise BellcrankError(f"a Dask worker on {os.uname().nodename} differs in {found}; {TARGETS_ALIKE}")
    begun = time.monotonic()
    with _loading:
        if task.key not in _kept:
            _kept.clear()
            _kept[task.key] = pickle.loads(task.runner)
        runner = _kept[task.key]
    columns = runner.run(task.values, threads=task.threads)
    return columns, time.monotonic() - begun
