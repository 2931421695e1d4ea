"""Ensembles of the small initial value problems of stepper_problem.py, and the lone runs beside them."""

import numpy as np

from bellcrank import _step
from bellcrank.codegen import llvm as machine
from bellcrank.simulation.integration.ensemble import EnsembleProblem, EnsembleResult, LaneKernels

COLUMNS = (
    "done", "status", "end_time", "end_state", "event_count", "event_time", "event_state", "stopped_by", "unresolved",
    "undefined", "least", "largest", "held_start", "held_end", "held_event",
    "accepted", "rejected", "evaluations", "single",
)  # fmt: skip


def integrate_ensemble(problem, method, tolerance, x0, *, t1=None, p=None, settings=None, threads=1, lanes=True,
                       progress=None, **changes):  # fmt: skip
    """Runs of a `Problem` from the starts x0 (N, n), with parameters p (N, np); `changes` as those of its `run`."""
    x0 = np.asarray(x0, float)
    rows = len(x0)
    common = problem.problem(method, tolerance, **changes)
    in_lanes = None
    if lanes and method != "Radau":
        events = problem.events.address("lanes") if problem.events else 0
        in_lanes = LaneKernels(width=machine.target().lanes, rhs=problem.slope.address("lanes"), events=events)
    found = _step.integrate_ensemble(
        EnsembleProblem(
            kernels=common.kernels,
            lanes=in_lanes,
            layout=common.layout,
            control=common.control,
            t1=np.full(rows, problem.t1) if t1 is None else np.asarray(t1, float),
            x0=x0,
            parameters=np.tile(problem.p, (rows, 1)) if p is None else np.asarray(p, float),
            settings=settings or {},
            signals=common.signals,
            stops=np.asarray(common.stops, float),
            events=common.events,
            threads=threads,
            progress=progress,
        )
    )
    return EnsembleResult(**found)


def lone_runs(problem, method, tolerance, x0, *, t1=None, p=None, settings=None, **changes):
    """The same runs one by one."""
    runs = []
    for row, start in enumerate(np.asarray(x0, float)):
        own = {name: values[row] for name, values in (settings or {}).items()}
        if "max_evaluations" in own:
            own["max_evaluations"] = int(own["max_evaluations"])
        own["t1"] = float(problem.t1 if t1 is None else t1[row])
        own["parameters"] = problem.p if p is None else np.asarray(p[row], float)
        runs.append(problem.run(method, tolerance, **(changes | own | {"x0": start})))
    return runs


def assert_equal_rows(one, other):
    """Two results are equal to the last bit."""
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def rows_of(result, rows):
    """Some rows of a result."""
    return EnsembleResult(seconds=0.0, **{name: getattr(result, name)[rows] for name in COLUMNS})
