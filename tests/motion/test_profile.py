"""Profiles run the whole distance, stay within their limits, and are as fast as these allow."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from bellcrank.errors import InputError
from bellcrank.motion.generators.profile import KINDS, profile

positive = st.floats(1e-3, 1e3)
maybe = st.none() | positive


@st.composite
def profiles(draw):
    kind = draw(st.sampled_from(KINDS))
    keys = {"constant": ["speed"], "trapezoid": ["speed", "acceleration"]}.get(kind, ["speed", "acceleration", "jerk"])
    limits = {key: value for key in keys if (value := draw(maybe)) is not None}
    assume(limits)
    return profile(kind, draw(positive), **limits), limits


@given(profiles())
def test_runs_the_distance_within_its_limits(made):
    timing, limits = made
    time, s, speed, acceleration = timing.rows(41)
    size = timing.distance
    assert s[0] == 0.0 and s[-1] == size
    assert time[0] == 0.0 and time[-1] == timing.duration
    assert np.all(np.diff(time) >= 0.0) and np.all(np.diff(s) >= -1e-9 * size)
    reached = timing.at(np.array([timing.duration]), side="before")[0][0]
    assert reached == pytest.approx(size, rel=1e-9)
    for key, peak in zip(("speed", "acceleration", "jerk"), timing.peaks(), strict=True):
        if key in limits:
            assert peak <= limits[key] * (1.0 + 1e-6)
    if timing.kind != "constant":
        assert speed[0] == 0.0 and speed[-1] == 0.0
    if timing.kind in ("quintic", "s_curve"):
        assert acceleration[0] == 0.0 and acceleration[-1] == 0.0


@given(profiles())
def test_some_limit_is_reached(made):
    """The fastest profile within its limits touches one of them."""
    timing, limits = made
    peaks = dict(zip(("speed", "acceleration", "jerk"), timing.peaks(), strict=True))
    assert any(peaks[key] == pytest.approx(limits[key], rel=1e-6) for key in limits)


@given(profiles(), st.floats(1.0, 20.0))
def test_a_longer_duration_stretches_time(made, factor):
    timing, limits = made
    slow = profile(timing.kind, timing.distance, timing.duration * factor, **limits)
    part = np.linspace(0.0, 1.0, 17)
    fast_s = timing.at(part * timing.duration)[0]
    slow_s = slow.at(part * slow.duration)[0]
    assert slow_s == pytest.approx(fast_s, rel=1e-7, abs=1e-9 * timing.distance)
    assert slow.peaks()[0] == pytest.approx(timing.peaks()[0] / factor, rel=1e-9)


@pytest.mark.parametrize("kind", ["trapezoid", "quintic", "s_curve"])
def test_speed_is_the_derivative_of_distance(kind):
    timing = profile(kind, 1.3, 2.1)
    t = np.linspace(0.05, 2.05, 41)
    h = 1e-5
    _, v, a = timing.at(t)
    (before, v_before, _), (after, v_after, _) = timing.at(t - h), timing.at(t + h)
    clear = np.min(np.abs(t[:, None] - timing.breaks), axis=1) > 2 * h
    assert v[clear] == pytest.approx(((after - before) / (2 * h))[clear], abs=1e-8)
    assert a[clear] == pytest.approx(((v_after - v_before) / (2 * h))[clear], abs=1e-7)


def test_known_shapes():
    assert profile("trapezoid", 1.2, speed=0.5, acceleration=2.0).duration == pytest.approx(1.2 / 0.5 + 0.25)
    assert profile("trapezoid", 1.0, acceleration=4.0).duration == pytest.approx(1.0)
    full = profile("s_curve", 1.2, speed=0.5, acceleration=2.0, jerk=20.0)
    assert full.duration == pytest.approx(1.2 / 0.5 + 0.5 / 2.0 + 2.0 / 20.0)
    assert len(full.coefficients) == 7
    assert profile("quintic", 2.0, 3.0).peaks()[0] == pytest.approx(1.875 * 2.0 / 3.0)
    assert profile("quintic", 2.0, 3.0).peaks()[2] == pytest.approx(60.0 * 2.0 / 27.0)


def test_rows_show_jumps_of_acceleration_twice():
    time, _, _, acceleration = profile("trapezoid", 1.2, 3.0).rows(31)
    twins = np.flatnonzero(np.diff(time) == 0.0)
    assert time[twins] == pytest.approx([1.0, 2.0])
    assert acceleration[twins] == pytest.approx([0.6, 0.0])
    assert acceleration[twins + 1] == pytest.approx([0.0, -0.6])
    for kind in ("constant", "quintic", "s_curve"):
        assert np.all(np.diff(profile(kind, 1.2, 3.0).rows(31)[0]) > 0.0)


def test_constant_rows_are_evenly_spaced():
    time, s, speed, acceleration = profile("constant", 2.0 * np.pi, 10.0).rows(1001)
    assert s == pytest.approx(2.0 * np.pi * np.arange(1001) / 1000, abs=1e-14)
    assert len(time) == 1001 and np.all(speed == speed[0]) and np.all(acceleration == 0.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (dict(kind="cubic", distance=1.0, duration=1.0), "unknown profile 'cubic'"),
        (dict(kind="constant", distance=1.0), "give a duration or a limit"),
        (
            dict(kind="constant", distance=1.0, speed=1.0, acceleration=1.0),
            "cannot keep a limit of acceleration",
        ),
        (dict(kind="trapezoid", distance=1.0, speed=1.0, jerk=1.0), "cannot keep a limit of jerk"),
        (
            dict(kind="quintic", distance=1.0, duration=0.0),
            "argument 'duration': expected a finite number of more than 0",
        ),
        (
            dict(kind="quintic", distance=1.0, duration=float("nan")),
            "argument 'duration': expected a finite number of more than 0",
        ),
        (dict(kind="quintic", distance=1.0, speed="fast"), "argument 'speed': .* found 'fast'"),
        (dict(kind="quintic", distance=1.875, duration=0.9, speed=1.875), "the least duration is 1.875 s"),
        (dict(kind="trapezoid", distance=1.0, duration=0.9, acceleration=4.0), "the least duration is 1 s"),
    ],
)
def test_refuses_in_one_sentence(arguments, words):
    with pytest.raises(InputError, match=words) as caught:
        profile(**arguments)
    assert "\n" not in str(caught.value)
