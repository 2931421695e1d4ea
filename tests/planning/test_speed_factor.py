"""The factor by which a motion can be sped up, against bisection with `size` and closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.planning.speed_scaling import scaled_motion
from bellcrank.simulation.trajectory.scene_notes import scene_notes

pytestmark = pytest.mark.tier2

PEAKS = ("peak torque", "motor speed", "peak curve")


def worst_use(scene: bc.Scene, motion: bc.Motion) -> float:
    """The largest share of a momentary limit that `size` finds."""
    robot = scene.robot
    uses = []
    for joint in bc.size(scene, [motion]).joints:
        column = robot.one_degree_joint(joint.name, "test").v
        margins = dict(joint.shaft.margins) if joint.shaft else {}
        uses += [1.0 - margins[key] for key in PEAKS if margins.get(key) is not None]
        uses.append(joint.peak_speed / robot.velocity_limit[column])
    return max(uses)


def factor_by_bisection(scene: bc.Scene, motion: bc.Motion, near: float) -> float:
    """The factor within a thousandth of a given one, to 1e-9."""
    low, high = 0.999 * near, 1.001 * near
    assert worst_use(scene, scaled_motion(motion, low)) < 1.0 < worst_use(scene, scaled_motion(motion, high))
    for _ in range(21):
        middle = (low + high) / 2.0
        inside = worst_use(scene, scaled_motion(motion, middle)) <= 1.0
        low, high = (middle, high) if inside else (low, middle)
    return (low + high) / 2.0


@pytest.mark.parametrize(("name", "motion"), [("geared_pendulum", "lift_and_return"), ("ur5", "circle")])
def test_bisection_with_size_finds_the_same_factor(name: str, motion: str) -> None:
    scene = bc.load_scene(name)
    found = bc.speed_factor(scene, motion, bc.MotionLimits(torque="none"))
    expected = factor_by_bisection(scene, found.motion, found.factor)
    assert found.factor == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("name", ["geared_pendulum", "planar_2r", "ur5"])
@pytest.mark.parametrize("corners", [4, 6])
def test_peaks_between_the_rows_of_a_coarse_motion_count(name: str, corners: int) -> None:
    """Eight samples between two rows gave factors up to 1.7 % too large; gears with losses make the torque jump."""
    scene = bc.load_scene(name)
    robot, random = scene.robot, np.random.default_rng(3)
    corner = [{j.name: float(random.uniform(-1.0, 1.0)) for j in robot.joints} for _ in range(corners)]
    smooth = bc.waypoints(robot, np.linspace(0.0, 2.0, corners).tolist(), corner)
    time = np.linspace(0.0, 2.0, 8)
    motion = bc.Motion(smooth.joints, time, *smooth.at(time), "coarse")
    found = bc.speed_factor(scene, motion, bc.MotionLimits(torque="none"))
    expected = factor_by_bisection(scene, motion, found.factor)
    assert found.factor == pytest.approx(expected, rel=2e-9)


def test_a_motion_that_exceeds_a_limit_is_slowed_down() -> None:
    scene = bc.load_scene("geared_pendulum")
    fast = bc.speed_factor(scene, "lift_and_return").scaled(6.0)
    found = bc.speed_factor(scene, fast)
    assert 0.0 < found.factor < 1.0
    assert found.factor * 6.0 == pytest.approx(bc.speed_factor(scene, "lift_and_return").factor, rel=1e-9)


def test_the_factor_of_a_pure_inertia_is_the_root_of_the_torque(tmp_path: Path) -> None:
    robot = bc.load_robot("planar_2r", friction="none")
    motion = bc.waypoints(robot, [0.0, 1.0], [{}, {"shoulder": 1.0, "elbow": 0.5}])
    limits = {"shoulder": 500.0, "elbow": 100.0}
    found = bc.speed_factor(robot, motion, bc.MotionLimits(speed="none", torque=limits))
    again = bc.speed_factor(
        robot, motion, bc.MotionLimits(speed="none", torque={k: 4.0 * v for k, v in limits.items()})
    )
    assert again.factor == pytest.approx(2.0 * found.factor, rel=1e-12)  # the arm lies in a horizontal plane


def test_no_factor_keeps_a_torque_that_cannot_hold_the_arm() -> None:
    found = bc.speed_factor("ur5", "circle", bc.MotionLimits(torque={"shoulder_lift_joint": 5.0}))
    assert found.factor == 0.0
    assert found.limit == "torque of shoulder_lift_joint"
    with pytest.raises(bc.InputError, match="cannot be scaled"):
        found.scaled()


def test_a_motion_that_rests_reaches_no_limit_at_any_speed() -> None:
    robot = bc.load_robot("planar_2r")
    found = bc.speed_factor(robot, bc.waypoints(robot, [0.0, 1.0], [{}, {}]))
    assert found.limit == "nothing"
    assert found.table().splitlines()[0].endswith("1000 times as fast or more: it reaches no limit")


def test_friction_limits_the_factor_as_bisection_over_inverse_dynamics_does() -> None:
    robot = bc.load_robot("planar_2r", friction={"shoulder": (5.0, 3.0), "elbow": (2.0, 1.0)})
    motion = bc.waypoints(robot, [0.0, 1.0, 2.0], [{}, {"shoulder": 1.0, "elbow": 0.5}, {"elbow": -0.2}])
    limits = bc.MotionLimits(speed="none", torque={"shoulder": 400.0, "elbow": 60.0})
    found = bc.speed_factor(robot, motion, limits)

    def shares(time: np.ndarray, k: float) -> np.ndarray:
        q, v, a = motion.at(time)
        return np.max(np.abs(robot.inverse_dynamics(q, k * v, k * k * a)) / [400.0, 60.0], axis=1)

    def use(k: float) -> float:
        """With the peak between samples."""
        found = shares(motion.time, k)
        peak = int(np.argmax(found))
        near = np.linspace(motion.time[max(peak - 1, 0)], motion.time[min(peak + 1, len(motion.time) - 1)], 2001)
        return float(np.max(shares(near, k)))

    low, high = 0.01, 50.0
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (middle, high) if use(middle) <= 1.0 else (low, middle)
    assert found.factor == pytest.approx(low, rel=1e-9)


def test_lengths_of_parameters_that_a_path_does_not_have_are_told_of_every_motion(tmp_path: Path) -> None:
    """Inverse kinematics takes the URDF's lengths: with another forearm the tip does not draw the circle."""
    path = tmp_path / "arm.yaml"
    path.write_text(
        "urdf: planar_2r\n"
        "motions: {round: {kind: circle, frame: tip, center: [1, 0, 0], radius: 0.2, duration: 2, start: {elbow: 1}}}\n"
        "control: [{name: follow, kind: computed_torque, motion: round, kp: 100, kd: 20}]\n"
        "parameters: {upper: {value: 0.8, sets: [joint.elbow.origin.x]}}\n"
        "initial: {motion: round}\nsimulate: {duration: 0.1, samples: 2}\n"
    )
    limits = bc.MotionLimits(speed={"shoulder": 2.0, "elbow": 2.0})

    def told(given: str | bc.Scene) -> list[bool]:
        texts = (
            bc.speed_factor(given, "round", limits).warnings,
            bc.time_optimal(given, "round", limits, grid=50, costs=False).warnings,
            bc.size(given, "round").warnings,
            scene_notes(given if isinstance(given, bc.Scene) else bc.load_scene(given)),
        )
        return [
            any("the parameters upper change: the frame moves along another path" in t for t in each) for each in texts
        ]

    assert told(str(path)) == 4 * [True]
    assert told(bc.load_scene(path, {"upper": 1.0})) == 4 * [False]  # the length of the URDF
