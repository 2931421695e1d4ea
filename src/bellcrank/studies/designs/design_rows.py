"""The rows of a study as objects, made when they are asked for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from bellcrank.studies.results.study_columns import StudyColumns


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
