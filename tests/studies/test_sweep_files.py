"""Tables, files and pictures of a sweep, of columns that are made up, so that each case and any size can be shown."""

import csv
import json
import math

import numpy as np
import pytest
from pyarrow import parquet

import bellcrank as bc
from bellcrank.studies.designs.axes import read_axis
from bellcrank.studies.designs.design_space import DesignSpace
from bellcrank.studies.designs.samples import Sample
from bellcrank.studies.results import sweep_tables
from bellcrank.studies.results.study_columns import StudyColumns, varies
from bellcrank.studies.results.sweep_result import Sweep
from bellcrank.studies.results.sweep_tables import write_tables

UNITS = {"lock.time": "s", "lock.crank": "rad", "end.work": "J"}
STATUSES = ("finished", "event", "infeasible", "unknown")


def made_up(vary, sample=None, done=None, scene="four_bar"):
    """A sweep whose designs lock after ten times their first value; every 7th is infeasible, every 11th unknown."""
    scene = bc.load_scene(scene)
    axes = tuple(read_axis(scene, path, values) for path, values in vary.items())
    space = DesignSpace(axes, None if sample is None else Sample.of(sample, seed=1))
    index = np.arange(len(space)) if done is None else np.asarray(done)
    x = space.values()[index, 0]
    infeasible, unknown = index % 7 == 6, index % 11 == 10
    unknown &= ~infeasible
    status = np.where(infeasible, 2, np.where(unknown, 3, 1)).astype(np.int8)
    measures = {
        "lock.time": 10.0 * x / 3.0,
        "lock.crank": np.full(len(x), 2.5) + 1e-12 * np.sin(x),
        "end.work": -(x**3),
    }
    for values in measures.values():
        values[infeasible] = np.nan
    measures["end.work"][unknown] = np.inf
    reasons = {int(k): "=1+1, not built" for k in np.flatnonzero(infeasible)}
    reasons |= {int(k): "'end.work' not a finite number" for k in np.flatnonzero(unknown)}
    return Sweep(
        scene=scene,
        space=space,
        units=UNITS,
        columns=StudyColumns(
            statuses=STATUSES, status=status, measures=measures, reasons=dict(sorted(reasons.items()))
        ),
        index=index,
        candidates=tuple(UNITS),
        noise=(1e-9, 1e-9),
    )


def test_default_measures_are_those_that_vary_by_more_than_the_errors_of_the_runs():
    result = made_up({"crank_length": "1.2:1.3:20"})
    assert result.default_measures == ("lock.time", "end.work")
    assert made_up({"crank_length": [1.2]}).default_measures == tuple(UNITS)  # of one design nothing varies
    assert not varies(np.array([1.0, 1.0 + 1e-10, np.nan, np.inf]), (0.0, 1e-9))
    assert varies(np.array([0.0, 1e-8]), (1e-9, 1e-9)) and not varies(np.array([np.nan]), (0.0, 0.0))


def test_a_table_of_many_designs_has_the_first_the_last_and_a_summary():
    result = made_up({"crank_length": "1:2:1001"})
    text = result.table(["lock.time", "end.work"])
    lines = text.splitlines()
    assert len(lines) < 40 and "… 981 more …" in lines
    assert lines[2].split() == ["1", "3.33333333", "-1", "event"]
    assert lines[8].split()[:4] == ["1.006", "-", "-", "infeasible"]
    assert lines[12] == "… 981 more …" and lines[22].split()[:3] == ["2", "-", "-"]
    assert "1001 designs: 780 event, 143 infeasible, 78 unknown" in lines
    assert "  infeasible, such as design 6: =1+1, not built" in lines
    known = result.column("lock.time")[np.isfinite(result.column("lock.time"))]
    row = next(line for line in lines if line.startswith("lock.time [s]")).split()
    assert row[2:7] == ["858", *(f"{x:.6g}" for x in (known.min(), np.median(known), known.mean(), known.max()))]
    assert row[7:] == ["crank_length", "1", "crank_length", "1.999"]  # 2 is infeasible


def test_a_short_table_shows_what_is_absent_and_what_is_unknown():
    lines = made_up({"crank_length": "1:2:11"}).table(["end.work"]).splitlines()
    assert lines[8].split()[1:3] == ["-", "infeasible"] and lines[12].split()[1:3] == ["unknown", "unknown"]


@pytest.mark.parametrize(
    ("vary", "sample", "done"),
    [
        ({"crank_length": "1:2:97", "simulate.solver": ["RK45", "DOP853"]}, None, None),
        ({"crank_length": "normal(1.24 m, 1 cm)", "initial.crank": "uniform(1 deg, 2 deg)"}, 200, None),
        ({"crank_length": "1:2:97"}, None, [0, 3, 6, 10, 50]),
    ],
)
def test_every_kind_of_file_reads_back_exactly(vary, sample, done, tmp_path):
    result = made_up(vary, sample, done)
    labels = [axis.label for axis in result.axes]
    shown = [[axis.shown(x) for x in column] for axis, column in zip(result.axes, result.values.T, strict=True)]
    finite = {name: np.where(np.isfinite(x), x, np.nan) for name, x in result.columns.measures.items()}
    reasons = [result.reasons.get(k, "") for k in range(len(result))]

    with result.to_csv(tmp_path / "s.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(result)
    for label, column in zip(labels, shown, strict=True):
        assert [float(row[label]) if row[label][0].isdigit() else row[label] for row in rows] == column
    for name, unit in UNITS.items():
        found = [float(row[f"{name} [{unit}]"] or "nan") for row in rows]
        assert np.array_equal(found, finite[name], equal_nan=True)
    assert [row["status"] for row in rows] == result.status.tolist()
    assert [row["reason"].removeprefix("'=").removeprefix("=") for row in rows] == [
        r.removeprefix("=") for r in reasons
    ]
    assert not any(row["reason"].startswith("=") for row in rows)  # no formula of a spreadsheet

    table = parquet.read_table(result.to_parquet(tmp_path / "s.parquet"))
    assert table["design"].to_pylist() == result.index.tolist()
    assert [table[label].to_pylist() for label in labels] == shown
    for name, unit in UNITS.items():
        column = table[f"{name} [{unit}]"]
        assert column.null_count == int(np.isnan(finite[name]).sum())
        assert np.array_equal(column.to_numpy(), finite[name], equal_nan=True)
    assert table["status"].to_pylist() == result.status.tolist()
    assert [text or "" for text in table["reason"].to_pylist()] == reasons
    about = json.loads(table.schema.metadata[b"bellcrank"])
    assert about["units"] == UNITS and about["scene"] == "Deployable four-bar" and about["complete"] is (done is None)
    assert about["sample"] == ("200 points, method sobol, seed 1" if sample else None)

    with np.load(result.to_npz(tmp_path / "s.npz")) as file:
        assert file["design"].tolist() == result.index.tolist()
        assert [file[label].tolist() for label in labels] == shown
        for name, unit in UNITS.items():
            assert np.array_equal(file[f"{name} [{unit}]"], finite[name], equal_nan=True)
        assert file["statuses"][file["status"]].tolist() == result.status.tolist()
        assert file["reasons"][file["reason"]].tolist() == reasons
        assert json.loads(file["about"].tobytes()) == about

    document = json.loads(result.to_json(tmp_path / "s.json").read_text(encoding="utf-8"))
    assert [design["values"] for design in document["designs"]] == [list(row) for row in zip(*shown, strict=True)]
    assert [design["reason"] for design in document["designs"]] == reasons
    for design, x in zip(document["designs"], finite["lock.time"], strict=True):
        assert design["measures"].get("lock.time", math.nan) == x or math.isnan(x)


def test_few_designs_are_written_as_csv_and_json_and_many_as_parquet_or_arrays(tmp_path, monkeypatch):
    monkeypatch.setattr(sweep_tables, "MOST_JSON", 10)
    monkeypatch.setattr(sweep_tables, "MOST_CSV", 20)

    def written(count):
        result = made_up({"crank_length": f"1:2:{count}"})
        files = [path.name for path in write_tables(result, tmp_path)]
        assert sorted(path.name for path in tmp_path.iterdir()) == sorted(files)  # none is left of another sweep
        return files, sweep_tables.file_note(result)

    assert written(10) == (["sweep.csv", "sweep.json"], "")
    assert written(20) == (["sweep.csv"], " (JSON is written of at most 10 designs)")
    assert written(21) == (["sweep.parquet"], " (CSV is written of at most 20 designs)")
    monkeypatch.setattr(sweep_tables, "has_pyarrow", lambda: False)
    files, note = written(21)
    assert files == ["sweep.npz"] and "pip install 'bellcrank[parquet]'" in note


def test_a_table_that_cannot_be_written_names_the_one_that_is(tmp_path):
    (tmp_path / "sweep.json").mkdir()
    with pytest.raises(bc.InputError, match=r"all designs are in sweep\.csv"):
        write_tables(made_up({"crank_length": "1:2:5"}), tmp_path)


def test_parquet_without_pyarrow_says_how_to_install_it(tmp_path, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(bc.InputError, match=r"pip install 'bellcrank\[parquet\]'"):
        made_up({"crank_length": "1:2:5"}).to_parquet(tmp_path / "s.parquet")


@pytest.mark.tier2
def test_designs_are_objects_that_are_made_when_they_are_asked_for():
    result = made_up({"crank_length": "1:2:100000"})
    designs = result.designs
    assert len(designs) == 100_000 and designs[-1].index == 99_999
    assert designs[10].status == "unknown" and math.isinf(designs[10].measures["end.work"])
    assert "lock.time" not in designs[6].measures and designs[6].reason == "=1+1, not built"
    assert [design.index for design in designs[3:9:2]] == [3, 5, 7] and len(designs[:0]) == 0
    assert designs == result.designs and designs[:2] != designs[1:3]
    with pytest.raises(IndexError):
        designs[100_000]


def test_a_large_grid_is_drawn_with_all_its_extremes():
    result = made_up({"crank_length": "1:2:100000"})
    peak = 54_321
    result.columns.measures["lock.time"][peak] = 50.0
    line, absent = result.plot(measures=["lock.time"]).axes[0].lines
    assert len(line.get_xdata()) < 5000 and len(absent.get_xdata()) <= 500
    drawn = dict(zip(line.get_xdata(), line.get_ydata(), strict=True))
    assert drawn[result.values[peak, 0]] == 50.0
    assert np.nanmin(line.get_ydata()) == np.nanmin(result.column("lock.time"))


def test_differences_within_the_errors_of_the_runs_are_not_drawn_as_a_trend():
    place = made_up({"crank_length": "1:2:50"}).plot(measures=["lock.crank"]).axes[0]
    low, high = place.get_ylim()
    assert high - low > 0.1 and "constant" in place.get_title()
    panels = made_up({"crank_length": "normal(1.24, 0.01)"}, 64).plot(measures=["lock.crank"]).axes
    assert "constant" in panels[0].get_title() and np.ptp(panels[1].get_ylim()) > 0.1


@pytest.mark.tier2
def test_a_sample_is_drawn_as_histograms_and_against_each_parameter(tmp_path):
    vary = {"crank_length": "normal(1.24, 0.01)", "initial.crank": "uniform(1 deg, 2 deg)"}
    result = made_up(vary, 512)
    figure = result.plot(tmp_path / "s.png", ["lock.time", "end.work"])
    panels = figure.axes
    assert len(panels) == 6 and (tmp_path / "s.png").stat().st_size > 10_000
    bars = panels[0].patches[0].get_data()
    assert bars.values.sum() == pytest.approx(100.0)
    known = np.isfinite(result.column("lock.time"))
    dots = panels[1].lines[0]
    assert np.array_equal(dots.get_xdata(), result.values[known, 0])
    assert np.array_equal(dots.get_ydata(), result.column("lock.time")[known])
    assert f"{int((~known).sum())} of 512" in panels[0].get_title()
    cells = made_up(vary, 8192).plot(measures=["lock.time"]).axes[1].collections[0].get_array()
    assert cells.sum() == np.isfinite(made_up(vary, 8192).column("lock.time")).sum()


def test_of_many_parameters_those_are_drawn_that_matter():
    scene = bc.load_scene("four_bar")
    names = [*scene.parameters, "initial.crank"]
    vary = {name: "uniform(1, 1.1)" for name in reversed(names)}
    result = made_up(vary, 256)
    panels = result.plot(measures=["lock.time"]).axes
    labels = [panel.get_xlabel() for panel in panels[1:]]
    assert len(labels) == 4 and result.axes[0].label in labels  # the one on which the made-up time depends
