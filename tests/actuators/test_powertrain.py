"""Motors with gears on an axis, against hand calculation and balances of energy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.powertrain import PowerTrains
from bellcrank.actuators.product_arrays import GearArrays, MotorArrays
from bellcrank.sizing.selection.axis_pairs import body_of

MOTOR: dict[str, Any] = {
    "torque_constant": 0.08,
    "torque_constant_basis": "dc",
    "resistance": 0.5,
    "coulomb_friction": 0.01,
    "viscous_friction": 2e-5,
    "rotor_inertia": 5e-6,
    "mass": 0.3,
}
GEAR: dict[str, Any] = {"ratio": 50.0, "efficiency": 0.8, "back_efficiency": 0.6, "inertia": 1e-6, "mass": 0.2}


def motor(**figures: Any) -> Motor:
    return Motor(**{"id": "m1", "maker": "", "model": "", **MOTOR, **figures})


def gear(**figures: Any) -> Gear:
    return Gear(**{"id": "g1", "maker": "", "model": "", "kind": "spur", **GEAR, **figures})


def test_a_geared_joint_by_hand() -> None:
    """Lifting, lowering and holding, worked out on paper; the same figures as those of `Actuator`."""
    train = PowerTrains.of(motor(), gear())
    lifting = train.load(np.array([11.31]), np.array([2.0]), np.array([3.0]))
    assert lifting.speed[0] == 100.0
    assert lifting.torque[0] == pytest.approx(11.31 / 40.0 + 6e-6 * 150.0)
    assert lifting.electrical_torque[0] == pytest.approx(lifting.torque[0] + 0.01 + 0.002)
    assert lifting.copper_loss[0] == pytest.approx(0.5 * (lifting.electrical_torque[0] / 0.08) ** 2)
    assert lifting.friction_loss[0] == pytest.approx(0.012 * 100.0)
    assert lifting.gear_loss[0] == pytest.approx(11.31 * 2.0 * (1.0 / 0.8 - 1.0))
    lowering = train.load(np.array([11.31]), np.array([-2.0]), np.array([3.0]))
    assert lowering.torque[0] == pytest.approx(11.31 * 0.6 / 50.0 + 6e-6 * 150.0)
    assert lowering.electrical_torque[0] == pytest.approx(lowering.torque[0] - 0.012)
    assert lowering.gear_loss[0] == pytest.approx(11.31 * 2.0 * 0.4)
    assert lowering.electrical_power[0] < 0.0
    held = train.load(np.array([9.81]), np.array([0.0]), np.array([0.0]))
    assert held.torque[0] == held.electrical_torque[0] == pytest.approx(9.81 / 40.0)
    assert train.reflected_inertia[0] == pytest.approx(2500 * 6e-6) and train.mass[0] == pytest.approx(0.5)


loads = st.tuples(st.floats(-50.0, 50.0), st.floats(-8.0, 8.0), st.floats(-100.0, 100.0))


@given(loads, st.floats(0.05, 1.0), st.floats(0.5, 200.0))
def test_the_shaft_bears_what_an_actuator_of_a_robot_configuration_bears(
    load: tuple[float, float, float], efficiency: float, ratio: float
) -> None:
    train = PowerTrains.of(motor(), gear(ratio=ratio, efficiency=efficiency, back_efficiency=None))
    one = Actuator(
        ratio=ratio, efficiency=efficiency, rotor_inertia=5e-6, gear_inertia=1e-6,
        rated_torque=1.0, peak_torque=1.0, rated_speed=1.0, max_speed=1.0,
    )  # fmt: skip
    arrays = [np.array([x]) for x in load]
    assert train.shaft_torque(*arrays) == pytest.approx(one.shaft_torque(*arrays), rel=1e-12, abs=1e-12)


@given(loads, st.floats(0.05, 1.0), st.floats(0.0, 1.0))
def test_power_in_is_power_out_and_losses(load: tuple[float, float, float], efficiency: float, back: float) -> None:
    """Electrical power is the axis's, the rotor's, and losses of gear, friction and copper, none of them negative."""
    torque, speed, rate = (np.array([x]) for x in load)
    train = PowerTrains.of(motor(), gear(efficiency=efficiency, back_efficiency=back))
    found = train.load(torque, speed, rate)
    kinetic = train.shaft_inertia * 50.0**2 * rate * speed
    out = torque * speed + kinetic + found.gear_loss + found.friction_loss + found.copper_loss
    assert found.electrical_power == pytest.approx(out, rel=1e-9, abs=1e-9)
    for loss in (found.gear_loss, found.friction_loss, found.copper_loss):
        assert loss[0] >= -1e-9 * float(np.abs(out[0]))


@given(loads)
def test_the_electrical_torque_is_linear_in_five_features(load: tuple[float, float, float]) -> None:
    torque, speed, rate = load
    train = PowerTrains.of(motor(), gear())
    motoring = torque * speed >= 0.0
    features = [torque * motoring, torque * (not motoring), rate, np.sign(speed), speed]
    expected = float(train.load(np.array([torque]), np.array([speed]), np.array([rate])).electrical_torque[0])
    assert float(train.electrical_coefficients[0] @ features) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_every_motor_with_every_gear_and_every_sample() -> None:
    motors = [motor(), motor(rotor_inertia=1e-5), motor(resistance=None)]
    curve = [(0.2, 0.5), (1.0, 0.8)]
    unknown = gear(efficiency=None, back_efficiency=None)
    gears = [gear(), unknown, DIRECT, gear(efficiency_curve=curve, rated_torque=20.0)]
    trains = PowerTrains(MotorArrays.of(motors)[:, None], GearArrays.of(gears)[None, :])
    samples = [np.linspace(-20.0, 20.0, 7), np.linspace(3.0, -2.0, 7), np.linspace(0.0, 9.0, 7)]
    found = trains[..., None].load(*samples)
    for i, one in enumerate(motors):
        for j, other in enumerate(gears):
            single = PowerTrains.of(one, other).load(*samples)
            for name in ("torque", "electrical_torque", "copper_loss", "gear_loss", "electrical_power"):
                np.testing.assert_array_equal(
                    np.broadcast_to(getattr(found, name), (3, 4, 7))[i, j], getattr(single, name)
                )
    assert trains.electrical_coefficients.shape == (3, 4, 5)
    assert np.isnan(found.torque[:, 1, :]).all() and np.isnan(found.copper_loss[2]).all()
    assert not np.isnan(found.torque[2, 0]).any()  # the shaft does not need the resistance


# ---- efficiency over load


def test_the_efficiency_over_load_holds_at_its_points() -> None:
    one = gear(efficiency=None, back_efficiency=None, rated_torque=20.0, efficiency_curve=[(0.25, 0.5), (1.0, 0.8)])
    train = PowerTrains.of(motor(), one)
    assert train.gear_torque(np.array([20.0]), np.array([1.0])) == pytest.approx(20.0 / (50.0 * 0.8))
    assert train.gear_torque(np.array([5.0]), np.array([1.0])) == pytest.approx(5.0 / (50.0 * 0.5))
    assert train.gear_torque(np.array([12.5]), np.array([1.0])) == pytest.approx(12.5 / (50.0 * 0.65))
    assert train.gear_torque(np.array([40.0]), np.array([1.0])) == pytest.approx(40.0 / (50.0 * 0.8))
    assert train.gear_torque(np.array([20.0]), np.array([-1.0])) == pytest.approx(20.0 * 0.8 / 50.0)
    assert train.gear_torque(np.array([-20.0]), np.array([1.0])) == pytest.approx(-20.0 * 0.8 / 50.0)
    # Below the first point the loss torque stays 5 N m (1/0.5 - 1) = 5 N m, against the motion.
    assert train.gear_torque(np.array([1.0]), np.array([1.0])) == pytest.approx(6.0 / 50.0)
    assert train.gear_torque(np.array([0.0]), np.array([1.0])) == pytest.approx(5.0 / 50.0)
    assert train.gear_torque(np.array([0.0]), np.array([-1.0])) == pytest.approx(-5.0 / 50.0)
    assert train.gear_torque(np.array([1.0]), np.array([-1.0])) == pytest.approx(
        (1.0 - 2.5) / 50.0
    )  # it must be driven
    assert train.gear_torque(np.array([0.0]), np.array([0.0])) == 0.0
    assert train.gear_torque(np.array([1.0]), np.array([0.0])) == pytest.approx(6.0 / 50.0)


@given(loads)
def test_a_gear_with_a_curve_never_makes_power(load: tuple[float, float, float]) -> None:
    torque, speed, _ = (np.array([x]) for x in load)
    one = gear(efficiency=None, rated_torque=20.0, efficiency_curve=[(0.1, 0.3), (0.5, 0.7), (1.0, 0.8)])
    train = PowerTrains.of(motor(), one)
    assert float((train.gear_torque(torque, speed) * 50.0 - torque)[0] * speed[0]) >= -1e-9 * abs(
        float((torque * speed)[0])
    )


def test_a_constant_curve_is_a_constant_efficiency_above_its_first_point() -> None:
    flat = PowerTrains.of(motor(), gear(rated_torque=20.0, efficiency_curve=[(0.01, 0.8), (1.0, 0.8)]))
    plain = PowerTrains.of(motor(), gear())
    torque, speed = np.array([-30.0, -10.0, 0.5, 5.0, 25.0]), np.array([1.0, -2.0, 2.0, -1.0, 0.5])
    assert flat.gear_torque(torque, speed) == pytest.approx(plain.gear_torque(torque, speed), rel=1e-12)


def test_a_curve_without_a_rated_torque_is_unknown() -> None:
    train = PowerTrains.of(motor(), gear(efficiency=None, efficiency_curve=[(0.1, 0.3), (1.0, 0.8)]))
    assert np.isnan(train.gear_torque(np.array([1.0]), np.array([1.0]))).all()


# ---- the body


def test_a_motor_and_its_gear_are_cylinders_one_behind_the_other() -> None:
    """Against the sum over many thin discs."""
    one = body_of(motor(diameter=0.06, length=0.08), gear(diameter=0.09, length=0.05))
    assert one is not None
    parts = ((0.3, 0.03, 0.0, 0.08), (0.2, 0.045, 0.08, 0.05))
    share = (np.arange(20000) + 0.5) / 20000
    x = np.concatenate([start + length * share for _, _, start, length in parts])
    m = np.repeat([mass / 20000 for mass, *_ in parts], 20000)
    r = np.repeat([radius for _, radius, *_ in parts], 20000)
    centre = (m * x).sum() / m.sum()
    assert one.mass == pytest.approx(0.5)
    assert one.axial_inertia == pytest.approx((m * r**2 / 2.0).sum(), rel=1e-9)
    assert one.transverse_inertia == pytest.approx((m * (r**2 / 4.0 + (x - centre) ** 2)).sum(), rel=1e-6)


def test_what_is_not_known_of_the_body_is_no_inertia() -> None:
    for one in (motor(), motor(diameter=0.06), motor(length=0.08)):  # a point mass
        found = body_of(one, DIRECT)
        assert found is not None and found.numbers.tolist() == [0.3, 0.0, 0.0]
    both = body_of(motor(diameter=0.06), gear())
    assert both is not None and both.mass == pytest.approx(0.5) and both.axial_inertia == 0.0
    half = body_of(motor(diameter=0.06, length=0.08), gear())
    assert half is not None and half.axial_inertia == pytest.approx(0.3 * 0.03**2 / 2.0)
    assert body_of(motor(mass=None), gear()) is body_of(motor(), gear(mass=None)) is None
