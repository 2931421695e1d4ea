"""`bellcrank fastest` from the command line."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import scipy.integrate

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


@pytest.mark.tier2
def test_a_factor_that_exceeds_a_limit_exits_with_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fastest", "geared_pendulum", "--scale", "5", "--out", str(tmp_path), "--no-plots"]) == 1
    assert "the factor 5 is not allowed" in capsys.readouterr().out
    assert main(["fastest", "geared_pendulum", "--scale", "max", "--out", str(tmp_path), "--no-plots"]) == 0


def test_a_slower_motion_is_judged_by_its_own_torques(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A pendulum that falls freely needs no torque; at half the speed it has to be held."""
    robot = bc.load_robot("geared_pendulum")

    def fall(_: float, state: Sequence[float]) -> list[float]:
        q, v = np.array(state[:1]), np.array(state[1:])
        return [state[1], float(robot.forward_dynamics(q, v, np.zeros(1))[0])]

    time = np.linspace(0.0, 0.3, 301)
    q, v = scipy.integrate.solve_ivp(fall, (0.0, 0.3), [1.2, 0.0], t_eval=time, rtol=1e-10, atol=1e-12).y
    a = [fall(0.0, state)[1] for state in zip(q, v, strict=True)]
    motion = tmp_path / "fall.csv"
    rows = [f"{t!r},{x!r},{y!r},{z!r}" for t, x, y, z in zip(time.tolist(), q.tolist(), v.tolist(), a, strict=True)]
    header = "time [s],shoulder position [rad],shoulder velocity [rad/s],shoulder acceleration [rad/s^2]"
    motion.write_text("\n".join([header, *rows]) + "\n")
    given = f"fastest geared_pendulum --no-actuators --speed none --no-plots --motion {motion} --out {tmp_path}".split()
    holding = abs(float(robot.inverse_dynamics(np.array([1.2]), np.zeros(1), np.zeros(1))[0]))
    given += ["--torque", f"shoulder={0.6 * holding}"]
    assert main([*given, "--scale", "1"]) == 0
    assert main([*given, "--scale", "0.95"]) == 0
    assert main([*given, "--scale", "0.5"]) == 1
    said = capsys.readouterr().out
    share = 0.75 / 0.6  # of the weight, as the acceleration is a quarter of that of the fall
    assert (
        f"the factor 0.5 is not allowed: the motion then exceeds the torque of shoulder by {100 * share - 100:.3g} %"
        in said
    )


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
        (["--scale", "max", "--html"], "--page"),
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
