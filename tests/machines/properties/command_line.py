"""The command line computes what Python does, says how it ended, and exits with 0 or 1."""

import csv
import re

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main


class CommandLine:
    def test_simulate_writes_the_run_and_says_what_it_is(self, loaded_file, loaded_run, tmp_path, capsys):
        assert main(["simulate", str(loaded_file), "--no-plots", "--out", str(tmp_path)]) == 0
        printed = capsys.readouterr().out
        assert printed.startswith(loaded_run.message) and printed.endswith(f"wrote run.npz, run.csv in {tmp_path}\n")
        drift = float(re.search(r"energy drift +(\S+) of the largest energy", printed)[1])
        assert drift == pytest.approx(loaded_run.energy_drift(), rel=0.06)
        energies = re.search(r"kinetic (\S+) J, potential (\S+) J, work (\S+) J", printed).groups()
        expected = [loaded_run.kinetic_energy[-1], loaded_run.potential_energy[-1], loaded_run.work[-1]]
        assert [float(each) for each in energies] == pytest.approx(expected, rel=1e-5)
        assert {path.name for path in tmp_path.iterdir()} == {"run.npz", "run.csv"}
        assert np.array_equal(bc.load_run(tmp_path / "run.npz").state, loaded_run.state)
        with (tmp_path / "run.csv").open(newline="") as file:
            time = [float(row[0]) for row in list(csv.reader(file))[1:]]
        assert np.array_equal(time, loaded_run.time)

    def test_options_are_the_arguments_of_simulate(self, loaded_file, loaded, loaded_run, tmp_path, capsys):
        stiffness = 1.3 * dict(zip(loaded.parameters, loaded.parameter_values, strict=True))["stiffness"]
        end = loaded_run.time[-1] / 2
        options = ["--set", f"stiffness={stiffness!r}", "--duration", f"{end!r}", "--solver", "RK45", "--rtol", "1e-7"]
        options = [text.replace("np.float64(", "").replace(")", "") for text in options]
        arguments = ["simulate", str(loaded_file), *options, "--atol", "1e-8", "--samples", "9", "--no-plots"]
        assert main([*arguments, "--out", str(tmp_path)]) == 0
        given = {"solver": "RK45", "rtol": 1e-7, "atol": 1e-8, "samples": 9}
        expected = bc.simulate(loaded, end, **given, overrides={"stiffness": stiffness})
        assert np.array_equal(bc.load_run(tmp_path / "run.npz").state, expected.state)
        assert "RK45, rtol 1e-07, atol 1e-08" in capsys.readouterr().out

    def test_a_run_that_ends_early_exits_with_1(self, loaded_file, tmp_path, capsys):
        cut = ["--set", "simulate.max_evaluations=60", "--no-plots", "--out", str(tmp_path)]
        assert main(["simulate", str(loaded_file), *cut]) == 1
        assert "evaluations_spent at" in capsys.readouterr().out
        assert bc.load_run(tmp_path / "run.npz").status == "evaluations_spent"

    def test_check_finds_the_scene_in_order(self, loaded_file, loaded, loaded_run, capsys):
        assert main(["check", str(loaded_file)]) == 0
        printed = capsys.readouterr().out
        rank = loaded_run.constraint_rank(0).rank
        freedoms = loaded.robot.nv - rank
        assert printed.startswith(f"{loaded_file}:\n") and "a consistent start was found" in printed
        assert re.search(
            rf"mobility +{freedoms} degrees? of freedom: {loaded.robot.nv} of the joints less {rank} ", printed
        )
