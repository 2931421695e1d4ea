"""The statuses of many runs, and why those that did not reach their target did not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Indices
from bellcrank.dynamics.inverse.input_breakpoints import prescribed_motion_end
from bellcrank.simulation.integration.integration import repeat_run
from bellcrank.simulation.integration.integration_problem import found_signals
from bellcrank.simulation.integration.statistics import Statistics, Status
from bellcrank.simulation.trajectory.non_finite import AHEAD, causes
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank.studies.results.measures import target_events

if TYPE_CHECKING:
    from bellcrank.studies.execution.runs import Runs
    from bellcrank.studies.results.measures import Measure

INFEASIBLE: Final = "infeasible"  # the design cannot be built
UNKNOWN: Final = "unknown"  # its run finished, but a measure of it is not a finite number
STATUSES: Final = (*map(str, Status), INFEASIBLE, UNKNOWN)
_NUMBER: Final = {status: k for k, status in enumerate(Status)}


def outcomes(runs: Runs, measures: Sequence[Measure]) -> tuple[NDArray[np.int8], dict[int, str]]:
    """The numbers (n,) of the STATUSES of runs with these measures, and reasons by row; none where all is well."""
    status = runs.result.status.astype(np.int8)
    reasons = _reasons(runs)
    count, first = _not_finite(measures, len(runs))
    clauses = {row: f"'{measures[first[row]].name}'" for row in np.flatnonzero(count).tolist()}
    wanted = target_events(runs.scene)
    for k, event in enumerate(runs.scene.events):
        if event.name in wanted:
            for row in np.flatnonzero(runs.result.undefined[:, k]).tolist():
                clauses.setdefault(row, f"the function of event '{event.name}'")
                count[row] += 1
    success = np.isin(status, [_NUMBER[each] for each in Status if each.success])
    for row, clause in clauses.items():
        if success[row]:
            more = f" and {count[row] - 1} more" if count[row] > 1 else ""
            blank = f"{clause}{more} not a finite number"
            reasons[row] = "; ".join(filter(None, [reasons.get(row, ""), blank]))
            status[row] = STATUSES.index(UNKNOWN)
    return status, reasons


def _not_finite(measures: Sequence[Measure], runs: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """How many measures of each run are not finite, and the number of the first of them."""
    count, first = np.zeros(runs, dtype=np.int64), np.zeros(runs, dtype=np.int64)
    for k, measure in enumerate(measures):
        bad = ~np.isfinite(measure.values)
        if measure.present is not None:
            bad &= measure.present
        if bad.any():
            first[bad & (count == 0)] = k
            count += bad
    return count, first


def _reasons(runs: Runs) -> dict[int, str]:
    """Why runs did not reach their target, by row."""
    found, wanted, reasons = runs.result, target_events(runs.scene), dict[int, str]()
    for number in np.unique(found.status).tolist():
        status, rows = tuple(Status)[number], np.flatnonzero(found.status == number)
        if status is Status.FINISHED and wanted:
            names, durations = " nor ".join(map(repr, wanted)), runs.duration[rows].tolist()
            texts = {duration: f"no event {names} within {duration:g} s" for duration in set(durations)}
            reasons |= zip(rows.tolist(), map(texts.__getitem__, durations), strict=True)
        elif status is Status.CONTACT and wanted:
            for row in rows.tolist():
                reasons[row] = f"at {found.end_time[row]:.6g} s {status.advice}"
        elif status is Status.EVENT:
            for k in np.unique(found.stopped_by[rows]).tolist():
                if (name := runs.scene.events[k].name) not in wanted:
                    for row in rows[found.stopped_by[rows] == k].tolist():
                        reasons[row] = f"event '{name}' ended the run at {found.end_time[row]:.6g} s"
        elif not status.success:
            reasons |= zip(rows.tolist(), _reasons_of_ends(runs, rows, status), strict=True)
    return reasons


def _reasons_of_ends(runs: Runs, rows: Indices, status: Status) -> Sequence[str]:
    """Why these runs ended early and what to do about it, as `Trajectory.reason` says."""
    if status is Status.PRESCRIBED_MOTION_ENDED and (end := prescribed_motion_end(runs.scene)) is not None:
        return [end.sentence] * len(rows)
    if status is Status.TURNED_OVER:
        return [_last_row(runs, row, status).reason for row in rows.tolist()]
    if status is not Status.NON_FINITE:
        return [status.advice] * len(rows)
    found = runs.result
    last = found.end_time[rows], found.end_state[rows], runs.parameters[rows]
    ahead = np.multiply.outer(runs.duration[rows], AHEAD)
    clauses = causes(runs.scene, last, runs.signals, ahead, found.held_end[rows])
    return ["; ".join(filter(None, [clause, status.advice])) for clause in clauses]


def _last_row(runs: Runs, row: int, status: Status) -> Trajectory:
    """The last state of a run."""
    time = runs.result.end_time[row : row + 1]
    found = found_signals(runs.scene, time, runs.result.held_end[row : row + 1])
    return Trajectory(
        scene=runs.scene,
        settings=replace(runs.scene.settings, duration=float(runs.duration[row])),
        time=time,
        state=runs.result.end_state[row : row + 1],
        parameters=runs.parameters[row],
        signals=(*runs.signals, *found),
        status=status,
        events=(),
        statistics=Statistics(steps=0, rejected=0, evaluations=0, jacobians=0, factorisations=0, kernel_time=0.0),
        steps=time,
        repeat=repeat_run,
    )
