"""Designs of the four-bar whose measures come from one simulation each, as a sweep."""

import numpy as np

import bellcrank as bc
from bellcrank.errors import InputError
from bellcrank.studies.designs.axes import read_axis
from bellcrank.studies.designs.design_space import DesignSpace
from bellcrank.studies.results.study_columns import StudyColumns
from bellcrank.studies.results.sweep_result import Sweep

STATUSES = ("event", "duration", "infeasible")
UNITS = {"lock.time": "s", "lock.crank": "rad"}


def linkage_sweep(vary, sample=None, overrides=None):
    """A sweep of the four-bar until it locks."""
    scene = bc.load_scene("four_bar", overrides or {})
    axes = tuple(read_axis(scene, path, values) for path, values in vary.items())
    space = DesignSpace(axes, sample)
    rows = [_row(scene, axes, row) for row in space.values().tolist()]
    status = np.array([STATUSES.index(status) for status, *_ in rows], dtype=np.int8)
    measures = dict(zip(UNITS, np.array([row[1:3] for row in rows]).T, strict=True))
    reasons = {k: row[3] for k, row in enumerate(rows) if row[3]}
    columns = StudyColumns(statuses=STATUSES, status=status, measures=measures, reasons=reasons)
    return Sweep(scene=scene, space=space, columns=columns, index=np.arange(len(rows)), units=UNITS,
                 candidates=tuple(UNITS), noise=(1e-9, 1e-9))  # fmt: skip


def _row(scene, axes, numbers):
    try:
        run = bc.simulate(scene.with_overrides({a.path: a.value(x) for a, x in zip(axes, numbers, strict=True)}))
    except InputError as error:
        return "infeasible", np.nan, np.nan, str(error).splitlines()[0]
    if not run.events:
        return "duration", np.nan, np.nan, "it did not lock"
    return "event", run.events[0].time, run.events[0].position[0], ""
