"""Fastest motions behind gears that lose power, which may split the allowed accelerations, and their bounds."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import bellcrank as bc
from tests.campaigns.fastest_behind_lossy_gears import random_arm
from tests.support.scenes import with_actuators

POSTURES = [(-0.3112, -1.4825), (-0.7125, -0.2364), (-1.1822, 0.3995)]
MOTORS = bc.MotionLimits(speed="none", torque="none")


def geared(folder: Path, efficiency: float = 0.8) -> bc.Scene:
    """The planar arm with its motors behind gears of an efficiency."""
    (folder / "arm.yaml").write_text(
        "urdf: planar_2r\nfriction: none\ngravity: [0, -9.81, 0]\nactuators:\n"
        f"  shoulder: {{ratio: 160, efficiency: {efficiency}, rotor_inertia: 5.9e-5, rated_torque: 2.4,\n"
        "             peak_torque: 7.1, rated_speed: 3000 rpm, max_speed: 5000 rpm, safety_factor: 1.2}\n"
        f"  elbow: {{ratio: 100, efficiency: {efficiency}, rotor_inertia: 4.0e-5, rated_torque: 1.27,\n"
        "          peak_torque: 3.8, rated_speed: 3000 rpm, max_speed: 5000 rpm, safety_factor: 1.2}\n"
    )
    return bc.load_scene(folder / "arm.yaml")


def most_used(scene: bc.Scene, motion: bc.Motion, efficiency: float) -> float:
    """The largest share of a motor's peak torque, from inverse dynamics between the rows."""
    step = np.diff(motion.time)
    inside = np.flatnonzero(step > 0.0)
    time = np.concatenate([motion.time[inside] + share * step[inside] for share in (0.01, 0.2, 0.4, 0.6, 0.8, 0.99)])
    q, v, a = motion.at(time)
    arm = bc.load_robot("planar_2r", friction="none", gravity=(0.0, -9.81, 0.0))  # without the rotors
    load = arm.inverse_dynamics(q, v, a)
    used = 0.0
    for k, (ratio, rotor, peak) in enumerate([(160.0, 5.9e-5, 7.1), (100.0, 4.0e-5, 3.8)]):
        passed = load[:, k] / ratio * np.where(load[:, k] * v[:, k] > 0.0, 1.0 / efficiency, efficiency)
        used = max(used, float(np.max(1.2 * np.abs(passed + rotor * ratio * a[:, k]) / peak)))
    return used


@pytest.mark.parametrize("efficiency", [0.8, 0.5])
def test_the_motion_uses_split_accelerations_and_keeps_all_limits(tmp_path: Path, efficiency: float) -> None:
    scene = geared(tmp_path, efficiency)
    path = bc.joint_path(scene.robot, POSTURES)
    found = bc.time_optimal(scene, path, MOTORS, costs=False)
    assert found.excess <= 1e-6
    assert 1.0 - 1e-6 <= most_used(scene, found.motion, efficiency) <= 1.0 + 1e-6
    assert 0.0 <= found.gap <= 1e-5
    if efficiency == 0.8:
        assert found.duration <= 0.50031  # without the split accelerations 0.50059 s


@pytest.mark.parametrize("efficiency", [0.7, 0.5])
def test_sizing_condemns_no_fastest_motion_at_its_reversals(tmp_path: Path, efficiency: float) -> None:
    scene = geared(tmp_path, efficiency)
    path = bc.joint_path(scene.robot, [(-1.0, 0.5), (-0.4, 1.2), (-1.1, 0.4)])
    found = bc.time_optimal(scene, path, MOTORS, costs=False)
    sizing = bc.size(scene, found.motion)
    for joint in ("shoulder", "elbow"):
        shaft = sizing.joint(joint).shaft
        assert shaft is not None
        margin = shaft.margins["peak torque"]
        assert margin is not None and margin >= -1e-6


def test_a_time_next_to_its_bound_is_called_optimal(tmp_path: Path) -> None:
    scene = geared(tmp_path)
    found = bc.time_optimal(scene, bc.joint_path(scene.robot, POSTURES), costs=False)
    assert 0.0 <= found.gap <= 1e-6
    assert found.bound.startswith("optimal: ")
    assert found.bound in found.table()
    written = json.loads(found.to_json(tmp_path / "found.json").read_text())
    assert written["lower_bound"] == found.lower_bound
    assert written["bound"] == found.bound


def test_a_lone_inertia_takes_its_bound(tmp_path: Path) -> None:
    robot = bc.load_robot("planar_2r", friction="none")
    path = bc.joint_path(robot, [{}, {"shoulder": 1.9}])
    found = bc.time_optimal(robot, path, bc.MotionLimits(speed="none", torque={"shoulder": 50.0}), costs=False)
    exact = 2.0 * np.sqrt(1.9 * robot.mass_matrix([0.0, 0.0])[0, 0] / 50.0)
    assert exact * (1.0 - 1e-6) <= found.lower_bound <= exact * (1.0 + 1e-10)


def test_a_bound_of_a_grid_and_one_with_limits_of_jerk_say_so(tmp_path: Path) -> None:
    scene = geared(tmp_path)
    path = bc.joint_path(scene.robot, POSTURES)
    fine = bc.time_optimal(scene, path, MOTORS, costs=False)
    coarse = bc.time_optimal(scene, path, MOTORS, grid=30, costs=False)
    assert coarse.lower_bound <= coarse.duration
    assert not coarse.bound.startswith("optimal")
    limits = bc.MotionLimits(speed="none", torque="none", jerk={"shoulder": 2000.0, "elbow": 2000.0})
    smooth = bc.time_optimal(scene, path, limits, costs=False)
    assert smooth.bound.startswith("without limits of jerk no motion takes less than")
    assert smooth.lower_bound == pytest.approx(fine.lower_bound, rel=1e-5)
    assert smooth.duration > fine.duration


def test_no_bound_is_stated_behind_a_gear_whose_efficiency_is_a_curve() -> None:
    motor = bc.Motor(id="m", maker="", model="", peak_torque=0.6, nominal_torque=0.3, nominal_speed=300.0,
                     max_speed=700.0, rotor_inertia=2e-5, peak_curve=((0.0, 0.6), (700.0, 0.3)))  # fmt: skip
    gear = bc.Gear(id="g", maker="", model="", kind="planetary", ratio=50.0, inertia=0.0, rated_torque=20.0,
                   efficiency_curve=((0.1, 0.6), (0.5, 0.72), (1.0, 0.8)))  # fmt: skip
    scene = with_actuators(bc.load_scene("geared_pendulum"), {"shoulder": bc.Actuator.of(motor, gear)})
    found = bc.time_optimal(scene, "lift_and_return", MOTORS, costs=False)
    assert np.isnan(found.lower_bound) and found.as_dict()["lower_bound"] is None
    assert found.bound == "no lower bound of the time is known"


def arm_with_geared_elbow(folder: Path, ratings: str) -> bc.Scene:
    (folder / "arm.yaml").write_text(
        "urdf: planar_2r\nfriction: none\ngravity: [0, -9.81, 0]\n"
        f"actuators: {{elbow: {{ratio: 100, rated_speed: 300, max_speed: 400, {ratings}}}}}\n"
    )
    return bc.load_scene(folder / "arm.yaml")


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("ratings", "postures", "torque"),
    [
        (
            "rotor_inertia: 1.8697e-4, peak_torque: 0.84188, rated_torque: 0.42, efficiency: 0.74912",
            [[-1.58224779, -0.47293647], [-2.20925269, 0.52147643]],
            404.54393,
        ),
        (
            "efficiency: 0.3954725827225761, rotor_inertia: 0.00019788630017258737, peak_torque: 2.2185904488089223,"
            " rated_torque: 1.1",
            [[-0.67664091, -1.99177654], [-1.95160748, -0.8781722]],
            1724.909680486338,
        ),
    ],
)
def test_wide_holes_among_the_accelerations_are_passed(
    tmp_path: Path, ratings: str, postures: list[list[float]], torque: float
) -> None:
    scene = arm_with_geared_elbow(tmp_path, ratings)
    path = bc.joint_path(scene.robot, postures)
    found = bc.time_optimal(scene, path, bc.MotionLimits(torque={"shoulder": torque}, speed="none"), costs=False)
    assert found.gap <= 1e-3
    assert found.lower_bound <= found.duration
    assert found.excess <= 1e-6 or found.warnings


@pytest.mark.tier2
@pytest.mark.parametrize("seed", [300_001, 300_007, 300_019])
def test_where_switching_is_fastest_the_motion_switches_and_keeps_all_limits(tmp_path: Path, seed: int) -> None:
    # Both ends of a hole lead back to one speed: the bound is of motions that switch as often as one likes.
    robot, scene, actuators, path = random_arm(seed, tmp_path)
    found = bc.time_optimal(scene, path, MOTORS, costs=False)
    assert found.excess <= 1e-6 and found.refined
    assert 0.0 <= found.gap <= 1e-4
    step = np.diff(found.motion.time)
    inside = np.flatnonzero(step > 0.0)
    shares = (0.02, 0.3, 0.7, 0.98)
    time = np.concatenate([found.motion.time[inside] + share * step[inside] for share in shares])
    q, v, a = found.motion.at(time)
    over = np.full(len(time), -1.0)
    load = robot.inverse_dynamics(q, v, a)
    for k, joint in enumerate(robot.joints):
        one = actuators[joint.name]
        passed = load[:, k] / one["ratio"] * one["efficiency"] ** np.where(load[:, k] * v[:, k] > 0.0, -1.0, 1.0)
        speed = np.abs(v[:, k]) * one["ratio"]
        limit = one["peak_torque"] * np.clip((one["max_speed"] - speed) / (one["max_speed"] - one["rated_speed"]), 0, 1)
        used = np.abs(passed + one["rotor_inertia"] * one["ratio"] * a[:, k]) / one["peak_torque"]
        over = np.maximum(over, used - limit / one["peak_torque"])
    exceeded = over > 2e-6  # in rows that are microseconds apart accelerations are rounded
    assert np.sum(np.tile(step[inside], len(shares))[exceeded]) <= 1e-5 * found.duration
    assert np.max(over) <= 1e-3
    jumps = np.flatnonzero(step == 0.0)
    switches = np.sum(np.abs(np.diff(found.motion.acceleration, axis=0)[jumps]).max(axis=1) > 1.0)
    assert switches > 50
