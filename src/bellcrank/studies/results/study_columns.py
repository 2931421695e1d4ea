"""The rows of many designs: as columns (a status, measures as arrays, reasons), and as objects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import overload

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


@dataclass(frozen=True)
class Design:
    """One row of a sweep.

    Attributes:
        index: Its number among the designs of the sweep, from 0.
        status: The status of its run, "infeasible" where it cannot be built, or "unknown" where a measure is not a
            finite number.
        reason: Why it did not reach its target; empty where it did.
        measures: Its measures by name; infinite where one is not a finite number.
    """

    index: int
    status: str
    reason: str
    measures: Mapping[str, float]


class DesignRows(Sequence[Design]):
    """A sequence of the rows of columns; `numbers` (n,) are the numbers of their designs."""

    def __init__(self, columns: StudyColumns, numbers: NDArray[np.int64]) -> None:
        self._columns, self._numbers = columns, numbers

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, row: int) -> Design: ...

    @overload
    def __getitem__(self, row: slice) -> tuple[Design, ...]: ...

    def __getitem__(self, row: int | slice) -> Design | tuple[Design, ...]:
        if isinstance(row, slice):
            return tuple(self[k] for k in range(*row.indices(len(self))))
        k = range(len(self))[row]
        columns = self._columns
        values = {name: float(column[k]) for name, column in columns.measures.items()}
        measures = {name: value for name, value in values.items() if not math.isnan(value)}
        status = columns.statuses[columns.status[k]]
        return Design(int(self._numbers[k]), status, columns.reasons.get(k, ""), measures)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, (DesignRows, tuple, list)):
            return NotImplemented
        return len(self) == len(other) and all(mine == its for mine, its in zip(self, other, strict=True))

    def __hash__(self) -> int:
        return hash((len(self), self._numbers.tobytes()))

    def __repr__(self) -> str:
        return f"DesignRows({len(self)} designs)"
