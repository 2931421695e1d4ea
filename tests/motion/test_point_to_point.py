"""Moves between postures in the time that limits allow, against the package ruckig and by differentiation."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import bellcrank as bc
from bellcrank.motion.generators.blends import Section, blended, straight, timing

Array = NDArray[np.float64]
# Distance, speed, acceleration, jerk, duration from rest to rest: figures of the package ruckig 0.19.4 (one joint).
RUCKIG = (
    (0.186, 0.148, 0.941, 291.0, 1.4172699236370589),
    (0.0042, 0.154, 2.32, 39.2, 0.15078948822583074),
    (0.104, 2.95, 0.534, 22.7, 0.90646228272420015),
    (5.36, 0.727, 4.72, 196.0, 7.5508718431769237),
    (0.0139, 0.37, 6.27, 151.0, 0.14334942120631478),
    (0.0168, 0.101, 28.0, 12.8, 0.34760266448864496),
    (1.04, 6.07, 4.68, 37.4, 1.0762106211241846),
    (0.00226, 0.115, 8.2, 20.4, 0.15247878288308547),
    (0.287, 2.09, 23.1, 7.23, 1.0830068226868321),
    (0.00713, 0.395, 9.63, 178.0, 0.10862751267526578),
    (1.58, 4.57, 6.54, 139.0, 1.0312122328907045),
    (0.00251, 0.72, 10.4, 470.0, 0.055493478336710839),
    (0.00372, 5.01, 1.94, 39.4, 0.14456580053304069),
    (0.0119, 2.49, 1.21, 449.0, 0.20105340477368577),
)
POSTURES = [{}, {"shoulder": 0.3, "elbow": 1.0}, {"shoulder": 1.0}, {"shoulder": 2.0, "elbow": 1.0}]
INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
MIMIC = """<robot name="gripper"><link name="base"/>
<link name="left">{inertial}</link>
<link name="right">{inertial}</link>
<link name="wheel">{inertial}</link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="left"/><axis xyz="1 0 0"/>
<limit lower="0" upper="0.1" effort="5" velocity="0.2"/></joint>
<joint name="follower" type="prismatic"><parent link="base"/><child link="right"/><axis xyz="-1 0 0"/>
<mimic joint="slide" multiplier="2"/><limit lower="0" upper="0.2" effort="5" velocity="0.1"/></joint>
<joint name="spin" type="continuous"><parent link="base"/><child link="wheel"/><axis xyz="0 0 1"/>
<limit effort="5" velocity="3"/></joint></robot>"""


@pytest.fixture
def arm() -> bc.Robot:
    return bc.load_robot("planar_2r")


@pytest.mark.parametrize(("distance", "speed", "acceleration", "jerk", "duration"), RUCKIG)
def test_one_joint_takes_the_time_of_ruckig(
    arm: bc.Robot, distance: float, speed: float, acceleration: float, jerk: float, duration: float
) -> None:
    move = bc.point_to_point(arm, [{}, {"elbow": distance}], speed=speed, acceleration=acceleration, jerk=jerk)
    assert move.duration == pytest.approx(duration, rel=1e-9)


def test_two_joints_in_step_take_the_time_of_ruckig_with_phase_synchronisation(arm: bc.Robot) -> None:
    move = bc.point_to_point(
        arm, [{}, {"shoulder": 1.5, "elbow": -0.6}], speed={"shoulder": 2.0, "elbow": 1.0},
        acceleration={"shoulder": 8.0, "elbow": 4.0}, jerk={"shoulder": 100.0, "elbow": 50.0},
    )  # fmt: skip
    assert move.duration == pytest.approx(1.08, rel=1e-12)
    assert np.ptp(move.position[:, 1] + 0.4 * move.position[:, 0]) < 1e-14  # along the straight line


@pytest.mark.parametrize("profile", ["trapezoid", "s_curve"])
@pytest.mark.parametrize("blend", [0.0, 0.1, 0.3])
def test_limits_are_kept_and_reached_in_each_stretch(arm: bc.Robot, profile: str, blend: float) -> None:
    limits: dict[str, Any] = {"speed": 1.2, "acceleration": 5.0} | ({"jerk": 60.0} if profile == "s_curve" else {})
    move = bc.point_to_point(arm, POSTURES, profile=profile, blend=blend, samples=4001, **limits)
    step = np.diff(move.time)
    inside = step > 1e-9
    assert np.abs(move.velocity).max() == pytest.approx(1.2, rel=1e-9)
    assert np.abs(move.acceleration).max() == pytest.approx(5.0, rel=1e-6)
    by_difference = np.diff(move.position, axis=0)[inside] / step[inside, None]
    middle = (move.velocity[1:] + move.velocity[:-1])[inside] / 2.0
    assert by_difference == pytest.approx(middle, abs=5.0 * step.max())
    if profile == "s_curve":
        jerk = np.diff(move.acceleration, axis=0)[inside] / step[inside, None]
        assert np.abs(jerk).max() == pytest.approx(60.0, rel=1e-3)
        assert np.abs(jerk).max() <= 60.0 * (1.0 + 1e-9)


def test_no_joint_overshoots_a_posture_at_which_the_motion_stops(arm: bc.Robot) -> None:
    move = bc.point_to_point(arm, POSTURES, acceleration=5.0, profile="trapezoid")
    points = np.stack([arm.posture(posture) for posture in POSTURES])
    stops = [int(np.argmin(np.abs(move.position - point).max(axis=1))) for point in points]
    for begin, end in pairwise(stops):
        assert np.all(np.abs(move.velocity[[begin, end]]) < 1e-12)
        part = move.position[begin : end + 1]
        assert np.all(np.diff(part, axis=0) * np.sign(part[-1] - part[0]) >= -1e-15)


def test_a_share_of_the_limits_stretches_the_move(arm: bc.Robot) -> None:
    """With a half of speed and acceleration: T = d/v + v/a at both."""
    whole, half = (
        bc.point_to_point(arm, [{}, {"elbow": 2.0}], speed=1.0, acceleration=2.0, profile="trapezoid", share=share)
        for share in (1.0, 0.5)
    )
    assert (whole.duration, half.duration) == pytest.approx((2.5, 4.5), rel=1e-12)


@pytest.mark.tier2
def test_the_path_of_a_blend_misses_the_corner_by_the_closed_form_and_is_smooth() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        points = rng.uniform(-1.0, 1.0, (3, 4))
        lines = [straight(a, b) for a, b in pairwise(points)]
        r = 0.5 * min(line.length for line in lines)
        path = blended(lines, [r], "path", "rad")
        s = np.linspace(0.0, path.length, 20001)
        x, first, second = path(s)
        e, f = ((line.end - line.begin) / line.length for line in lines)
        missed = np.linalg.norm(x - points[1], axis=1).min()
        assert missed == pytest.approx(5.0 / 32.0 * r * np.linalg.norm(f - e), rel=1e-6)
        assert missed <= 5.0 / 16.0 * r
        assert np.gradient(x, s, axis=0)[1:-1] == pytest.approx(first[1:-1], abs=1e-3)
        assert np.abs(np.diff(second, axis=0)).max() < 0.02 / r  # continuous
        third = path.derivative(s, 3)
        assert np.diff(second, axis=0) / (s[1] - s[0]) == pytest.approx((third[1:] + third[:-1]) / 2.0, abs=0.05 / r**2)
        assert np.linalg.norm(first, axis=1).max() <= 1.0 + 1e-12
        assert np.diff(first, axis=0) / (s[1] - s[0]) == pytest.approx((second[1:] + second[:-1]) / 2.0, abs=0.02 / r)


def test_a_blend_longer_than_half_of_a_segment_is_refused(arm: bc.Robot) -> None:
    points = [{}, {"elbow": 1.0}, {"elbow": 1.0, "shoulder": 0.3}]
    with pytest.raises(
        bc.InputError, match=r"blend of 0.2 rad or m at point 2 .* half of the segment behind it.* at most 0.15 "
    ):
        bc.point_to_point(arm, points, acceleration=1.0, jerk=1.0, blend=0.2)


def test_timing_of_sections_is_that_of_a_profile_from_rest_to_rest() -> None:
    alone = timing("s_curve", [Section(length=0.7, speed=0.5, acceleration=2.0, jerk=30.0)])
    split = timing("s_curve", [Section(length=0.3, speed=0.5, acceleration=2.0, jerk=30.0),
                               Section(length=0.4, speed=0.5, acceleration=2.0, jerk=30.0)])  # fmt: skip
    move = bc.point_to_point(bc.load_robot("planar_2r"), [{}, {"elbow": 0.7}], speed=0.5, acceleration=2.0, jerk=30.0)
    assert alone.duration == pytest.approx(move.duration, rel=1e-12)
    assert split.duration == pytest.approx(move.duration, rel=1e-12)  # both sections reach the cruising speed


def test_prismatic_continuous_and_mimic_joints(tmp_path: Path) -> None:
    (tmp_path / "gripper.urdf").write_text(MIMIC.format(inertial=INERTIAL))
    robot = bc.load_robot(tmp_path / "gripper.urdf")
    move = bc.point_to_point(robot, [{}, {"slide": 0.1, "spin": 7.0}], acceleration={"slide": 1.0, "spin": 9.0},
                             profile="trapezoid")  # fmt: skip
    assert move.position[-1].tolist() == [0.1, 7.0]  # a continuous joint is not wrapped
    alone = bc.point_to_point(robot, [{}, {"slide": 0.1}], acceleration=5.0, profile="trapezoid")
    assert alone.velocity.max() == pytest.approx(0.1 / 2.0)  # the speed of the joint that follows twice as far
    with pytest.raises(bc.InputError, match="mimics 'slide'"):
        bc.point_to_point(robot, [{}, {"follower": 0.1}], acceleration=1.0, jerk=1.0)


def test_missing_limits_and_other_arguments_are_refused(arm: bc.Robot) -> None:
    ends = [{}, {"elbow": 1.0}]
    with pytest.raises(bc.InputError, match="no limit of acceleration is known for elbow"):
        bc.point_to_point(arm, ends)
    with pytest.raises(bc.InputError, match="no limit of jerk is known for elbow"):
        bc.point_to_point(arm, ends, acceleration=1.0, jerk={"shoulder": 5.0})
    with pytest.raises(bc.InputError, match="cannot keep a limit of jerk"):
        bc.point_to_point(arm, ends, acceleration=1.0, jerk=5.0, profile="trapezoid")
    with pytest.raises(bc.InputError, match="postures 2 and 3 are the same"):
        bc.point_to_point(arm, [*ends, {"elbow": 1.0}], acceleration=1.0, jerk=5.0)
    with pytest.raises(bc.InputError, match="two postures or more"):
        bc.point_to_point(arm, [{}], acceleration=1.0, jerk=5.0)
    for wrong in (0.0, -1.0, np.nan, np.inf, {"elbow": 0.0}, {"elbow": np.nan}, {"wrist": 1.0}, "urdf", [1.0]):
        with pytest.raises(bc.InputError, match=r"acceleration|wrist"):
            bc.point_to_point(arm, ends, acceleration=wrong, jerk=5.0)  # type: ignore[arg-type]


def test_moves_of_a_configuration_are_sized_and_sped_up(tmp_path: Path) -> None:
    (tmp_path / "moves.yaml").write_text(
        "name: moves\nurdf: planar_2r\nmotions:\n"
        "  there: {kind: point_to_point, from: {}, to: {elbow: 60 deg}, acceleration: 5, jerk: 100, speed: 90 deg/s}\n"
        "  whole:\n    kind: join\n    parts:\n      - there\n      - {kind: dwell, duration: 0.2}\n"
        "      - {kind: point_to_point, to: {}, acceleration: {elbow: 5}, profile: trapezoid, share: 50 %}\n"
    )
    scene = bc.load_scene(tmp_path / "moves.yaml")
    whole = scene.motion("whole")
    assert whole.position[-1] == pytest.approx([0.0, 0.0], abs=1e-15)
    assert bc.size(scene, ["there"]).joint("elbow").peak_speed <= np.pi / 2.0 + 1e-12
    assert bc.time_optimal(scene, "there", costs=False).duration < whole.duration


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("to: {}, acceleration: 1, jerk: 1", "give 'from'"),
        ("from: {}, acceleration: 1, jerk: 1", "the key 'to' is missing"),
        ("positions: [{}], acceleration: 1, jerk: 1", "two postures or more"),
        ("positions: [{}, {elbow: 1}], to: {}, acceleration: 1, jerk: 1", "not both"),
        ("from: {}, to: {elbow: 1}, acceleration: 0, jerk: 1", "expected more than 0"),
        ("from: {}, to: {elbow: 1}, acceleration: {elbow: .nan}, jerk: 1", "finite"),
        ("from: {}, to: {elbow: 1}, acceleration: 5 kg, jerk: 1", "kg"),
        ("from: {}, to: {elbow: 1}, acceleration: 5, jerk: 1, share: 120 %", "at most 1"),
        ("from: {}, to: {elbow: 1}, acceleration: 5, jerk: 1, blnd: 1", "did you mean 'blend'"),
    ],
)
def test_wrong_entries_are_refused(tmp_path: Path, keys: str, message: str) -> None:
    (tmp_path / "m.yaml").write_text(f"name: m\nurdf: planar_2r\nmotions:\n  m: {{kind: point_to_point, {keys}}}\n")
    with pytest.raises(bc.InputError, match=message):
        scene = bc.load_scene(tmp_path / "m.yaml")
        scene.motion("m")


@pytest.mark.parametrize("acceleration", [1e-160, 1e-300, 5e-324])
def test_limits_that_are_too_small_to_move_are_refused(arm, acceleration):
    with pytest.raises(bc.InputError, match=r"the motion takes more than 1e\+30 s; give larger ones"):
        bc.point_to_point(arm, [[0, 0], [0, 1], [1, 1]], speed=1, acceleration=acceleration, jerk=100, blend=0.2)
