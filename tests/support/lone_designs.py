"""Designs of a study simulated alone, as what their rows must agree with."""

import math

import numpy as np
import pytest
from lone_measures import reason, run_measures, start_measures, unknown_measures

import bellcrank as bc
from bellcrank.studies.axes import read_axis
from bellcrank.studies.simulation_runner import SimulationRunner

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
        return "infeasible", str(error).removeprefix(f"{found.scene.source}: "), measures
    why, status = reason(run), str(run.status)
    if run.success and (blank := unknown_measures(run, measures)):
        status, why = "unknown", "; ".join(filter(None, [why, blank]))
    return status, why, measures


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
