"""An actuator against hand calculation: one pendulum with a gear."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.actuator_fields import actuator_from_fields
from bellcrank.config.fields import Fields
from bellcrank.errors import InputError
from bellcrank.motion.motion import Motion
from bellcrank.robot.load import load_robot
from bellcrank.sizing.size import size

GOOD: dict[str, Any] = {
    "ratio": 50.0,
    "efficiency": 0.8,
    "rotor_inertia": 5e-6,
    "gear_inertia": 1e-6,
    "rated_torque": 0.32,
    "peak_torque": 0.95,
    "rated_speed": 300.0,
    "max_speed": 600.0,
}


def one(actuator: Actuator, load: float, speed: float, rate: float) -> float:
    return float(actuator.shaft_torque(np.array([load]), np.array([speed]), np.array([rate]))[0])


def test_pendulum_with_a_gear_by_hand() -> None:
    """2 kg at 0.5 m, ratio 50, efficiency 0.8, shaft inertia 6e-6 kg m²: every figure worked out on paper."""
    actuator = Actuator(**GOOD)
    robot = load_robot("geared_pendulum", rotor_inertia={"shoulder": actuator.reflected_inertia})
    assert actuator.reflected_inertia == pytest.approx(2500 * 6e-6)  # 0.015 kg m²

    def at(angle: float, speed: float, rate: float) -> Any:
        """A short motion whose middle row is the state; gravity torque 9.81 sin(angle), inertia 0.5 kg m²."""
        time = np.linspace(-1e-4, 1e-4, 3)
        q, v = angle + speed * time + rate * time**2 / 2, speed + rate * time
        motion = Motion(robot.joints, time, q[:, None], v[:, None], np.full((3, 1), rate))
        return size(robot, motion, {"shoulder": actuator}).joint("shoulder")

    lifting = at(np.pi / 2, 2.0, 3.0)  # 9.81 + 0.5·3 = 11.31 N m; 11.31 / (50·0.8) + 6e-6·50·3 = 0.28365 N m
    assert lifting.peak_torque == pytest.approx(11.31, rel=1e-6)
    assert lifting.shaft.peak_torque.value == pytest.approx(0.28365, rel=1e-5)
    assert lifting.peak_power == pytest.approx(22.62, rel=2e-4)
    lowering = at(np.pi / 2, -2.0, 3.0)  # the load gives power: 11.31·0.8/50 + 0.0009 = 0.18186 N m
    assert lowering.shaft.peak_torque.value == pytest.approx(0.18186, rel=1e-5)
    assert lowering.peak_regenerating_power == pytest.approx(22.62, rel=2e-4)
    held = at(np.pi / 2, 0.0, 0.0)  # standing still the motor bears the gear's losses: 9.81/40 = 0.24525 N m
    assert held.shaft.peak_torque.value == pytest.approx(0.24525, rel=1e-9)
    assert held.shaft.rms_torque == pytest.approx(0.24525, rel=1e-9)
    assert held.shaft.inertia_ratio == pytest.approx(0.5 / 0.015, rel=1e-9)
    assert held.holding_torque == pytest.approx(9.81, rel=1e-12)
    assert held.shaft.peak_speed.value == 0.0
    assert held.shaft.margins["peak torque"] == pytest.approx(1 - 0.24525 / 0.95, rel=1e-9)
    assert held.shaft.margins["continuous torque"] == pytest.approx(1 - 0.24525 / 0.32, rel=1e-9)
    # The same load without the actuator's rotor in the robot gives the same figures.
    bare = load_robot("geared_pendulum")
    row = np.array([[np.pi / 2]] * 2), np.full((2, 1), 0.0), np.full((2, 1), 0.0)
    again = size(bare, Motion(bare.joints, np.array([0.0, 1.0]), *row), {"shoulder": actuator}).joint("shoulder")
    assert again.shaft is not None and again.shaft.peak_torque.value == pytest.approx(0.24525, rel=1e-9)


@given(st.floats(-100, 100), st.floats(-10, 10), st.floats(0.05, 1.0), st.floats(0.1, 200))
def test_a_gear_never_makes_power(load: float, speed: float, efficiency: float, ratio: float) -> None:
    actuator = Actuator(**{**GOOD, "ratio": ratio, "efficiency": efficiency, "rotor_inertia": 0.0, "gear_inertia": 0.0})
    shaft = one(actuator, load, speed, 0.0) * ratio * speed
    assert shaft >= load * speed - 1e-9 * abs(load * speed) - 1e-300  # half of the least number is zero
    electric = float(Actuator(**{**GOOD, "motor_efficiency": 0.9}).electrical_power(np.array([shaft]))[0])
    assert electric >= shaft


def test_the_default_curve_is_flat_to_rated_speed_and_then_falls_to_zero() -> None:
    actuator = Actuator(**GOOD)
    speeds = np.array([0.0, 300.0, -300.0, 450.0, 600.0, 601.0])
    np.testing.assert_allclose(actuator.available_torque(speeds), [0.95, 0.95, 0.95, 0.475, 0.0, 0.0])
    flat = Actuator(**{**GOOD, "max_speed": 300.0})
    np.testing.assert_allclose(flat.available_torque(np.array([299.0, 301.0])), [0.95, 0.0])


shares = st.floats(0.01, 1.0) | st.just(0.0)
curves = st.lists(st.tuples(st.floats(0.5, 50), shares), min_size=1, max_size=4)
torques = st.floats(0.001, 3) | st.floats(-3, -0.001) | st.just(0.0)


@given(curves, torques, st.floats(-150, 150))
def test_use_of_the_curve_says_inside_exactly_when_the_torque_is_available(
    steps: Any, torque: float, speed: float
) -> None:
    points = [(0.0, 2.0)]
    for width, share in steps:
        points.append((points[-1][0] + width, points[-1][1] * share))
    actuator = Actuator(**{**GOOD, "curve": tuple(points)})
    use = float(actuator.curve_use(np.array([torque]), np.array([speed]))[0])
    assert np.isfinite(use) and use >= 0.0
    if abs(use - 1.0) > 1e-6:
        inside = abs(speed) <= points[-1][0] and abs(torque) <= actuator.available_torque(np.array([speed]))[0]
        assert (use < 1.0) == inside
    # Twice as far out along the same ray is twice the use.
    double = float(actuator.curve_use(np.array([2 * torque]), np.array([2 * speed]))[0])
    assert double == pytest.approx(2 * use, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ratio": 0}, "actuators.shoulder.ratio: expected more than 0"),
        ({"efficiency": 1.2}, "at most 1"),
        ({"rated_speed": "3 kg"}, "expected a number in rad/s"),
        ({"rotor_inertia": -1}, "0 kg m.2 or more"),
        ({"peak_torque": 0.1}, "at least the rated torque"),
        ({"max_speed": 10}, "at least the rated speed"),
        ({"safety_factor": 0.5}, "'safety_factor': expected a finite number of at least 1"),
        ({"efficency": 0.5}, "did you mean 'efficiency'"),
        ({"curve": [[0, 1]]}, "at least two"),
        ({"curve": [[0, 1], [0, 0.5]]}, "start at 0 and rise"),
        ({"curve": [[0, 1], [5, 2]]}, "do not rise"),
        ({"curve": [[0, 1, 2]]}, "2 numbers"),
        ({"rated_torque": ".nan"}, "N m"),
        ({"motor_efficiency": 0}, "more than 0"),
    ],
)
def test_impossible_drives_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        actuator_from_fields(Fields(GOOD | change, "x.yaml", "actuators.shoulder"))


def test_units_of_a_card_are_read() -> None:
    actuator = actuator_from_fields(
        Fields(GOOD | {"rated_speed": "3000 rpm", "max_speed": "6000 rpm", "rotor_inertia": "60 g cm^2"})
    )
    assert actuator.rated_speed == pytest.approx(314.159265) and actuator.rotor_inertia == pytest.approx(6e-6)


def test_a_drive_that_holds_its_load_at_rest_carries_the_gears_losses_and_every_speed_has_a_direction() -> None:
    actuator = Actuator(**GOOD)
    held = [one(actuator, 20.0, speed, 0.0) for speed in (0.0, -0.0, 1e-30, 1e-3)]
    assert held == [20.0 / (50.0 * 0.8)] * 4
    given_back = [one(actuator, 20.0, speed, 0.0) for speed in (-1e-30, -1e-3)]  # the limit from one side of a reversal
    assert given_back == pytest.approx([20.0 * 0.8 / 50.0] * 2, rel=1e-15)
