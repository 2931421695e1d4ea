"""Motions that bellcrank makes are their own polynomials between the rows, wherever the rows lie."""

from __future__ import annotations

import pickle
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

import bellcrank as bc
from bellcrank.motion.motion_entry import stretched

Array = NDArray[np.float64]
ARM = bc.load_robot("planar_2r")
CORNER = [{"shoulder": 0.5}, {"elbow": 1.0}, {"shoulder": 0.5}]


def cornering(**more: Any) -> bc.Motion:
    """A motion that passes a reversal of its path with a blend, whose end differs by rounding from the path's."""
    limits = {"speed": 0.5, "acceleration": 4.0, "profile": "trapezoid", "blend": 0.25}
    return bc.point_to_point(ARM, CORNER, **(limits | more))


def beside(motion: bc.Motion, rows: list[int], gap: float) -> bc.Motion:
    """The motion with further rows a gap after some of its own."""
    time = np.insert(motion.time, np.add(rows, 1), motion.time[rows] + gap)
    states = zip(
        (motion.position, motion.velocity, motion.acceleration), motion.at(motion.time[rows] + gap), strict=True
    )
    q, v, a = (np.insert(old, np.add(rows, 1), new, axis=0) for old, new in states)
    return replace(motion, time=time, position=q, velocity=v, acceleration=a)


def trapezoid(distance: float, speed: float, acceleration: float, t: Array) -> tuple[Array, Array, Array]:
    """Distance, speed and acceleration at times t of the fastest move from rest to rest, in closed form."""
    rise = min(speed / acceleration, np.sqrt(distance / acceleration))
    top = acceleration * rise
    whole = 2.0 * rise + max(0.0, distance / top - rise)
    left = whole - t
    conditions = [t < rise, left < rise]
    s = np.select(
        conditions, [0.5 * acceleration * t**2, distance - 0.5 * acceleration * left**2], top * (t - rise / 2)
    )
    v = np.select(conditions, [acceleration * t, acceleration * left], top)
    return s, v, np.select(conditions, [acceleration, -acceleration], 0.0)


angle = st.floats(-3.0, 3.0).map(lambda x: round(x, 3))


@settings(max_examples=25, deadline=None)
@given(
    postures=st.lists(st.tuples(angle, angle), min_size=2, max_size=4),
    speed=st.floats(0.05, 5.0),
    acceleration=st.floats(0.1, 50.0),
    samples=st.integers(2, 60),
    gap=st.sampled_from([1e-13, 1.5e-8, 1e-6]),
)
def test_a_trapezoid_is_its_closed_form_everywhere_however_close_its_rows_are(
    postures: list[tuple[float, float]], speed: float, acceleration: float, samples: int, gap: float
) -> None:
    points = [np.array(posture) for posture in postures]
    if min(np.abs(b - a).max() for a, b in pairwise(points)) < 1e-3:
        return
    motion = bc.point_to_point(
        ARM, points, speed=speed, acceleration=acceleration, profile="trapezoid", samples=samples
    )
    single = np.flatnonzero(np.diff(motion.time) > 10.0 * gap)[1:-1].tolist()
    motion = beside(motion, single[:: max(1, len(single) // 5)], gap)
    begin = 0.0
    for a, b in pairwise(points):
        length = float(np.linalg.norm(b - a))
        along = (b - a) / length
        limits = speed / np.abs(along).max(), acceleration / np.abs(along).max()
        rise = min(limits[0] / limits[1], np.sqrt(length / limits[1]))
        whole = 2.0 * rise + max(0.0, length / (limits[1] * rise) - rise)
        t = whole * (0.5 - 0.5 * np.cos(np.pi * np.linspace(0.003, 0.997, 171)))
        t = t[(np.abs(t - rise) > 1e-9 * whole) & (np.abs(whole - t - rise) > 1e-9 * whole)]
        found, exact = motion.at(np.minimum(begin + t, motion.time[-1])), trapezoid(length, *limits, t)
        np.testing.assert_allclose(found[0], a + np.outer(exact[0], along), rtol=0, atol=1e-9)
        np.testing.assert_allclose(found[1], np.outer(exact[1], along), rtol=0, atol=1e-9 * speed + 1e-9)
        np.testing.assert_allclose(found[2], np.outer(exact[2], along), rtol=0, atol=1e-9 * acceleration)
        begin += whole
    assert motion.duration == pytest.approx(begin, rel=1e-12)
    probes = np.linspace(0.0, motion.duration, 5001)
    for limit, values in zip((speed, acceleration), motion.at(probes)[1:], strict=True):
        assert np.abs(values).max() <= limit * (1.0 + 1e-9)


def test_a_peak_does_not_rest_on_rows_that_differ_by_rounding() -> None:
    """The peak of 31.33 N m, by Pinocchio's RNEA on positions and their differences at other times than the rows."""
    motion = cornering()
    assert np.diff(np.unique(motion.time)).min() > 1e-6
    h = 1e-4
    t = np.linspace(2.0 * h, motion.duration - 2.0 * h, 60_001)
    before, here, after = (motion.at(t + step)[0] for step in (-h, 0.0, h))
    model, data = ARM.model, ARM.model.createData()
    rates, bends = (after - before) / (2.0 * h), (after - 2.0 * here + before) / h**2
    torques = np.array([pinocchio.rnea(model, data, *state) for state in zip(here, rates, bends, strict=True)])
    dense = np.abs(torques).max(axis=0)
    sizing = bc.size(ARM, motion)
    found = [joint.peak_torque for joint in sizing.joints]
    assert dense[0] == pytest.approx(31.33, abs=0.01)
    np.testing.assert_allclose(found, dense, rtol=1e-3)  # differences over a jump of the acceleration blur it
    for gap in (1e-13, 1.5e-8, 1e-6):
        nearly = beside(motion, [40, 400, 700, len(motion) - 2], gap)
        peaks = [joint.peak_torque for joint in bc.size(ARM, nearly).joints]
        np.testing.assert_allclose(peaks, found, rtol=1e-9)
        assert sizing.undetermined == ()


@pytest.mark.parametrize("gap", [1.5e-8, 3e-7])
def test_rows_within_rounding_make_no_acceleration_in_a_sampled_motion(gap: float) -> None:
    motion = beside(cornering(), [40, 400, 700, 1000], gap)
    rows = motion.time, motion.position, motion.velocity, motion.acceleration
    sampled = bc.Motion(motion.joints, *rows)
    assert sampled.forms == ()
    t = (motion.time[:-1, None] + np.diff(motion.time)[:, None] * np.linspace(0.1, 0.9, 9)).ravel()
    limits = np.abs(motion.acceleration).max(axis=0) * (1.0 + 1e-3)
    assert np.all(np.abs(sampled.at(t)[2]) <= limits)


def test_waypoints_are_one_spline_whatever_the_rows() -> None:
    times, postures = [0.0, 1.0, 1.5, 3.0], [{}, {"elbow": 1.0}, {"shoulder": 0.7}, {}]
    few, many = (bc.waypoints(ARM, times, postures, samples=samples) for samples in (4, 4001))
    t = np.linspace(0.0, 3.0, 777)
    for found, exact in zip(few.at(t), many.at(t), strict=True):
        np.testing.assert_allclose(found, exact, rtol=0, atol=1e-12)
    found, exact = (bc.size(ARM, motion).joint("shoulder").peak_torque for motion in (few, many))
    assert found == pytest.approx(exact, rel=1e-9)


def test_joined_stretched_and_copied_motions_keep_their_closed_forms() -> None:
    move = cornering(samples=9)
    both = bc.join(bc.dwell(ARM, CORNER[0], 0.7), move, bc.waypoints(ARM, [0.0, 2.0], [CORNER[-1], {}], samples=3))
    assert len(both.forms) == 3 and not both.interpolated.any()
    t = np.linspace(0.0, move.duration, 501)[1:-1]
    slow = stretched(both, 2.5)
    for order, (found, late, own) in enumerate(
        zip(both.at(0.7 + t), slow.at(2.5 * (0.7 + t)), move.at(t), strict=True)
    ):
        np.testing.assert_allclose(found, own, rtol=0, atol=1e-8)
        np.testing.assert_allclose(late * 2.5**order, own, rtol=0, atol=1e-8)
    again = pickle.loads(pickle.dumps(both))
    for found, own in zip(again.at(t), both.at(t), strict=True):
        np.testing.assert_array_equal(found, own)


def test_a_closed_form_with_which_the_rows_do_not_agree_is_left_out() -> None:
    move = cornering()
    assert len(move.forms) == 1
    assert replace(move, velocity=1.001 * move.velocity).forms == ()
    assert replace(move, time=1.001 * move.time).forms == ()
    assert len(replace(move, name="renamed").forms) == 1
