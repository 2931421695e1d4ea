"""Runs that are simulated one by one, as rows of the record of an ensemble."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.system import system_of
from bellcrank.simulation.ensemble_problem import EnsembleResult
from bellcrank.simulation.status import Status
from bellcrank.simulation.trajectory import Trajectory

Array = NDArray[np.float64]


def store_run(result: EnsembleResult, row: int, run: Trajectory) -> None:
    """Put what a run found into a row of the record; extremes are those of the run's rows."""
    system, events, known = system_of(run.scene), run.scene.events, set[str]()
    size = system.nq + system.nv
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
            result.event_state[row, k, :size] = np.concatenate([mine[0].position, mine[0].velocity])
            result.event_state[row, k, size:] = 0.0  # the work there is not kept
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
