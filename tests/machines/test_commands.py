"""The commands by themselves: help, lists, and what they write, in this process."""

import csv
import json
import re

import matplotlib.image
import numpy as np
import pytest
from page_series import decoded

import bellcrank as bc
from bellcrank.cli import main

COMMANDS = (
    "size", "judge", "select", "fastest", "simulate", "sweep", "optimise", "synthesise", "modes", "replay", "report",
    "plot", "check", "catalogue", "robots", "demo", "doctor", "completion", "bench", "verify",
)  # fmt: skip
SHORT = ["--duration", "1", "--no-plots"]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command, capsys):
    with pytest.raises(SystemExit) as end:
        main([command, "--help"])
    printed = capsys.readouterr().out
    assert end.value.code == 0 and printed.startswith(f"usage: bellcrank {command} ") and "-h, --help" in printed


def test_help_lists_every_command_and_the_exit_codes(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    printed = capsys.readouterr().out
    assert set(re.findall(r"^    (\w+)", printed, flags=re.M)) == set(COMMANDS)
    assert "Exit codes: 0: success; 1: a limit is exceeded, a check failed or a run ended" in printed
    with pytest.raises(SystemExit) as end:
        main(["--version"])
    assert end.value.code == 0 and capsys.readouterr().out == f"bellcrank {bc.__version__}\n"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["simulate", "nowhere.yaml"], "bellcrank: nowhere.yaml: there is no such file; check the path\n"),
        (
            ["simulate", "pendulum", "--solver", "Euler"],
            "bellcrank: argument 'solver': unknown solver 'Euler' (expected: RK45, RK4, DOP853, Radau, auto)\n",
        ),
        (["simulate", "four_bar", "--set", "crank_lenth=3"], "unknown key or parameter 'crank_lenth'; did you mean "),
        (
            ["simulate", "four_bar", "--set", "initial.coupler=5", "--set", "initial.rocker=0.61"],
            "initial: the constraints",
        ),
        (["sweep", "four_bar", "--vary", "crank_length=1.2:1.3:0"], "crank_length"),
        (["plot", "nowhere.npz"], "bellcrank: nowhere.npz: there is no such file"),
    ],
)
def test_wrong_input_is_one_sentence_and_exits_with_2(arguments, sentence, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    printed = capsys.readouterr()
    assert sentence in printed.err and printed.err.count("\n") == 1 and printed.out == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("arguments", [["simulat"], ["simulate"], ["simulate", "pendulum", "--duration"]])
def test_a_wrong_command_line_exits_with_2_and_shows_the_usage(arguments, capsys):
    with pytest.raises(SystemExit) as end:
        main(arguments)
    printed = capsys.readouterr()
    assert end.value.code == 2 and printed.err.startswith("usage: bellcrank") and printed.out == ""


def test_robots_lists_what_can_be_loaded(capsys):
    assert main(["robots"]) == 0
    printed = capsys.readouterr().out
    for name, what, title in (
        ("four_bar", "size, simulate", "Deployable four-bar"),
        ("panda_held", "simulate", "Panda that"),
    ):
        assert re.search(rf"^  {name} +{what} +{title}", printed, flags=re.M)
    assert re.search(r"^  solo12 +solo12\.urdf", printed, flags=re.M)


def test_doctor_names_versions(capsys):
    assert main(["doctor"]) == 0
    printed = " ".join(capsys.readouterr().out.split())  # where a line breaks depends on the length of the paths in it
    assert f"bellcrank {bc.__version__}, " in printed and f"numpy {np.__version__}" in printed


def test_verify_compares_with_the_textbooks_equations(capsys):
    assert main(["verify", "planar_2r_swing"]) == 0
    rows = re.findall(r"(\d\.\d\de-\d\d) +tolerance +(\S+) +(\w+)$", capsys.readouterr().out, flags=re.M)
    assert len(rows) >= 4 and all(float(found) <= float(most) and verdict == "ok" for found, most, verdict in rows)


def test_modes_of_a_pendulum_are_those_of_its_length(tmp_path, capsys):
    assert main(["modes", "pendulum", "--out", str(tmp_path)]) == 0
    assert re.search(r"1 +0 ± 3\.13209i +0\.498488 +0 ", capsys.readouterr().out)  # √(g/l) of 1 m
    found = json.loads((tmp_path / "modes.json").read_text())
    assert found["A"] == [[0.0, 1.0], [-9.81, 0.0]] and found["position"] == [0.0] and found["stable"]
    assert found["modes"][0]["eigenvalue"] == pytest.approx([0.0, np.sqrt(9.81)], rel=1e-12)


def test_sensitivities_are_written_with_their_units(tmp_path):
    assert main(["simulate", "four_bar", *SHORT, "--sensitivity", "crank_length", "--out", str(tmp_path)]) == 0
    run = bc.simulate("four_bar", 1.0, sensitivities=["crank_length"])
    with (tmp_path / "sensitivities.csv").open(newline="") as file:
        titles, *rows = list(csv.reader(file))
    assert titles[:2] == ["time [s]", "d(crank position)/d(crank_length) [rad per m]"]
    table = np.array(rows, dtype=float)
    assert np.array_equal(table[:, 1:7], run.sensitivity("crank_length").state)
    with np.load(tmp_path / "sensitivities.npz") as arrays:
        assert any(np.array_equal(each, run.time) for each in arrays.values())


def test_a_run_is_replayed_reported_and_drawn_from_its_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "pendulum", *SHORT]) == 0
    assert (tmp_path / "pendulum_run" / "run.npz").exists()
    assert main(["replay", "pendulum_run"]) == main(["report", "pendulum_run", "--out", "report.html"]) == 0
    run = bc.load_run("pendulum_run/run.npz")
    for page in ("pendulum_run.html", "report.html"):
        film = decoded((tmp_path / page).read_text())
        assert film["title"] == "Simple pendulum" and film["time"][-1] == pytest.approx(run.time[-1])
    assert main(["plot", "pendulum_run", "--out", "run.png"]) == 0
    picture = matplotlib.image.imread(tmp_path / "run.png")
    assert picture.shape[0] > 300 and 0.002 < (picture[..., :3].min(axis=2) < 0.6).mean() < 0.5
    assert "wrote" in capsys.readouterr().out


def test_a_sweep_writes_its_designs(tmp_path, capsys):
    vary = ["--vary", "initial.swing=20:60:3", "--vary", "simulate.duration=0.5,1.5"]
    arguments = ["sweep", "pendulum", *vary, "--set", "simulate.samples=2", "--out", str(tmp_path)]
    assert main(arguments) == 0
    result = bc.sweep("pendulum", {"initial.swing": [20, 40, 60], "simulate.duration": [0.5, 1.5]})
    with (tmp_path / "sweep.csv").open(newline="") as file:
        titles, *rows = list(csv.reader(file))
    assert [row[:2] for row in rows] == [[repr(a), repr(t)] for a in (20.0, 40.0, 60.0) for t in (0.5, 1.5)]
    column = titles.index("end.swing [rad]")
    assert [float(row[column]) for row in rows] == result.column("end.swing").tolist()
    assert "6 designs" in capsys.readouterr().out and json.loads((tmp_path / "sweep.json").read_text())["complete"]


def test_check_says_what_is_wrong_and_exits_with_1(tmp_path, capsys):
    urdf = bc.load_robot("planar_2r").source.read_text()
    (tmp_path / "light.urdf").write_text(re.sub(r'mass value="[^"]*"', 'mass value="-2"', urdf, count=1))
    assert main(["check", str(tmp_path / "light.urdf")]) == 1
    line = urdf[: urdf.index("<mass")].count("\n") + 1
    sentence = f"link 'link_1', <mass> (line {line}): the mass is -2 kg; expected 0 or more"
    assert capsys.readouterr().out == f"{tmp_path / 'light.urdf'}:\n  error    file: {sentence}\n  1 error\n"
    assert main(["check", "planar_2r"]) == 0 and "nothing found" in capsys.readouterr().out


def test_completion_knows_the_commands(capsys):
    assert main(["completion", "bash"]) == 0
    printed = capsys.readouterr().out
    assert all(command in printed for command in COMMANDS)
