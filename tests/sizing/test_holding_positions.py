"""Where the largest holding torques occur: at positions of the joints that have a part in them, the others at rest."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.sizing.holding_gravity import gravity_holding_torques

BODY = '<inertial><mass value="2"/><origin xyz="0.3 0.1 0"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
TILT = 0.7  # rad, of the column's frame; its axis is vertical to rounding


def arm(folder: Path) -> bc.Robot:
    """A column that turns about the vertical, written in a tilted frame, with two links that pitch on it."""
    links = "".join(f'<link name="{name}">{BODY}</inertial></link>' for name in ("column", "upper", "lower"))
    joints = "".join(
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.5 0 0" rpy="{tilt} 0 0"/><axis xyz="{axis}"/></joint>'
        for name, parent, child, tilt, axis in (
            ("yaw", "base", "column", TILT, f"0 {math.sin(TILT)!r} {math.cos(TILT)!r}"),
            ("shoulder", "column", "upper", -TILT, "0 1 0"),
            ("elbow", "upper", "lower", 0, "0 1 0"),
        )
    )
    (folder / "arm.urdf").write_text(f'<robot name="arm"><link name="base"/>{links}{joints}</robot>')
    return bc.load_robot(folder / "arm.urdf")


def test_a_joint_that_a_torque_does_not_depend_on_stays_where_it_is(tmp_path: Path) -> None:
    robot = arm(tmp_path)
    turned = np.zeros((9, 3))
    turned[:, 0] = np.linspace(-3.0, 3.0, 9)
    torque = robot.gravity_torque(turned)
    assert 0.0 < np.ptp(torque, axis=0).max() < 1e-13 * np.abs(torque).max()  # by rounding alone
    found = gravity_holding_torques(robot)
    expected = 2.0 * 9.81 * np.array([0.3 + 0.5 + 0.3, 0.3])
    assert found.torque[1:] == pytest.approx(expected, rel=1e-9)
    assert found.position[1:, 0] == pytest.approx(0.0, abs=0.0)
