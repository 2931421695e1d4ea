"""Motions from files with few digits: rounding is told from what moves, and never hides it."""

from __future__ import annotations

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage


@pytest.fixture(scope="module")
def arm():
    return bc.load_robot("planar_2r", gravity=(0, -9.81, 0))


def _written(arm, path, columns, decimals, unit="rad"):
    """The smooth motion from rest to rest in a file with so many decimals; `columns` of position, velocity, …"""
    motion = bc.waypoints(arm, [0.0, 1.0], [{}, {"shoulder": 1.1, "elbow": 0.7}], samples=columns[1])
    factor = {"rad": 1.0, "deg": 180.0 / np.pi}[unit]
    names = ("position", "velocity", "acceleration")[: columns[0]]
    titles = [
        f"{joint} {name} [{unit}{('', '/s', '/s^2')[k]}]" for k, name in enumerate(names) for joint in arm.joint_names
    ]
    table = np.column_stack([factor * getattr(motion, name) for name in names])
    rows = [
        f"{float(t)!r}," + ",".join(f"{x:.{decimals}f}" for x in row) for t, row in zip(motion.time, table, strict=True)
    ]
    path.write_text("\n".join(["time [s]," + ",".join(titles), *rows]) + "\n")
    return path


@pytest.mark.parametrize("unit", ["rad", "deg"])
@pytest.mark.parametrize(("kinds", "samples"), [(1, 21), (1, 101), (2, 201), (3, 201)])
@pytest.mark.parametrize("decimals", [4, 6, 9])
def test_rounding_in_a_file_is_neither_a_start_in_motion_nor_a_disagreement(
    arm, tmp_path, unit, kinds, samples, decimals
):
    motion = bc.read_motion(arm, _written(arm, tmp_path / "m.csv", (kinds, samples), decimals, unit))
    told = [text for text in motion.warnings if "moving" in text or "does not agree" in text]
    peak = np.abs(motion.velocity).max()
    assert all("starts moving" in text or "ends moving" in text for text in told), told
    # where the digits leave more than a hundredth of the largest speed unknown, that is said
    assert all("the digits of its file leave" in text for text in told), told
    if told:
        assert max(motion.speed_noise) > 0.01 * peak and decimals == 4


def test_a_start_in_motion_is_told_whatever_the_digits(arm, tmp_path):
    path = tmp_path / "m.csv"
    path.write_text("time [s],shoulder position [rad],elbow position [rad]\n0,0,0\n1,1,2\n2,2,4\n3,3,6\n")
    typed = bc.read_motion(arm, path)
    assert any("starts moving: elbow velocity 2 rad/s at 0 s;" in text for text in typed.warnings)
    time = np.linspace(0.0, 1.0, 101)
    rows = "\n".join(f"{t:.2f},{0.03 * t + t**3:.6f},{t**3:.6f}" for t in time)
    path.write_text(f"time [s],shoulder position [rad],elbow position [rad]\n{rows}\n")
    assert any("starts moving: shoulder velocity 0.03 rad/s" in text for text in bc.read_motion(arm, path).warnings)


def test_a_limit_that_is_met_to_the_last_digit_of_a_file_is_not_exceeded(tmp_path):
    (tmp_path / "arm.urdf").write_text(
        '<robot name="r"><link name="base"/><link name="arm"><inertial><origin xyz="0.3 0 0"/><mass value="1"/>'
        '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>'
        f'<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>'
        f'<limit lower="-1" upper="{np.pi / 4!r}" '
        'effort="9" velocity="9"/></joint></robot>'
    )
    robot = bc.load_robot(tmp_path / "arm.urdf")
    for excess, inside in ((0.0, True), (5e-5, False)):
        time = np.linspace(0.0, 1.0, 101)
        angle = (np.pi / 4 + excess) * (10 * time**3 - 15 * time**4 + 6 * time**5)
        rows = "\n".join(f"{t:.2f},{q:.5f}" for t, q in zip(time, angle, strict=True))
        (tmp_path / "m.csv").write_text(f"time [s],j position [rad]\n{rows}\n")
        motion = bc.read_motion(robot, tmp_path / "m.csv")
        assert (motion.position.max() > np.pi / 4) is np.True_  # 0.78540, and the limit is 0.785398…
        sizing = bc.size(robot, motion)
        assert sizing.inside is inside, sizing.exceeded
        assert any("leaves the range" in text for text in motion.warnings) is not inside


def test_what_is_unknown_of_a_motion_stays_with_it_when_it_is_joined(arm, tmp_path):
    motion = bc.read_motion(arm, _written(arm, tmp_path / "m.csv", (1, 101), 6))
    rest = bc.dwell(arm, motion.position[-1], 0.5)
    assert bc.join(motion, rest).speed_noise == motion.speed_noise and max(motion.speed_noise) > 0.0
    assert rest.speed_noise == (0.0, 0.0) and rest.position_noise == (0.0, 0.0)
    exact = bc.read_motion(arm, bc.write_motion(bc.waypoints(arm, [0, 1], [{}, {"elbow": 1}]), tmp_path / "e.csv"))
    assert exact.position_noise == (0.0, 0.0)


@pytest.mark.tier2
def test_a_linkage_that_follows_a_file_with_few_digits_does_not_start_moving(tmp_path):
    scene = bc.load_scene("five_bar")
    motion = Linkage(scene).motion("pick")
    names = ("left_motor", "right_motor")
    columns = [motion.position[:, scene.robot.joint(name).q] for name in names]
    rows = [",".join([f"{t:.4f}", *(f"{x:.6f}" for x in row)]) for t, *row in zip(motion.time, *columns, strict=True)]
    header = "time [s]," + ",".join(f"{name} position [rad]" for name in names)
    (tmp_path / "pick.csv").write_text("\n".join([header, *rows]) + "\n")
    sizing = bc.size("five_bar", tmp_path / "pick.csv")
    exact = bc.size("five_bar", "pick")
    assert not [text for text in exact.warnings if "moving" in text]
    told = [text for text in sizing.warnings if "moving" in text]
    assert all("the digits of its file leave" in text for text in told), told
