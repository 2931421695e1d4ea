"""`bellcrank fastest` from the command line."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

import bellcrank as bc
from bellcrank.cli import main


def test_it_writes_the_motion_the_limits_and_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fastest", "geared_pendulum", "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "motor torque of shoulder" in printed
    found = json.loads((tmp_path / "fastest_lift_and_return.json").read_text())
    motion = bc.read_motion(bc.load_robot("geared_pendulum"), tmp_path / "fastest_lift_and_return.csv")
    assert motion.duration == pytest.approx(found["duration"], rel=1e-6)
    rows = list(csv.reader((tmp_path / "limits_lift_and_return.csv").read_text().splitlines()))
    assert rows[0][0] == "t [s]"
    assert float(rows[-1][0]) == pytest.approx(found["duration"], rel=1e-9)
    assert (tmp_path / "fastest_lift_and_return.png").stat().st_size > 10_000


def test_a_factor_that_exceeds_a_limit_exits_with_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fastest", "geared_pendulum", "--scale", "5", "--out", str(tmp_path), "--no-plots"]) == 1
    assert "the factor 5 is not allowed" in capsys.readouterr().out
    assert main(["fastest", "geared_pendulum", "--scale", "max", "--out", str(tmp_path), "--no-plots"]) == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--speed", "elbo=2"], "did you mean 'elbow'"),
        (["--speed", "elbow"], "expected JOINT=VALUE"),
        (["--torque", "elbow=-2"], "torque of 'elbow'"),
        (["--grid", "1"], "--grid"),
        (["--motion", "elbow_u"], "elbow_up"),
        (["--tool", "tip"], "tool_speed"),
        (["--scale", "0"], "--scale"),
        (["--scale", "max", "--grid", "10"], "--grid"),
        (["--scale", "max", "--html"], "--html"),
        (["--repeat-limit", "temperature"], "--repeat"),
        (["--speed", "elbow=1", "--speed", "elbow=2"], "two limits"),
    ],
)
def test_wrong_options_are_told_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], message: str
) -> None:
    assert main(["fastest", "planar_2r", "--out", str(tmp_path), *options]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
