"""Runs that are simulated one by one, as rows of the record of an ensemble.

Runs whose forces switch, or whose controllers are sampled, step one by one: the instants of each are its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.system import system_of
from bellcrank.elements.signals import Signal
from bellcrank.simulation.ensemble_problem import EnsembleResult
from bellcrank.simulation.integration import Integration, Rows, prepared_integration
from bellcrank.simulation.status import Status
from bellcrank.simulation.trajectory import Trajectory
from bellcrank.studies.scene_designs import DesignGroup

Array = NDArray[np.float64]


Found = dict[int, tuple[Signal, ...]]  # the signals of runs by row


def single_runs(group: DesignGroup, result: EnsembleResult, progress: Callable[[int], object] | None) -> Found:
    """Simulate the designs of a group one by one into the rows of the record; returns their signals.

    After Ctrl-C the rows of those that were not simulated are not done.
    """
    scene, found, integrations = group.scene, Found(), dict[tuple[float, ...], Integration]()
    projected = bool(scene.constraints) and scene.settings.stabilisation.kind == "projection"
    for row in range(len(group.rows)):
        numbers = {name: float(values[row]) for name, values in group.settings.items()}
        key = (float(group.duration[row]), *numbers.values())
        if key not in integrations:
            settings = replace(scene.settings, duration=key[0], **numbers)  # type: ignore[arg-type]
            rows = Rows(np.linspace(0.0, key[0], 2))
            integrations[key] = prepared_integration(scene, settings, group.parameters[row], rows, projected, True)
        integration = integrations[key]
        stepped = integration.stepper.run(x0=group.start[row], parameters=group.parameters[row])
        run = integration.trajectory(stepped, group.parameters[row])
        if run.status is Status.INTERRUPTED:
            break
        store_run(result, row, run)
        result.least[row], result.largest[row] = stepped.least, stepped.largest
        found[row] = run.signals
        if progress is not None:
            progress(row + 1)
    return found


def store_run(result: EnsembleResult, row: int, run: Trajectory) -> None:
    """Put what a run found into a row of the record; extremes are those of the run's rows."""
    system, events, known = system_of(run.scene), run.scene.events, set[str]()
    size = system.nq + system.nv + system.nz
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
