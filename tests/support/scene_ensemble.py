"""Ensembles of scenes that differ by overrides, and the lone runs beside them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import bellcrank as bc
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.scene.scene import Scene
from bellcrank.simulation.integration.ensemble import EnsembleResult, EnsembleStarts, integrate_ensemble
from bellcrank.simulation.integration.statistics import Status
from bellcrank.simulation.trajectory.trajectory import Trajectory

COLUMNS = (
    "status", "end_time", "end_state", "event_count", "event_time", "event_state", "stopped_by", "unresolved",
    "undefined", "least", "largest", "accepted", "rejected", "evaluations", "single",
)  # fmt: skip


class SceneEnsemble:
    """The runs of a scene with each of some overrides, in lanes and one by one."""

    def __init__(self, scene: Scene, overrides: Sequence[Mapping[str, Any]]) -> None:
        self.scene = scene
        self.scenes = [scene.with_overrides(dict(changes)) for changes in overrides]
        system = system_of(scene)
        self.start = np.zeros((len(self.scenes), system.size))
        for row, variant in zip(self.start, self.scenes, strict=True):
            q, v = consistent_start(variant)
            row[: system.nq], row[system.nq : system.nq + system.nv] = q, v
        self.parameters = np.array([system_parameters(variant) for variant in self.scenes])

    def run(self, rows: Any = slice(None), *, observe: bool = True, threads: int = 1) -> EnsembleResult:
        """The ensemble of some of the rows."""
        start = self.start[rows]
        starts = EnsembleStarts(
            parameters=self.parameters[rows],
            start=start,
            duration=np.full(len(start), self.scene.settings.duration),
            signals=tuple(self.scene.signals),
        )
        return integrate_ensemble(self.scene, starts, observe=observe, threads=threads)

    def lone(self, row: int, times: Any = None) -> Trajectory:
        """One of the runs."""
        duration = self.scene.settings.duration
        return bc.simulate(self.scenes[row], times=[0.0, duration] if times is None else times)


def assert_equal_rows(one: EnsembleResult, other: EnsembleResult, rows: Any = slice(None)) -> None:
    """`one` is equal to some rows of `other`, to the last bit."""
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name)[rows], err_msg=name)


def assert_same_events(found: EnsembleResult, ensemble: SceneEnsemble, *, time: float, state: float) -> None:
    """Counts are those of lone runs; the first of each event agrees within `time` (s) and `state`."""
    names = [event.name for event in ensemble.scene.events]
    for row in range(len(ensemble.scenes)):
        run = ensemble.lone(row)
        missed = {entry.event: entry.steps for entry in run.statistics.unresolved if not entry.undefined}
        undefined = {entry.event: entry.steps for entry in run.statistics.unresolved if entry.undefined}
        for k, name in enumerate(names):
            events = [event for event in run.events if event.name == name]
            assert found.event_count[row, k] == len(events), (row, name)
            assert found.unresolved[row, k] == missed.get(name, 0), (row, name)
            assert found.undefined[row, k] == undefined.get(name, 0), (row, name)
            if not events:
                assert np.isnan(found.event_time[row, k]) and np.isnan(found.event_state[row, k]).all()
                continue
            first = events[0]
            expected = np.concatenate([first.position, first.velocity])
            np.testing.assert_allclose(found.event_time[row, k], first.time, rtol=0, atol=time, err_msg=f"{row} {name}")
            np.testing.assert_allclose(found.event_state[row, k, : len(expected)], expected, rtol=0, atol=state)
        ended = run.status is Status.EVENT
        stopped = names[found.stopped_by[row]] if found.stopped_by[row] >= 0 else None
        assert (stopped is not None) == ended
        if ended:
            assert stopped == run.events[-1].name
            np.testing.assert_allclose(found.end_time[row], run.time[-1], rtol=0, atol=time)
