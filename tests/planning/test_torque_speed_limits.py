"""The limits of torque over speed that fastest motions keep are those by which motors are judged."""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.planning.limits.motor_limits import torque_speed_polylines

MOTOR = bc.Motor(
    id="m", maker="", model="", nominal_voltage=24.0, torque_constant=0.1, torque_constant_basis="dc", resistance=0.5,
    rotor_inertia=1e-4, coulomb_friction=0.01, viscous_friction=2e-5, peak_torque=1.45, peak_current=15.3,
    max_speed=400.0,
)  # fmt: skip


@pytest.mark.parametrize("voltage", [17.0, 24.0, 31.5, 48.0])
def test_limits_between_the_corners_are_those_of_the_motor(voltage):
    actuator = bc.Actuator.of(MOTOR, None, bc.Conditions(voltage=voltage))
    driving, braking = torque_speed_polylines(actuator)
    random = np.random.default_rng(3)
    for line, sign in ((driving, 1.0), (braking, -1.0)):
        corners = np.array(line)
        assert 2 + (sign > 0.0) <= len(corners) <= 8  # straight lines: only corners are kept, and that of the voltage
        speed = random.uniform(0.0, corners[-1, 0], 500)
        torque = np.interp(speed, *corners.T)
        some = torque > 1e-3
        use = actuator.curve_use(torque[some], sign * speed[some])
        np.testing.assert_allclose(use, 1.0, atol=1e-7)


def test_a_corner_next_to_the_largest_speed_is_kept_on_the_safe_side():
    """The voltage lowers the peak torque over the last 0.5 rad/s alone."""
    lost = 0.1 * 399.5 + (1.45 + 0.01 + 2e-5 * 399.5) * 0.5 / 0.1  # k ω + R i at the corner; 10 % are in reserve
    actuator = bc.Actuator.of(MOTOR, None, bc.Conditions(voltage=lost / 0.9))
    driving, _ = torque_speed_polylines(actuator)
    speed = np.append(np.linspace(0.0, 399.0, 100), np.linspace(399.0, 400.0, 100))
    use = actuator.curve_use(np.interp(speed, *np.array(driving).T), speed)
    np.testing.assert_allclose(use[:100], 1.0, atol=1e-7)
    assert driving[-1] == pytest.approx((400.0, 1.45 - 0.5 * (0.1 * 0.1 / 0.5 + 2e-5)))
    assert use.min() > 0.99 and use.max() < 1.0 + 1e-7
