"""Inverse kinematics: against the closed form of the 2R arm, on real arms against their own frames, and its
refusals.
"""

from __future__ import annotations

import numpy as np
import pytest

import bellcrank
from bellcrank.errors import InputError, UnreachableError
from bellcrank.motion.generators.frame_motions import circle, line
from bellcrank.motion.kinematics.rotations import angles_to, between, from_rpy

CENTER, RADIUS, DURATION = (1.2, 1.2, 0.0), 0.2, 10.0
PANDA_START = {
    "panda_joint2": -0.785, "panda_joint4": -2.356, "panda_joint6": 1.571, "panda_joint7": 0.785,
}  # fmt: skip
UR5_START = {
    "shoulder_lift_joint": -1.2, "elbow_joint": 1.8, "wrist_1_joint": -2.2, "wrist_2_joint": -1.57,
}  # fmt: skip
# Extremes over φ = 2πk/1000 of the lecture's circle, N m: τ1 min, τ1 max, τ2 min, τ2 max.
LECTURE = {
    -1.0: (71.86823535828, 168.2846498082, 62.9079893977, 71.60635945914),
    1.0: (210.4184480206, 242.2724868525, 0.8249586697778, 33.25421705658),
}


@pytest.fixture(scope="module")
def arm():
    return bellcrank.load_robot("planar_2r", gravity=(0, -9.81, 0))


@pytest.fixture(scope="module")
def panda():
    return bellcrank.load_robot("panda")


@pytest.fixture(scope="module")
def ur5():
    return bellcrank.load_robot("ur5")


def closed_form(t, elbow):
    """Position, velocity and acceleration of the 2R arm on the circle, by differentiating the closed form by
    hand.
    """
    w = 2 * np.pi / DURATION
    cos, sin = np.cos(w * t), np.sin(w * t)
    x = np.stack([CENTER[0] + RADIUS * cos, CENTER[1] + RADIUS * sin], axis=1)
    xd = RADIUS * w * np.stack([-sin, cos], axis=1)
    xdd = -RADIUS * w * w * np.stack([cos, sin], axis=1)
    c = (np.sum(x * x, axis=1) - 2.0) / 2.0
    cd = np.sum(x * xd, axis=1)
    cdd = np.sum(xd * xd + x * xdd, axis=1)
    q2 = elbow * np.arccos(c)
    s = np.sin(q2)
    v2 = -cd / s
    a2 = -(cdd + c * v2 * v2) / s
    q1 = np.arctan2(x[:, 1], x[:, 0]) - np.arctan2(s, 1 + c)  # the last term is q2 / 2 for equal links
    r2 = np.sum(x * x, axis=1)
    turn = x[:, 0] * xd[:, 1] - x[:, 1] * xd[:, 0]
    turn_d = x[:, 0] * xdd[:, 1] - x[:, 1] * xdd[:, 0]
    v1 = turn / r2 - v2 / 2
    a1 = turn_d / r2 - 2 * turn * cd / r2**2 - a2 / 2
    return np.stack([q1, q2], axis=1), np.stack([v1, v2], axis=1), np.stack([a1, a2], axis=1)


@pytest.mark.parametrize("elbow", [-1.0, 1.0])
def test_lecture_circle_against_the_closed_form(arm, elbow):
    motion = circle(arm, "tip", CENTER, RADIUS, DURATION, start={"elbow": elbow})
    assert len(motion) == 1001
    q, v, a = closed_form(motion.time, elbow)
    assert np.max(np.abs(motion.position - q)) < 5e-15
    assert np.max(np.abs(motion.velocity - v)) < 5e-15
    assert np.max(np.abs(motion.acceleration - a)) < 1e-14
    torque = arm.inverse_dynamics(motion.position, motion.velocity, motion.acceleration)[:-1]
    found = np.stack([torque.min(axis=0), torque.max(axis=0)], axis=1).ravel()
    assert found == pytest.approx(LECTURE[elbow], rel=1e-11)


@pytest.mark.tier2
@pytest.mark.parametrize("orientation", [None, "hold", (np.pi, 0.0, 0.3)])
def test_redundant_arm_repeats_on_a_closed_path(panda, orientation):
    motion = circle(
        panda,
        "panda_hand",
        (0.45, 0, 0.5),
        0.1,
        5,
        start=PANDA_START,
        orientation=orientation,
        turns=2,
        samples=401,
    )
    assert np.max(np.abs(motion.position[-1] - motion.position[0])) < 1e-13
    assert np.max(np.abs(motion.position[200] - motion.position[0])) < 1e-13
    position, rotation = panda.frame_pose("panda_hand", motion.position)
    s = 4 * np.pi * motion.time / 5
    wanted = np.stack([0.45 + 0.1 * np.cos(s), 0.1 * np.sin(s), np.full_like(s, 0.5)], axis=1)
    assert np.max(np.abs(position - wanted)) < 1e-14
    if orientation is not None:
        held = panda.frame_pose("panda_hand", panda.posture(PANDA_START))[1]
        target = held if orientation == "hold" else from_rpy(np.array(orientation))
        assert np.max(angles_to(rotation, target)) < 1e-13
    fingers = panda.joint("panda_finger_joint1").q
    assert np.all(motion.position[:, fingers] == 0.0)


def test_redundant_posture_is_the_nearest_to_the_start(panda):
    """Independent route: moving along the null space of the Jacobian must not bring the posture nearer."""
    motion = circle(panda, "panda_hand", (0.45, 0, 0.5), 0.1, 5, start=PANDA_START, samples=21)
    start = panda.posture(PANDA_START)
    for q in motion.position[::5]:
        units = np.eye(panda.nv)
        jacobian = panda.frame_velocity("panda_hand", np.tile(q, (panda.nv, 1)), units)[0].T
        free = np.linalg.svd(jacobian)[2][3:]
        assert np.max(np.abs(free @ (q - start))) < 1e-12


@pytest.mark.tier2
@pytest.mark.parametrize("orientation", [None, "hold"])
@pytest.mark.parametrize("profile", ["constant", "quintic", "s_curve", "trapezoid"])
def test_rates_are_the_derivatives_of_the_posture(ur5, profile, orientation):
    """Frame velocity from the rates is the path's; accelerations agree with differences of the velocities."""
    motion = circle(
        ur5,
        "ee_link",
        (0.45, 0.1, 0.3),
        0.1,
        2,
        start=UR5_START,
        profile=profile,
        orientation=orientation,
        normal=(1, 1, 1),
    )
    linear, angular = ur5.frame_velocity("ee_link", motion.position, motion.velocity)
    speed = np.linalg.norm(linear, axis=1)
    assert np.sum(0.5 * (speed[1:] + speed[:-1]) * np.diff(motion.time)) == pytest.approx(0.2 * np.pi, rel=1e-5)
    if orientation:
        assert np.max(np.abs(angular)) < 1e-12
    for piece in motion.pieces:
        t, v, a = motion.time[piece], motion.velocity[piece], motion.acceleration[piece]
        if profile == "s_curve":
            continue  # the jerk jumps inside
        h = t[1] - t[0]
        numeric = (v[:-4] - 8 * v[1:-3] + 8 * v[3:-1] - v[4:]) / (12 * h)
        assert np.max(np.abs(numeric - a[2:-2])) < 1e-6 * np.max(np.abs(a))


def test_limits_are_kept_along_the_path(ur5):
    motion = line(
        ur5,
        "ee_link",
        (0.45, 0.3, 0.4),
        start=UR5_START,
        orientation="hold",
        profile="trapezoid",
        speed=0.3,
        acceleration=2,
    )
    linear = ur5.frame_velocity("ee_link", motion.position, motion.velocity)[0]
    speed = np.linalg.norm(linear, axis=1)
    assert np.max(speed) == pytest.approx(0.3, rel=1e-12) and motion.warnings == ()
    assert ur5.frame_pose("ee_link", motion.position[-1])[0] == pytest.approx([0.45, 0.3, 0.4], abs=1e-14)
    assert motion.position[0] == pytest.approx(ur5.posture(UR5_START), abs=1e-12)
    assert len(motion.pieces) == 3


def test_a_clockwise_circle_is_the_reverse(arm):
    there = circle(arm, "tip", CENTER, RADIUS, DURATION, start={"elbow": -1.0}, samples=101)
    back = circle(arm, "tip", CENTER, RADIUS, DURATION, start={"elbow": -1.0}, samples=101, turns=-1)
    assert back.position == pytest.approx(there.position[::-1], abs=1e-14)
    assert back.velocity == pytest.approx(-there.velocity[::-1], abs=1e-13)


def test_a_circle_about_the_worlds_x_begins_in_the_direction_of_y(ur5):
    """The usual first direction, the world's x made normal to the axis, does not exist there."""
    centre, radius = np.array([0.45, 0.1, 0.4]), 0.1
    motion = circle(ur5, "ee_link", centre, radius, 2, start=UR5_START, normal=(2, 0, 0), samples=9)
    angle = np.linspace(0.0, 2.0 * np.pi, 9)
    expected = centre + radius * np.stack([0.0 * angle, np.cos(angle), np.sin(angle)], axis=1)
    assert ur5.frame_pose("ee_link", motion.position)[0] == pytest.approx(expected, abs=1e-12)


def test_a_tilted_planar_arm_moves_in_its_plane():
    """The plane need not be one of the world's."""
    robot = bellcrank.load_robot("planar_2r", floating_base=True)
    rotation = from_rpy(np.array([0.4, -0.3, 0.2]))
    start = robot.posture({"elbow": -1.0})
    start[3:7] = _quaternion(rotation)
    motion = circle(robot, "tip", rotation @ CENTER, RADIUS, DURATION, start=start, normal=rotation[:, 2], samples=51)
    position = robot.frame_pose("tip", motion.position)[0] @ rotation
    assert np.hypot(position[:, 0] - 1.2, position[:, 1] - 1.2) == pytest.approx(RADIUS, abs=1e-13)
    assert np.all(motion.position[:, :7] == start[:7]) and np.all(motion.velocity[:, :6] == 0.0)


def _quaternion(rotation):
    w = 0.5 * np.sqrt(1.0 + np.trace(rotation))
    skew = [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    return np.array([*(np.array(skew) / (4 * w)), w])


def test_a_straight_start_finds_some_branch(arm):
    motion = circle(arm, "tip", CENTER, RADIUS, DURATION, samples=101)
    position = arm.frame_pose("tip", motion.position)[0]
    assert np.hypot(position[:, 0] - 1.2, position[:, 1] - 1.2) == pytest.approx(RADIUS, abs=1e-13)
    assert np.ptp(np.sign(motion.position[:, 1])) == 0.0


def test_the_branch_never_jumps_near_a_singular_posture(arm):
    """Passing 1e-4 m inside the full reach: the elbow comes near 0 and must go back on its own side."""
    motion = circle(arm, "tip", (-1.7, 0, 0), 0.2999, 10, start={"elbow": -1.0}, samples=4001)
    assert np.all(motion.position[:, 1] < 0.0) and np.max(motion.position[:, 1]) > -0.03
    assert np.max(np.abs(np.diff(motion.position, axis=0))) < 0.05
    assert any("passes near a singular posture at 5 s" in warning for warning in motion.warnings)


@pytest.mark.parametrize(
    ("center", "radius", "words"),
    [
        ((1.9, 0, 0), 0.2, r"leaves the reach of 'planar_2r' at 0 s, .* \(2.1, 0, 0\) m is missed by 0.1 m"),
        ((-1.9, 0, 0), 0.2, r"leaves the reach of 'planar_2r' at 3\.26\d* s, .* is missed by 0.0999 m"),
        ((-1.7, 0, 0), 0.3, r"meets a singular posture of 'planar_2r' at 5 s, at \(-2, "),
        ((9, 9, 0), 0.2, r"at 0 s, .* is missed by 10\.93 m"),
        ((1.2, 1.2, 0.1), 0.2, r"can only move in a plane .* at 0 s the path, .* is 0.1 m away from it"),
    ],
)
def test_says_when_where_and_by_how_much(arm, center, radius, words):
    with pytest.raises(UnreachableError, match=words) as caught:
        circle(arm, "tip", center, radius, 10, start={"elbow": -1.0})
    assert "\n" not in str(caught.value)


def test_a_line_through_the_base_is_singular(arm):
    with pytest.raises(UnreachableError, match=r"meets a singular posture of 'planar_2r' at 2.5 s"):
        line(arm, "tip", (-1, 0, 0), 5, begin=(1, 0, 0), start={"elbow": -1.0})


def test_an_orientation_out_of_reach(ur5):
    with pytest.raises(UnreachableError, match=r"leaves the reach of 'ur5' at .* is missed by"):
        line(ur5, "ee_link", (1.45, 0.3, 0.4), 2, start=UR5_START, orientation="hold")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (dict(frame="tipp"), "unknown frame 'tipp'; did you mean 'tip'"),
        (dict(frame="base"), "no joint of 'planar_2r' moves frame 'base'"),
        (dict(orientation="hold"), "has 3 coordinates, but 'planar_2r' moves it by 2 joints only"),
        (dict(orientation="level"), "argument 'orientation': expected 'hold', rpy or a rotation matrix"),
        (dict(orientation=np.diag([1.0, 1.0, -1.0])), "is not a rotation"),
        (dict(orientation=(0, 0)), r"got shape \(2,\)"),
        (dict(normal=(0, 0, 0)), "normal must not be zero"),
        (dict(radius="wide"), "argument 'radius': expected a finite number .* found 'wide'"),
        (dict(center=(1.2, None, 0)), "argument 'center.1.': expected a finite number, found None"),
        (dict(profile="cubic"), "unknown profile 'cubic'"),
        (dict(start={"wrist": 1.0}), "unknown joint 'wrist'"),
        (dict(samples=1.5), "argument 'samples': expected a whole number"),
    ],
)
def test_refuses_in_one_sentence(arm, arguments, words):
    given = dict(frame="tip", center=CENTER, radius=RADIUS, duration=DURATION, start={"elbow": -1.0}) | arguments
    with pytest.raises(InputError, match=words) as caught:
        circle(arm, **given)
    assert "\n" not in str(caught.value)


def test_the_line_needs_a_length(arm):
    with pytest.raises(InputError, match="begins where it ends; use dwell"):
        line(arm, "tip", (2, 0, 0), 1)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.7, np.pi - 1e-9, np.pi])
def test_the_way_between_two_rotations(angle):
    begin = from_rpy(np.array([0.3, -0.2, 1.0]))
    end = begin @ from_rpy(np.array([angle, 0.0, 0.0]))
    half = between(begin, end, 0.5)
    assert half @ half.T == pytest.approx(np.eye(3), abs=1e-12)
    assert angles_to(half[None], begin)[0] == pytest.approx(angle / 2, abs=1e-6)
    assert angles_to(half[None], end)[0] == pytest.approx(angle / 2, abs=1e-6)
    assert np.array_equal(between(begin, end, 1.0), end)


POLAR = """<robot name="polar"><link name="ground"/><link name="a"/><link name="b"/><link name="tip"/>
<joint name="turn" type="continuous"><parent link="ground"/><child link="a"/><axis xyz="0 0 1"/></joint>
<joint name="reach" type="prismatic"><parent link="a"/><child link="b"/><origin xyz="{x} {y} 0"/><axis xyz="1 0 0"/>
  <limit lower="0" upper="{most}" effort="1" velocity="1"/></joint>
<joint name="t" type="fixed"><parent link="b"/><child link="tip"/><origin xyz="{out} 0 0"/></joint></robot>"""


@pytest.mark.tier2
@pytest.mark.parametrize("size", [1e-6, 1e-3, 1.0, 1e3])
def test_a_robot_that_turns_and_reaches_is_as_far_from_singular_at_any_size(tmp_path, size):
    """Its Jacobian has lever arms and shares of 1 in it; 0.4.0 calls it singular at 1 µm, and nearly so at 1 mm."""
    file = tmp_path / "polar.urdf"
    file.write_text(POLAR.format(x=0.3 * size, y=0.1 * size, most=3 * size, out=0.2 * size), encoding="utf-8")
    robot = bellcrank.load_robot(file)
    start = {"turn": 0.5, "reach": 0.5 * size}
    motion = circle(robot, "tip", (size, 0.6 * size, 0.0), 0.3 * size, 2.0, start=start)
    assert motion.notes == ()
    turn, reach = motion.position.T
    x, y = 0.5 + reach / size, 0.1  # of the tip in the axes that turn
    place = np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y], axis=1)
    np.testing.assert_allclose(np.hypot(*(place - [1.0, 0.6]).T), 0.3, rtol=1e-12)


@pytest.mark.tier2
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e3])
def test_a_robot_that_turns_and_reaches_is_refused_where_its_levers_vanish_at_any_size(tmp_path, size):
    file = tmp_path / "polar.urdf"
    file.write_text(POLAR.format(x=0.3 * size, y=0.0, most=3 * size, out=-0.3 * size), encoding="utf-8")
    robot = bellcrank.load_robot(file)
    with pytest.raises(UnreachableError, match=r"singular posture|leaves the reach"):  # through the axis that turns
        line(robot, "tip", (-size, 1e-9 * size, 0.0), 2.0, begin=(size, 0.0, 0.0), start={"reach": size})
