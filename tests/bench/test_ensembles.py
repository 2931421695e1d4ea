"""The bench of many designs: its rows with tiny numbers, and the command."""

import json
import math
import sys

import pytest

from bellcrank.cli import main
from bellcrank_bench.measurements import ensemble_speed, study_speed, warm_calls
from bellcrank_bench.measurements.ensemble_row import Duration, EnsembleRow, best_in_turns
from bellcrank_bench.tables.text import ensemble_table

ENSEMBLE = "bellcrank, ensemble"


@pytest.mark.tier2
def test_bench_of_ensembles_writes_times_ratios_and_errors(tmp_path, capsys):
    arguments = ["four_bar", "five_bar", "--designs", "24", "--repeats", "1", "--out", str(tmp_path)]
    assert main(["bench", "--ensembles", *arguments]) == 0
    text = capsys.readouterr().out
    assert "24 designs of four_bar at 1e-09" in text and "not measured: the limits of its motors make kinks" in text
    rows = json.loads((tmp_path / "ensembles.json").read_text())["rows"]
    found = {(row["subject"], row["tool"], row["setting"]): row for row in rows}
    for scene, limit in (("four_bar", 1e-7), ("five_bar", 1e-8)):  # at 1e-9, over some hundred steps
        one = found[scene, "bellcrank, one run", ""]
        assert one["ratio"] == 1.0
        for threads in ("1 thread", "2 threads"):
            row = found[scene, ENSEMBLE, threads]
            assert 0.0 < row["error"] < limit
            assert row["ratio"] == pytest.approx(row["seconds"] / one["seconds"])
            assert found[scene, "bellcrank, ensemble with all measures", threads]["cpu"] > 0.0
    assert 0.0 < found["four_bar", "C baseline", "loop in C"]["error"] < 1e-7


@pytest.mark.parametrize("name", ["rolling_disk", "planar_2r_swing", "spring_pendulum"])
def test_designs_of_the_other_scenes_are_as_their_lone_runs(name):
    assert ensemble_speed.Ensemble(name, 8).error() < 1e-5  # the disk's motion spreads errors by about 1e3 in 10 s


@pytest.mark.tier2
def test_peers_that_are_missing_are_rows_that_say_so(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    rows = ensemble_speed.ensemble_rows("spring_pendulum", 8, 1, peers=True)
    [rollout] = [row for row in rows if row.tool == "mujoco.rollout"]
    assert rollout.note.startswith("not installed") and not rollout.timed
    [scipy] = [row for row in rows if row.tool.startswith("SciPy")]
    assert scipy.error < 1e-6 and scipy.timed


@pytest.mark.tier2
def test_a_sweep_and_sizings_and_calls_are_timed_and_checked():
    [study] = study_speed.study_rows(64)
    assert study.timed and " GB" in study.note
    size, *many = study_speed.sizing_rows(16, 1)
    assert size.timed and all(row.timed and row.error < 1e-9 for row in many)
    stepping, beside = warm_calls.simulate_rows("four_bar", 1)
    assert stepping.timed and beside.timed
    binding, own = warm_calls.inverse_dynamics_rows("ur5", 1)
    assert binding.timed and own.timed and own.error < 1e-12


@pytest.mark.tier2
def test_first_use_is_timed_without_a_cache_and_from_it(monkeypatch):
    monkeypatch.setattr(warm_calls, "PROCESSES", 1)
    rows = warm_calls.first_use_rows("ur5")
    assert [row.setting for row in rows] == ["empty cache", "from the cache"] and all(row.timed for row in rows)
    assert rows[1].data()["ratio"] == pytest.approx(rows[1].time.seconds / rows[0].time.seconds)
    assert len(ensemble_table(rows).splitlines()) == 3


def test_times_are_the_best_of_several_and_a_time_that_is_not_measured_is_a_dash():
    times = iter([Duration(2.0, 1.0), Duration(1.0, 3.0)])
    assert best_in_turns([lambda: next(times)], 2) == [Duration(1.0, 1.0)]
    row = EnsembleRow(subject="arm", tool="tool", time=Duration(2e-6), base=Duration(1e-6))
    assert ensemble_table([row]).splitlines()[1].split() == ["arm", "tool", "2.00", "µs", "2", "-"]
    assert row.data()["ratio"] == 2.0 and row.data()["cpu"] is None and math.isinf(row.time.cpu)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--ensembles", "four_baa"], "unknown scene with designs 'four_baa'"),
        (["--ensembles", "--designs", "0"], "--designs"),
        (["--ensembles", "--hard"], "separate benchmarks"),
        (["--ensembles", "--markdown", "tables.md"], "--markdown is for scenes and --dynamics"),
    ],
)
def test_bench_of_ensembles_refuses_in_one_sentence(arguments, told, capsys):
    assert main(["bench", *arguments]) == 2
    assert told in capsys.readouterr().err
