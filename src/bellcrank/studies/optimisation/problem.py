"""A search for the best design as a problem of numbers: variables from 0 to 1, an objective and limits of measures.

Designs are run by the runner of a sweep, many at once, and have the sweep's measures. A design that cannot be built, or
whose run does not reach its target, is infeasible: its numbers are NaN.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.cached_values import cached_property
from bellcrank.config.fields import parse_number
from bellcrank.config.numbers import split_number
from bellcrank.notes import Note
from bellcrank.scene.scene import Scene
from bellcrank.studies.axes import Axis
from bellcrank.studies.columns import Columns
from bellcrank.studies.design_runner import DesignRunner, StudyInterrupted
from bellcrank.studies.exceedance import Limit
from bellcrank.studies.sizing_measures import INFEASIBLE
from bellcrank.studies.sizing_runner import SizingRunner

Array = NDArray[np.float64]
BLOCK = 4096  # designs of one call of the runner


@dataclass(frozen=True, eq=False)
class Variable:
    """A number that is varied, with its bounds in the unit of its axis.

    With `sizes`, which rise, it is one of them; the bounds are the smallest and the largest.
    """

    axis: Axis
    lower: float
    upper: float
    sizes: tuple[float, ...] = ()

    @property
    def width(self) -> float:
        """Upper less lower bound."""
        return self.upper - self.lower


@dataclass(eq=False)
class DesignProblem:
    """What is looked for, and every design that was run.

    Attributes:
        scene: What is changed.
        runner: Runs designs.
        variables: What is varied.
        measure: The objective.
        sign: 1 to make it small, −1 to make it large.
        limits: Conditions that designs are to keep.
        threads: How many threads run designs.
        progress: Called with the number of designs that were run.
        notes: On the scene.
        scales: Of the objective and of each limit: the spread of their measures over the sample, and larger where a
            limit is far away.
        spreads: These spreads.
        points: The designs that were run, from 0 to 1, (n, variables).
        values: Objective, then the measures of the limits (n, 1 + limits); NaN where infeasible.
        reasons: Why designs are infeasible, by row.
    """

    scene: Scene
    runner: DesignRunner
    variables: tuple[Variable, ...]
    measure: str
    sign: float
    limits: tuple[Limit, ...]
    threads: int
    progress: Callable[[int], object]
    notes: tuple[Note, ...] = ()
    scales: Array = field(init=False)
    spreads: Array = field(init=False)
    points: list[Array] = field(default_factory=list)
    values: list[Array] = field(default_factory=list)
    reasons: dict[int, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.scales = self.spreads = np.ones(1 + len(self.limits))

    def reframed(self, measure: str, sign: float, limits: tuple[Limit, ...]) -> DesignProblem:
        """The same designs with another objective and limits, whose measures are among those of this problem."""
        found = replace(self, measure=measure, sign=sign, limits=limits, points=list(self.points))
        order = [self.measures.index(name) for name in found.measures]
        found.values, found.reasons = [values[:, order] for values in self.values], dict(self.reasons)
        found._set_spreads(self.spreads[order])
        return found

    @property
    def measures(self) -> tuple[str, ...]:
        """The measures of the objective and of the limits."""
        return (self.measure, *(limit.measure for limit in self.limits))

    def unit_of(self, k: int) -> str:
        """The unit of the objective (0) or of a limit's measure (from 1 on); empty where it has none."""
        unit = self.runner.units[self.measures[k]]
        return "" if unit == "1" else unit

    def measure_of(self, k: int, value: float) -> str:
        """The name of that measure with a value of it."""
        return f"{self.measures[k]} {value:.6g} {self.unit_of(k)}".rstrip()

    @property
    def count(self) -> int:
        """The number of designs that were run."""
        return sum(map(len, self.points))

    def numbers(self, points: Array) -> Array:
        """Values (n, variables) in the units of the axes, of points from 0 to 1; sizes are exactly those given."""
        lower, upper = (np.array([getattr(one, name) for one in self.variables]) for name in ("lower", "upper"))
        found = np.asarray(np.where(points == 1.0, upper, lower + points * (upper - lower)))
        for k, sizes in self.sizes.items():
            rows, places = np.nonzero(points[:, k, None] == sizes)
            found[rows, k] = np.array(self.variables[k].sizes)[places]
        return found

    def point(self, numbers: Sequence[float]) -> Array:
        """The point (variables,) of values in the units of the axes."""
        lower, width = (np.array([getattr(one, name) for one in self.variables]) for name in ("lower", "width"))
        return np.asarray((np.array(numbers) - lower) / width)

    def present_point(self) -> Array | None:
        """The point of the scene's own values, which may be outside the bounds; None where not all are known."""
        numbers, parameters = [], self.scene.parameters
        for k, axis in enumerate(variable.axis for variable in self.variables):
            name = self.runner.changes[k].path if isinstance(self.runner, SizingRunner) else axis.path
            name = name.removeprefix("parameters.").removesuffix(".value")
            own = parameters.get(name) or next((it for it in parameters.values() if it.sets == (axis.path,)), None)
            if own is not None:
                numbers.append(own.value / parse_number(axis.value(1.0), own.unit))
                continue
            written = _written(self.scene.data, axis.path)
            split = split_number(written) if isinstance(written, str) else None
            if split is None and isinstance(written, (int, float)) and not isinstance(written, bool):
                split = float(written), ""
            if split is None or split[1] != axis.suffix:
                return None
            numbers.append(split[0])
        return self.point(numbers)

    # ---- standard sizes

    @cached_property
    def sizes(self) -> dict[int, Array]:
        """The sizes (n,) from 0 to 1 of each variable that has some, by its number."""
        return {k: (np.array(one.sizes) - one.lower) / one.width for k, one in enumerate(self.variables) if one.sizes}

    @property
    def combinations(self) -> int:
        """How many combinations of sizes there are; 1 where no variable has sizes."""
        return math.prod(map(len, self.sizes.values()))

    def at_sizes(self, points: Array) -> Array:
        """Points (n, variables) with each variable that has sizes at the nearest of them."""
        found = points.copy()
        for k, sizes in self.sizes.items():
            found[:, k] = sizes[np.abs(points[:, k, None] - sizes).argmin(axis=1)]
        return found

    def within(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (n, variables) are designs that were asked for: within the bounds, and at sizes."""
        return np.asarray(((points >= 0.0) & (points <= 1.0) & (self.at_sizes(points) == points)).all(axis=1))

    def run(self, points: Array) -> Array:
        """Objective and measures of limits (n, 1 + limits) of designs; NaN where infeasible.

        Raises StudyInterrupted on Ctrl-C, once the designs that are done are kept.
        """
        found = []
        for first in range(0, len(points), BLOCK):
            part, before = points[first : first + BLOCK], self.count
            rows = np.arange(len(part))
            try:
                columns = self.runner.run(
                    self.numbers(part), threads=self.threads, progress=partial(self._report, before)
                )
            except StudyInterrupted as stopped:
                self._keep(part[stopped.rows], stopped.columns)
                raise
            found.append(self._keep(part[rows], columns))
            self.progress(self.count)
        return np.concatenate(found) if found else np.zeros((0, len(self.measures)))

    def _report(self, before: int, done: int) -> None:
        self.progress(before + done)

    def _keep(self, points: Array, columns: Columns) -> Array:
        reasons = dict(columns.reasons)
        if isinstance(self.runner, SizingRunner):  # a design that exceeds a rating has been sized all the same
            out = columns.statuses.index(INFEASIBLE) if len(columns) else 0
            reasons = {row: text for row, text in reasons.items() if columns.status[row] == out}
        values = np.stack([columns.measures[name] for name in self.measures], axis=1)
        for row in np.flatnonzero(~np.isfinite(values).all(axis=1)).tolist():
            reasons.setdefault(row, columns.reasons.get(row, f"it does not have {' and '.join(set(self.measures))}"))
        values[list(reasons)] = np.nan
        self.reasons |= {self.count + row: text for row, text in reasons.items()}
        self.points.append(points)
        self.values.append(values)
        return values

    # ---- scaled numbers

    def set_scales(self, values: Array) -> None:
        """Take the spread of the measures over a sample (n, 1 + limits) as their scales."""
        spreads = np.ones(values.shape[1])
        for k, column in enumerate(values.T):
            known = column[np.isfinite(column)]
            spread = float(np.subtract(*np.quantile(known, [0.9, 0.1]))) if len(known) else 0.0
            spreads[k] = spread if spread > 0.0 else max(abs(float(known[0])) if len(known) else 1.0, 1e-12)
        self._set_spreads(spreads)

    def _set_spreads(self, spreads: Array) -> None:
        self.spreads, self.scales = spreads, spreads.copy()
        for k, limit in enumerate(self.limits):  # so that the excess of a limit that is far away does not overflow
            self.scales[1 + k] = max(spreads[1 + k], 1e-9 * abs(limit.value))

    def objective(self, values: Array) -> Array:
        """The scaled objective (n,), to be made small."""
        return np.asarray(self.sign * values[:, 0] / self.scales[0])

    def excess(self, values: Array) -> Array:
        """By how much designs (n, 1 + limits) break each limit (n, limits), scaled; negative where they keep it."""
        found = np.zeros((len(values), len(self.limits)))
        for k, limit in enumerate(self.limits):
            beyond = (values[:, 1 + k] - limit.value) / self.scales[1 + k]
            found[:, k] = np.abs(beyond) if limit.relation == "=" else self.side(k) * beyond
        return found

    def side(self, k: int) -> float:
        """1 where a limit bounds its measure from above, −1 from below."""
        return -1.0 if self.limits[k].relation.startswith(">") else 1.0

    def violation(self, values: Array) -> Array:
        """The sum (n,) of what designs break of the limits, scaled; infinite where they are infeasible."""
        total = np.maximum(self.excess(values), 0.0).sum(axis=1)
        return np.asarray(np.where(np.isfinite(values).all(axis=1), total, np.inf))

    def best(self, tolerance: float) -> int | None:
        """The row of the best design within the bounds and at sizes: of those that keep the limits, else the one that
        breaks them least; None where none can be run. The scene's own design may be outside.
        """
        if not self.count:
            return None
        points, values = np.concatenate(self.points), np.concatenate(self.values)
        broken = np.where(self.within(points), self.violation(values), np.inf)
        if not np.isfinite(broken).any():
            return None
        broken[broken <= tolerance] = 0.0
        return int(np.lexsort((self.objective(values), broken))[0])


def _written(data: Any, path: str) -> Any:
    """What a scene's mapping says under a dotted path; None where it says nothing there."""
    for key in path.split("."):
        data = data.get(key) if isinstance(data, dict) else None
    return data
