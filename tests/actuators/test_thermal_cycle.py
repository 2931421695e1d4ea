"""The periodic state of a cycle: fixed point, runaway, peaks, and the time from cold to a limit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from thermal_reference import ALPHA, cycle_matrix, integrated, model

from bellcrank.actuators.thermal import HeatCycle, ThermalModel, temperatures
from bellcrank.actuators.thermal_cycle import CyclePath, periodic_temperatures, time_to_limit


def cycle(durations: Any, copper: Any, friction: Any = 0.0) -> HeatCycle:
    copper = np.atleast_2d(np.asarray(copper, dtype=float))
    return HeatCycle(
        duration=np.asarray(durations, dtype=float), copper_loss=copper, friction_loss=np.zeros_like(copper) + friction
    )


@st.composite
def settling(draw: Any) -> tuple[ThermalModel, HeatCycle]:
    """A motor and a cycle whose mean copper loss is at most 0.8 of that at which it runs away.

    Cycles last from a thousandth of the winding's time constant to a hundred of them.
    """
    inner, outer = 10.0 ** draw(st.floats(-0.7, 0.7)), 10.0 ** draw(st.floats(-0.3, 1.0))
    winding = 10.0 ** draw(st.floats(-0.5, 1.5))
    thermal = model((winding, winding * 10.0 ** draw(st.floats(0.0, 2.5))), (inner, outer), draw(st.floats(0.0, 50.0)))
    count = draw(st.integers(2, 8))
    durations = np.array([10.0 ** draw(st.floats(-3.0, 1.0)) for _ in range(count)]) * winding * inner
    copper = np.array([draw(st.floats(0.0, 1.0)) for _ in range(count)])
    mean = float(copper @ durations / durations.sum())
    assume(mean > 1e-3)
    copper *= draw(st.floats(0.05, 0.8)) / (ALPHA * (inner + outer)) / mean
    return thermal, cycle(durations, copper, [draw(st.floats(0.0, 3.0)) for _ in range(count)])


@settings(deadline=None)
@given(settling())
def test_one_cycle_from_the_fixed_point_returns_to_it(drawn: tuple[ThermalModel, HeatCycle]) -> None:
    thermal, heat = drawn
    found = periodic_temperatures(thermal, heat)
    assume(found.winding_peak[0] < 1000.0)  # long hot parts of a cycle may run away by themselves
    _, winding, housing = temperatures(thermal, heat, (found.winding_start, found.housing_start))
    assert winding[0, -1] == pytest.approx(found.winding_start[0], abs=1e-6)
    assert housing[0, -1] == pytest.approx(found.housing_start[0], abs=1e-6)
    assert winding[0].max() <= found.winding_peak[0] + 1e-9 and housing[0].max() <= found.housing_peak[0] + 1e-9


@settings(deadline=None, max_examples=10)
@given(settling())
def test_a_transient_of_25_of_the_slowest_time_constants_ends_in_the_fixed_point(
    drawn: tuple[ThermalModel, HeatCycle],
) -> None:
    """The effective time constant of the cycle is -period / ln ρ: e^-25 of 1000 K is 1.4e-8 K."""
    thermal, heat = drawn
    found = periodic_temperatures(thermal, heat)
    assume(found.winding_peak[0] < 1000.0)
    count = math.ceil(25.0 / -math.log(found.spectral_radius[0]))
    assume(count * len(heat.duration) < 5000)
    _, winding, housing = temperatures(thermal, heat.repeated(count))
    assert winding[0, -1] == pytest.approx(found.winding_start[0], abs=1e-6)
    assert housing[0, -1] == pytest.approx(found.housing_start[0], abs=1e-6)


def test_the_periodic_state_by_scipys_integrator() -> None:
    """Three cycles from the fixed point, and their peaks, by Radau's method."""
    thermal, heat = model((5.568, 108.036), (0.74, 8.96)), cycle([3.0, 1.0, 5.0], [40.0, 5.0, 12.0], [1.0, 2.0, 0.0])
    found = periodic_temperatures(thermal, heat)
    start = [float(found.winding_start[0]), float(found.housing_start[0])]
    assert integrated(thermal, heat.repeated(3), start)[-1] == pytest.approx(start, abs=1e-6)
    samples = integrated(thermal, heat, start, dense=400)
    assert found.winding_peak[0] == pytest.approx(samples[:, 0].max(), abs=1e-3)
    assert found.housing_peak[0] == pytest.approx(samples[:, 1].max(), abs=1e-3)
    assert found.winding_peak[0] >= samples[:, 0].max() - 1e-9


# ---- runaway


@pytest.mark.tier2
@settings(deadline=None)
@given(settling())
def test_the_spectral_radius_is_that_of_scipys_matrices(drawn: tuple[ThermalModel, HeatCycle]) -> None:
    thermal, heat = drawn
    expected = np.abs(np.linalg.eigvals(cycle_matrix(thermal, heat))).max()
    assert periodic_temperatures(thermal, heat).spectral_radius[0] == pytest.approx(expected, rel=1e-9)


@settings(deadline=None, max_examples=10)
@given(settling())
def test_runaway_is_said_exactly_where_the_spectral_radius_reaches_1(drawn: tuple[ThermalModel, HeatCycle]) -> None:
    """The load is bisected until scipy's spectral radius is 1; just below the motor settles, just above it does not."""
    thermal, heat = drawn

    def loaded(factor: float) -> HeatCycle:
        return cycle(heat.duration, factor * heat.copper_loss, heat.friction_loss)

    def excess(factor: float) -> float:
        return float(np.abs(np.linalg.eigvals(cycle_matrix(thermal, loaded(factor)))).max()) - 1.0

    most = 2.0
    while excess(most) < 0.0:
        most *= 1.5
    critical = brentq(excess, 0.0, most, xtol=1e-13, rtol=1e-14)
    below, above = (periodic_temperatures(thermal, loaded(critical * (1.0 + side))) for side in (-1e-9, 1e-9))
    slow = -math.log(cycle_matrix(thermal, cycle(heat.duration, 0.0 * heat.copper_loss)).max())
    assume(slow > 1e-6)  # round-off of scipy's radius is 1e-15 of 1, and a cycle must change it by more
    assert not below.runaway[0] and np.isfinite(below.winding_peak[0]) and below.winding_peak[0] > 1e4
    assert above.runaway[0] and np.isinf(above.winding_peak[0]) and np.isinf(above.housing_start[0])


def test_runaway_where_numbers_overflow() -> None:
    thermal = model((1.0, 10.0), (1.0, 10.0))
    found = periodic_temperatures(thermal, cycle([1e4, 1.0], [1e5, 0.0]))
    assert found.runaway[0] and np.isinf(found.winding_peak[0])
    assert 0.0 < time_to_limit(thermal, cycle([1e4, 1.0], [1e5, 0.0]), np.array([130.0]))[0] < 2e-3


def test_a_cycle_without_losses_stays_at_the_ambient_temperature() -> None:
    found = periodic_temperatures(model((5.0, 100.0), (1.0, 4.0), 40.0), cycle([1.0, 2.0], [0.0, 0.0]))
    assert found.winding_peak == pytest.approx([40.0]) and found.housing_peak == pytest.approx([40.0])
    assert found.growth[0] < 0.0


# ---- peaks


@settings(deadline=None, max_examples=10)
@given(settling())
def test_peaks_are_those_of_a_finely_divided_cycle(drawn: tuple[ThermalModel, HeatCycle]) -> None:
    thermal, heat = drawn
    found = periodic_temperatures(thermal, heat)
    assume(found.winding_peak[0] < 1000.0)
    start = (found.winding_start, found.housing_start)
    _, winding, housing = temperatures(thermal, heat.divided(50), start)
    for peak, samples in ((found.winding_peak[0], winding[0]), (found.housing_peak[0], housing[0])):
        assert samples.max() <= peak + 1e-9
        # Between samples a temperature rises by less than its largest step between samples.
        assert peak <= samples.max() + np.abs(np.diff(samples)).max()


def test_the_housing_is_hottest_inside_the_interval_after_the_load() -> None:
    thermal, heat = model((20.0, 30.0), (1.0, 4.0)), cycle([5.0, 40.0], [60.0, 0.0])
    found = periodic_temperatures(thermal, heat)
    _, _, ends = temperatures(thermal, heat, (found.winding_start, found.housing_start))
    samples = integrated(thermal, heat, [found.winding_start[0], found.housing_start[0]], dense=4000)
    assert found.housing_peak[0] > ends[0].max() + 1.0
    assert found.housing_peak[0] == pytest.approx(samples[:, 1].max(), abs=1e-4)


def test_the_winding_is_hottest_inside_an_interval_when_its_housing_cools() -> None:
    thermal, heat = model((1.0, 30.0), (1.0, 4.0)), cycle([0.5, 60.0, 200.0], [100.0, 0.0, 3.0], [0.0, 40.0, 0.0])
    found = periodic_temperatures(thermal, heat)
    _, ends, _ = temperatures(thermal, heat, (found.winding_start, found.housing_start))
    samples = integrated(thermal, heat, [found.winding_start[0], found.housing_start[0]], dense=20000)
    assert found.winding_peak[0] > ends[0].max() + 0.1
    assert found.winding_peak[0] == pytest.approx(samples[:, 0].max(), abs=1e-4)


def test_many_motors_at_once_are_each_what_they_are_alone() -> None:
    rng = np.random.default_rng(3)
    count, n = 5000, 6  # more than one chunk
    thermal = ThermalModel(
        winding_capacity=rng.uniform(1, 20, count),
        housing_capacity=rng.uniform(20, 500, count),
        winding_resistance=rng.uniform(0.5, 5, count),
        housing_resistance=rng.uniform(1, 10, count),
        friction_share=rng.uniform(0, 1, count),
        ambient=np.full(count, 30.0),
    )
    heat = HeatCycle(
        duration=rng.uniform(0.1, 20.0, n),
        copper_loss=rng.uniform(0, 90, (count, n)) * rng.uniform(0, 1, (count, 1)),
        friction_loss=rng.uniform(0, 5, (count, n)),
    )
    found = periodic_temperatures(thermal, heat)
    limit = np.full(count, 155.0)
    times = time_to_limit(thermal, heat, limit)
    assert 0.05 < found.runaway.mean() < 0.95 and 0.05 < np.isinf(times).mean() < 0.95
    for k in (0, 7, 4095, 4096, 4999):
        one = slice(k, k + 1)
        alone = periodic_temperatures(thermal[one], heat[one])
        np.testing.assert_allclose(alone.winding_peak, found.winding_peak[one], rtol=1e-12)
        np.testing.assert_allclose(alone.growth, found.growth[one], rtol=1e-9)
        np.testing.assert_allclose(time_to_limit(thermal[one], heat[one], limit[one]), times[one], rtol=1e-9)
    assert periodic_temperatures(thermal[:0], heat[:0]).winding_peak.shape == (0,)


# ---- the time from cold to a limit


@settings(deadline=None, max_examples=10)
@given(settling(), st.floats(0.05, 1.3))
def test_the_winding_has_the_limit_at_the_time_found_and_not_before(
    drawn: tuple[ThermalModel, HeatCycle], share: float
) -> None:
    thermal, heat = drawn
    ambient, peak = float(thermal.ambient[0]), float(periodic_temperatures(thermal, heat).winding_peak[0])
    assume(peak < 1000.0)
    limit = ambient + share * (peak - ambient)
    time = float(time_to_limit(thermal, heat, np.array([limit]))[0])
    if share > 1.0 + 1e-9:
        assert math.isinf(time)
        return
    assume(share < 1.0 - 1e-6)
    whole, rest = divmod(time, heat.period)
    assume(whole * len(heat.duration) < 500)
    durations = np.tile(heat.duration, int(whole) + 1)
    ends = np.cumsum(durations)
    last = int(np.searchsorted(ends, time))
    durations = np.append(durations[:last], time - (ends[last - 1] if last else 0.0))
    many = heat.repeated(int(whole) + 1)
    until = HeatCycle(
        duration=durations, copper_loss=many.copper_loss[:, : last + 1], friction_loss=many.friction_loss[:, : last + 1]
    )
    _, winding, _ = temperatures(thermal, until)
    assert winding[0, -1] == pytest.approx(limit, abs=1e-6) and winding[0, :-1].max() <= limit + 1e-6
    _, earlier, _ = temperatures(thermal, until.divided(20))
    assert earlier[0, :-1].max() <= limit + 1e-6
    assert 0.0 <= rest <= heat.period


def test_a_limit_reached_where_the_winding_is_hottest_inside_an_interval_is_found_before_that() -> None:
    """Friction heats the housing; then the winding rises above it, and falls with it."""
    thermal, heat = model((5.0, 100.0), (1.0, 4.0)), cycle([300.0, 900.0], [0.0, 5.0], [20.0, 0.0])
    fine = heat.divided(20_000)
    time, winding, _ = temperatures(thermal, fine)
    top = int(np.argmax(winding[0]))
    assert 310.0 < time[top] < 400.0 and winding[0, -1] < winding[0, top] - 10.0, "hottest inside the second interval"
    for below in (0.01, 1.0, 5.0):
        limit = float(winding[0, top]) - below
        first = int(np.argmax(winding[0] >= limit))
        assert 300.0 < time[first] < time[top]
        found = float(time_to_limit(thermal, heat, np.array([limit]))[0])
        assert time[first - 1] - 1e-9 <= found <= time[first] + 1e-9


def test_limits_at_the_ambient_and_beyond_the_peak() -> None:
    thermal, heat = model((5.0, 100.0), (1.0, 4.0), count=3), cycle([1.0, 2.0], [[8.0, 1.0]] * 3)
    peak = periodic_temperatures(thermal, heat).winding_peak[0]
    times = time_to_limit(thermal, heat, np.array([25.0, peak + 1e-6, peak - 1e-6]))
    assert times[0] == 0.0 and math.isinf(times[1]) and 1000.0 < times[2] < 1e5
    assert time_to_limit(thermal, heat, np.array([20.0, np.nan, 30.0]))[0] == 0.0
    assert np.isnan(time_to_limit(thermal, heat, np.array([20.0, np.nan, 30.0]))[1])


def test_a_limit_that_is_reached_after_many_cycles() -> None:
    """A cycle of 10 ms, a limit that takes hours: the count of cycles goes into the millions."""
    thermal, heat = model((50.0, 5000.0), (1.0, 2.0)), cycle([0.004, 0.006], [20.0, 5.0])
    mean = 0.4 * 20.0 + 0.6 * 5.0
    steady, _ = thermal.steady_temperatures(np.array([mean]), np.zeros(1))
    limit = 25.0 + 0.99 * (steady - 25.0)
    found = float(time_to_limit(thermal, heat, limit)[0])
    smooth = float(time_to_limit(thermal, cycle([1.0], [mean]), limit)[0])
    assert found / 0.01 > 1e6 and found == pytest.approx(smooth, rel=1e-3)


def test_the_map_of_two_cycles_is_the_map_twice() -> None:
    thermal, heat = model((5.0, 100.0), (1.0, 4.0)), cycle([10.0, 20.0], [8.0, 1.0])
    one = CyclePath.of(thermal, heat).map
    two = CyclePath.of(thermal, heat.repeated(2)).map
    assert one.doubled().matrix == pytest.approx(two.matrix, rel=1e-12)
    assert one.doubled().shift == pytest.approx(two.shift, rel=1e-12)
