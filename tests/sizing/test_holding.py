"""Holding torques against brute force and against closed forms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from two_link import M1, M2, R1, R2, G, TwoLink

import bellcrank as bc
from bellcrank.robot.load import load_robot
from bellcrank.sizing.holding_gravity import gravity_holding_torques

UNIT = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
SLIDER = """<robot name="slider"><link name="base"/>
<link name="arm"><inertial><mass value="3"/><origin xyz="0.2 0 0"/>{unit}</inertial></link>
<link name="rod"><inertial><mass value="2"/>{unit}</inertial></link>
<joint name="turn" type="{kind}"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>{limit}</joint>
<joint name="slide" type="prismatic"><parent link="arm"/><child link="rod"/><axis xyz="1 0 0"/>{slide}</joint>
</robot>"""
FOLLOWER = """<robot name="follow"><link name="base"/><link name="a">{body}</link><link name="b">{body}</link>
<joint name="one" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/></joint>
<joint name="two" type="continuous"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/>
<axis xyz="0 1 0"/><mimic joint="one" multiplier="2"/></joint></robot>"""


def test_two_link_by_hand() -> None:
    robot: Any = TwoLink()
    holding = gravity_holding_torques(robot)
    np.testing.assert_allclose(holding.torque, [G * (M1 * R1 + M2 * (1 + R2)), G * M2 * R2], rtol=1e-12)


def test_ranges_are_kept() -> None:
    robot: Any = TwoLink()
    robot.lower, robot.upper = np.array([np.radians(60), 0.2]), np.array([np.radians(120), 0.4])
    holding = gravity_holding_torques(robot)
    grid = np.stack(
        np.meshgrid(np.linspace(robot.lower[0], robot.upper[0], 201), np.linspace(0.2, 0.4, 201)), axis=-1
    ).reshape(-1, 2)
    np.testing.assert_allclose(holding.torque, np.abs(robot.gravity_torque(grid)).max(axis=0), rtol=1e-9)
    assert np.all((holding.position >= robot.lower - 1e-12) & (holding.position <= robot.upper + 1e-12))


@pytest.mark.tier2
@pytest.mark.parametrize("name", ["ur5", "kinova", "panda"])
def test_no_random_posture_needs_more_and_the_posture_found_needs_as_much(name: str) -> None:
    robot = load_robot(name, gravity=(2.0, -3.0, -9.0))
    holding = gravity_holding_torques(robot)
    generator = np.random.default_rng(7)
    columns = [joint.q for joint in robot.joints]
    low = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)[columns]
    high = np.where(np.isfinite(robot.upper), robot.upper, np.pi)[columns]
    postures = low + (high - low) * generator.random((50_000, len(columns)))
    torque = np.abs(robot.gravity_torque(postures))
    # Improve the best random postures of each joint by shrinking random steps: an independent search.
    for k in range(len(columns)):
        best = postures[np.argsort(torque[:, k])[-40:]].copy()
        for width in np.geomspace(1.5, 1e-4, 50):
            near = np.clip(best[:, None] + width * generator.standard_normal((40, 60, len(columns))), low, high)
            near = np.concatenate([near, best[:, None]], axis=1)
            values = np.abs(robot.gravity_torque(near.reshape(-1, len(columns))))[:, k].reshape(40, -1)
            best = near[np.arange(40), values.argmax(axis=1)]
        searched = np.abs(robot.gravity_torque(best))[:, k].max()
        assert searched <= holding.torque[k] * (1 + 1e-12) + 1e-12
        assert searched == pytest.approx(holding.torque[k], rel=5e-3, abs=1e-3)  # a random search stops short
        assert abs(robot.gravity_torque(holding.position[k])[k]) == pytest.approx(
            holding.torque[k], rel=1e-12, abs=1e-12
        )


def slider(tmp_path: Path, kind: str, slide: str, limit: str = "") -> Any:
    path = tmp_path / "slider.urdf"
    path.write_text(SLIDER.format(unit=UNIT, kind=kind, slide=slide, limit=limit))
    return load_robot(path)


def test_a_sliding_joint_goes_to_its_end(tmp_path: Path) -> None:
    robot = slider(tmp_path, "continuous", '<limit lower="-0.1" upper="0.8" effort="1" velocity="1"/>')
    holding = gravity_holding_torques(robot)
    np.testing.assert_allclose(holding.torque, [9.81 * (3 * 0.2 + 2 * 0.8), 9.81 * 2], rtol=1e-12)
    assert holding.notes == ()


@pytest.mark.parametrize("tolerance", [0.0, 0.1])
def test_passes_along_a_tree_take_a_sliding_joint_to_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tolerance: float
) -> None:
    robot = slider(tmp_path, "continuous", '<limit lower="-0.1" upper="0.8" effort="1" velocity="1"/>')
    monkeypatch.setattr("bellcrank.sizing.holding_gravity.MANY", 0)  # as for trees of many joints
    holding = gravity_holding_torques(robot, mass_tolerance=tolerance)
    largest = 9.81 * np.array([3 * 0.2 + 2 * 0.8, 2]) * (1 + tolerance)
    np.testing.assert_allclose(holding.torque, largest, rtol=1e-12)


def test_a_sliding_joint_without_limits_is_held_at_zero_and_said_so(tmp_path: Path) -> None:
    holding = gravity_holding_torques(slider(tmp_path, "continuous", ""))
    np.testing.assert_allclose(holding.torque[0], 9.81 * 3 * 0.2, rtol=1e-12)
    assert "slides without limits" in holding.notes[0]


def test_a_joint_that_others_follow(tmp_path: Path) -> None:
    path = tmp_path / "follow.urdf"
    body = f'<inertial><mass value="1"/><origin xyz="0.5 0 0"/>{UNIT}</inertial>'
    path.write_text(FOLLOWER.format(body=body))
    holding = gravity_holding_torques(load_robot(path))
    x = np.linspace(-np.pi, np.pi, 2_000_001)
    # V = g (0.5 h(x) + h(x) + 0.5 h(3x)), h = −sin; its slope is the torque.
    assert holding.torque[0] == pytest.approx(np.abs(9.81 * (1.5 * np.cos(x) + 1.5 * np.cos(3 * x))).max(), rel=1e-9)


def test_a_mass_tolerance_raises_the_holding_torque() -> None:
    robot: Any = TwoLink()
    np.testing.assert_allclose(
        gravity_holding_torques(robot, mass_tolerance=0.1).torque,
        1.1 * gravity_holding_torques(robot).torque,
        rtol=1e-12,
    )


ARM_AND_COUNTERWEIGHT = """<robot name="arm"><link name="base"/><link name="arm"><inertial><mass value="1"/>
<origin xyz="1 0 0"/>{unit}</inertial></link><link name="counter"><inertial><mass value="1.9"/>
<origin xyz="{at}"/>{unit}</inertial></link>
<joint name="one" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-3.2" upper="3.2" effort="1" velocity="1"/></joint>
<joint name="two" type="{kind}"><parent link="arm"/><child link="counter"/>{origin}<axis xyz="{axis}"/>
<limit lower="-{range}" upper="{range}" effort="1" velocity="1"/></joint></robot>"""


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("kind", "axis", "origin", "at", "reach"),
    [
        ("revolute", "0 1 0", '<origin xyz="-0.5 0 0.3"/>', "0 0 0", 0.5),  # its angle does not matter
        ("revolute", "0 1 0", '<origin xyz="-0.2 0 0.1"/>', "-0.4 0 0.3", 0.6),
        ("revolute", "1 0 0", '<origin xyz="-0.3 0 0"/>', "-0.1 0.2 0.5", 2.0),
        ("prismatic", "1 0 0", '<origin xyz="-0.5 0 0.3"/>', "0 0 0", 0.2),
    ],
)
def test_the_worst_of_all_masses_and_postures_is_found(
    tmp_path: Path, kind: str, axis: str, origin: str, at: str, reach: float
) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(ARM_AND_COUNTERWEIGHT.format(unit=UNIT, kind=kind, axis=axis, origin=origin, at=at, range=reach))
    robot = load_robot(path)
    holding = gravity_holding_torques(robot, mass_tolerance=0.3)
    both = np.stack(np.meshgrid(np.linspace(-3.2, 3.2, 1281), np.linspace(-reach, reach, 161)), axis=-1).reshape(-1, 2)
    rest = np.zeros_like(both)
    shares = robot.link_torques(both, rest, rest)
    corners = [np.abs(a * shares[:, 0] + b * shares[:, 1]).max(axis=0) for a in (0.7, 1.3) for b in (0.7, 1.3)]
    brute = np.max(corners, axis=0)
    assert np.all(holding.torque >= brute * (1 - 1e-12) - 1e-12)
    np.testing.assert_allclose(holding.torque, brute, rtol=2e-5, atol=1e-9)
    for k, posture in enumerate(holding.position):  # and the posture told needs as much, with some masses
        needs = robot.link_torques(posture, rest[0], rest[0])[:, k]
        assert abs(needs.sum()) + 0.3 * np.abs(needs).sum() == pytest.approx(holding.torque[k], rel=1e-12, abs=1e-12)
    if at == "0 0 0" and kind == "revolute":
        assert holding.torque[0] == pytest.approx(8.966, abs=5e-4)  # 7.297 at the nominal masses' worst posture


def test_more_tolerance_never_lowers_the_holding_torque_and_scaling_all_masses_is_within_it() -> None:
    robot = load_robot("ur5")
    nominal, wide, wider = (gravity_holding_torques(robot, mass_tolerance=tol).torque for tol in (0.0, 0.1, 0.3))
    assert np.all(wide >= 1.1 * nominal - 1e-9) and np.all(wider >= 1.3 * nominal - 1e-9)
    assert np.all(wider >= wide - 1e-9)
    generator = np.random.default_rng(3)
    postures = generator.uniform(-np.pi, np.pi, (20_000, robot.nq))
    shares = robot.link_torques(postures, np.zeros_like(postures), np.zeros_like(postures))
    needed = np.abs(shares.sum(axis=1)) + 0.3 * np.abs(shares).sum(axis=1)
    assert np.all(needed.max(axis=0) <= wider * (1 + 1e-12) + 1e-12)


def test_a_mass_tolerance_with_a_joint_that_others_follow(tmp_path: Path) -> None:
    path = tmp_path / "follow.urdf"
    path.write_text(FOLLOWER.format(body=f'<inertial><mass value="1"/><origin xyz="0.5 0 0"/>{UNIT}</inertial>'))
    robot = load_robot(path)
    x = np.linspace(-np.pi, np.pi, 400_001)[:, None]
    shares = robot.link_torques(x, 0 * x, 0 * x)[:, :, 0]
    brute = (np.abs(shares.sum(axis=1)) + 0.2 * np.abs(shares).sum(axis=1)).max()
    assert gravity_holding_torques(robot, mass_tolerance=0.2).torque[0] == pytest.approx(brute, rel=1e-9)


@pytest.mark.parametrize(("angle", "expected"), [(1.0, 3.0 * (np.pi + 0.5)), (10.0, 3.0 * (10.0 - 0.5))])
def test_a_spring_at_a_joint_without_limits_is_held_over_one_turn_and_over_the_motions(
    tmp_path: Path, angle: float, expected: float
) -> None:
    body = f'<inertial><mass value="2"/>{UNIT}</inertial>'
    (tmp_path / "turner.urdf").write_text(
        f'<robot name="turner"><link name="base"/><link name="arm">{body}</link><joint name="turn" type="continuous">'
        '<parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint></robot>'
    )
    (tmp_path / "turner.yaml").write_text(
        "urdf: turner.urdf\nforces: [{kind: joint_spring, joint: turn, stiffness: 3, rest: 0.5}]\n"
        f"motions: {{go: {{kind: waypoints, times: [0, 2], positions: [{{}}, {{turn: {angle}}}]}}}}\n"
    )
    sizing = bc.size(tmp_path / "turner.yaml")
    assert sizing.joint("turn").holding_torque == pytest.approx(expected, rel=1e-12)
    assert any("turns without limits" in note and "over one turn" in note for note in sizing.warnings)
