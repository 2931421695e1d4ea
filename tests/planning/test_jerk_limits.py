"""Fastest motions with limits of jerk against closed forms, differences, ruckig, and the motion without such limits."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import ruckig

import bellcrank as bc
from bellcrank.dynamics.inverse.mechanism import mechanism_of
from bellcrank.planning.fastest_pass import fastest_refined
from bellcrank.planning.jerk.jerk_pass import JerkTiming, jerk_excess, jerk_limited
from bellcrank.planning.joint_path import paths_of_motion
from bellcrank.planning.limits.path_limits import PathLimits

pytestmark = pytest.mark.tier2


def seven_segments(distance: float, speed: float, acceleration: float, jerk: float) -> float:
    """The time of the S-curve between rests: jerk, acceleration and speed each at their limit as long as possible."""
    ramp = acceleration / jerk if speed * jerk >= acceleration**2 else np.sqrt(speed / jerk)
    rise = ramp + speed / acceleration if speed * jerk >= acceleration**2 else 2.0 * ramp
    if distance >= speed * rise:
        return float(rise + distance / speed)
    if distance >= 2.0 * acceleration**3 / jerk**2:
        half = acceleration / jerk / 2.0
        return float(2.0 * (half + np.sqrt(half**2 + distance / acceleration)))
    return float(4.0 * np.cbrt(distance / (2.0 * jerk)))


def straight_move(
    distance: dict[str, float], speed: float, acceleration: float, jerk: float, **options: object
) -> bc.results.FastestMotion:
    arm = bc.load_robot("planar_2r", friction="none")
    names = dict.fromkeys(distance)
    limits = bc.MotionLimits(
        speed=dict.fromkeys(names, speed), acceleration=dict.fromkeys(names, acceleration),
        jerk=dict.fromkeys(names, jerk), torque="none",
    )  # fmt: skip
    return bc.time_optimal(arm, bc.joint_path(arm, [{}, distance]), limits, **options)  # type: ignore[arg-type]


CASES = [(1.0, 1e3, 1e3, 10.0), (1.0, 1e3, 3.0, 30.0), (1.0, 0.7, 3.0, 30.0), (0.02, 1.0, 5.0, 100.0)]


@pytest.mark.parametrize(("distance", "speed", "acceleration", "jerk"), CASES)
def test_one_joint_takes_the_time_of_seven_segments(
    distance: float, speed: float, acceleration: float, jerk: float
) -> None:
    found = straight_move({"shoulder": distance}, speed, acceleration, jerk)
    exact = seven_segments(distance, speed, acceleration, jerk)
    assert found.duration == pytest.approx(exact, rel=5e-5)  # slowed until jerks, found to 1e-4, are kept: 1e-4 / 3
    assert found.duration >= exact * (1.0 - 1e-7)  # limits are kept, so that it is not faster
    assert found.excess <= 1e-6
    assert any("local optimum" in warning for warning in found.warnings)


def test_a_straight_move_of_two_joints_takes_the_time_that_ruckig_gives_along_the_line() -> None:
    way = {"shoulder": 1.2, "elbow": -0.7}
    given = ruckig.InputParameter(1)
    length = float(np.hypot(*way.values()))
    share = 1.2 / length  # the shoulder moves most and sets all limits along the line
    given.current_position, given.target_position = [0.0], [length]
    given.max_velocity, given.max_acceleration, given.max_jerk = [1.5 / share], [6.0 / share], [60.0 / share]
    trajectory = ruckig.Trajectory(1)
    ruckig.Ruckig(1).calculate(given, trajectory)
    assert straight_move(way, 1.5, 6.0, 60.0).duration == pytest.approx(trajectory.duration, rel=5e-5)


def curved(jerk: float | None, **options: object) -> bc.results.FastestMotion:
    arm = bc.load_robot("planar_2r", friction={"shoulder": (3.0, 0.5), "elbow": (2.0, 0.2)})
    path = bc.joint_path(arm, [{}, {"shoulder": 0.6, "elbow": -0.8}, {"shoulder": 1.3, "elbow": 0.3}])
    given = "none" if jerk is None else dict.fromkeys(arm.joint_names, jerk)
    limits = bc.MotionLimits(speed={"elbow": 3.0}, torque={"shoulder": 70.0, "elbow": 40.0}, jerk=given)
    return bc.time_optimal(arm, path, limits, **options)  # type: ignore[arg-type]


def test_growing_limits_of_jerk_lead_to_the_fastest_motion_without_them() -> None:
    free = curved(None, costs=False).duration
    times = [curved(jerk).duration for jerk in (1e2, 1e3, 1e4, 1e6)]
    assert all(one > two for one, two in pairwise(times))
    assert times[-1] == pytest.approx(free, rel=5e-5)  # cells are not narrower than 4e-4 of the path parameter


def test_jerk_and_torque_are_kept_between_the_rows() -> None:
    found = curved(200.0)
    motion, arm = found.motion, bc.load_robot("planar_2r", friction={"shoulder": (3.0, 0.5), "elbow": (2.0, 0.2)})
    t = np.linspace(0.0, motion.duration, 40_001)
    q, v, a = motion.at(t)
    jerk = np.abs(np.diff(a, axis=0)) / np.diff(t)[:, None]
    assert jerk.max() <= 200.0 * (1.0 + 2e-3)
    assert jerk.max() >= 200.0 * (1.0 - 1e-3)
    torque = np.abs(arm.inverse_dynamics(q, v, a)) / np.array([70.0, 40.0])
    assert torque.max() <= 1.0 + 1e-3
    assert np.abs(v[[0, -1]]).max() == np.abs(a[[0, -1]]).max() == 0.0
    idle = [not name for name in found.active]
    assert np.sum(np.diff(found.time)[idle]) < 0.02 * found.duration


def test_the_derivatives_of_the_time_are_those_of_extrapolated_differences() -> None:
    costs = {cost.limit: cost.derivative for cost in curved(200.0).costs}
    arm = bc.load_robot("planar_2r", friction={"shoulder": (3.0, 0.5), "elbow": (2.0, 0.2)})
    path = bc.joint_path(arm, [{}, {"shoulder": 0.6, "elbow": -0.8}, {"shoulder": 1.3, "elbow": 0.3}])

    def time(limit: str, factor: float) -> float:
        jerk, torque = dict.fromkeys(arm.joint_names, 200.0), {"shoulder": 70.0, "elbow": 40.0}
        speed = {"elbow": 3.0}
        what, joint = limit.split(" of ")
        {"jerk": jerk, "torque": torque, "speed": speed}[what][joint] *= factor
        return bc.time_optimal(arm, path, bc.MotionLimits(speed=speed, torque=torque, jerk=jerk)).duration

    whole = curved(200.0).duration
    for limit, derivative in costs.items():
        wide, narrow = ((time(limit, 1 + h) - time(limit, 1 - h)) / (2 * h * whole) for h in (0.08, 0.04))
        assert derivative == pytest.approx((4.0 * narrow - wide) / 3.0, abs=3e-3)


def test_slower_time_shows_in_the_derivatives() -> None:
    """In slower time speeds, accelerations and jerks fall with the first, second and third power: with Euler's theorem
    their derivatives, times these powers, add up to -1.
    """
    powers = {"speed": 1.0, "acceleration": 2.0, "jerk": 3.0}
    for distance, speed, acceleration, jerk in CASES:
        found = straight_move({"shoulder": distance}, speed, acceleration, jerk)
        total = sum(powers[cost.limit.split(" of ")[0]] * cost.derivative for cost in found.costs)
        assert total == pytest.approx(-1.0, abs=1e-5)


def test_shipped_motors_are_kept_within_their_limits() -> None:
    found = bc.time_optimal("geared_pendulum", "lift_and_return", bc.MotionLimits(jerk={"shoulder": 2000.0}))
    shaft = bc.size("geared_pendulum", [found.motion]).joint("shoulder").shaft
    assert shaft is not None
    assert min(shaft.margins[key] or 0.0 for key in ("peak torque", "motor speed", "peak curve")) > -1e-3
    assert found.duration > bc.time_optimal("geared_pendulum", "lift_and_return", costs=False).duration


def test_a_path_with_blends_is_followed_with_limits_of_jerk() -> None:
    arm = bc.load_robot("planar_2r", friction="none")
    path = bc.joint_path(arm, [{}, {"shoulder": 0.6, "elbow": -0.8}, {"shoulder": 1.3, "elbow": 0.3}], blend=0.3)
    found = bc.time_optimal(arm, path, bc.MotionLimits(torque="none", jerk=dict.fromkeys(arm.joint_names, 100.0)))
    t = np.linspace(0.0, found.duration, 20_001)
    jerk = np.abs(np.diff(found.motion.at(t)[2], axis=0)) / np.diff(t)[:, None]
    assert jerk.max() == pytest.approx(100.0, rel=3e-3)


def test_limits_of_jerk_that_cannot_be_used_are_refused(tmp_path: Path) -> None:
    arm = bc.load_robot("planar_2r", friction="none")
    path = bc.joint_path(arm, [{}, {"shoulder": 1.0}])
    with pytest.raises(bc.InputError, match="leave the grid out"):
        bc.time_optimal(arm, path, bc.MotionLimits(jerk={"shoulder": 10.0}), grid=100)
    with pytest.raises(bc.InputError, match="no joint with a limit of jerk moves"):
        bc.time_optimal(arm, path, bc.MotionLimits(torque="none", jerk={"elbow": 10.0}))
    with pytest.raises(bc.InputError, match="jerk"):
        bc.MotionLimits(jerk={"shoulder": 0.0})
    with pytest.raises(bc.InputError, match="urdf"):
        bc.MotionLimits(jerk="urdf")
    with pytest.raises(bc.InputError, match="leave jerk out"):
        bc.speed_factor("planar_2r", "elbow_up", bc.MotionLimits(jerk={"elbow": 10.0}))


def test_the_command_takes_limits_of_jerk(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from bellcrank.cli import main

    arguments = ["--jerk", "shoulder=2000 rad/s^3", "--no-plots", "--out", str(tmp_path)]
    assert main(["fastest", "geared_pendulum", *arguments]) == 0
    assert "jerk of shoulder" in capsys.readouterr().out


def test_the_acceleration_of_the_tool_is_kept_with_limits_of_jerk() -> None:
    arm = bc.load_robot("planar_2r", friction="none")
    path = bc.joint_path(arm, [{}, {"shoulder": 0.6, "elbow": -0.8}, {"shoulder": 1.3, "elbow": 0.3}])
    limits = bc.MotionLimits(
        torque="none", jerk=dict.fromkeys(arm.joint_names, 300.0), tool="tip", tool_acceleration=4.0, tool_speed=1.2
    )
    found = bc.time_optimal(arm, path, limits)
    motion = found.motion
    velocity = np.stack([arm.frame_velocity("tip", q[None], v[None])[0][0] for q, v in zip(
        *motion.at(np.linspace(0.0, motion.duration, 4001))[:2], strict=True)])  # fmt: skip
    assert np.linalg.norm(velocity, axis=1).max() == pytest.approx(1.2, rel=1e-3)
    acceleration = np.linalg.norm(np.diff(velocity, axis=0), axis=1) * 4000.0 / motion.duration
    assert acceleration.max() == pytest.approx(4.0, rel=2e-3)
    assert {"speed of frame tip", "acceleration of frame tip"} <= {cost.limit for cost in found.costs}
    powers = {"speed": 1.0, "acceleration": 2.0, "jerk": 3.0}
    total = sum(powers[cost.limit.split(" of ")[0]] * cost.derivative for cost in found.costs)
    assert total == pytest.approx(-1.0, abs=1e-4)


def test_a_joint_at_rest_along_a_tool_path_does_not_count_as_turning() -> None:
    robot = bc.load_scene("ur5").config.robot()
    limits = bc.MotionLimits(jerk=dict.fromkeys(robot.joint_names, 300.0))
    found = bc.time_optimal("ur5", "circle", limits)
    assert len(found.s) < 2000
    assert found.excess <= 1e-6


def test_motors_of_a_linkage_with_a_free_platform_take_limits_of_jerk() -> None:
    """Where only jerks limit, the time grows with the third root of 1 / jerk; as they grow, it approaches that without
    them. The motion keeps the rods' lengths and is that of the motors' torques.
    """
    config, mechanism = bc.load_scene("delta").config, mechanism_of(bc.load_scene("delta"))
    path = paths_of_motion(mechanism.along("pick")[0])[0]
    motors = [joint.v for joint in mechanism.motors]

    def limited(jerk: float) -> JerkTiming:
        given = bc.MotionLimits(jerk={joint.name: jerk for joint in mechanism.motors})
        return jerk_limited(path, PathLimits(mechanism, config.actuators, given))

    slow, fast, fastest = limited(1e3), limited(8e3), limited(1e7)
    assert slow.duration / fast.duration == pytest.approx(2.0, rel=1e-6)
    free = fastest_refined(path, PathLimits(mechanism, config.actuators, bc.MotionLimits()))
    assert 1.0 < fastest.duration / free.duration < 1.005
    motion = slow.motion("slow")
    jerk = np.abs(np.diff(motion.acceleration[:, motors], axis=0)) / np.diff(motion.time)[:, None]
    assert jerk.max() == pytest.approx(1e3, rel=1e-3)
    residual = mechanism.residuals(motion.time, motion.position, motion.velocity, motion.acceleration)
    assert max(residual) < 1e-11
    assert jerk_excess(motion, np.where(np.isin(np.arange(mechanism.robot.nv), motors), 1e3, np.inf))[0] < 1e-3


def test_a_free_platform_has_no_limit_of_jerk_of_its_own() -> None:
    with pytest.raises(bc.InputError, match="floating"):
        bc.time_optimal("delta", "pick", bc.MotionLimits(jerk={"platform_pose": 100.0}))
