"""A study that needs no scene: designs (a, b) and measures in closed form, with rows that fail and values that are NaN.

As a program it runs a study in a folder, and prints a line whenever rows are kept:
python small_study.py FOLDER DESIGNS SECONDS_A_DESIGN CHECKPOINT_EVERY
"""

import hashlib
import os
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bellcrank.studies.execution.design_runner import StudyInterrupted
from bellcrank.studies.results.study_columns import StudyColumns

STATUSES = ("finished", "event", "infeasible")
UNITS = {"root": "m", "sine": "1", "steps": "1"}


@dataclass
class SmallSpace:
    count: int
    identity: dict = field(default_factory=lambda: {"a": "0 … 10", "b": "by golden ratio"})

    def values(self, first, stop):
        number = np.arange(first, stop)
        return np.column_stack([10.0 * number / self.count, np.modf(0.6180339887498949 * number)[0]])


@dataclass
class SmallRunner:
    """`seconds` is how long a design takes; designs of an `a` from `deadly` on kill their process."""

    seconds: float = 0.0
    deadly: float = np.inf
    interrupt_at: int | None = None
    identity: dict = field(default_factory=lambda: {"scene": "closed forms"})
    units = UNITS
    default_measures = ("root",)
    noise = (0.0, 0.0)

    def run(self, values, *, threads=1, progress=None):
        a, b = values.T
        if (a >= self.deadly).any():
            os.kill(os.getpid(), 9)
        for done in range(0, len(values), 256):
            time.sleep(self.seconds * min(256, len(values) - done))
            if progress is not None:
                progress(done)
        columns = small_columns(a, b)
        if self.interrupt_at is not None and len(values) > self.interrupt_at:
            rows = np.delete(np.arange(self.interrupt_at), self.interrupt_at // 2)  # threads leave gaps
            raise StudyInterrupted(rows, chosen_rows(columns, rows))
        return columns


def small_columns(a, b):
    bad = b > 0.9
    status = np.where(bad, 2, b > 0.5).astype(np.int8)
    measures = {"root": np.sqrt(a + b), "sine": np.sin(1e3 * a) * b, "steps": np.floor(100.0 * b)}
    measures = {name: np.where(bad, np.nan, values) for name, values in measures.items()}
    reasons = {int(k): f"b is more than 0.9 in every {int(10 * b[k])}th" for k in np.flatnonzero(bad)}
    return StudyColumns(statuses=STATUSES, status=status, measures=measures, reasons=reasons)


def chosen_rows(columns, rows):
    place = {int(row): k for k, row in enumerate(rows)}
    return StudyColumns(
        statuses=columns.statuses,
        status=columns.status[rows],
        measures={name: values[rows] for name, values in columns.measures.items()},
        reasons={place[row]: text for row, text in columns.reasons.items() if row in place},
    )


def expected_columns(count):
    return small_columns(*SmallSpace(count).values(0, count).T)


def same_columns(one, other):
    """Whether two tables are equal, bit for bit."""
    return (
        one.statuses == other.statuses
        and np.array_equal(one.status, other.status)
        and list(one.measures) == list(other.measures)
        and all(one.measures[name].tobytes() == other.measures[name].tobytes() for name in one.measures)
        and dict(one.reasons) == dict(other.reasons)
    )


def digest(columns):
    data = [columns.status.tobytes(), *(values.tobytes() for values in columns.measures.values())]
    data.append(repr(sorted(columns.reasons.items())).encode())
    return hashlib.sha256(b"".join(data)).hexdigest()


def main(folder, count, seconds, checkpoint_every):
    from bellcrank.studies.execution.execution import LocalExecutor
    from bellcrank.studies.execution.study import run_study
    from bellcrank.studies.execution.study_folder import StudyFolder

    class Spoken(StudyFolder):
        def write(self, rows, unsaved):
            super().write(rows, unsaved)
            print("kept", rows.done.sum(), flush=True)

    with Spoken(Path(folder), notify=lambda text: print("note:", text, flush=True)) as place:
        print("begun", flush=True)
        runner = SmallRunner(seconds=float(seconds))
        running = iter(["running"])

        def progress(done, of):
            for line in running:
                print(line, flush=True)

        run = run_study(
            SmallSpace(int(count)), runner, LocalExecutor(1), folder=place, progress=progress,
            checkpoint_every=float(checkpoint_every),
        )  # fmt: skip
        print("digest", digest(run.columns), flush=True)
        place.remove_checkpoints()


if __name__ == "__main__":
    main(*sys.argv[1:])
