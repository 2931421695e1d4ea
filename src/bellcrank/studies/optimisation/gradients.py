"""Values and gradients of the objective and the limits at a design.

They are exact where bellcrank has derivatives: events and ends of runs (`Trajectory.sensitivity`), and peak and RMS
torques of sizings (`Sizing.sensitivities`), whose peaks come with all maxima over time that may become the peak.
Otherwise they are differences of fourth order of designs that are run together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.config.fields import parse_number
from bellcrank.errors import BellcrankError
from bellcrank.simulation.simulate import simulate
from bellcrank.sizing.sensitivities import sizing_sensitivities, torque_maxima
from bellcrank.studies.designs.plain_axes import ValueKind
from bellcrank.studies.designs.sizing_changes import factors
from bellcrank.studies.execution.simulation_runner import NOISE, SimulationRunner
from bellcrank.studies.execution.sizing_runner import SizingRunner
from bellcrank.studies.optimisation.formulas import choices
from bellcrank.studies.optimisation.waypoint_gradients import covers, slopes_of

if TYPE_CHECKING:
    from bellcrank.simulation.sensitivities.sensitivities import RunSensitivity
    from bellcrank.studies.optimisation.problem import DesignProblem

# Weights of f(x + k h) in h f'(x), with the error h^4 f''''' / 30 (central) or h^4 f''''' / 5: B. Fornberg, Math. Comp.
# 51 (1988) 699-706, tables 1 and 2.
STENCILS = (
    {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12},
    {0: -25 / 12, 1: 4.0, 2: -3.0, 3: 4 / 3, 4: -1 / 4},
    {0: 25 / 12, -1: -4.0, -2: 3.0, -3: -4 / 3, -4: 1 / 4},
)
SHORTEST, LONGEST = 1e-3, 2e-2  # steps of differences, as shares of the width between the bounds
PEAK = "peak_torque"
OF_JOINT = (PEAK, "rms_torque", "peak_speed")


class GradientRow(NamedTuple):
    """One smooth function: a measure, or one of the maxima of which a peak is the largest.

    Attributes:
        value: In the unit of the measure.
        gradient: (variables,) by the points from 0 to 1.
        key: What it is, to find it again at a near design.
        time: s, of a maximum.
    """

    value: float
    gradient: Array
    key: tuple[str, ...] = ()
    time: float = 0.0


@dataclass(eq=False)
class Gradients:
    """Computes the rows of the measures of a problem.

    Attributes:
        problem: The problem.
        exact: Which measures, of which formulas may be made, have exact gradients.
    """

    problem: DesignProblem
    exact: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        noise = self.problem.runner.noise[1] / (NOISE if isinstance(self.problem.runner, SimulationRunner) else 1.0)
        self.step = float(np.clip(0.3 * noise**0.2, SHORTEST, LONGEST))
        self.factors = np.array([variable.width for variable in self.problem.variables])
        self.names = self._names() if self.problem.robustness is None else ()
        runner = self.problem.runner
        plain = self.problem.robustness is None and not self.names
        self.beside = plain and isinstance(runner, SizingRunner) and covers(runner.shared)
        if self.names:
            self.exact = frozenset(filter(self._is_exact, self.problem.leaves))

    @property
    def exact_measures(self) -> frozenset[str]:
        """The measures and formulas whose gradients are exact."""
        problem = self.problem
        return frozenset(name for name in problem.measures if self.exact.issuperset(problem.leaves_of(name)))

    def at(
        self, points: Sequence[Array], values: Sequence[Array], free: Sequence[Mask] | None = None
    ) -> list[list[list[GradientRow]]]:
        """For each design, the rows of each measure, which is the largest of them; `values` (1 + limits,) are its own.

        A gradient that is not known, because designs beside it are infeasible, is NaN. That by a variable that is not
        `free` (variables,) may be 0 instead.
        """
        every = np.ones((len(points), len(self.factors)), dtype=bool)
        wanted = every if free is None else np.array(free)
        if self.problem.robustness is not None and len(points):
            return self._rows_of_scenarios(np.array(points), wanted)
        measures = self.problem.leaves
        plain = [self.problem.plain[point.tobytes()] for point in points]
        found = [[list[GradientRow]() for _ in measures] for _ in points]
        for rows, point, value in zip(found, points, plain, strict=True):
            if self.exact:
                own = self._exact_rows(point)
                for k, name in enumerate(measures):
                    if given := own.get(name):
                        shift = value[k] - max(row.value for row in given)  # to the value of the sweep's engine
                        rows[k] = [row._replace(value=row.value + shift) for row in given]
        if self.beside:
            for rows, point, value in zip(found, points, plain, strict=True):
                for name, near in self._rows_of_waypoints(point).items():
                    if name in measures and not rows[k := measures.index(name)]:
                        shift = value[k] - max(row.value for row in near)
                        rows[k] = [row._replace(value=row.value + shift) for row in near]
        left = [k for k, name in enumerate(measures) if any(not rows[k] for rows in found)]
        if left:
            slopes = self._differences(np.array(points), np.array(plain), wanted, self.problem.run_plain)
            for rows, value, slope in zip(found, plain, slopes, strict=True):
                for k in left:
                    rows[k] = rows[k] or [GradientRow(float(value[k]), slope[k], (measures[k],))]
        return [self._of_measures(rows, value) for rows, value in zip(found, plain, strict=True)]

    def _of_measures(self, rows: Sequence[Sequence[GradientRow]], plain: Array) -> list[list[GradientRow]]:
        """The rows of measures and formulas from those of the measures that these are made from.

        Of a peak that makes a design worse all maxima count; one that makes it better, or is to have a value, is no set
        of conditions: its largest maximum counts.
        """
        problem, found = self.problem, []
        equal = [False, *(limit.relation == "=" for limit in problem.limits)]
        for name, side, same in zip(problem.measures, problem.sides.tolist(), equal, strict=True):
            at = [problem.leaves.index(leaf) for leaf in problem.leaves_of(name)]
            value, slopes = plain[at], np.ones(1)
            if formula := problem.formulas.get(name):
                value, slopes = plain[at], formula.slopes(plain[at])
            several, drops = [], []
            for k, top, slope in zip(at, value, slopes.tolist(), strict=True):
                own = rows[k] if slope * side > 0.0 and not same else [max(rows[k], key=lambda row: row.value)]
                several.append(own)
                drops.append([abs(slope) * (top - row.value) for row in own])
            if formula is None:
                found.append(list(several[0]))
                continue
            whole = float(formula.values(value))
            found.append([self._combined(chosen, whole, value, slopes) for chosen in choices(several, drops)])
        return found

    @staticmethod
    def _combined(chosen: Sequence[GradientRow], whole: float, plain: Array, slopes: Array) -> GradientRow:
        """The formula, linearised where each measure is one of its rows."""
        beyond = float(sum(s * (row.value - v) for s, row, v in zip(slopes, chosen, plain, strict=True)))
        gradient = np.sum([s * row.gradient for s, row in zip(slopes, chosen, strict=True)], axis=0)
        time = sum(k * row.time for k, row in enumerate(chosen, 1))
        return GradientRow(whole + beyond, gradient, tuple(part for row in chosen for part in row.key), time)

    # ---- differences

    def _rows_of_scenarios(self, points: Array, free: Mask) -> list[list[list[GradientRow]]]:
        """Of the worst, a row for each deviation; of mean and standard deviation, their row."""
        robust = self.problem.robustness
        assert robust is not None
        values = self.problem.run_scenarios(points)
        slopes = self._differences(points, values.reshape(len(points), -1), free, self.problem.run_scenarios)
        slopes = slopes.reshape(*values.shape, -1)
        combined, found = robust.combined(values, self.problem.sides), []
        for one, slope, whole in zip(values, slopes, combined, strict=True):
            rows = []
            for k, (name, side) in enumerate(zip(self.problem.measures, self.problem.sides.tolist(), strict=True)):
                if robust.factor is None:
                    several = zip(one[:, k].tolist(), slope[:, k], strict=True)
                    rows.append([GradientRow(value, by, (name, str(s))) for s, (value, by) in enumerate(several)])
                else:
                    rows.append([GradientRow(float(whole[k]), robust.weights(one[:, k], side) @ slope[:, k], (name,))])
            found.append(rows)
        return found

    def _differences(self, points: Array, values: Array, free: Mask, run_designs: Callable[[Array], Array]) -> Array:
        """Slopes (designs, measures, variables) of designs (n, variables); NaN where no stencil fits.

        `values` (n, measures) are those of the designs; where they are judged at deviations, those of each, as columns.
        """
        found = np.where(free[:, None, :], np.full((1, values.shape[1], 1), np.nan), 0.0)
        for stencil in STENCILS:
            wanted, asked = [], []
            for row, k in np.argwhere(np.isnan(found).any(axis=1)).tolist():
                ends = [points[row, k] + self.step * end for end in (min(stencil), max(stencil))]
                if ends[0] >= 0.0 and ends[1] <= 1.0:
                    wanted.append((row, k))
                    for place in filter(None, stencil):
                        beside = points[row].copy()
                        beside[k] += place * self.step
                        asked.append(beside)
            if not wanted:
                continue
            run = iter(run_designs(np.array(asked)).reshape(len(asked), -1))
            for row, k in wanted:
                parts = [w * (next(run) if place else values[row]) for place, w in stencil.items()]
                found[row, :, k] = np.sum(parts, axis=0) / self.step
        return found

    def _rows_of_waypoints(self, point: Array) -> dict[str, list[GradientRow]]:
        """The rows of measures by differences with maxima where they are, at a design; none where there are none."""
        runner = self.problem.runner
        assert isinstance(runner, SizingRunner)
        found = slopes_of(runner.shared, self.problem.numbers(point[None])[0] * factors(runner.axes, runner.changes),
                          self.factors)  # fmt: skip
        return {
            name: [GradientRow(value, slope, (name,), time) for value, slope, time in several]
            for name, several in found.items()
        }

    # ---- exact

    def _names(self) -> tuple[str, ...]:
        """The names of the variables for sensitivities; none where one of them has no derivatives."""
        runner = self.problem.runner
        if isinstance(runner, SizingRunner):
            self.factors = self.factors * factors(runner.axes, runner.changes)
            known = all(change.kind == "parameter" for change in runner.changes) and not runner._path_notes()
            return tuple(change.path for change in runner.changes) if known else ()
        if not isinstance(runner, SimulationRunner):
            return ()
        plain = {axis.column: axis for axis in runner.designs.plain}
        starts = {ValueKind.PARAMETER: "", ValueKind.POSITION: "initial.", ValueKind.VELOCITY: "initial.velocity."}
        found = []
        for k, axis in enumerate(runner.axes):
            own = next((name for name, it in runner.scene.parameters.items() if it.sets == (axis.path,)), None)
            if own is not None:  # a number of the robot's tree, which the sweep has declared as a parameter
                found.append(own)
                self.factors[k] *= parse_number(axis.value(1.0), runner.scene.parameters[own].unit)
            elif k in plain and plain[k].kind in starts:
                found.append(starts[plain[k].kind] + plain[k].name)
                self.factors[k] *= plain[k].factor
            else:
                return ()
        return tuple(found)

    def _is_exact(self, measure: str) -> bool:
        runner, (first, _, rest) = self.problem.runner, measure.partition(".")
        if isinstance(runner, SizingRunner):
            return measure.rpartition(".")[2] in OF_JOINT and measure.rpartition(".")[0] in {
                joint.name for joint in runner.base.joints
            }
        scene = self.problem.runner.scene  # type: ignore[attr-defined]
        joints = {joint.name for joint in scene.robot.joints if joint.nv == 1}
        own = rest.removesuffix(".velocity") in joints
        if first == "start":
            return rest in joints
        if first == "end":
            scalar = rest in scene.outputs and len(list(scene.outputs[rest].quantity.suffixes())) == 1
            return not any(event.stop for event in scene.events) and (own or scalar)
        return first in {event.name for event in scene.events} and (own or rest in ("time", "impulse", "energy_lost"))

    def _exact_rows(self, point: Array) -> dict[str, list[GradientRow]]:
        """The rows of the exact measures at a design; none of them where the run has no derivatives there."""
        numbers = self.problem.numbers(point[None])[0].tolist()
        try:
            if isinstance(self.problem.runner, SizingRunner):
                return self._rows_of_sizing(self.problem.runner, numbers)
            return self._rows_of_run(numbers)
        except BellcrankError:
            return {}

    def _rows_of_sizing(self, runner: SizingRunner, numbers: list[float]) -> dict[str, list[GradientRow]]:
        sizing = runner.design(numbers)
        wanted = [measure.rpartition(".") for measure in sorted(self.exact)]
        kinds, found = {kind for _, _, kind in wanted}, dict[str, list[GradientRow]]()
        maxima = torque_maxima(sizing, self.names) if PEAK in kinds else {}
        slopes = sizing_sensitivities(sizing, self.names) if kinds - {PEAK} else ()
        for joint, _, kind in wanted:
            if kind == PEAK:
                found[f"{joint}.{kind}"] = [
                    GradientRow(
                        abs(it.torque), self.factors * np.sign(it.torque) * it.slope, (joint, it.motion), it.time
                    )
                    for it in maxima[joint]
                ]
            else:
                gradient = np.array([getattr(one.joint(joint), kind) for one in slopes])
                found[f"{joint}.{kind}"] = [GradientRow(0.0, self.factors * gradient, (joint, kind))]
        return found

    def _rows_of_run(self, numbers: list[float]) -> dict[str, list[GradientRow]]:
        runner = self.problem.runner
        assert isinstance(runner, SimulationRunner)
        scene = runner.scene.with_overrides(runner.designs.overrides(numbers))
        run = simulate(scene, sensitivities=self.names, samples=2)
        by = [run.sensitivity(name) for name in self.names]
        found = {}
        for measure in self.exact:
            gradient = self.factors * np.array([_slope(one, measure) for one in by])
            found[measure] = [GradientRow(0.0, gradient, (measure,))]
        return found


def _slope(by: RunSensitivity, measure: str) -> float:
    """The derivative of a measure of a run. Raises BellcrankError where the run does not have it."""
    first, _, rest = measure.partition(".")
    joints = {joint.name: joint for joint in by.run.robot.joints}
    name = rest.removesuffix(".velocity")
    if first == "start":
        return float(by.position[0, joints[rest].q])
    if first == "end":
        if name not in joints:
            return float(by.output(rest)[-1])
        values = by.velocity[-1, joints[name].v] if name != rest else by.position[-1, joints[name].q]
        return float(values)
    event = by.event(first)
    if rest in ("time", "impulse", "energy_lost"):
        return float(getattr(event, rest))
    return float(event.velocity[joints[name].v] if name != rest else event.position[joints[name].q])
