"""The time of a design in ensembles of scenes, next to lone runs, a loop over the C baseline, and other tools.

Designs differ in one number of the scene, drawn with a fixed seed. The loop in C, MuJoCo and SciPy run the scene's own
design again and again to the benchmark's duration, without its events.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Final

import numpy as np

from bellcrank.errors import BellcrankError, InputError
from bellcrank.messages import unknown_name
from bellcrank.scene.scene import load_scene
from bellcrank.simulation.integration.ensemble import EnsembleResult, EnsembleStarts, integrate_ensemble
from bellcrank.simulation.integration.statistics import Status
from bellcrank.simulation.simulate import simulate
from bellcrank.studies.sweep_plan import SampleRequest, SweepPlan, plan_sweep
from bellcrank_bench.c_baseline import baseline
from bellcrank_bench.c_baseline.baseline import CBaseline
from bellcrank_bench.measurements import ensemble_peers
from bellcrank_bench.measurements.ensemble_row import Duration, EnsembleRow, best_in_turns, clocked, thread_count
from bellcrank_bench.problems.reference_motion import reference
from bellcrank_bench.problems.registry import BENCHMARKS, NOT_MEASURED

VARIED: Final = {  # of each scene, what its designs differ in
    "four_bar": ("crank_length", "uniform(1.2405 m, 1.2415 m)"),
    "rolling_disk": ("axial_inertia", "uniform(2.4e-3 kg m^2, 2.5e-3 kg m^2)"),
    "planar_2r_swing": ("initial.elbow", "uniform(44 deg, 46 deg)"),
    "spring_pendulum": ("initial.swing", "uniform(44 deg, 46 deg)"),
    "five_bar": ("initial.left_motor", "uniform(109 deg, 111 deg)"),
}
ADDED: Final = {  # of scenes that have no parameter that is varied
    "rolling_disk": {"parameters": {"axial_inertia": {"value": 2.5e-3, "sets": ["link.disk.inertia.yy"]}}}
}
TOLERANCE = 1e-9  # of every run that is timed
TIGHT = 1e-12  # of the lone runs that are the reference
CHECKED = 20  # designs that are compared with lone runs
LONE = 40  # lone runs, and runs of the loop in C, a turn
THREADS = 2


def varied(name: str) -> str:
    """The name itself. Raises InputError for a scene of which no designs are known."""
    if name not in VARIED:
        raise InputError("bench: " + unknown_name("scene with designs", name, VARIED))
    return name


@dataclass(frozen=True, eq=False)
class Ensemble:
    """So many designs of a scene at TOLERANCE, ready to be run."""

    name: str
    designs: int

    @cached_property
    def plan(self) -> SweepPlan:
        """The scene, and its designs."""
        path, drawn = VARIED[self.name]
        scene = load_scene(
            self.name, {"simulate.rtol": TOLERANCE, "simulate.atol": TOLERANCE} | ADDED.get(self.name, {})
        )
        return plan_sweep(scene, {path: drawn}, SampleRequest(self.designs, "random", 0))

    @cached_property
    def starts(self) -> EnsembleStarts:
        """Parameters and starts. Raises BellcrankError where not all designs share their equations."""
        block = self.plan.runner.designs.block(self.plan.space.values())  # type: ignore[attr-defined]
        if len(block.groups) != 1 or block.infeasible:
            raise BellcrankError(f"{self.name}: its designs do not share their equations, or some are infeasible")
        [group] = block.groups
        return EnsembleStarts(
            parameters=group.parameters,
            start=group.start,
            duration=group.duration,
            settings=group.settings,
            signals=group.scene.signals,
        )

    def step(self, threads: int) -> EnsembleResult:
        """Integrate all, without measures."""
        return integrate_ensemble(self.plan.scene, self.starts, observe=False, threads=threads)

    def lone(self) -> Duration:
        """The least stepping time of LONE single runs without rows in between."""
        times = [simulate(self.plan.scene, samples=2).statistics.kernel_time for _ in range(LONE)]
        return Duration(min(times), min(times))

    def error(self) -> float:
        """Largest difference of position (rad, m) and time (s) at the end of CHECKED designs from lone runs at TIGHT.

        It is infinite where a status differs.
        """
        found, statuses, largest = self.step(1), list(Status), 0.0
        [axis], nq = self.plan.space.axes, self.plan.scene.robot.nq
        values = self.plan.space.values()
        for row in range(min(CHECKED, len(values))):
            scene = self.plan.scene.with_overrides({axis.path: axis.value(values[row, 0])})
            run = simulate(scene, rtol=TIGHT, atol=TIGHT, samples=2)
            if statuses[found.status[row]] is not run.status:
                return float("inf")
            position = np.abs(found.end_state[row, :nq] - run.position[-1]).max()
            largest = max(largest, float(position), abs(float(found.end_time[row] - run.time[-1])))
        return largest


def ensemble_rows(name: str, designs: int, repeats: int, peers: bool) -> list[EnsembleRow]:
    """The rows of a scene: lone runs, ensembles with and without measures, the loop in C, then other tools."""
    ensemble = Ensemble(name, designs)
    runner, values = ensemble.plan.runner, ensemble.plan.space.values()
    functions: list[Callable[[], Duration]] = [ensemble.lone]
    labels = [("bellcrank, one run", "")]
    for threads in (1, THREADS):
        where = thread_count(threads)
        functions += [
            partial(_per_design, partial(ensemble.step, threads), designs),
            partial(_per_design, partial(runner.run, values, threads=threads), designs),
        ]
        labels += [("bellcrank, ensemble", where), ("bellcrank, ensemble with all measures", where)]
    remarks, errors = [], {"bellcrank, ensemble": ensemble.error()}
    try:
        functions.append(_c_loop(name, errors))
        labels.append((baseline.NAME, "loop in C"))
    except BellcrankError as error:
        remarks.append((baseline.NAME, str(error)))
    ensemble.step(1), runner.run(values[:8])  # compiled before the clock starts
    best = best_in_turns(functions, repeats)
    notes = {
        "bellcrank, one run": "stepping time of simulate(), least of all",
        "bellcrank, ensemble": f"error: from {min(CHECKED, designs)} lone runs at {TIGHT:g}",
        "bellcrank, ensemble with all measures": "from values to measures, starts included",
        baseline.NAME: "own design, no events, no projection; error: from the reference at the end",
    }
    rows = [
        EnsembleRow(
            subject=name, tool=tool, setting=setting, time=time, base=best[0],
            error=errors.get(tool), note=notes[tool],
        )
        for (tool, setting), time in zip(labels, best, strict=True)
    ]  # fmt: skip
    rows += [EnsembleRow(subject=name, tool=tool, note=note) for tool, note in remarks]
    return rows + (ensemble_peers.peer_rows(name, TOLERANCE, THREADS, rows[0].base) if peers else [])


def _per_design(function: Callable[[], object], designs: int) -> Duration:
    return clocked(function) / designs


def _c_loop(name: str, errors: dict[str, float]) -> Callable[[], Duration]:
    """A loop over the C baseline whose error is noted. Raises BellcrankError where there is none."""
    if name not in BENCHMARKS:
        raise BellcrankError(f"not measured: {NOT_MEASURED[name]}")
    compiled = CBaseline(BENCHMARKS[name])
    end = compiled.many(1, TOLERANCE)[1]
    exact = reference(name)
    position = exact.benchmark.compared(end[None])[0]
    errors[baseline.NAME] = float(np.abs(position - exact.benchmark.positions(exact.state)[-1]).max())

    def timed() -> Duration:
        cpu = clocked(lambda: seconds.append(compiled.many(LONE, TOLERANCE)[0])).cpu
        return Duration(seconds[-1], cpu) / LONE

    seconds: list[float] = []
    return timed
