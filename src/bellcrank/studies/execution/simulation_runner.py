"""Simulations of many designs of a scene: from their values to their measures, status and reasons, in columns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Array, Indices
from bellcrank.cached_values import Portable, cached_property
from bellcrank.dynamics.equations.system import system_of
from bellcrank.dynamics.inverse.input_breakpoints import prescribed_motion_end, signals_until
from bellcrank.elements.signals import values_at
from bellcrank.errors import BellcrankError, InputError
from bellcrank.scene.scene import Scene
from bellcrank.simulation.integration.ensemble import EnsembleResult, EnsembleStarts, integrate_ensemble
from bellcrank.simulation.integration.integration_problem import known_signals
from bellcrank.simulation.integration.statistics import Status
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank.studies.designs.plain_axes import DesignAxis
from bellcrank.studies.designs.scene_designs import DesignGroup, SceneDesigns
from bellcrank.studies.execution.design_runner import StudyInterrupted, scene_identity
from bellcrank.studies.execution.run_outcomes import INFEASIBLE, STATUSES, outcomes
from bellcrank.studies.execution.runs import Runs
from bellcrank.studies.results.measures import default_measures, run_measures, start_measures
from bellcrank.studies.results.study_columns import StudyColumns

if TYPE_CHECKING:
    from bellcrank.studies.results.measures import Measure

Progress = Callable[[int], object]
NOISE = 100.0  # of the tolerances: the error of a run, which is the sum of those of its steps


class SimulationRunner(Portable):
    """Runs the designs of a scene along the axes of a study (a DesignRunner)."""

    def __init__(self, scene: Scene, axes: Sequence[DesignAxis]) -> None:
        """Raises InputError for a scene in which nothing can move."""
        if not scene.robot.nv:
            raise InputError(
                f"{scene.source}: {scene.robot.urdf.name} has no movable joint, so there is nothing to simulate; "
                "floating_base: true in a scene frees its base"
            )
        self.scene, self.axes = scene, tuple(axes)

    @cached_property
    def designs(self) -> SceneDesigns:
        """What makes parameters and starts of values."""
        return SceneDesigns(self.scene, self.axes)

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Every measure by name with its unit, in the order of the columns."""
        found: dict[str, str] = {}
        for scene in filter(None, (self.scene, self._nearby)):
            none = Runs.none(scene)
            start = start_measures(scene.robot, none.start[:, : scene.robot.nq])
            found = {measure.name: measure.unit for measure in (*start, *run_measures(none))} | found
        return found

    @property
    def _nearby(self) -> Scene | None:
        """A design in whose equations no row of a constraint vanishes by chance, which may have more multipliers."""
        parameters = {axis.path: self.scene.parameters.get(axis.path) for axis in self.axes}
        nudged = {path: 1.001 * known.value + 1e-3 for path, known in parameters.items() if known is not None}
        if not nudged or not self.scene.constraints:
            return None
        try:
            scene = self.scene.with_overrides(nudged)
            return None if system_of(scene) is system_of(self.scene) else scene
        except BellcrankError:
            return None

    @property
    def default_measures(self) -> tuple[str, ...]:
        """The measures that tables and plots show if they vary."""
        return default_measures(self.scene, self.units)

    @property
    def noise(self) -> tuple[float, float]:
        """Absolute and relative differences of a measure up to which they are errors of the integration."""
        return NOISE * self.scene.settings.atol, NOISE * self.scene.settings.rtol

    @cached_property
    def identity(self) -> Mapping[str, str]:
        """What the results depend on, by a name that a user understands."""
        scene = self.scene
        return {
            **scene_identity(scene),
            "equations": scene.structure_key[:12],
            "solver settings": repr(scene.settings),
        }

    def run(self, values: Array, *, threads: int = 1, progress: Progress | None = None) -> StudyColumns:
        """The columns of designs with values (n, axes); see DesignRunner."""
        table = ResultTable(self.units, len(values))
        try:
            block = self.designs.block(values, threads=threads)
            table.fill(slice(None), list(start_measures(self.scene.robot, block.start_position)))
            table.refuse(block.infeasible)
            for group in block.groups:
                runs, rows = self._runs(group, values, threads, _beyond(table.count, progress))
                measures = list(run_measures(runs))
                began = start_measures(self.scene.robot, runs.start[:, : self.scene.robot.nq])
                table.fill(rows, measures)
                table.settle(rows, *outcomes(runs, [*began, *measures]))
                if len(rows) < len(group.rows):
                    raise KeyboardInterrupt
        except KeyboardInterrupt:
            raise StudyInterrupted(*table.settled()) from None
        return table.columns()

    def _runs(
        self, group: DesignGroup, values: Array, threads: int, progress: Progress | None
    ) -> tuple[Runs, NDArray[np.int64]]:
        """The runs of a group of designs and their rows: all, or those that were done before an interruption."""
        scene, signals, duration = group.scene, group.scene.signals, group.duration
        end = prescribed_motion_end(scene)
        if end is not None:
            signals, duration = signals_until(scene, end.time), np.minimum(duration, end.time)
        signals = known_signals(scene, signals)
        starts = EnsembleStarts(
            parameters=group.parameters,
            start=group.start,
            duration=duration,
            settings=group.settings,
            signals=signals,
        )
        result = integrate_ensemble(scene, starts, threads=threads, progress=progress)
        early = (result.status == list(Status).index(Status.FINISHED)) & (duration < group.duration)
        result.status[early] = list(Status).index(Status.PRESCRIBED_MOTION_ENDED)
        self._simulate_turned_over(group, values, result)
        runs = Runs(
            scene=scene,
            signals=signals,
            duration=group.duration,
            parameters=group.parameters,
            start=group.start,
            result=result,
        )
        if result.done.all():
            return runs, group.rows
        done = np.flatnonzero(result.done)
        return runs.part(done), group.rows[done]

    def _scene(self, values: Array) -> Scene:
        """The scene of a design with values (axes,)."""
        return self.scene.with_overrides(self.designs.overrides(values.tolist()))

    def _simulate_turned_over(self, group: DesignGroup, values: Array, result: EnsembleResult) -> None:
        """Simulate designs one by one in which a weld or hinge turned over; such a run ends before that."""
        cosines = system_of(group.scene).observed_layout.cosines
        turned = result.done & ~(result.least[:, cosines] > 0.0).all(axis=1)
        for row in np.flatnonzero(turned).tolist():
            scene = self._scene(values[group.rows[row]])
            run = simulate(scene)
            if run.status is not Status.TURNED_OVER:  # between its rows
                run = simulate(scene, times="steps")
            if run.status is Status.INTERRUPTED:
                result.done[row:] = False
                return
            _store(result, row, run)


def _beyond(done: int, progress: Progress | None) -> Progress | None:
    """A function that reports so many more designs."""
    return None if progress is None else lambda count: progress(done + count)


def _store(result: EnsembleResult, row: int, run: Trajectory) -> None:
    """Put what a run found into a row of the record; extremes are those of the run's rows."""
    system, events, known = system_of(run.scene), run.scene.events, set[str]()
    size = system.nq + system.nv + system.nz
    found = run.signals[len(known_signals(run.scene, run.signals)) :]

    def held(time: float) -> Array:
        values: Array = values_at(found, np.array([time]))[0]
        return values

    result.held_start[row], result.held_end[row] = held(0.0), held(float(run.time[-1]))
    result.status[row] = list(Status).index(run.status)
    result.end_time[row], result.end_state[row] = run.time[-1], run.state[-1]
    result.stopped_by[row] = -1
    for k, rule in enumerate(events):
        mine = [event for event in run.events if event.name == rule.name and rule.name not in known]
        known.add(rule.name)
        lost = [it for it in run.statistics.unresolved if it.event == rule.name]
        result.event_count[row, k] = len(mine) + run.statistics.omitted_events.get(rule.name, 0)
        result.unresolved[row, k] = sum(it.steps for it in lost if not it.undefined)
        result.undefined[row, k] = sum(it.steps for it in lost if it.undefined)
        result.event_time[row, k], result.event_state[row, k] = np.nan, np.nan
        if mine:
            result.event_time[row, k] = mine[0].time
            result.event_state[row, k, :size] = mine[0].state
            result.event_state[row, k, size:] = 0.0  # the work there is not kept
            result.held_event[row, k] = held(mine[0].time)
        if any(event.stopped for event in mine):
            result.stopped_by[row] = k
    with np.errstate(all="ignore"):
        values = [system.observe(*part._arguments).reshape(len(part), -1) for part in run.parts()]
    result.least[row] = np.min([each.min(axis=0) for each in values], axis=0)
    result.largest[row] = np.max([each.max(axis=0) for each in values], axis=0)
    statistics = run.statistics
    result.accepted[row], result.rejected[row] = statistics.steps, statistics.rejected
    result.evaluations[row] = statistics.evaluations
    result.single[row] = result.done[row] = True


# ---- The rows of a block of designs while they are filled in.


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

    def columns(self) -> StudyColumns:
        """All rows."""
        return StudyColumns(statuses=STATUSES, status=self._status, measures=self._measures, reasons=self._reasons)

    def settled(self) -> tuple[Indices, StudyColumns]:
        """The rows that are done, and their results."""
        rows = np.flatnonzero(self.known)
        place = {row: k for k, row in enumerate(rows.tolist())}
        return rows, StudyColumns(
            statuses=STATUSES,
            status=self._status[rows],
            measures={name: column[rows] for name, column in self._measures.items()},
            reasons={place[row]: reason for row, reason in self._reasons.items() if row in place},
        )
