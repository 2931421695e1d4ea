"""Simulations of many designs of a scene: from their values to their measures, status and reasons, in columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bellcrank.cached_values import Portable, cached_property
from bellcrank.codegen import cache as disk
from bellcrank.codegen import llvm as machine
from bellcrank.dynamics.prescribed_motion_end import prescribed_motion_end, signals_until
from bellcrank.dynamics.system import system_of
from bellcrank.errors import InputError
from bellcrank.scene.scene import Scene
from bellcrank.simulation.ensemble import EnsembleStarts, integrate_ensemble
from bellcrank.simulation.ensemble_problem import EnsembleResult
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.status import Status
from bellcrank.studies.columns import Columns
from bellcrank.studies.measures import Measure, run_measures, start_measures
from bellcrank.studies.run_outcomes import INFEASIBLE, STATUSES, outcomes
from bellcrank.studies.runs import Runs
from bellcrank.studies.scene_designs import DesignAxis, DesignGroup, SceneDesigns
from bellcrank.studies.single_runs import store_run
from bellcrank.version import version

Array = NDArray[np.float64]
Progress = Callable[[int], object]


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
        none = Runs.none(self.scene)
        start = start_measures(self.scene.robot, none.start[:, : self.scene.robot.nq])
        return {measure.name: measure.unit for measure in (*start, *run_measures(none))}

    @cached_property
    def identity(self) -> Mapping[str, str]:
        """What the results depend on, by a name that a user understands."""
        scene, target = self.scene, machine.target()
        return {
            "scene": disk.digest(repr(scene.data)),
            "files of the scene": disk.digest(repr(sorted(scene.files.items()))),
            "robot": disk.digest(scene.robot.key),
            "equations": scene.structure_key,
            "solver settings": repr(scene.settings),
            "axes": ", ".join(f"{axis.path} [{axis.unit or '1'}]" for axis in self.axes),
            "bellcrank": version(),
            "processor": f"{target.lanes} SIMD lanes, {'with' if target.fused else 'without'} fused multiply-add",
        }

    def run(self, values: Array, *, threads: int = 1, progress: Progress | None = None) -> Columns:
        """The columns of designs with values (n, axes); see DesignRunner."""
        count = len(values)
        block = self.designs.block(values, threads=threads)
        columns = {name: np.full(count, np.nan) for name in self.units}
        status = np.full(count, STATUSES.index(INFEASIBLE), dtype=np.int8)
        reasons = dict(block.infeasible)
        _fill(columns, slice(None), list(start_measures(self.scene.robot, block.start_position)))
        done = len(reasons)
        for group in block.groups:
            runs = self._runs(group, values, threads, _shifted(progress, done))
            measures = list(run_measures(runs))
            began = start_measures(self.scene.robot, group.start[:, : self.scene.robot.nq])
            own, why = outcomes(runs, [*began, *measures])
            status[group.rows] = own
            reasons |= {int(group.rows[row]): reason for row, reason in why.items()}
            _fill(columns, group.rows, measures)
            done += len(group.rows)
        return Columns(statuses=STATUSES, status=status, measures=columns, reasons=reasons)

    def _runs(self, group: DesignGroup, values: Array, threads: int, progress: Progress | None) -> Runs:
        """The runs of a group of designs. Raises KeyboardInterrupt where they were interrupted."""
        scene, signals, duration = group.scene, group.scene.signals, group.duration
        end = prescribed_motion_end(scene)
        if end is not None:
            signals, duration = signals_until(scene, end.time), np.minimum(duration, end.time)
        starts = EnsembleStarts(
            parameters=group.parameters,
            start=group.start,
            duration=duration,
            settings=group.settings,
            signals=signals,
        )
        result = integrate_ensemble(scene, starts, threads=threads, progress=progress)
        if not result.done.all():
            raise KeyboardInterrupt
        early = (result.status == list(Status).index(Status.FINISHED)) & (duration < group.duration)
        result.status[early] = list(Status).index(Status.PRESCRIBED_MOTION_ENDED)
        self._simulate_turned_over(group, values, result)
        return Runs(
            scene=scene,
            signals=signals,
            duration=group.duration,
            parameters=group.parameters,
            start=group.start,
            result=result,
        )

    def _simulate_turned_over(self, group: DesignGroup, values: Array, result: EnsembleResult) -> None:
        """Simulate designs one by one in which a weld or hinge turned over; such a run ends before that."""
        cosines = system_of(group.scene).observed_layout.cosines
        for row in np.flatnonzero(~(result.least[:, cosines] > 0.0).all(axis=1)).tolist():
            scene = self.scene.with_overrides(self.designs.overrides(values[group.rows[row]].tolist()))
            run = simulate(scene)
            if run.status is not Status.TURNED_OVER:  # between its rows
                run = simulate(scene, times="steps")
            if run.status is Status.INTERRUPTED:
                raise KeyboardInterrupt
            store_run(result, row, run)


def _fill(columns: dict[str, Array], rows: NDArray[np.int64] | slice, measures: Sequence[Measure]) -> None:
    for measure in measures:
        if measure.name in columns:
            columns[measure.name][rows] = measure.values


def _shifted(progress: Progress | None, done: int) -> Progress | None:
    return None if progress is None else lambda count: progress(done + count)
