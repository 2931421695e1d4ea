"""Commands take a robot file with closed loops, given by a relative path, with nothing beside it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from bellcrank.cli import main

pytestmark = pytest.mark.tier2

FOUR_BAR = """<mujoco model="four"><compiler angle="radian"/><worldbody>
<body name="crank"><joint name="a" type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .2 0 0" size=".01" mass=".2"/>
<body name="coupler" pos=".2 0 0"><joint name="b" type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .4 0 .1" size=".01" mass=".3"/></body></body>
<body name="rocker" pos=".5 0 0"><joint name="c" type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .1 0 .1" size=".01" mass=".2"/></body></worldbody>
<equality><connect body1="coupler" body2="rocker" anchor=".4 0 .1"/></equality>
<actuator><motor joint="a"/></actuator></mujoco>"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "four.xml").write_text(FOUR_BAR)
    rows = [f"{t},{0.2 * np.sin(np.pi * t) ** 2}" for t in np.linspace(0.0, 1.0, 101)]
    (tmp_path / "m.csv").write_text("\n".join(["time [s],a position [rad]", *rows]))
    return tmp_path


def test_size_sizes_the_motor_of_the_loop_and_no_other_joint(folder: Path) -> None:
    assert main(["size", "four.xml", "--motion", "m.csv", "--out", "sized", "--no-plots"]) == 0
    joints = json.loads((folder / "sized" / "sizing.json").read_text())["joints"]
    assert [joint["name"] for joint in joints] == ["a"]
    held = 9.81 * (0.2 * 0.1 + 0.3 * 0.2)  # N m: crank, and the whole coupler at its pin, none of it on the rocker
    assert 0.1 < joints[0]["rms_torque"] < held


def test_fastest_takes_the_loop_with_its_motor(folder: Path) -> None:
    assert main(["fastest", "four.xml", "--motion", "m.csv", "--torque", "a=5", "--out", "fast", "--no-plots"]) == 0
    found = json.loads((folder / "fast" / "fastest_m.json").read_text())
    assert [cost["limit"] for cost in found["costs"]] == ["torque of a"]
    assert found["duration"] < 0.1


def test_simulate_and_check_open_it(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "four.xml", "--duration", "0.1", "--out", "run"]) == 0
    assert (folder / "run" / "run.npz").is_file()
    main(["check", "four.xml"])
    printed = capsys.readouterr().out
    assert "1 degree of freedom" in printed
