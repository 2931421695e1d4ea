"""A search that was killed goes on: the same result, without running a design twice."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import InputError
from bellcrank.studies.execution.simulation_runner import SimulationRunner
from bellcrank.studies.optimisation import kept_designs

LENGTHS = {"crank_length": (1.2, 1.24), "rocker_length": (1.2, 1.24)}
ASKED = {"minimise": "lock.crank", "limits": "lock.time <= 15 s", "samples": 32, "starts": 2, "threads": 1}


@pytest.fixture
def counted(monkeypatch):
    """How many designs were run."""
    found = []

    def run(self, values, **named):
        found.append(len(values))
        return whole(self, values, **named)

    whole = SimulationRunner.run
    monkeypatch.setattr(SimulationRunner, "run", run)
    return found


def test_a_search_takes_the_designs_that_its_folder_keeps(tmp_path, counted):
    plain = bc.optimise("four_bar", LENGTHS, **ASKED)
    alone = sum(counted)
    counted.clear()
    first = bc.optimise("four_bar", LENGTHS, folder=tmp_path, **ASKED)
    assert 0 < sum(counted) <= alone  # a design that is asked for twice runs once
    counted.clear()
    again = bc.optimise("four_bar", LENGTHS, folder=tmp_path, **ASKED)
    assert sum(counted) == 0
    for one in (first, again):
        assert one.as_dict() == plain.as_dict()
        assert np.array_equal(np.concatenate(one.problem.values), np.concatenate(plain.problem.values), equal_nan=True)
    with pytest.raises(InputError, match="holds an unfinished study that differs in"):
        bc.optimise("four_bar", {"crank_length": (1.2, 1.24)}, folder=tmp_path, **ASKED)
    other = bc.optimise("four_bar", {"crank_length": (1.2, 1.24)}, folder=tmp_path, restart=True, **ASKED)
    assert other.complete and (tmp_path / "checkpoints.1").is_dir()


def test_reasons_of_infeasible_designs_and_fronts_are_kept_too(tmp_path, counted):
    wide = {"crank_length": (0.2, 1.24), "rocker_length": {"sizes": [1.2, 1.22]}}
    asked = {"minimise": "lock.time", "maximise": "lock.crank", "points": 3, "samples": 16, "starts": 1, "threads": 1}
    plain = bc.pareto_front("four_bar", wide, **asked)
    assert plain.problem.reasons
    bc.pareto_front("four_bar", wide, folder=tmp_path, **asked)
    counted.clear()
    again = bc.pareto_front("four_bar", wide, folder=tmp_path, **asked)
    assert sum(counted) == 0 and again.as_dict() == plain.as_dict() and again.problem.reasons == plain.problem.reasons


def test_a_damaged_file_of_kept_designs_is_computed_anew(tmp_path, counted, capsys, monkeypatch):
    monkeypatch.setattr(kept_designs, "EVERY", 0.0)
    plain = bc.optimise("four_bar", LENGTHS, folder=tmp_path, **ASKED)
    files = sorted((tmp_path / "checkpoints").glob("*.npz"))
    assert len(files) > 2
    files[0].write_bytes(files[0].read_bytes()[:-40])
    counted.clear()
    assert bc.optimise("four_bar", LENGTHS, folder=tmp_path, **ASKED).as_dict() == plain.as_dict()
    assert sum(counted) == 1 and "is damaged" in capsys.readouterr().out


def test_wrong_input_leaves_no_folder(tmp_path, capsys):
    assert main(["optimise", "four_bar", "--minimise", "lock.tim", "--vary", "crank_length=1.2:1.24", "--out",
                 str(tmp_path / "o")]) == 2  # fmt: skip
    assert "unknown measure 'lock.tim'" in capsys.readouterr().err and not (tmp_path / "o").exists()


@pytest.mark.tier2
def test_a_killed_command_goes_on_and_its_folder_holds_the_result_alone(tmp_path, monkeypatch, capsys):
    line = ["optimise", "balanced_arm", "--no-plots", "--threads", "1"]
    script = (
        "import sys, bellcrank.studies.optimisation.kept_designs as kept; kept.EVERY = 0.0; "
        "from bellcrank.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    started = subprocess.Popen(
        [sys.executable, "-c", script, *line, "--out", "killed"], cwd=tmp_path, stdout=subprocess.DEVNULL
    )
    kept = tmp_path / "killed/checkpoints"
    end = time.monotonic() + 300
    while len(list(kept.glob("*.npz"))) < 3 and started.poll() is None and time.monotonic() < end:
        time.sleep(0.01)
    os.kill(started.pid, signal.SIGKILL)
    started.wait()
    assert len(list(kept.glob("*.npz"))) >= 3
    monkeypatch.chdir(tmp_path)
    assert main([*line, "--out", "killed"]) == 0
    assert "designs were run before" in capsys.readouterr().out
    assert main([*line, "--out", "whole"]) == 0
    for name in ("designs.csv", "optimum.json"):
        assert Path("killed", name).read_bytes() == Path("whole", name).read_bytes()
    assert sorted(path.name for path in Path("killed").iterdir()) == ["designs.csv", "optimum.json"]
