"""A search for the best design as a problem of numbers: variables from 0 to 1, an objective and limits of measures.

Designs are run by the runner of a sweep, many at once, and have the sweep's measures. A design that cannot be built, or
whose run does not reach its target, is infeasible: its numbers are NaN.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.cached_values import cached_property
from bellcrank.config.fields import parse_number
from bellcrank.config.units import split_number, whole_number
from bellcrank.notes import Note
from bellcrank.scene.scene import Scene
from bellcrank.studies.designs.axes import StudyAxis
from bellcrank.studies.designs.sizing_changes import PLACEMENT, present_duration
from bellcrank.studies.execution.design_runner import DesignRunner, StudyInterrupted
from bellcrank.studies.execution.execution import Executor, LocalExecutor
from bellcrank.studies.execution.executors import Opened
from bellcrank.studies.execution.fastest_runner import FastestRunner
from bellcrank.studies.execution.sizing_runner import SizingRunner
from bellcrank.studies.execution.study import run_study
from bellcrank.studies.optimisation.formulas import Formula
from bellcrank.studies.optimisation.kept_designs import KeptDesigns, Ran
from bellcrank.studies.optimisation.robustness import CHECKED, Robustness
from bellcrank.studies.results.exceedance import Limit
from bellcrank.studies.results.sizing_measures import INFEASIBLE
from bellcrank.studies.results.study_columns import StudyColumns

BLOCK = 4096  # designs of one call of the runner


@dataclass(frozen=True, eq=False)
class Variable:
    """A number that is varied, with its bounds in the unit of its axis.

    With `sizes`, which rise, it is one of them; the bounds are the smallest and the largest.
    """

    axis: StudyAxis
    lower: float
    upper: float
    sizes: tuple[float, ...] = ()

    @property
    def width(self) -> float:
        """Upper less lower bound."""
        return self.upper - self.lower


@dataclass(frozen=True, eq=False)
class GivenDesigns:
    """Designs by their values (n, axes), in the axes' units."""

    numbers: Array

    @property
    def count(self) -> int:
        """The number of designs."""
        return len(self.numbers)

    @property
    def identity(self) -> Mapping[str, str]:
        """None: they are kept by their values (kept_designs.py)."""
        return {}

    def values(self, first: int, stop: int) -> Array:
        """As in Designs."""
        return self.numbers[first:stop]


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
        executor: What runs designs, in whose block searches are.
        progress: Called with the number of designs that were run.
        notes: On the scene.
        robustness: How designs are judged at deviations of their values; None: at their values alone.
        scales: Of the objective and of each limit: the spread of their measures over the sample, and larger where a
            limit is far away.
        spreads: These spreads.
        formulas: Those of the objective and the limits that are formulas of measures, by their texts.
        kept: The folder that keeps designs; None: none does.
        points: The designs that were run, from 0 to 1, (n, variables).
        values: Objective, then the measures of the limits (n, 1 + limits); NaN where infeasible.
        reasons: Why designs are infeasible, by row.
        plain: The measures (leaves,) of designs, by the bytes of their points, where there are no deviations.
    """

    scene: Scene
    runner: DesignRunner
    variables: tuple[Variable, ...]
    measure: str
    sign: float
    limits: tuple[Limit, ...]
    executor: Executor
    progress: Callable[[int], object]
    notes: tuple[Note, ...] = ()
    robustness: Robustness | None = None
    formulas: Mapping[str, Formula] = field(default_factory=dict)
    kept: KeptDesigns | None = None
    scales: Array = field(init=False)
    spreads: Array = field(init=False)
    points: list[Array] = field(default_factory=list)
    values: list[Array] = field(default_factory=list)
    reasons: dict[int, str] = field(default_factory=dict)
    plain: dict[bytes, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.scales = self.spreads = np.ones(1 + len(self.limits))

    def reframed(self, measure: str, sign: float, limits: tuple[Limit, ...]) -> DesignProblem:
        """The same designs with another objective and limits, whose measures are among those of this problem."""
        found = replace(self, measure=measure, sign=sign, limits=limits, points=list(self.points))
        if self.robustness is None:
            order = [self.measures.index(name) for name in found.measures]
        else:  # the worst of a measure is another number from above than from below
            known = list(zip(self.measures, self.sides.tolist(), strict=True))
            order = [known.index(one) for one in zip(found.measures, found.sides.tolist(), strict=True)]
        found.values, found.reasons = [values[:, order] for values in self.values], dict(self.reasons)
        leaves = [self.leaves.index(name) for name in found.leaves]
        found.plain = {key: values[leaves] for key, values in self.plain.items()}
        found._set_spreads(self.spreads[order])
        return found

    @property
    def measures(self) -> tuple[str, ...]:
        """The measures of the objective and of the limits."""
        return (self.measure, *(limit.measure for limit in self.limits))

    @cached_property
    def leaves(self) -> tuple[str, ...]:
        """The measures that these are or are made from, each once."""
        return tuple(dict.fromkeys(leaf for name in self.measures for leaf in self.leaves_of(name)))

    def leaves_of(self, measure: str) -> tuple[str, ...]:
        """The measures that a formula is made from; a measure itself."""
        return self.formulas[measure].leaves if measure in self.formulas else (measure,)

    @property
    def units(self) -> dict[str, str]:
        """The units of measures and formulas."""
        return {**self.runner.units, **{name: one.unit for name, one in self.formulas.items()}}

    def evaluated(self, plain: Array) -> Array:
        """The measures (…, 1 + limits) from those (…, leaves) that they are made from."""
        found = []
        for name in self.measures:
            columns = plain[..., [self.leaves.index(leaf) for leaf in self.leaves_of(name)]]
            found.append(self.formulas[name].values(columns) if name in self.formulas else columns[..., 0])
        return np.stack(found, axis=-1)

    def unit_of(self, k: int) -> str:
        """The unit of the objective (0) or of a limit's measure (from 1 on); empty where it has none."""
        unit = self.units[self.measures[k]]
        return "" if unit == "1" else unit

    def measure_of(self, k: int, value: float) -> str:
        """The name of that measure with a value of it."""
        return f"{self.label(k)} {value:.6g} {self.unit_of(k)}".rstrip()

    def label(self, k: int) -> str:
        """The name of that measure, with how it is judged."""
        return self.measures[k] if self.robustness is None else f"{self.robustness.rule} of {self.measures[k]}"

    @property
    def sides(self) -> Array:
        """(1 + limits,) 1 where a large measure is worse, −1 where a small one is."""
        return np.array([self.sign, *map(self.side, range(len(self.limits)))])

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
        found = [present_number(self.runner, k, variable.axis) for k, variable in enumerate(self.variables)]
        numbers = [number for number in found if number is not None]
        return self.point(numbers) if len(numbers) == len(found) else None

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

    def within(self, points: Array) -> Mask:
        """Whether points (n, variables) are designs that were asked for: within the bounds, and at sizes."""
        return np.asarray(((points >= 0.0) & (points <= 1.0) & (self.at_sizes(points) == points)).all(axis=1))

    def run(self, points: Array) -> Array:
        """Objective and measures of limits (n, 1 + limits) of designs; NaN where infeasible.

        Raises StudyInterrupted on Ctrl-C, once the designs that are done are kept.
        """
        return self._combined(self.run_scenarios(points))

    def run_scenarios(self, points: Array) -> Array:
        """The same at each deviation (n, scenarios, 1 + limits); one, the design itself, where it is judged so."""
        return self.evaluated(self.run_plain(points))

    def run_plain(self, points: Array) -> Array:
        """The measures (n, scenarios, leaves) that these are made from."""
        found, each = [], self._scenarios
        block = max(BLOCK // each, 1)
        for first in range(0, len(points), block):
            part, before = points[first : first + block], self.count
            numbers = self._designs(part)
            ran = Ran.none(len(numbers), self.leaves)
            if self.kept is not None:
                ran = self.kept.recalled(numbers, self.leaves)
            try:
                self._run_new(numbers, ran, partial(self._report, before))
            except StudyInterrupted:
                done = np.flatnonzero(ran.done.reshape(-1, each).all(axis=1))
                self._keep(part[done], ran.part((each * done[:, None] + np.arange(each)).ravel()))
                raise
            found.append(self._keep(part, ran))
            self.progress(self.count)
        return np.concatenate(found) if found else np.zeros((0, each, len(self.leaves)))

    def _run_new(self, numbers: Array, ran: Ran, progress: Callable[[int], object]) -> None:
        """Run the designs with values (n, axes) that were not run before. Raises StudyInterrupted as `run`."""
        rows, stopped = np.flatnonzero(~ran.done), None
        if not len(rows):
            return
        try:
            columns = self._columns(numbers[rows], progress)
        except StudyInterrupted as error:
            columns, rows, stopped = error.columns, rows[error.rows], error
        if len(rows):
            ran.fill(rows, self._ran(columns, self.leaves))
            if self.kept is not None:
                self.kept.add(numbers[rows], self._ran(columns, self.kept.names))
        if stopped is not None:
            raise stopped

    def _columns(self, numbers: Array, progress: Callable[[int], object]) -> StudyColumns:
        """The columns of designs with values (n, axes). Raises StudyInterrupted as `run`."""
        designs, executor = GivenDesigns(numbers), Opened(self.executor)
        found = run_study(designs, self.runner, executor, progress=lambda done, _: progress(done))
        if not found.complete:
            raise StudyInterrupted(found.designs, found.columns)
        return found.columns

    def keep_in(self, folder: KeptDesigns) -> None:
        """Keep each design that is run in a folder, and take those that are there as they are. Raises InputError."""
        axes = [one.path for one in self.runner.axes]  # type: ignore[attr-defined]
        folder.open(self.runner.identity, axes, self.leaves)
        self.kept = folder

    @cached_property
    def _scenarios(self) -> int:
        return 1 if self.robustness is None else len(self.robustness.deviations)

    def _designs(self, points: Array) -> Array:
        """The values (n · scenarios, axes) at which designs are run."""
        numbers = self.numbers(points)
        return numbers if self.robustness is None else self.robustness.designs(numbers, self.robustness.deviations)

    def _combined(self, values: Array) -> Array:
        return values[:, 0] if self.robustness is None else self.robustness.combined(values, self.sides)

    def as_designed(self, point: Array) -> StudyColumns:
        """The columns of a design without deviations."""
        numbers = self.numbers(point[None])
        if self.robustness is not None:
            numbers = self.robustness.designs(numbers, np.zeros((1, len(self.robustness.axes))))
        return self.runner.run(numbers)

    def checked(self, point: Array) -> Array:
        """The measures (1 + limits,) of a design as it is judged, at other deviations; NaN where one cannot be run."""
        assert self.robustness is not None
        drawn = self.robustness.drawn(CHECKED, 1)
        designs = self.robustness.designs(self.numbers(point[None]), drawn)
        columns = self.runner.run(designs, threads=LocalExecutor().threads)  # also after the block of the executor
        return np.asarray(self._combined(self.of_columns(columns)[None])[0])

    def of_columns(self, columns: StudyColumns) -> Array:
        """The measures (n, 1 + limits) of columns; NaN where infeasible."""
        return self.evaluated(self._ran(columns, self.leaves).judged()[0])

    def _report(self, before: int, done: int) -> None:
        self.progress(before + done // self._scenarios)

    def _keep(self, points: Array, ran: Ran) -> Array:
        """Keep designs with what was run of them; their measures (n, scenarios, leaves)."""
        each = self._scenarios
        values, reasons = ran.judged()
        for name, column in zip(self.measures, self.evaluated(values).T, strict=True):
            for row in np.flatnonzero(np.isnan(column)).tolist():
                reasons.setdefault(row, f"the formula '{name}' has no finite value")
        values = values.reshape(len(points), each, -1)
        for row in sorted(reasons, reverse=True):  # so that the first is named
            text = reasons[row]
            if self.robustness is not None:
                text = f"at a deviation within the tolerances: {text}"
            self.reasons[self.count + row // each] = text
            values[row // each] = np.nan
        self.points.append(points)
        self.values.append(self._combined(self.evaluated(values)))
        if self.robustness is None:
            self.plain.update(zip((point.tobytes() for point in points), values[:, 0], strict=True))
        return values

    def _ran(self, columns: StudyColumns, names: Sequence[str]) -> Ran:
        """What was run, with some of the measures."""
        count, reasons = len(columns), columns.reasons
        out = np.isin(np.arange(count), list(reasons))
        if isinstance(self.runner, SizingRunner):  # a design that exceeds a rating has been sized all the same
            out = columns.status == columns.statuses.index(INFEASIBLE)
        values = np.stack([columns.measures[name] for name in names], axis=1)
        return Ran(tuple(names), np.ones(count, dtype=np.bool_), values, out, dict(reasons))

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

    @property
    def error(self) -> float:
        """How the scaled objective errs from one design to the next, where that is more than rounding."""
        return self.runner.noise[0] / float(self.scales[0]) if isinstance(self.runner, FastestRunner) else 0.0

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


def present_number(runner: DesignRunner, k: int, axis: StudyAxis) -> float | None:
    """The scene's own value of the axis k of a runner, in its unit; None where it is not known."""
    scene: Scene = runner.scene  # type: ignore[attr-defined]
    parameters = scene.parameters
    name = runner.changes[k].path if isinstance(runner, SizingRunner | FastestRunner) else axis.path
    name = name.removeprefix("parameters.").removesuffix(".value")
    own = parameters.get(name) or next((it for it in parameters.values() if it.sets == (axis.path,)), None)
    if own is not None:
        return own.value / parse_number(axis.value(1.0), own.unit)
    written = written_value(scene.data, axis.path)
    if written is None:
        written = present_duration(scene, axis.path)
    if written is None and PLACEMENT.match(axis.path):
        written = 0.0  # the path lies as it is written
    if isinstance(written, str) and axis.unit and not axis.suffix:  # in SI units, however it is written
        try:
            return parse_number(written, axis.unit)
        except ValueError:
            return None
    split = split_number(written) if isinstance(written, str) else None
    if split is None and isinstance(written, (int, float)) and not isinstance(written, bool):
        split = float(written), ""
    return None if split is None or split[1] != axis.suffix else split[0]


def written_value(data: Any, path: str) -> Any:
    """What a scene's mapping says under a dotted path, with entries of lists by number from 1; None: nothing."""
    for key in path.split("."):
        if isinstance(data, dict):
            data = data.get(key)
        else:
            number = whole_number(key) if isinstance(data, list) else None
            data = data[number - 1] if number is not None and 1 <= number <= len(data) else None
    return data
