"""The continuous torque over speed, against makers' figures, the transient model, and hand calculation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bellcrank.actuators import electrical
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.continuous_torque import (
    SOURCES,
    continuous_torque,
    continuous_torque_text,
    thermal_limit_torque,
)
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.product_arrays import MotorArrays
from bellcrank.actuators.thermal import ThermalModel

RPM = math.pi / 30.0
HERE = Conditions()
# maxon catalogue pages: k_M, R, R_wh, R_ha, T_max, I_0, printed nominal current, what copper loss alone permits
RE25 = (0.0234, 2.18, 3.1, 14.0, 100.0, 0.0263, 1.24, 1.248)
EC90 = (0.217, 2.3, 2.99, 1.89, 125.0, 0.13, 2.12, 2.53)
RE40 = (0.0302, 0.299, 1.93, 4.65, 155.0, 0.137, 6.0, 6.62)
EC4POLE30 = (0.0136, 0.102, 0.209, 7.4, 155.0, 0.728, 7.58, 10.54)


def motor(**figures: Any) -> Motor:
    return Motor(**{"id": "m1", "maker": "", "model": "", **figures})


def thermal_motor(row: tuple[float, ...], **figures: Any) -> Motor:
    constant, resistance, winding, housing, hottest, no_load, *_ = row
    return motor(
        torque_constant=constant,
        torque_constant_basis="dc",
        resistance=resistance,
        resistance_winding_housing=winding,
        resistance_housing_ambient=housing,
        max_winding_temperature=hottest,
        no_load_current=no_load,
        **figures,
    )


def at(one: Motor, speed: float, conditions: Conditions = HERE) -> tuple[float, str]:
    found = continuous_torque(MotorArrays.of([one]), speed, conditions)
    return float(found.torque[0]), SOURCES[int(found.source[0])]


# ---- thermal limit


@pytest.mark.parametrize("row", [RE25, EC90, RE40, EC4POLE30])
def test_copper_loss_alone_permits_the_currents_worked_out_from_the_makers_figures(row: tuple[float, ...]) -> None:
    """At standstill there is no speed-dependent loss: the current is the root of ΔT / (R_th R25 (1 + α ΔT)).

    The printed nominal current of the ironless RE 25 agrees within 1 %. Those of the others are lower, because friction
    and iron losses heat the motor at nominal speed, and brushes and magnets have limits of their own.
    """
    constant, printed, formula = row[0], row[6], row[7]
    one = MotorArrays.of([thermal_motor(row)])
    torque = thermal_limit_torque(one, 0.0, HERE)
    current = float(electrical.electrical_torque(one, torque, np.zeros(1))[0]) / constant
    assert current == pytest.approx(formula, rel=1e-3)  # three digits
    assert current >= printed
    if row is RE25:
        assert current == pytest.approx(printed, rel=0.01)


def test_the_nominal_torque_of_the_re_25_is_its_thermal_limit_at_nominal_speed() -> None:
    """maxon RE 25 (118743): 0.0286 N m at 3800 rpm; the whole of the no-load loss, 0.24 W, heats the housing."""
    one = MotorArrays.of([thermal_motor(RE25)])
    torque = float(thermal_limit_torque(one, 3800.0 * RPM, HERE)[0])
    assert torque == pytest.approx(0.0286, rel=0.03) and torque < 0.0286


def test_the_nominal_point_of_a_fast_motor_says_how_much_of_the_friction_heats_it() -> None:
    """maxon EC-4pole 30 (305013): 0.0946 N m at 16100 rpm, where the no-load loss is 16.7 W.

    All of it in the housing would take 123 K of the 130 K that are permitted, and the copper loss of the nominal torque
    takes 68 K. The share that is left makes the nominal point the thermal limit.
    """
    point = {"nominal_torque": 0.0946, "nominal_speed": 16100.0 * RPM}
    one = thermal_motor(EC4POLE30, **point)
    copper = (0.0946 / 0.0136 + 0.728) ** 2 * 0.102 * (1.0 + 0.0039 * 130.0)
    share = (130.0 - 7.609 * copper) / (7.4 * 0.0136 * 0.728 * 16100.0 * RPM)
    assert one.friction_heat_share == pytest.approx(share) and 0.45 < share < 0.55
    motors = MotorArrays.of([one])
    assert float(thermal_limit_torque(motors, 16100.0 * RPM, HERE)[0]) == pytest.approx(0.0946, rel=1e-9)
    slow, nominal, fast = (at(one, speed * RPM)[0] for speed in (1000.0, 16100.0, 20000.0))
    assert slow == nominal == 0.0946 and 0.06 < fast < 0.0946
    assert thermal_motor(EC4POLE30).friction_heat_share == 1.0  # without the nominal point
    # A nominal torque that copper loss alone would not permit: no loss is left, and the maker's torque holds still.
    bold = thermal_motor(EC4POLE30, **{**point, "nominal_torque": 0.14})
    assert bold.friction_heat_share == 0.0 and at(bold, 16100.0 * RPM) == (0.14, "nominal torque")
    assert at(bold, 16101.0 * RPM)[1] == "thermal limit"
    # A nominal torque below the limit of the whole loss: the share is 1, not more.
    assert thermal_motor(EC4POLE30, **{**point, "nominal_torque": 0.02}).friction_heat_share == 1.0


@given(
    st.floats(0.0, 60.0), st.floats(0.0, 4000.0), st.floats(0.0, 900.0), st.sampled_from([RE25, EC90, RE40, EC4POLE30])
)
def test_the_thermal_limit_held_for_ever_heats_the_winding_to_its_largest_temperature(
    ambient: float, altitude: float, speed: float, row: tuple[float, ...]
) -> None:
    """The steady state of the two-body model, which has the resistance at the temperature that it finds itself."""
    conditions = Conditions(ambient=ambient, altitude=altitude)
    motors = MotorArrays.of([thermal_motor(row, time_constant_winding=10.0, time_constant_motor=500.0)])
    torque = thermal_limit_torque(motors, speed, conditions)
    model = ThermalModel.of(motors, conditions)
    loss = electrical.friction_loss(motors, np.full(1, speed))
    copper = electrical.copper_loss(motors, electrical.electrical_torque(motors, torque, np.full(1, speed)))
    winding, _ = model.steady_temperatures(copper, loss)
    hottest = row[4]
    if torque[0] > 0.0:
        assert winding[0] == pytest.approx(hottest, abs=1e-8)
    else:  # friction alone, with the current that overcomes it, is too much
        assert winding[0] >= hottest - 1e-8 or not np.isfinite(winding[0])


def test_the_housing_may_be_the_limit() -> None:
    cool = thermal_motor(EC90, max_housing_temperature=60.0)
    motors = MotorArrays.of([cool])
    torque = float(thermal_limit_torque(motors, 100.0, HERE)[0])
    assert torque < float(thermal_limit_torque(MotorArrays.of([thermal_motor(EC90)]), 100.0, HERE)[0])
    total = (60.0 - 25.0) / 1.89  # W from the housing to the air
    copper = total - 0.217 * 0.13 * 100.0
    hot = 2.3 * (1.0 + 0.0039 * 100.0)  # with the winding taken at its largest temperature, on the safe side
    assert torque == pytest.approx(0.217 * math.sqrt(copper / hot) - 0.217 * 0.13)


def test_a_motor_that_friction_alone_overheats_has_no_continuous_torque() -> None:
    assert at(thermal_motor(EC4POLE30), 1e5) == (0.0, "thermal limit")


# ---- which source counts


def test_the_printed_curve_goes_first_and_ends_at_its_last_speed() -> None:
    one = thermal_motor(RE25, nominal_torque=0.0286, continuous_curve=[(0.0, 0.03), (400.0, 0.02)])
    assert at(one, 200.0) == (pytest.approx(0.025), "printed curve")
    assert at(one, -200.0) == (pytest.approx(0.025), "printed curve")
    assert np.isnan(at(one, 400.1)[0]) and at(one, 400.1)[1] == "unknown"
    text = continuous_torque_text(one, 400.1, HERE)
    assert text == "unknown (the printed curve ends at 400 rad/s, below 400.1 rad/s)"
    stopped = motor(continuous_curve=[(0.0, 0.03), (400.0, 0.0)])
    assert at(stopped, 400.1) == (0.0, "printed curve")
    limited = motor(continuous_curve=[(0.0, 0.03), (400.0, 0.02)], max_speed=500.0)
    assert np.isnan(at(limited, 499.0)[0]) and at(limited, 501.0) == (0.0, "printed curve")


def test_a_nominal_torque_at_standstill_leaves_the_heat_of_friction_whole() -> None:
    assert thermal_motor(RE25, nominal_torque=0.0286, nominal_speed=0.0).friction_heat_share == 1.0


def test_the_thermal_limit_is_not_above_the_printed_nominal_torque() -> None:
    one = thermal_motor(EC90, nominal_torque=0.494, nominal_speed=1640 * RPM)
    assert at(one, 0.0) == (0.494, "nominal torque")
    torque, source = at(one, 400.0)  # above the nominal speed the thermal limit is known
    assert source == "thermal limit" and 0.3 < torque < 0.494
    cool = at(one, 400.0, Conditions(ambient=-40.0))
    assert cool == (0.494, "nominal torque")


def test_in_a_warm_room_the_smaller_of_thermal_limit_and_derated_nominal_torque_counts() -> None:
    slow = thermal_motor(RE25, nominal_torque=0.0286, nominal_speed=3800 * RPM)
    assert at(slow, 100.0, Conditions(ambient=45.0)) == (pytest.approx(0.0286 * 55.0 / 75.0), "nominal torque")
    # Friction takes half of the permitted rise of this motor: what is left for copper falls faster than the rise.
    fast = thermal_motor(EC4POLE30, nominal_torque=0.0946, nominal_speed=16100.0 * RPM)
    torque, source = at(fast, 16100.0 * RPM, Conditions(ambient=85.0))
    assert source == "thermal limit" and 0.01 < torque < 0.0946 * 70.0 / 130.0
    assert at(fast, 16100.0 * RPM)[0] == pytest.approx(0.0946)  # where both are the same


def test_the_nominal_torque_holds_up_to_the_nominal_speed() -> None:
    one = motor(nominal_torque=1.27, nominal_speed=314.0)
    assert at(one, 314.0) == (1.27, "nominal torque")
    assert at(one, -100.0) == (1.27, "nominal torque")
    torque, source = at(one, 314.1)
    assert math.isnan(torque) and source == "unknown"
    without = motor(nominal_torque=1.27)
    assert at(without, 0.0) == (1.27, "nominal torque")  # every nominal speed is above standstill
    assert math.isnan(at(without, 1.0)[0])
    assert math.isnan(at(motor(), 0.0)[0])


def test_the_nominal_current_gives_a_nominal_torque_that_is_not_printed() -> None:
    figures = {"torque_constant": 0.0302, "nominal_current": 6.0, "no_load_current": 0.137, "nominal_speed": 700.0}
    one = motor(**figures, torque_constant_basis="dc")
    assert at(one, 500.0) == (pytest.approx(0.0302 * (6.0 - 0.137)), "nominal torque")
    assert continuous_torque_text(one, 500.0, HERE).startswith("0.1771 N m (nominal current; ")


# ---- derating


def test_printed_torques_are_derated_with_the_temperature_rise() -> None:
    one = motor(nominal_torque=2.0, nominal_speed=300.0, reference_temperature=40.0, max_winding_temperature=140.0)
    assert at(one, 100.0, Conditions(ambient=40.0))[0] == 2.0
    assert at(one, 100.0, Conditions(ambient=20.0))[0] == 2.0  # a cool room raises nothing
    assert at(one, 100.0, Conditions(ambient=50.0))[0] == pytest.approx(1.8)
    assert at(one, 100.0, Conditions(ambient=50.0, altitude=2000.0))[0] == pytest.approx(1.62)
    assert at(one, 100.0, Conditions(altitude=3000.0))[0] == pytest.approx(1.6)
    assert at(one, 100.0, Conditions(ambient=140.0))[0] == 0.0
    assert at(one, 100.0, Conditions(ambient=150.0))[0] == 0.0
    curve = motor(
        continuous_curve=[(0.0, 2.0), (300.0, 1.0)], reference_temperature=40.0, max_winding_temperature=140.0
    )
    assert at(curve, 150.0, Conditions(ambient=50.0))[0] == pytest.approx(1.35)


def test_derating_for_the_ambient_needs_the_largest_winding_temperature() -> None:
    one = motor(nominal_torque=2.0, nominal_speed=300.0, reference_temperature=40.0)
    assert math.isnan(at(one, 100.0, Conditions(ambient=41.0))[0])
    assert at(one, 100.0, Conditions(ambient=40.0, altitude=2000.0))[0] == pytest.approx(1.8)  # this needs none
    unstated = motor(nominal_torque=2.0, nominal_speed=300.0)  # the reference counts as 25 °C
    assert at(unstated, 100.0, Conditions(ambient=25.0))[0] == 2.0
    assert math.isnan(at(unstated, 100.0, Conditions(ambient=26.0))[0])


@given(st.floats(0.0, 0.4), st.floats(41.0, 120.0))
def test_derating_in_proportion_is_on_the_safe_side(share: float, ambient: float) -> None:
    """What a motor of known losses may deliver, where friction has a share of the heat of at most r / (1 + r)."""
    ratio = (140.0 - ambient) / 100.0
    if share <= ratio / (1.0 + ratio):
        permitted = math.sqrt((ratio - share) / (1.0 - share))  # of the electrical torque at 40 °C
        assert ratio <= permitted + 1e-12


def test_the_text_says_where_the_torque_is_from_and_what_is_missing() -> None:
    one = motor(nominal_torque=2.0, nominal_speed=300.0, reference_temperature=40.0, max_winding_temperature=140.0)
    assert continuous_torque_text(one, 10.0, Conditions(ambient=50.0)) == "1.8 N m (nominal torque, derated by 0.9)"
    plain = motor(nominal_torque=2.0, nominal_speed=300.0)
    expected = "2 N m (nominal torque; its reference temperature is not stated, 25 °C is assumed)"
    assert continuous_torque_text(plain, 10.0, HERE) == expected
    assert continuous_torque_text(thermal_motor(RE25), 10.0, HERE).endswith("(thermal limit at 25 °C)")
    high = continuous_torque_text(thermal_motor(RE25), 10.0, Conditions(ambient=30.0, altitude=2000.0))
    assert high.endswith("(thermal limit at 30 °C, 2000 m)")
    expected = (
        "unknown (310 rad/s is above the nominal speed, 300 rad/s, and figures of the thermal limit are not stated)"
    )
    assert continuous_torque_text(plain, 310.0, HERE) == expected
    assert continuous_torque_text(motor(), 1.0, HERE) == (
        "unknown (neither a nominal torque nor the figures of the thermal limit are stated)"
    )
    expected = "unknown (the speed of the nominal torque is not stated)"
    assert continuous_torque_text(motor(nominal_torque=2.0), 1.0, HERE) == expected
    assert "the largest winding temperature is not stated" in continuous_torque_text(
        plain, 1.0, Conditions(ambient=30.0)
    )


def test_many_motors_and_speeds_at_once() -> None:
    rows = [thermal_motor(RE25), motor(nominal_torque=1.0, nominal_speed=100.0), motor()]
    speeds = np.array([0.0, 50.0, 150.0])
    found = continuous_torque(MotorArrays.of(rows)[:, None], speeds, HERE)
    assert found.torque.shape == (3, 3)
    one_by_one = [[at(row, speed)[0] for speed in speeds] for row in rows]
    np.testing.assert_array_equal(found.torque, one_by_one)
