"""Designs of a study simulated alone, as what their rows must agree with."""

import math

import numpy as np
import pytest
from lone_measures import measure_name, reason, run_measures, start_measures, unknown_measures

import bellcrank as bc
from bellcrank.studies.designs.axes import read_axis
from bellcrank.studies.execution.design_runner import infeasible_reason
from bellcrank.studies.execution.simulation_runner import SimulationRunner

ROWS, WINDOW = 20_001, 1001  # in which extremes are looked for, and again around them
EXTREMES = ("least.", "largest.", "energy_drift", "constraint_residual")  # they depend on where one looks


def runner(scene, **vary):
    """A runner, and the values of designs: a list for each axis, of equal lengths; "__" stands for a dot."""
    scene = bc.load_scene(scene) if isinstance(scene, str) else scene
    axes = tuple(read_axis(scene, path.replace("__", "."), values) for path, values in vary.items())
    return SimulationRunner(scene, axes), np.column_stack([axis.numbers for axis in axes])


def statuses(columns):
    """The names of the statuses of all designs."""
    return [columns.statuses[k] for k in columns.status]


def lone(found, values):
    """(status, reason, measures) of a design by `simulate`."""
    changes = found.designs.overrides(values.tolist())
    measures = {}
    try:
        scene = found.scene.with_overrides(changes)
        measures |= {name: value for name, _, value in start_measures(scene)}
        run = bc.simulate(scene)
        measures |= {name: value for name, _, value in run_measures(run)}
    except bc.BellcrankError as error:
        return "infeasible", infeasible_reason(error, found.scene), measures
    why, status = reason(run), str(run.status)
    if run.success and (blank := unknown_measures(run, measures)):
        status, why = "unknown", "; ".join(filter(None, [why, blank]))
    return status, why, measures


def lone_extremes(found, values):
    """Least and largest outputs of a design simulated alone, by measure, and how much may be missing of each.

    Many rows, and again many around the extreme ones; between two of these a value may be as much larger than both as
    one is larger than its neighbour.
    """
    try:
        scene = found.scene.with_overrides(found.designs.overrides(values.tolist()))
        run = bc.simulate(scene, samples=ROWS)
    except bc.BellcrankError:
        return {}, {}
    extremes, missing = {}, {}
    for name, output in scene.outputs.items():
        rows = run.output(name).reshape(len(run), -1)
        for c, label in enumerate(output.quantity.suffixes()):
            for what, sign in (("least", -1.0), ("largest", 1.0)):
                k = int(np.argmax(sign * rows[:, c]))
                ends = run.time[max(k - 1, 0)], run.time[min(k + 1, len(run) - 1)]
                near = bc.simulate(scene, times=np.linspace(*ends, WINDOW), duration=scene.settings.duration)
                column = sign * near.output(name).reshape(len(near), -1)[:, c]
                k, measure = int(np.argmax(column)), measure_name(f"{what}.{name}", label)
                extremes[measure] = sign * max(column[k], (sign * rows[:, c]).max())
                missing[measure] = np.max(column[k] - column[[max(k - 1, 0), min(k + 1, len(column) - 1)]])
    return extremes, missing


def check(found, values, tolerance):
    """Compare every design with its lone run, to a tolerance; returns the columns."""
    columns = check_statuses(found, values)
    for k, row in enumerate(values):
        measures = lone(found, row)[2]
        there = {name for name, column in columns.measures.items() if not math.isnan(column[k])}
        assert there - {"end.work"} == set(measures)
        for name, value in measures.items():
            if not name.startswith(EXTREMES):
                assert columns.measures[name][k] == pytest.approx(value, rel=tolerance, abs=tolerance), name
    return columns


def check_statuses(found, values):
    """Compare statuses and reasons alone."""
    columns = found.run(values)
    assert list(columns.measures) == list(found.units)
    for k, row in enumerate(values):
        assert (statuses(columns)[k], columns.reasons.get(k, "")) == lone(found, row)[:2]
    return columns
