"""The bench of fastest motions: the same problem for all tools, the same times of motions, ratios, and the command."""

from __future__ import annotations

import json
import sys

import pytest

from bellcrank import InputError
from bellcrank.cli import main
from bellcrank_bench.measurements.fastest_peers import RUNS
from bellcrank_bench.measurements.fastest_speed import BELLCRANK, ROBOTS, bellcrank_run, fastest_rows, path_problem


@pytest.mark.parametrize("name", ROBOTS)
def test_toppra_finds_the_same_time_on_the_same_grid(name):
    problem = path_problem(name)
    ours, theirs = (problem.duration(run()) for run in (bellcrank_run(problem), next(iter(RUNS.values()))(problem)))
    assert theirs == pytest.approx(ours, rel=1e-6)


def test_copp_finds_the_time_of_toppra_where_both_limit_both_ends_of_cells():
    rows = {(row.tool.split()[0], row.method): row for row in fastest_rows("planar_2r", 1)}
    both = [row for (_, method), row in rows.items() if "both" in method]
    assert len(both) == 2 and all(row.error < 1e-6 for row in both)
    assert rows[BELLCRANK, "limits at beginnings of cells"].error == 0.0


def test_a_missing_peer_is_a_row(monkeypatch):
    monkeypatch.setitem(sys.modules, "copp_py", None)
    missing = [row for row in fastest_rows("planar_2r", 1) if row.failure]
    assert any("copp-py" in row.tool and "not installed" in row.failure for row in missing)


def test_the_command_writes_a_table_and_json(tmp_path, capsys):
    assert main(["bench", "--fastest", "planar_2r", "--repeats", "1", "--out", str(tmp_path)]) == 0
    assert "planar_2r  bellcrank" in capsys.readouterr().out
    rows = json.loads((tmp_path / "fastest.json").read_text())["rows"]
    assert rows[0]["tool"] == BELLCRANK and rows[0]["seconds"] > 0.0


def test_an_unknown_robot_is_named():
    with pytest.raises(InputError, match="panda"):
        path_problem("pandda")
