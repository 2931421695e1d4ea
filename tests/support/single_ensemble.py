"""An ensemble by the integrator of single runs, one after the other: what the lanes must agree with."""

import math
from dataclasses import replace

import numpy as np

from bellcrank import _step
from bellcrank.simulation.ensemble_problem import EnsembleResult
from bellcrank.simulation.integration_problem import IntegrationProblem

ROWS = 501  # of a run, in which extremes are looked for


def integrate(problem, rows=ROWS):
    """The result for an EnsembleProblem."""
    runs = [_row(problem, k, rows) for k in range(len(problem.x0))]
    columns = {name: np.array([run[name] for run in runs]) for name in (runs[0] if runs else {})}
    return EnsembleResult(**columns, seconds=0.0)


def _row(problem, k, rows):
    settings = {name: float(values[k]) for name, values in problem.settings.items()}
    if "max_evaluations" in settings:
        settings["max_evaluations"] = int(settings["max_evaluations"])
    control = replace(problem.control, **settings)
    x0, p, t1 = problem.x0[k].copy(), problem.parameters[k].copy(), float(problem.t1[k])
    found = _step.integrate(
        IntegrationProblem(
            kernels=problem.kernels, layout=problem.layout, control=control, t1=t1, x0=x0, parameters=p,
            signals=problem.signals, stops=problem.stops, events=problem.events, times=np.linspace(0.0, t1, rows),
        )
    )  # fmt: skip
    events, size = len(problem.events.terminal), len(x0)
    first = [next((i for i, which in enumerate(found.event_index) if which == e), None) for e in range(events)]
    last = found.event_index[-1] if found.status == 1 else -1
    time, state = np.append(found.time, found.end_time), np.vstack([found.state.reshape(-1, size), found.end_state])
    values = np.array([_observed(problem, t, x, p) for t, x in zip(time, state, strict=True)])
    return {
        "done": True,
        "status": found.status,
        "end_time": found.end_time,
        "end_state": np.array(found.end_state),
        "event_count": np.array(found.event_counts) if events else np.zeros(0, int),
        "event_time": np.array([math.nan if i is None else found.event_time[i] for i in first]),
        "event_state": np.array([np.full(size, np.nan) if i is None else found.event_state[i] for i in first]).reshape(
            events, size
        ),
        "stopped_by": int(last),
        "unresolved": np.array(found.unresolved_count) if events else np.zeros(0, int),
        "undefined": np.array(found.undefined_count) if events else np.zeros(0, int),
        "least": values.min(axis=0),
        "largest": values.max(axis=0),
        "accepted": found.accepted,
        "rejected": found.rejected,
        "evaluations": found.evaluations,
        "single": True,
    }


def _observed(problem, t, x, p):
    """The observed quantities at a time and state."""
    u = np.concatenate([np.zeros(0), *[signal.at(np.array([t]))[0] for signal in problem.signals]])
    inputs = (np.array([t]), np.ascontiguousarray(x), u, p)
    return _step.evaluate(problem.observe, inputs, tuple(map(len, inputs)), (problem.observed,))[0]
