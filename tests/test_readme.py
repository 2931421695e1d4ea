"""What the README shows is what happens."""

import math
import re
from pathlib import Path

import pytest

from bellcrank.cli import main

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


def test_the_sizing_example_runs(capsys):
    exec(compile(blocks("python")[0], "README.md", "exec"), {})
    assert float(capsys.readouterr().out) == pytest.approx(45, abs=5)


def test_the_simulation_example_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(blocks("python")[1], "README.md", "exec"), {})
    first, second, third = capsys.readouterr().out.splitlines()
    status, slide = first.split()
    assert status == "finished"
    assert float(slide) == pytest.approx(6.70749476, abs=1e-7)  # A. Ghosal's lecture 18, integrated independently
    coriolis, place = second.split(maxsplit=1)
    assert 0 < float(coriolis) < 10
    mass = [float(x) for x in place.strip("[]").split()]
    assert math.hypot(*mass) == pytest.approx(float(slide), abs=1e-7)  # the mass hangs on the slide, from the origin
    drift, error = map(float, third.split())
    assert drift < 1e-8
    assert 0 < error < 1e-6
    assert {path.name for path in tmp_path.iterdir()} == {"pendulum.npz", "pendulum.csv", "pendulum.png"}


def test_the_sweep_and_replay_example_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(compile(blocks("python")[2], "README.md", "exec"), names)
    times = [design.measures["lock.time"] for design in names["designs"].designs]
    assert times == sorted(times, reverse=True)  # the longer the crank, the sooner it locks
    assert "lock.time" in capsys.readouterr().out
    assert "<html" in Path("four_bar.html").read_text(encoding="utf-8")


def test_every_command_it_names_exists(capsys):
    commands = set(re.findall(r"`bellcrank (\w+)", README))
    assert {"size", "simulate", "sweep", "replay", "report", "plot", "check", "verify", "bench", "robots"} <= commands
    for command in commands:
        with pytest.raises(SystemExit) as ended:
            main([command, "--help"])
        assert ended.value.code == 0


def test_it_stays_short_with_two_marked_commands():
    assert len(README.splitlines()) <= 150
    for marker in ("main-job", "tests"):
        after = README.split(f"<!-- {marker} -->\n```sh\n")[1]
        assert len(after.split("```")[0].splitlines()) == 1
