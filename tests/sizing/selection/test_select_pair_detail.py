"""Curves of a motor and the load of a pair, for plots: against formulas written here, and each other."""

import dataclasses

import numpy as np
import pytest
from sample_selection import BARE, FULL, HARMONIC, PLANET, SILENT, STRONG, candidate, selection

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import DIRECT
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.powertrain import PowerTrains
from bellcrank.sizing.selection.criteria import cycles_of
from bellcrank.sizing.selection.load_reductions import reduce_loads
from bellcrank.sizing.selection.pair_detail import motor_curves, pair_detail, pair_details, straightened
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.thermal_criteria import peak_temperatures

NOMINAL = Conditions()


@pytest.fixture(scope="module")
def chosen():
    return selection()


def first_detail(chosen, motor, gear, conditions=None, **changes):
    """The detail of a pair on the first axis."""
    axis = chosen.axes[0] if conditions is None else dataclasses.replace(chosen.axes[0], conditions=conditions)
    return pair_detail(dataclasses.replace(chosen, **changes), axis, candidate(motor, gear, 0.5))


# ---- curves


def test_the_short_time_region_is_bounded_by_the_peak_torque_the_voltage_and_the_largest_speed():
    region = motor_curves(FULL, NOMINAL).short_time
    friction = FULL.torque_constant * FULL.no_load_current
    line = (0.9 * 320.0 - FULL.torque_constant * region[:, 0]) * FULL.torque_constant / FULL.resistance - friction
    np.testing.assert_allclose(region[1:, 2], np.minimum(17.0, line)[1:], rtol=1e-9)
    np.testing.assert_allclose(region[:, 1], -17.0)
    assert region[0, 0] == 0.0 and region[-1, 0] <= FULL.max_speed
    slow = motor_curves(dataclasses.replace(FULL, max_speed=200.0), NOMINAL).short_time
    assert slow[-1].tolist() == [200.0, -17.0, 17.0]


def test_the_voltage_line_passes_through_stall_and_no_load():
    line = motor_curves(FULL, dataclasses.replace(NOMINAL, voltage=100.0)).voltage
    at = np.interp([1e-6, 90.0 / 0.7], line[:, 0], line[:, 1]) + FULL.torque_constant * FULL.no_load_current
    np.testing.assert_allclose(at, [0.7 / 1.1 * 90.0, 0.0], atol=1e-6)


def test_what_is_not_stated_leaves_the_region_open_and_is_named():
    curves = motor_curves(Motor(id="m", maker="", model="", peak_torque=4.0), NOMINAL)
    assert curves.short_time.tolist() == [[0.0, -4.0, 4.0], [np.inf, -4.0, 4.0]]
    assert curves.unknown == ("voltage limit", "maximum speed") and curves.continuous is None and curves.voltage is None
    open_above = motor_curves(Motor(id="m", maker="", model="", max_speed=300.0), NOMINAL)
    assert open_above.short_time.tolist() == [[0.0, -np.inf, np.inf], [300.0, -np.inf, np.inf]]
    assert open_above.unknown == ("peak torque", "voltage limit")
    nothing = motor_curves(Motor(id="m", maker="", model=""), NOMINAL)
    assert nothing.short_time is None and len(nothing.unknown) == 3


def test_a_printed_peak_curve_bounds_the_region():
    motor = Motor(id="m", maker="", model="", peak_curve=((0.0, 5.0), (100.0, 5.0), (200.0, 1.0)))
    curves = motor_curves(motor, NOMINAL)
    assert curves.short_time.tolist() == [[0.0, -5.0, 5.0], [100.0, -5.0, 5.0], [200.0, -1.0, 1.0]]
    assert "peak torque" not in curves.unknown


def test_the_continuous_curve_ends_where_it_is_unknown_and_is_derated():
    assert motor_curves(BARE, NOMINAL).continuous.tolist() == [[0.0, 3.0], [300.0, 3.0]]
    without_model = dataclasses.replace(FULL, resistance_winding_housing=None)
    hot = motor_curves(without_model, dataclasses.replace(NOMINAL, ambient=60.0)).continuous
    np.testing.assert_allclose(hot, [[0.0, 5.2 * 80.0 / 115.0], [314.0, 5.2 * 80.0 / 115.0]])


def test_assumed_values_fill_what_a_motor_does_not_state():
    motor = Motor(id="m", maker="", model="", peak_torque=4.0)
    assert motor_curves(motor, Conditions(assume={"motor.max_speed": 100.0})).short_time[-1, 0] == 100.0


def test_points_on_straight_lines_are_left_out_and_no_others():
    x = np.linspace(0.0, 1.0, 101)
    bent = np.column_stack([x, np.minimum(1.0, 1.5 - x), x**2])
    kept = straightened(bent)
    assert 10 < len(kept) < 101 and [0.5, 1.0] in kept[:, :2].tolist()
    for k in (1, 2):
        error = np.interp(x, kept[:, 0], kept[:, k]) - bent[:, k]
        assert np.abs(error).max() <= 1.0001e-4 * np.ptp(bent[:, k])


# ---- loads


@pytest.mark.parametrize("gear", [HARMONIC, PLANET, DIRECT], ids=lambda gear: gear.id)
def test_the_load_at_the_shaft_is_that_of_the_power_train_and_its_mean_square_that_of_the_cycle(chosen, gear):
    detail = first_detail(chosen, FULL, gear)
    assert detail.shaft.left_out == ()
    for cycle, seen in zip(chosen.cycles, detail.cycles, strict=True):
        torque, speed, acceleration = cycle.torque[:, 0], cycle.speed[:, 0], cycle.acceleration[:, 0]
        expected = 1.2 * PowerTrains.of(FULL, gear).load(torque, speed, acceleration).torque
        np.testing.assert_allclose(seen.torque, expected, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(seen.speed, gear.ratio * speed, rtol=1e-12)
        time, squared = cycle.time, expected**2
        assert seen.rms_torque == pytest.approx(np.sqrt(np.trapezoid(squared, time) / cycle.duration), rel=2e-3)
        assert seen.mean_speed == pytest.approx(np.trapezoid(abs(seen.speed), time) / cycle.duration, rel=2e-3)


def test_an_unknown_efficiency_and_inertia_are_left_out_and_named(chosen):
    detail = first_detail(chosen, FULL, SILENT)
    assert detail.shaft.left_out == ("gear efficiency", "gear inertia")
    cycle, seen = chosen.cycles[0], detail.cycles[0]
    ideal = 1.2 * (cycle.torque[:, 0] / 80.0 + 4e-4 * 80.0 * cycle.acceleration[:, 0])
    np.testing.assert_allclose(seen.torque, ideal, rtol=1e-12, atol=1e-12)
    assert seen.rms_torque is None and seen.temperature is None and not seen.runaway
    assert detail.temperature_text == "Unknown: not stated: gear efficiency, gear inertia."
    conditions = Conditions(assume={"gear.efficiency": 0.7, "gear.inertia": 1e-5})
    known = first_detail(chosen, FULL, SILENT, conditions=conditions)
    assert known.shaft.left_out == () and known.cycles[0].rms_torque is not None


def test_a_gear_without_a_ratio_has_no_load(chosen):
    detail = first_detail(chosen, FULL, dataclasses.replace(SILENT, ratio=None))
    assert np.isnan(detail.shaft.ratio) and detail.cycles[0].rms_torque is None
    assert "ratio" in detail.temperature_text


def test_details_of_many_pairs_are_those_of_each(chosen):
    axis = chosen.axes[1]
    for many, one in zip(pair_details(chosen, axis, axis.candidates), axis.candidates, strict=True):
        alone = pair_detail(chosen, axis, one)
        assert many.shaft.left_out == alone.shaft.left_out and many.temperature_text == alone.temperature_text
        for a, b in zip(many.cycles, alone.cycles, strict=True):
            np.testing.assert_allclose(a.torque, b.torque, rtol=1e-12)
            assert (a.temperature is None) == (b.temperature is None)
            if a.temperature is not None:
                np.testing.assert_allclose(a.temperature, b.temperature, rtol=1e-10)


# ---- temperatures


def test_temperatures_return_to_themselves_and_balance_the_heat(chosen):
    """In the periodic state the mean heat flow through the housing is the mean loss."""
    conditions = chosen.conditions
    detail = first_detail(chosen, STRONG, HARMONIC)
    for cycle, seen in zip(chosen.cycles, detail.cycles, strict=True):
        time, winding, housing = seen.temperature.T
        assert abs(winding[-1] - winding[0]) < 1e-9 and abs(housing[-1] - housing[0]) < 1e-9
        friction = STRONG.torque_constant * STRONG.no_load_current
        torque = seen.torque + 1.2 * friction * np.sign(seen.speed)  # the safety factor is on the whole current
        copper = STRONG.resistance * (torque / STRONG.torque_constant) ** 2
        factor = 1.0 + 0.0039 * (np.interp(cycle.time, time, winding) - 25.0)
        loss = copper * factor + STRONG.friction_heat_share * friction * np.abs(seen.speed)
        mean = cycle.weight @ loss / cycle.duration
        flow = (np.trapezoid(housing, time) / time[-1] - conditions.ambient) / STRONG.resistance_housing_ambient
        assert flow == pytest.approx(mean, rel=2e-3)


def test_temperatures_are_those_of_the_criterion(chosen):
    for axis in range(2):
        for motor, gear in ((FULL, HARMONIC), (STRONG, PLANET)):
            detail = pair_detail(chosen, chosen.axes[axis], candidate(motor, gear, 0.5))
            pair = Pairs.possible([motor], [gear]).take(np.array([1]))
            assert pair.rows(0) == (motor, gear)
            loads = reduce_loads(tuple(one.axis for one in chosen.axes), chosen.cycles)[axis]
            for ((_, _, cycles),) in (cycles_of(pair, loads, chosen.conditions),):
                peaks = [peak_temperatures(pair, cycle, chosen.conditions)[0, :2] for cycle in cycles]
            for peak, seen in zip(peaks, detail.cycles, strict=True):
                np.testing.assert_allclose(seen.temperature[:, 1:].max(axis=0), peak, atol=0.05)


def test_runaway_is_said(chosen):
    weak = dataclasses.replace(FULL, resistance=40.0)
    detail = first_detail(chosen, weak, HARMONIC)
    assert detail.cycles[0].runaway and detail.cycles[0].temperature is None
    assert detail.temperature_text.startswith("Thermal runaway: in swing")


def test_a_long_duty_cycle_is_shown_whole(chosen):
    cycle = chosen.cycles[0]
    (part,) = cycle.sequence
    passes = 200
    long = dataclasses.replace(
        cycle, duration=cycle.duration * passes, weight=cycle.weight * passes, sequence=((part[0], part[1], passes),)
    )
    once, often = (first_detail(chosen, FULL, HARMONIC, cycles=(each,)).cycles[0].temperature for each in (cycle, long))
    assert often[-1, 0] == pytest.approx(passes * once[-1, 0]) and len(often) <= 501
    assert often[:, 1].max() == pytest.approx(once[:, 1].max(), abs=0.2)
