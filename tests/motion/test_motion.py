"""Motions are exact at their rows, smooth between them, and say what a motor would not forgive."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import bellcrank
from bellcrank.errors import InputError
from bellcrank.motion import coordinates
from bellcrank.motion.generators.frame_motions import circle
from bellcrank.motion.generators.waypoints import dwell, waypoints
from bellcrank.motion.motion import Motion, join


@pytest.fixture(scope="module")
def arm():
    return bellcrank.load_robot("planar_2r", gravity=(0, -9.81, 0))


FREE = (
    SimpleNamespace(name="base", kind="floating", q=0, nq=7, v=0, nv=6),
    SimpleNamespace(name="slide", kind="planar", q=7, nq=4, v=6, nv=3),
    SimpleNamespace(name="hip", kind="revolute", q=11, nq=1, v=9, nv=1),
)


def swing(arm, n=21, end=1.0, name="swing"):
    t = np.linspace(0.0, end, n)
    q = np.stack([np.sin(t), np.cos(2 * t)], axis=1)
    v = np.stack([np.cos(t), -2 * np.sin(2 * t)], axis=1)
    a = np.stack([-np.sin(t), -4 * np.cos(2 * t)], axis=1)
    return Motion(arm.joints, t, q, v, a, name)


def free_states(seed, n=6):
    rng = np.random.default_rng(seed)
    q, v, a = rng.normal(size=(n, 12)), rng.normal(size=(n, 10)), rng.normal(size=(n, 10))
    for block in (slice(3, 7), slice(9, 11)):
        q[:, block] /= np.linalg.norm(q[:, block], axis=1, keepdims=True)
    return q, v, a


@given(st.integers(0, 2**32 - 1))
def test_rates_and_back(seed):
    q, v, a = free_states(seed)
    for got, want in zip(coordinates.from_rates(FREE, q, *coordinates.rates(FREE, q, v, a)), (q, v, a), strict=True):
        assert got == pytest.approx(want, abs=1e-12)


@given(st.integers(0, 2**32 - 1), st.floats(0.1, 10.0))
def test_length_of_a_quaternion_does_not_matter(seed, length):
    q, v, a = free_states(seed)
    qd, qdd = coordinates.rates(FREE, q, v, a)
    for block in (slice(3, 7), slice(9, 11)):
        for array in (q, qd, qdd):
            array[:, block] *= length
    _, v2, a2 = coordinates.from_rates(FREE, q, qd, qdd)
    assert v2 == pytest.approx(v, abs=1e-10) and a2 == pytest.approx(a, abs=1e-10)


def test_free_base_rates_agree_with_the_traced_map():
    """Independent route: E(q) v, traced from the joint models."""
    robot = bellcrank.load_robot("planar_2r", floating_base=True)
    rng = np.random.default_rng(3)
    q, v = rng.normal(size=(5, robot.nq)), rng.normal(size=(5, robot.nv))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    qd, _ = coordinates.rates(robot.joints, q, v, np.zeros_like(v))
    assert qd == pytest.approx(robot.configuration_rate(q, v), abs=1e-14)


def test_second_rates_are_the_derivative_of_the_first():
    """A free base turning at a constant body rate: the quaternion is exp(½ ω t)."""
    w, h = np.array([0.3, -0.7, 1.1]), 1e-5
    size = np.linalg.norm(w)

    def state(t):
        q = np.concatenate([[0, 0, 0], np.sin(size * t / 2) * w / size, [np.cos(size * t / 2)]])
        return q, np.concatenate([[0.2 * t, 0.1, -0.4 * t * t], w]), np.array([0.2, 0.0, -0.8 * t, 0, 0, 0])

    base = FREE[:1]

    def rates(t):
        return coordinates.rates(base, *(part[None] for part in state(t)))

    _, qdd = rates(0.8)
    numeric = (rates(0.8 + h)[0] - rates(0.8 - h)[0]) / (2 * h)
    assert qdd == pytest.approx(numeric, abs=1e-9)


def test_exact_at_rows_and_fourth_order_between(arm):
    motion = swing(arm)
    q, v, a = motion.at(motion.time)
    assert np.array_equal(q, motion.position)
    assert np.array_equal(v, motion.velocity)
    assert np.array_equal(a, motion.acceleration)
    errors = []
    for n in (11, 21, 41):
        t = np.linspace(0.0, 1.0, 400)
        errors.append(np.max(np.abs(swing(arm, n).at(t)[2][:, 1] + 4 * np.cos(2 * t))))
    slopes = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(slopes > 3.8)


def test_at_a_single_time_and_outside(arm):
    motion = swing(arm)
    q, v, a = motion.at(0.33)
    assert q.shape == v.shape == a.shape == (2,)
    assert q[0] == pytest.approx(np.sin(0.33), abs=1e-11)
    with pytest.raises(InputError, match=r"time 1.5 s lies outside it \(0 s to 1 s\)"):
        motion.at(1.5)
    with pytest.raises(InputError, match="outside"):
        motion.at([0.5, float("nan")])


def test_free_base_motion_interpolates_on_unit_quaternions():
    robot = bellcrank.load_robot("planar_2r", floating_base=True)
    w = np.array([0.3, -0.7, 1.1])
    t = np.linspace(0.0, 6.0, 61)
    size = np.linalg.norm(w)

    def position(t):
        q = np.tile(robot.neutral, (len(t), 1))
        q[:, 3:6] = np.sin(size * t / 2)[:, None] * w / size
        q[:, 6] = np.cos(size * t / 2)
        return q

    q = position(t)
    q[30:] *= np.array([1, 1, 1, -1, -1, -1, -1, 1, 1])  # the same rotations, the other sign
    v = np.tile(np.concatenate([np.zeros(3), w, np.zeros(2)]), (len(t), 1))
    motion = Motion(robot.joints, t, q, v, np.zeros_like(v))
    middle = 0.5 * (t[1:] + t[:-1])
    q2, v2, a2 = motion.at(middle)
    assert np.abs(np.sum(q2[:, 3:7] * position(middle)[:, 3:7], axis=1)) == pytest.approx(1.0, abs=1e-12)
    assert v2 == pytest.approx(v[:-1], abs=1e-7) and a2 == pytest.approx(0.0, abs=1e-5)


def test_arrays_are_read_only(arm):
    motion = swing(arm)
    with pytest.raises(ValueError, match="read-only"):
        motion.position[0, 0] = 1.0


def test_both_limits_at_a_jump(arm):
    joined = join(dwell(arm, [0.0, 1.0], 2.0), swing(arm))
    assert len(joined.pieces) == 2 and joined.duration == pytest.approx(3.0)
    assert joined.at(2.0, side="before")[2] == pytest.approx([0.0, 0.0])
    assert joined.at(2.0)[2] == pytest.approx([0.0, -4.0])
    assert joined.at(np.array([2.0 - 1e-9]))[2] == pytest.approx(np.zeros((1, 2)))


def test_warns_of_what_a_motor_cannot_do(arm):
    joined = dwell(arm, [0.0, 1.0], 2.0) + swing(arm)
    found = " | ".join(joined.warnings)
    assert "ends moving: elbow velocity -1.819 rad/s at 3 s" in found
    assert "jumps in velocity at 2 s: shoulder velocity by 1 rad/s" in found
    assert "starts moving" not in found
    assert "starts moving: shoulder velocity 1 rad/s at 0 s" in " | ".join(swing(arm).warnings)
    rest = waypoints(arm, [0, 1], [[0, 0], [1, 1]])
    assert rest.warnings == ()
    assert (dwell(arm, [0, 0], 1.0) + rest + dwell(arm, [1, 1], 0.5)).warnings == ()


def test_warns_outside_the_joint_range(arm):
    motion = waypoints(arm, [0, 1], [[0, 0], [0, arm.upper[1] + 0.1]])
    assert any("leaves the range of joint 'elbow'" in warning for warning in motion.warnings)


def test_join_keeps_every_part(arm):
    first = waypoints(arm, [0, 1], [[0, 0], [1, -1]], samples=11, name="out")
    second = waypoints(arm, [5, 7], [[1, -1], [0, 0]], samples=11, name="back")
    joined = join(first, second)
    assert joined.name == "out + back" and joined.duration == pytest.approx(3.0)
    assert np.all(np.diff(joined.time) > 0.0)  # nothing jumps: the shared row stands once
    assert joined.at(1.0 + 0.6)[0] == pytest.approx(second.at(5.6)[0], abs=1e-12)


def test_join_refuses_a_gap(arm):
    with pytest.raises(InputError, match="the first ends with joint 'shoulder' at 1, the second starts at 0"):
        join(waypoints(arm, [0, 1], [[0, 0], [1, 0]]), dwell(arm, [0, 0], 1.0))
    with pytest.raises(InputError, match=r"their joints are shoulder, elbow and shoulder"):
        pendulum = bellcrank.load_robot("geared_pendulum")
        join(dwell(arm, [0, 0], 1.0), dwell(pendulum, [0.0], 1.0))
    with pytest.raises(InputError, match="at least one motion"):
        join()


def test_waypoints_are_hit_and_smooth_to_the_acceleration(arm):
    times, points = [0.0, 0.7, 1.0, 2.5], np.array([[0, 0], [1, -0.5], [1.2, 0.3], [-0.4, 1.0]])
    motion = waypoints(arm, times, points)
    assert motion.at(times)[0] == pytest.approx(points, abs=1e-14)
    for end in (0, -1):
        assert np.all(motion.velocity[end] == 0.0) and np.all(motion.acceleration[end] == 0.0)
    assert len(motion.pieces) == 1 and motion.warnings == ()
    h = np.diff(motion.time)[:, None]
    moved = 0.5 * h * (motion.velocity[1:] + motion.velocity[:-1]) - h * h / 12 * np.diff(motion.acceleration, axis=0)
    assert np.sum(moved, axis=0) == pytest.approx(points[-1] - points[0], abs=1e-9)
    assert np.max(np.abs(np.diff(motion.acceleration, axis=0) / h)) < 200.0  # no jump of acceleration


def test_two_waypoints_are_the_quintic(arm):
    motion = waypoints(arm, [0.0, 2.0], [[0, 0], [1.0, -2.0]])
    u = motion.time / 2.0
    assert motion.position[:, 0] == pytest.approx(10 * u**3 - 15 * u**4 + 6 * u**5, abs=1e-13)


def test_waypoints_take_joints_by_name(arm):
    motion = waypoints(arm, [0, 1], [{"elbow": -1.0}, {"shoulder": 0.5}])
    assert motion.position[0] == pytest.approx([0, -1.0]) and motion.position[-1] == pytest.approx([0.5, 0])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda arm: dwell(arm, [0, 0], 0.0),
            "argument 'duration': expected a finite number of more than 0 and at most 1e.30 .s., found 0.0",
        ),
        (lambda arm: dwell(arm, [0, 0], "long"), "argument 'duration': .* found 'long'"),
        (lambda arm: waypoints(arm, [0, 1, 1], [[0, 0]] * 3), "but 1 s follows 1 s"),
        (lambda arm: waypoints(arm, [0, 1], [[0, 0]]), "2 times but 1 positions"),
        (lambda arm: waypoints(arm, [0], [[0, 0]]), "at least 2 times are needed"),
        (lambda arm: waypoints(arm, ["a", "b"], [[0, 0]] * 2), "argument 'times': expected increasing numbers"),
        (lambda arm: waypoints(arm, [0, np.inf], [[0, 0]] * 2), "time 1 is not finite"),
        (
            lambda arm: waypoints(arm, [0, 1], [[0, 0]] * 2, samples=1),
            "argument 'samples': expected a whole number of at least 2",
        ),
        (lambda arm: waypoints(arm, [0, 1], [{"wrist": 1}, {}]), "unknown joint 'wrist'"),
        (
            lambda arm: circle(arm, "tip", (1.2, 1.2, 0), -0.2, 10),
            "argument 'radius': expected a finite number of more than 0",
        ),
        (lambda arm: circle(arm, "tip", (1.2, 1.2), 0.2, 10), "argument 'center': expected 3 numbers"),
        (lambda arm: circle(arm, "tip", (1.2, 1.2, 0), 0.2, 10, turns=0), "turns must not be 0"),
    ],
)
def test_refuses_in_one_sentence(arm, make, words):
    with pytest.raises(InputError, match=words) as caught:
        make(arm)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (dict(time=[0.0, 2.0, 1.0]), r"time decreases, from 2 s to 1 s \(rows 1, 2\)"),
        (dict(time=[0.0, 0.0, 1.0]), "the first or the last time occurs twice"),
        (dict(time=[0.0, 1.0]), "position has shape"),
        (dict(position=[[0, 0], [0, np.nan], [0, 0]]), "position holds a value that is not finite, in row 1"),
        (dict(velocity=[[0], [0], [0]]), r"velocity has shape \(3, 1\), expected \(3, 2\)"),
        (dict(acceleration=[["a", "b"]] * 3), "argument 'acceleration': expected an array"),
    ],
)
def test_a_motion_that_exists_is_valid(arm, change, words):
    zero = np.zeros((3, 2))
    data = dict(time=[0.0, 1.0, 2.0], position=zero, velocity=zero, acceleration=zero) | change
    with pytest.raises(InputError, match=words):
        Motion(arm.joints, **data)


def test_position_must_not_jump(arm):
    zero = np.zeros((4, 2))
    with pytest.raises(InputError, match=r"joint 'elbow' jumps by 0\.1"):
        Motion(arm.joints, [0, 1, 1, 2], [[0, 0], [0, 0], [0, 0.1], [0, 0.1]], zero, zero)


@pytest.mark.parametrize(
    ("angle", "suspected"), [(45.0, True), (8.95, True), (2.0, False), (-8.95, True), (8.85, False), (-4.0, False)]
)
def test_a_posture_far_out_may_have_been_meant_in_degrees(arm, angle, suspected):
    high = 2.9  # 8.95 rad is more than 6 rad beyond, though less than two turns
    assert (arm.lower[1], arm.upper[1]) == (-high, high)
    notes = dwell(arm, {"elbow": angle}, 1.0).warnings
    found = [note for note in notes if "were degrees meant? write '45 deg'" in note]
    assert len(found) == suspected and all(f"'elbow' reaches {angle:g} rad" in note for note in found)
    assert any("leaves the range" in note for note in notes) == (abs(angle) > high)
