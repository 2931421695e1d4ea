"""Cycles that repeat indefinitely: sized again, marched through the thermal model, and refused where nothing helps."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from coupled_robots import WRIST
from scipy.integrate import solve_ivp

import bellcrank as bc

COPPER = 0.0039  # 1/K, rise of the resistance of copper, related to that at 25 °C


def continuous_margins(robot: str, motion: bc.Motion) -> dict[str, float]:
    sizing = bc.size(robot, [motion])
    return {name: shaft.margins["continuous torque"] for name, shaft in sizing.shafts}


def fast_motion(robot: str, path: str) -> bc.Motion:
    return bc.time_optimal(robot, path, costs=False).motion


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("robot", "path"), [("geared_pendulum", "lift_and_return"), ("planar_2r", "elbow_up"), ("ur5", "circle")]
)
@pytest.mark.parametrize("by", ["pause", "speed"])
def test_sizing_the_cycle_finds_the_continuous_torque_just_used(robot: str, path: str, by: str) -> None:
    motion = fast_motion(robot, path)
    assert min(continuous_margins(robot, motion).values()) < -0.1
    cycle = bc.repeated_cycle(robot, motion, by=by)
    margins = continuous_margins(robot, cycle.motion)
    assert min(margins, key=margins.__getitem__) == cycle.joint
    assert min(margins.values()) == pytest.approx(0.0, abs=1e-6)
    assert cycle.uses == pytest.approx({name: 1.0 - margin for name, margin in margins.items()}, abs=1e-6)
    assert cycle.duration == pytest.approx(motion.duration / cycle.factor + cycle.pause, rel=1e-12)


def test_a_motion_that_motors_bear_is_repeated_as_it_is() -> None:
    cycle = bc.repeated_cycle("geared_pendulum", "lift_and_return")
    assert (cycle.pause, cycle.factor, cycle.joint) == (0.0, 1.0, "")
    assert "without a pause" in cycle.table()


@pytest.mark.tier2
def test_motors_that_cannot_hold_the_last_posture_bear_no_cycle() -> None:
    scene = bc.load_scene("geared_pendulum")
    weak = {"shoulder": dataclasses.replace(scene.actuators["shoulder"], rated_torque=0.01)}
    motion = bc.waypoints(scene.robot, [0.0, 0.5], [{}, {"shoulder": 1.5}])
    with pytest.raises(bc.BellcrankError, match="no pause is long enough"):
        bc.repeated_cycle(scene, motion, actuators=weak)
    with pytest.raises(bc.BellcrankError, match="no speed is low enough"):
        bc.repeated_cycle(scene, motion, actuators=weak, by="speed")


def test_a_pause_for_one_motor_that_overloads_another_is_refused() -> None:
    """The elbow needs a pause; the shoulder bears the motion, but not to hold the last posture for so long."""
    arm = bc.load_robot("planar_2r", gravity=(0.0, -9.81, 0.0))
    start = {"shoulder": -np.pi / 2}
    motion = bc.waypoints(arm, [0.0, 0.35, 1.5], [start, {**start, "elbow": 1.2}, {"shoulder": 0.0}])
    strong = {"efficiency": 1.0, "rated_speed": 1e4, "max_speed": 1e5, "peak_torque": 1e4}
    actuators = {name: bc.Actuator(ratio=1.0, rated_torque=1e4, **strong) for name in arm.joint_names}
    sizing = bc.size(arm, motion, actuators)
    rms = {name: shaft.rms_torque for name, shaft in sizing.shafts}
    tight = {
        "shoulder": bc.Actuator(ratio=1.0, rated_torque=1.01 * rms["shoulder"], **strong),
        "elbow": bc.Actuator(ratio=1.0, rated_torque=0.97 * rms["elbow"], **strong),
    }
    with pytest.raises(bc.BellcrankError, match=r"no pause (suffices|is long enough)"):
        bc.repeated_cycle(arm, motion, actuators=tight)


def test_without_known_limits_it_says_what_is_missing() -> None:
    with pytest.raises(bc.InputError, match="catalogue"):
        bc.repeated_cycle("geared_pendulum", "lift_and_return", limit="temperature")
    arm = bc.load_robot("planar_2r")
    with pytest.raises(bc.InputError, match="no joint has an actuator"):
        bc.repeated_cycle(arm, bc.waypoints(arm, [0.0, 1.0], [{}, {"elbow": 1.0}]))


def hot_pendulum() -> tuple[bc.Robot, bc.Motion, dict[str, bc.Actuator]]:
    """A pendulum without friction that a small motor of the catalogue swings faster than it bears for ever."""
    arm = bc.load_robot("geared_pendulum", friction="none")
    motor = next(m for m in bc.load_catalogue().motors if m.id == "maxon_ec45flat_50w_24v")
    gear = bc.Gear(id="g", maker="", model="", kind="planetary", ratio=50.0, efficiency=1.0, inertia=0.0)
    motion = bc.waypoints(arm, [0.0, 0.4, 0.8], [{}, {"shoulder": 1.2}, {}])
    return arm, motion, {"shoulder": bc.Actuator.of(motor, gear)}


@pytest.mark.tier2
@pytest.mark.parametrize("by", ["pause", "speed"])
def test_the_winding_of_a_marched_cycle_reaches_its_limit(by: str) -> None:
    arm, motion, actuators = hot_pendulum()
    cycle = bc.repeated_cycle(arm, motion, actuators=actuators, limit="temperature", by=by)
    assert cycle.original_uses["shoulder"] > 1.05
    assert cycle.uses["shoulder"] == pytest.approx(1.0, abs=1e-9)
    chosen = actuators["shoulder"]
    motor = chosen.motor
    capacity_w = motor.time_constant_winding / motor.resistance_winding_housing
    capacity_h = motor.time_constant_motor / motor.resistance_housing_ambient
    constant = motor.dc_torque_constant
    ratio, inertia = chosen.ratio, chosen.shaft_inertia

    def rates(t: float, x: np.ndarray) -> list[float]:
        q, v, a = (one[0] for one in cycle.motion.at(np.array([cycle.motion.time[0] + t % cycle.duration])))
        torque = arm.inverse_dynamics(q, v, a)[0] / ratio + inertia * ratio * a[0]
        speed = ratio * v[0]
        friction = motor.coulomb_torque * np.sign(speed) + motor.viscous_coefficient * speed
        copper = motor.resistance * ((torque + friction) / constant) ** 2 * (1.0 + COPPER * (x[0] - 25.0))
        flow = (x[0] - x[1]) / motor.resistance_winding_housing
        away = (x[1] - 25.0) / motor.resistance_housing_ambient
        heat = motor.friction_heat_share * friction * speed
        return [(copper - flow) / capacity_w, (flow - away + heat) / capacity_h]

    period = cycle.duration

    def passed(start: np.ndarray) -> tuple[np.ndarray, float]:
        run = solve_ivp(rates, (0.0, period), start, max_step=period / 400, rtol=1e-9, atol=1e-9)
        return run.y[:, -1], float(run.y[0].max())

    base = np.array([80.0, 60.0])  # the cycle's map is affine: three passes give its fixed point
    end = passed(base)[0]
    columns = np.column_stack([passed(base + step)[0] - end for step in np.eye(2)])
    fixed = base + np.linalg.solve(np.eye(2) - columns, end - base)
    peak = passed(fixed)[1]
    assert peak == pytest.approx(motor.max_winding_temperature, abs=0.05)


@pytest.mark.tier2
@pytest.mark.parametrize("by", ["pause", "speed"])
def test_motors_of_a_coupled_transmission_bear_the_cycle(tmp_path: Path, by: str) -> None:
    """A differential wrist; its sizing judges the motors along the cycle as one motion."""
    (tmp_path / "wrist.urdf").write_text(WRIST)
    ratings = "{ratio: 20, rated_torque: 0.05, peak_torque: 3, rated_speed: 300, max_speed: 900, rotor_inertia: 1.0e-5}"
    config = tmp_path / "wrist.yaml"
    config.write_text(
        "name: Wrist\nurdf: wrist.urdf\nmotions:\n"
        "  bow: {kind: waypoints, times: [0, 0.15, 0.3], positions: [{}, {pitch: 0.5, roll: 1.0}, {}], samples: 401}\n"
        "transmissions:\n  - {joints: [pitch, roll], motors: [left, right], matrix: [[1, 1], [1, -1]]}\n"
        f"actuators: {{left: {ratings}, right: {ratings}}}\n"
    )
    cycle = bc.repeated_cycle(config, "bow", by=by)
    margins = {one.name: one.shaft.margins["continuous torque"] for one in bc.size(config, [cycle.motion]).motors}
    assert cycle.joint in ("left", "right")
    assert cycle.original_uses[cycle.joint] > 1.1
    assert min(margins.values()) == pytest.approx(0.0, abs=1e-6)
    assert cycle.uses == pytest.approx({name: 1.0 - margin for name, margin in margins.items()}, abs=1e-6)


@pytest.mark.tier2
def test_the_command_writes_the_cycle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from bellcrank.cli import main

    options = ["--repeat", "pause", "--no-plots", "--out", str(tmp_path)]
    assert main(["fastest", "geared_pendulum", *options]) == 0
    assert "a pause of" in capsys.readouterr().out
    robot = bc.load_scene("geared_pendulum").config.robot()
    written = bc.read_motion(robot, tmp_path / "cycle_lift_and_return.csv")
    assert continuous_margins("geared_pendulum", written)["shoulder"] == pytest.approx(0.0, abs=1e-6)
    assert (tmp_path / "cycle_lift_and_return.json").exists()
    assert main(["fastest", "geared_pendulum", "--scale", "max", *options]) == 2
