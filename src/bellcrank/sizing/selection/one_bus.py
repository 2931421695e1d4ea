"""The best combination whose motors suit one bus, where the voltage of the bus is not given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bellcrank.cached_values import cached_property
from bellcrank.sizing.selection.joint_problem import Masses, judge_choice
from bellcrank.sizing.selection.joint_search import SearchResult, best_combination, fixed_point
from bellcrank.sizing.selection.judged_axes import JudgedAxes
from bellcrank.sizing.selection.ranking import NOT_JUDGED, Indices, RankKeys, total

Bools = NDArray[np.bool_]
ROUNDING = 1e-12  # of a voltage


@dataclass(eq=False)
class OneBus:
    """A problem of whose pairs only those are permitted whose nominal voltages lie in one window; implements
    `JointProblem`. Given pairs, and motors whose nominal voltage is not stated, are permitted.

    Attributes:
        problem: The pairs of all axes.
        lowest: The lowest nominal voltage of the window, V; the highest is `voltage_ratio`² times as high.
    """

    problem: JudgedAxes
    lowest: float

    @property
    def influence(self) -> Bools:
        """As of all pairs."""
        return self.problem.influence

    @property
    def classes(self) -> Sequence[Indices]:
        """As of all pairs."""
        return self.problem.classes

    @property
    def kept(self) -> Sequence[bool]:
        """As of all pairs."""
        return self.problem.kept

    @property
    def largest(self) -> bool:
        """As of all pairs."""
        return self.problem.largest

    @property
    def effort(self) -> int:
        """As of all pairs."""
        return self.problem.effort

    @cached_property
    def permitted(self) -> list[Bools]:
        """Per axis whether (m,) each pair is permitted."""
        highest = self.lowest * self.problem.common.voltage_ratio**2 * (1.0 + ROUNDING)
        found = []
        for axis in self.problem.axes:
            volts = axis.pairs.of_motor("nominal_voltage")
            found.append(np.isnan(volts) | ((volts >= self.lowest * (1.0 - ROUNDING)) & (volts <= highest)) | axis.kept)
        return found

    @cached_property
    def bounds(self) -> list[RankKeys]:
        """As of all pairs; those that are not permitted come last."""
        return [
            np.where(permitted[:, None], bounds, np.array(NOT_JUDGED))
            for permitted, bounds in zip(self.permitted, self.problem.bounds, strict=True)
        ]

    def keys(self, axis: int, masses: Masses, rows: Bools | None = None) -> RankKeys:
        """As of all pairs; those that are not permitted are not judged."""
        permitted = self.permitted[axis]
        found = self.problem.keys(axis, masses, permitted if rows is None else rows & permitted)
        return np.where(permitted[:, None], found, np.array(NOT_JUDGED))


def lowest_voltages(problem: JudgedAxes) -> list[float]:
    """The nominal voltages at which a window may begin: those of all motors that may drive an axis."""
    volts = [axis.pairs.of_motor("nominal_voltage")[bounds[:, 0] == 0]
             for axis, bounds in zip(problem.axes, problem.bounds, strict=True)]  # fmt: skip
    every = np.unique(np.concatenate(volts))
    return [float(one) for one in every if not np.isnan(one)]


def best_on_one_bus(problem: JudgedAxes, effort: int) -> tuple[OneBus, SearchResult] | None:
    """The best combination of those that suit one bus.

    Args:
        problem: The pairs of all axes.
        effort: How many pairs the search may judge.

    Returns:
        The window of voltages with its best combination; None where no window has one.
    """
    best: tuple[OneBus, SearchResult] | None = None
    opened, voltages = 0, lowest_voltages(problem)
    for lowest in voltages:
        window = OneBus(problem, lowest)
        start = fixed_point(window)
        found = best_combination(window, effort // len(voltages), start.choice if start.satisfied else None)
        if found is None or any(pair is None for pair in found.choice):
            continue
        opened += found.open
        if best is None or _total(window, found) < _total(window, best[1]):
            best = window, found
    return best and (best[0], SearchResult(best[1].choice, opened))


def _total(window: OneBus, found: SearchResult) -> tuple[int, ...]:
    return total(judge_choice(window.problem, found.choice), window.largest)
