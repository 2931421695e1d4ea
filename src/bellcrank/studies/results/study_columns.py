"""The rows of many designs as columns: a status, measures as arrays, and reasons where there are some."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Array, Indices


@dataclass(frozen=True, eq=False, kw_only=True)
class StudyColumns:
    """Results of n designs.

    Attributes:
        statuses: The names that `status` numbers: "finished", "event", …, "infeasible", "unknown".
        status: (n,) numbers of `statuses`.
        measures: (n,) a measure by name, SI units; NaN where a design does not have it, infinite where it has it
            and it is not a finite number.
        reasons: Why a design did not reach its target, by its row; none where it did.
    """

    statuses: tuple[str, ...]
    status: NDArray[np.int8]
    measures: Mapping[str, Array]
    reasons: Mapping[int, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.status)

    def rows(self, first: int, stop: int) -> StudyColumns:
        """The rows `first`, …, `stop` − 1, without a copy."""
        reasons = {row - first: reason for row, reason in self.reasons.items() if first <= row < stop}
        measures = {name: values[first:stop] for name, values in self.measures.items()}
        return StudyColumns(statuses=self.statuses, status=self.status[first:stop], measures=measures, reasons=reasons)

    @classmethod
    def none(cls) -> StudyColumns:
        """No rows, of no measures."""
        return cls(statuses=(), status=np.zeros(0, dtype=np.int8), measures={})

    @classmethod
    def joined(cls, parts: Sequence[StudyColumns]) -> StudyColumns:
        """The rows of several parts, which have the same statuses and measures, one after another."""
        first, reasons, at = parts[0], dict[int, str](), 0
        for part in parts:
            reasons |= {at + row: reason for row, reason in part.reasons.items()}
            at += len(part)
        measures = {name: np.concatenate([part.measures[name] for part in parts]) for name in first.measures}
        status = np.concatenate([part.status for part in parts])
        return cls(statuses=first.statuses, status=status, measures=measures, reasons=reasons)

    def take(self, rows: Indices) -> StudyColumns:
        """Some of the rows, by their numbers (n,), in that order."""
        reasons = {k: self.reasons[row] for k, row in enumerate(rows.tolist()) if row in self.reasons}
        measures = {name: values[rows] for name, values in self.measures.items()}
        return StudyColumns(statuses=self.statuses, status=self.status[rows], measures=measures, reasons=reasons)


def varies(values: Array, noise: tuple[float, float]) -> bool:
    """Whether the finite values (n,) of a measure differ by more than absolute + relative × magnitude (`noise`)."""
    known = values[np.isfinite(values)]
    if not len(known):
        return False
    least, largest = float(known.min()), float(known.max())
    return largest - least > noise[0] + noise[1] * max(abs(least), abs(largest))
