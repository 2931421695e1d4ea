"""The rows of a block of designs while they are filled in."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.errors import BellcrankError
from bellcrank.studies.columns import Columns
from bellcrank.studies.run_outcomes import INFEASIBLE, STATUSES

if TYPE_CHECKING:
    from bellcrank.studies.measures import Measure

Array = NDArray[np.float64]
Rows = NDArray[np.int64]


class ResultTable:
    """n designs with measures of these names, none of them known at first.

    Attributes:
        known: The designs that are done (n,).
    """

    def __init__(self, names: Iterable[str], count: int) -> None:
        self.known = np.zeros(count, dtype=np.bool_)
        self._status = np.full(count, STATUSES.index(INFEASIBLE), dtype=np.int8)
        self._measures = {name: np.full(count, np.nan) for name in names}
        self._reasons: dict[int, str] = {}

    @property
    def count(self) -> int:
        """How many designs are done."""
        return int(np.count_nonzero(self.known))

    def refuse(self, infeasible: Mapping[int, str]) -> None:
        """Designs that cannot be built, with the reason of each row."""
        self.known[list(infeasible)] = True
        self._reasons |= infeasible

    def fill(self, rows: Rows | slice, measures: Sequence[Measure]) -> None:
        """The measures of some rows. What a run has and is not a finite number becomes infinite."""
        for measure in measures:
            if measure.name not in self._measures:
                raise BellcrankError(
                    f"measure '{measure.name}' of a design is not one of the study (a fault of bellcrank); vary around "
                    "a design that has it"
                )
            values, undefined = measure.values, np.isnan(measure.values)
            if measure.present is not None:
                undefined &= measure.present
            self._measures[measure.name][rows] = np.where(undefined, np.inf, values) if undefined.any() else values

    def settle(self, rows: Rows, status: NDArray[np.int8], reasons: Mapping[int, str]) -> None:
        """The statuses of these rows, and reasons by their place among them."""
        self._status[rows] = status
        self._reasons |= {int(rows[k]): reason for k, reason in reasons.items()}
        self.known[rows] = True

    def columns(self) -> Columns:
        """All rows."""
        return Columns(statuses=STATUSES, status=self._status, measures=self._measures, reasons=self._reasons)

    def settled(self) -> tuple[NDArray[np.intp], Columns]:
        """The rows that are done, and their results."""
        rows = np.flatnonzero(self.known)
        place = {row: k for k, row in enumerate(rows.tolist())}
        return rows, Columns(
            statuses=STATUSES,
            status=self._status[rows],
            measures={name: column[rows] for name, column in self._measures.items()},
            reasons={place[row]: reason for row, reason in self._reasons.items() if row in place},
        )
