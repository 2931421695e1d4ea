"""The rows of a study in memory: one array that is filled as the designs are done."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Array
from bellcrank.errors import BellcrankError
from bellcrank.memory import check_memory
from bellcrank.studies.designs.design_ranges import DesignRange
from bellcrank.studies.results.study_columns import StudyColumns


class StudyRows:
    """The columns of N designs, of which some are done.

    Attributes:
        names: The measures.
        statuses: As in Columns; empty until the first rows are added.
        done: Which designs are done (N,).
        status: Numbers of `statuses` (N,), of the designs that are done.
        measures: (measures, N); undefined where a design is not done.
        reasons: By the number of the design.
    """

    def __init__(self, count: int, names: Sequence[str]) -> None:
        """Raises InputError where the rows do not fit into the memory."""
        check_memory(count, 8 * len(names) + 2, "designs")
        self.names, self.statuses = tuple(names), tuple[str, ...]()
        self.done = np.zeros(count, dtype=np.bool_)
        self.status = np.zeros(count, dtype=np.int8)
        self.measures: Array = np.empty((len(names), count))
        self.reasons: dict[int, str] = {}
        self._texts: dict[str, str] = {}  # many designs have the same reason

    def __len__(self) -> int:
        return len(self.done)

    def add(self, designs: DesignRange, columns: StudyColumns) -> None:
        """Add the rows of a range. Raises BellcrankError where they are not those of this study."""
        if len(columns) != designs.size or tuple(columns.measures) != self.names:
            raise BellcrankError(
                f"{designs.size} designs gave {len(columns)} rows of {len(columns.measures)} measures, expected "
                f"{len(self.names)} measures in the order of the units (a fault of bellcrank)"
            )
        columns_of = [columns.measures[name] for name in self.names]
        reasons = {designs.first + row: text for row, text in columns.reasons.items()}
        self.fill(designs, columns.statuses, columns.status, columns_of, reasons)

    def fill(
        self,
        designs: DesignRange,
        statuses: tuple[str, ...],
        status: NDArray[np.int8],
        measures: Sequence[Array],
        reasons: Mapping[int, str],
    ) -> None:
        """Fill the rows of a range; `reasons` by the number of the design. Raises BellcrankError for other statuses."""
        if self.statuses not in ((), statuses):
            raise BellcrankError(f"statuses {statuses} follow {self.statuses} (a fault of bellcrank)")
        first, stop = designs
        self.statuses = statuses
        self.status[first:stop] = status
        for row, values in zip(self.measures, measures, strict=True):
            row[first:stop] = values
        for design, text in reasons.items():
            self.reasons[design] = self._texts.setdefault(text, text)
        self.done[first:stop] = True

    def columns(self) -> StudyColumns:
        """The rows that are done, without a copy; nothing can be added afterwards."""
        count, measures, status, reasons = len(self), self.measures, self.status, self.reasons
        if not self.done.all():
            count = int(self.done.sum())
            for row in measures:
                row[:count] = row[self.done]
            measures, status = measures[:, :count], status[self.done]
            place = np.cumsum(self.done) - 1
            reasons = {int(place[design]): text for design, text in reasons.items() if self.done[design]}
        return StudyColumns(
            statuses=self.statuses,
            status=status,
            measures=dict(zip(self.names, measures, strict=True)),
            reasons=dict(sorted(reasons.items())),
        )
