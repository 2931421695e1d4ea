"""All results have one interface: a table, CSV, pandas, JSON, notes."""

from __future__ import annotations

import csv
import functools
import json
import math
import sys

import numpy as np
import pandas
import pytest

import bellcrank as bc
from bellcrank.notes import Note
from tests.support.public_names import NAMES, public

FOUR_BAR = {"crank_length": [1.22, 1.24]}
SIZES = {"crank_length": {"sizes": [1.22, 1.24]}}
POINTS = [(0, 0), (1, 0.2), (1.5, 1), (1, 1.5), (0, 1)]


@functools.cache
def swinging():
    return bc.simulate("pendulum", duration=1.0, samples=11, sensitivities=["initial.swing"])


@functools.cache
def fastest():
    return bc.time_optimal("geared_pendulum", "lift_and_return", costs=False)


def period():
    return 2.0 * math.pi / math.sqrt(9.81)


MADE = {
    "Trajectory": swinging,
    "RunSensitivity": lambda: swinging().sensitivity("initial.swing"),
    "Sizing": lambda: bc.size("geared_pendulum"),
    "SizingSensitivity": lambda: bc.size("four_bar").sensitivities(["crank_length"])[0],
    "DriveVerdicts": lambda: bc.judge("geared_pendulum"),
    "Selection": lambda: bc.select("geared_pendulum"),
    "SelectionVerification": lambda: bc.verify_selection("manutec_axis"),
    "FastestMotion": fastest,
    "SpeedFactor": lambda: bc.speed_factor("geared_pendulum", "lift_and_return"),
    "RepeatedCycle": lambda: bc.repeated_cycle("geared_pendulum", fastest().motion),
    "Linearisation": lambda: bc.linearise("pendulum"),
    "RootLoci": lambda: bc.root_loci("pendulum", "gravity", [[0, -1.0, 0], [0, -4.0, 0]]),
    "FloquetModes": lambda: bc.floquet(bc.load_scene("pendulum", {"initial.swing": "1e-6 deg"}), period()),
    "Mobility": lambda: bc.mobility("four_bar"),
    "Sweep": lambda: bc.sweep("four_bar", FOUR_BAR),
    "Sensitivity": lambda: bc.sobol_indices("four_bar", {"crank_length": "normal(1.24 m, 1 mm)"}, n=2),
    "SampleStatistics": lambda: bc.sobol_indices("four_bar", {"crank_length": "normal(1.24 m, 1 mm)"}, n=2).statistics,
    "Optimum": lambda: bc.optimise("four_bar", {"crank_length": (1.22, 1.24)}, minimise="lock.time", samples=16),
    "ParetoFront": lambda: bc.pareto_front("four_bar", SIZES, minimise="lock.time", maximise="lock.crank"),
    "DesignSelection": lambda: bc.select_designs(
        "geared_pendulum", {"link.pendulum.mass": [2, 3]}, makers="ROBOTIS"
    ),
    "Synthesis": lambda: bc.synthesise("four_bar", POINTS, "72 deg"),
}  # fmt: skip


def test_every_class_that_writes_itself_is_a_result_and_is_tried_here():
    classes = {name for name in NAMES if isinstance(public(name), type)}
    results = {name for name in classes if issubclass(public(name), bc.results.Result)} - {"Result"}
    assert results == set(MADE)
    assert not [
        name for name in classes - results - {"Result"} if {"to_csv", "to_json", "table"} & set(dir(public(name)))
    ]


@pytest.mark.parametrize("name", MADE)
def test_a_result_prints_its_table_and_its_files_hold_the_same_rows(name, tmp_path):
    found = MADE[name]()
    assert type(found).__name__ == name
    assert str(found) == found.table() and found.table().strip()
    assert found._repr_html_()
    assert isinstance(found.notes, tuple) and all(isinstance(note, Note) for note in found.notes)

    path = found.to_csv(tmp_path / "result.csv")
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = list(csv.reader(file))
    frame = found.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame.columns) == header and len(frame) == len(rows) > 0
    assert len(set(header)) == len(header)
    for k, column in enumerate(frame.columns):
        written = [row[k] for row in rows]
        if frame[column].dtype.kind == "f":
            np.testing.assert_array_equal(frame[column], [float(x) if x else math.nan for x in written])

    data = json.loads(found.to_json(tmp_path / "result.json").read_text(encoding="utf-8"))
    assert list(data) == list(found.as_dict())


def test_without_pandas_its_result_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(bc.InputError, match="pip install pandas"):
        bc.mobility("four_bar").to_pandas()
