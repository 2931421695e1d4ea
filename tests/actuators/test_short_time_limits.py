"""The region of short-time operation, point by point and in four quadrants."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from bellcrank.actuators import electrical
from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.product_arrays import Curves, MotorArrays
from bellcrank.actuators.short_time_limits import (
    SpeedTorqueLimit,
    curve_use,
    peak_curve_use,
    peak_curves,
    short_time_limits,
    voltage_limit_source,
)

# maxon EC 45 flat 70 W, 24 V (651614): catalogue page
EC45: dict[str, Any] = {
    "torque_constant": 0.0404,
    "torque_constant_basis": "dc",
    "resistance": 0.573,
    "no_load_current": 0.27,
    "nominal_voltage": 24.0,
    "no_load_speed": 586.4,  # 5600 rpm
    "stall_torque": 1.69,
    "max_speed": 1047.2,
}
HERE = Conditions(voltage_reserve=0.0)


def motor(**figures: Any) -> Motor:
    return Motor(**{"id": "m1", "maker": "", "model": "", **figures})


def limits(one: Motor, conditions: Conditions = HERE) -> dict[tuple[str, str], SpeedTorqueLimit]:
    return {(limit.name, limit.basis): limit for limit in short_time_limits(MotorArrays.of([one]), conditions)}


def use(one: Motor, name: str, basis: str, torque: float, speed: float, conditions: Conditions = HERE) -> float:
    return float(limits(one, conditions)[name, basis].use(np.array(torque), np.array(speed))[0])


def test_a_motor_runs_at_its_no_load_speed_at_the_limit_of_its_voltage() -> None:
    """At the printed no-load speed the torque is that of the no-load current, and the voltage the nominal one."""
    friction = 0.0404 * 0.27
    assert use(motor(**EC45), "voltage limit", "electrical", friction, 586.4) == pytest.approx(1.0, rel=0.01)
    assert use(motor(**EC45), "voltage limit", "electrical", 1.69, 0.0) == pytest.approx(1.0, rel=0.01)  # stall


@given(st.floats(-2.0, 2.0), st.floats(-1200.0, 1200.0), st.floats(5.0, 80.0), st.floats(0.0, 0.5))
def test_the_voltage_limit_is_the_voltage_over_the_usable_one_in_four_quadrants(
    torque: float, speed: float, bus: float, reserve: float
) -> None:
    conditions = Conditions(voltage=bus, voltage_reserve=reserve)
    voltage = 0.573 * torque / 0.0404 + 0.0404 * speed
    expected = abs(voltage) / (bus * (1.0 - reserve))
    assert use(motor(**EC45), "voltage limit", "electrical", torque, speed, conditions) == pytest.approx(expected)
    motors = MotorArrays.of([motor(**EC45)])
    assert float(electrical.voltage(motors, np.array(torque), np.array(speed))[0]) == pytest.approx(voltage)
    assert float(electrical.usable_voltage(motors, conditions)[0]) == pytest.approx(bus * (1.0 - reserve))


def test_braking_takes_less_voltage_than_driving() -> None:
    drive, brake = (use(motor(**EC45), "voltage limit", "electrical", torque, 500.0) for torque in (0.3, -0.3))
    assert brake < drive


def test_a_hot_winding_takes_more_voltage() -> None:
    hot = Conditions(voltage_reserve=0.0, winding_temperature=125.0)
    assert use(motor(**EC45), "voltage limit", "electrical", 1.0, 0.0, hot) == pytest.approx(
        1.39 * use(motor(**EC45), "voltage limit", "electrical", 1.0, 0.0)
    )


def test_stall_torque_and_no_load_speed_stand_in_for_an_unknown_resistance() -> None:
    known = {"nominal_voltage": 24.0, "no_load_speed": 600.0, "stall_torque": 2.0}
    one = motor(**known)
    assert voltage_limit_source(one) == "stall torque and no-load speed"
    assert np.isnan(use(one, "voltage limit", "electrical", 0.1, 100.0))
    assert use(one, "voltage limit", "shaft", 1.0, 300.0) == pytest.approx(1.0)
    assert use(one, "voltage limit", "shaft", -1.0, 300.0) == pytest.approx(0.0)
    low = Conditions(voltage=12.0, voltage_reserve=0.1)
    assert use(one, "voltage limit", "shaft", 0.5, 150.0, low) == pytest.approx(1.0 / 0.9)
    # Where the exact line is known, it alone counts.
    assert np.isnan(use(motor(**EC45), "voltage limit", "shaft", 1.0, 300.0))
    assert voltage_limit_source(motor(**EC45)) == "torque constant and resistance"
    assert voltage_limit_source(motor(stall_torque=2.0, no_load_speed=600.0)) == "unknown"
    assert voltage_limit_source(motor(nominal_voltage=24.0, stall_torque=2.0)) == "unknown"
    assert np.isnan(use(motor(), "voltage limit", "shaft", 0.1, 10.0))


def test_peak_torque_peak_current_and_speed() -> None:
    one = motor(
        peak_torque=3.0, torque_constant=0.5, torque_constant_basis="phase_rms", peak_current=8.0, max_speed=400.0
    )
    assert use(one, "peak torque", "shaft", -1.5, 100.0) == pytest.approx(0.5)
    assert use(one, "peak current", "electrical", 2.0, 100.0) == pytest.approx(0.5)  # k_t I_peak on its own basis
    assert use(one, "maximum speed", "shaft", 5.0, -100.0) == pytest.approx(0.25)
    bare = motor()
    for name, basis in (("peak torque", "shaft"), ("peak current", "electrical"), ("maximum speed", "shaft")):
        assert np.isnan(use(bare, name, basis, 0.1, 0.1))


def test_without_a_bus_voltage_each_motor_has_its_own() -> None:
    unknown = motor(**{**EC45, "nominal_voltage": None})
    assert np.isnan(use(unknown, "voltage limit", "electrical", 0.1, 10.0))
    assert use(unknown, "voltage limit", "electrical", 0.0, 10.0, Conditions(voltage=24.0)) > 0.0


# ---- printed curves

CURVE = ((0.0, 3.0), (200.0, 3.0), (300.0, 1.0), (400.0, 0.8))  # not convex


def test_the_use_of_a_printed_curve_is_the_factor_along_the_ray() -> None:
    motors = MotorArrays.of([motor(peak_curve=CURVE), motor()])
    torque, speed = np.array([1.5, 1.0, 0.5, 0.0, -3.0, 0.0]), np.array([0.0, 300.0, -150.0, 200.0, 0.0, 0.0])
    found = peak_curve_use(motors[:, None], HERE, torque, speed)
    assert found[0] == pytest.approx([0.5, 1.0, 0.5, 0.5, 1.0, 0.0])
    assert np.isnan(found[1]).all()
    assert np.isnan(peak_curve_use(motors[:1], HERE, np.array([np.nan]), np.array([1.0]))).all()


@st.composite
def falling_curves(draw: Any) -> tuple[tuple[float, float], ...]:
    count = draw(st.integers(2, 6))
    speeds = np.concatenate([[0.0], np.cumsum([draw(st.floats(1.0, 100.0)) for _ in range(count - 1)])])
    torques = sorted((draw(st.floats(0.1, 10.0)) for _ in range(count)), reverse=True)
    if draw(st.booleans()):
        torques[-1] = 0.0
    return tuple(zip(speeds.tolist(), torques, strict=True))


@given(falling_curves(), st.floats(-20.0, 20.0), st.floats(-600.0, 600.0))
def test_a_point_divided_by_its_use_is_on_the_curve(
    curve: tuple[tuple[float, float], ...], torque: float, speed: float
) -> None:
    """Independent of the formula of the use: the torque that is available at the speed, from numpy's interpolation."""
    assume(abs(torque) > 1e-3 or abs(speed) > 1e-3)
    found = float(curve_use(Curves.of([curve]), np.array([torque]), np.array([speed]))[0])
    speeds, torques = np.array(curve).T

    def inside(factor: float) -> bool:
        at = abs(speed) / factor
        return at <= speeds[-1] and abs(torque) / factor <= np.interp(at, speeds, torques)

    assert inside(found * (1.0 + 1e-9)) and not inside(found * (1.0 - 1e-9))
    # It agrees with the actuators of robot configurations, which have one curve each.
    one = Actuator(ratio=1.0, rated_torque=0.1, peak_torque=10.0, rated_speed=1.0, max_speed=600.0, curve=curve)
    assert found == pytest.approx(float(one.curve_use(np.array([torque]), np.array([speed]))[0]), rel=1e-9)


@given(st.floats(12.0, 48.0), st.floats(0.0, 1.0))
def test_at_a_lower_voltage_the_voltage_limited_part_of_a_curve_moves_exactly(bus: float, share: float) -> None:
    """A curve that is the voltage line at 48 V is the voltage line at the bus voltage."""
    figures = {**EC45, "nominal_voltage": 48.0, "torque_constant": 0.08, "resistance": 3.0}
    stall, ideal = 0.08 * 48.0 / 3.0, 48.0 / 0.08
    one = motor(**figures, peak_curve=((0.0, stall), (ideal, 0.0)))
    conditions = Conditions(voltage=bus, voltage_reserve=0.0)
    torque = share * 0.08 * bus / 3.0
    speed = (bus - 3.0 * torque / 0.08) / 0.08
    found = float(peak_curve_use(MotorArrays.of([one]), conditions, np.array([torque]), np.array([speed]))[0])
    assert found == pytest.approx(1.0, rel=1e-9)


def test_a_curve_at_another_voltage() -> None:
    one = motor(peak_curve=CURVE, nominal_voltage=48.0)
    assert peak_curves(MotorArrays.of([one]), Conditions(voltage=60.0)).last_x == 400.0  # stays as printed
    assert np.isnan(peak_curves(MotorArrays.of([one]), Conditions(voltage=47.0)).last_x).all()  # k is unknown
    unknown = motor(peak_curve=CURVE)
    assert np.isnan(peak_curves(MotorArrays.of([unknown]), Conditions(voltage=47.0)).last_x).all()
    assert peak_curves(MotorArrays.of([unknown]), Conditions()).last_x == 400.0
    low = motor(peak_curve=CURVE, nominal_voltage=48.0, torque_constant=0.1, torque_constant_basis="dc")
    motors = MotorArrays.of([low])
    moved = Conditions(voltage=38.0)  # by 100 rad/s
    assert peak_curve_use(motors, moved, np.array([1.0]), np.array([200.0])) == pytest.approx(1.0)
    assert peak_curve_use(motors, moved, np.array([1.5]), np.array([0.0])) == pytest.approx(0.5)
    nothing = Conditions(voltage=8.0)  # by 400 rad/s: no speed is left
    assert np.isinf(peak_curve_use(motors, nothing, np.array([0.1]), np.array([0.0]))).all()
