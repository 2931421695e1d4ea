"""Motors, gears and actuators of a machine's catalogue, by the formulas of data sheets; and motors that move several
joints together.
"""

import math

import numpy as np
import pytest
from plain_shaft import PlainShaft
from properties.dynamics import close
from properties.sizing import at_peak
from sized import SIZED

import bellcrank as bc

CONDITIONS = bc.Conditions(
    voltage=43.0, voltage_reserve=0.08, ambient=37.0, altitude=1700.0, safety_factor=1.3, winding_temperature=25.0
)
TO_DC = {"dc": 1.0, "phase_rms": math.sqrt(2.0 / 3.0), "phase_peak": 2.0 / math.sqrt(3.0)}
COUPLING = ((1.4, -0.6), (0.7, 1.9))


class Actuators:
    def test_figures_of_a_motor_follow_from_those_that_are_stated(self, catalogue):
        for motor in catalogue.motors:
            constant = TO_DC[motor.torque_constant_basis] * motor.torque_constant
            assert motor.dc_torque_constant == pytest.approx(constant, rel=1e-14)
            assert motor.motor_constant == pytest.approx(constant / math.sqrt(motor.resistance), rel=1e-14)
            assert motor.power_rate == pytest.approx(motor.nominal_torque**2 / motor.rotor_inertia, rel=1e-14)
            assert motor.nominal_acceleration == pytest.approx(motor.nominal_torque / motor.rotor_inertia, rel=1e-14)
            if motor.coulomb_friction is None:
                friction = motor.torque_constant * motor.no_load_current, 0.0
            else:
                friction = motor.coulomb_friction, motor.viscous_friction
            assert (motor.coulomb_torque, motor.viscous_coefficient) == pytest.approx(friction, rel=1e-14)
            if motor.peak_current is not None:
                assert motor.peak_electrical_torque == pytest.approx(motor.torque_constant * motor.peak_current)

    def test_three_phases_have_the_power_and_loss_of_the_direct_current(self, catalogue):
        """A star of three phases whose sinusoidal currents are in phase with the induced voltages."""
        angle = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
        phases = np.cos(angle[:, None] - 2.0 * np.pi / 3.0 * np.arange(3))
        motor = next(one for one in catalogue.motors if one.torque_constant_basis == "phase_rms")
        torque, speed = 0.8 * motor.nominal_torque, 170.0
        amplitude = math.sqrt(2.0) * torque / motor.torque_constant
        induced = 2.0 / 3.0 * torque * speed / amplitude  # of a phase, from the power of three
        power = np.mean((phases * induced * phases * amplitude).sum(axis=1))
        loss = np.mean((0.5 * motor.resistance * (phases * amplitude) ** 2).sum(axis=1))
        between = np.max(induced * (phases[:, 0] - phases[:, 1]))
        current = torque / motor.dc_torque_constant
        assert power == pytest.approx(torque * speed, rel=1e-12)
        assert loss == pytest.approx(motor.resistance * current**2, rel=1e-12)
        assert between == pytest.approx(motor.dc_torque_constant * speed, rel=1e-4)

    def test_an_actuator_of_products_has_their_limits_and_losses(self, catalogue):
        random = np.random.default_rng(11)
        complete = [motor for motor in catalogue.motors if motor.peak_torque and not motor.peak_curve]
        for motor, gear in zip(complete, [*catalogue.gears, *catalogue.gears], strict=False):
            one = bc.Actuator.of(motor, gear, CONDITIONS)
            assert (one.ratio, one.safety_factor) == (gear.ratio, 1.3)
            inertia = motor.rotor_inertia + gear.inertia
            assert one.shaft_inertia == pytest.approx(inertia, rel=1e-14)
            assert one.reflected_inertia == pytest.approx(gear.ratio**2 * inertia, rel=1e-14)
            speed = random.uniform(-1.2, 1.2, 60) * motor.max_speed / gear.ratio
            torque = random.uniform(-1.2, 1.2, 60) * motor.peak_torque * gear.ratio
            rate = random.uniform(-1.0, 1.0, 60) * motor.nominal_torque / (inertia * gear.ratio)
            expected = PlainShaft(one, torque, speed, rate, np.ones(60))
            found = one.shaft_torque(torque, speed, rate)
            close(found, expected.torque)
            close(one.curve_use(1.3 * found, gear.ratio * speed), expected.curve_use())
            close(one.supply_power(found, gear.ratio * speed), expected.supply_power())
            turning = np.linspace(0.0, 0.99 * motor.nominal_speed, 40)
            available = one.available_torque(turning)
            assert np.all(np.abs(one.curve_use(available, turning) - 1.0) <= 1e-9)
            for at in (0.0, 0.7 * motor.nominal_speed, -motor.nominal_speed, 1.3 * motor.nominal_speed):
                assert one.continuous_torque(at) == pytest.approx(float(expected.brute.s1(at)[0]), rel=1e-12)

    def test_an_actuator_of_ratings_has_the_curve_and_losses_of_its_ratings(self, sized):
        random = np.random.default_rng(12)
        for one in sized.inputs.actuators.values():
            if not one.by_ratings:
                continue
            speed = random.uniform(-1.2, 1.2, 60) * one.max_speed / one.ratio
            torque = random.uniform(-1.2, 1.2, 60) * one.peak_torque * one.ratio
            expected = PlainShaft(one, torque, speed, torque, np.ones(60))
            found = one.shaft_torque(torque, speed, torque)
            close(found, expected.torque)
            close(one.curve_use(one.safety_factor * found, one.ratio * speed), expected.curve_use())
            close(one.supply_power(found, one.ratio * speed), expected.supply_power())
            points = one.curve or ((0.0, one.peak_torque), (one.rated_speed, one.peak_torque), (one.max_speed, 0.0))
            x, y = np.array(points).T
            close(one.available_torque(one.ratio * speed), np.interp(np.abs(one.ratio * speed), x, y, right=0.0))

    def test_altitude_and_assumed_values_count_as_documented(self, catalogue):
        for altitude, share in ((0.0, 1.0), (1000.0, 1.0), (1700.0, 0.93), (4000.0, 0.7)):
            assert bc.Conditions(altitude=altitude).altitude_factor == pytest.approx(share, rel=1e-12)
        assumed = bc.Conditions(assume={"gear.efficiency": 0.66, "motor.peak_torque": 3.3})
        for row, field, value in (
            *((gear, "efficiency", 0.66) for gear in catalogue.gears),
            *((motor, "peak_torque", 3.3) for motor in catalogue.motors),
        ):
            stated = getattr(row, field)
            assert getattr(assumed.completed(row), field) == (value if stated is None else stated)
            assert dict(assumed.filled(row)) == ({field: value} if stated is None else {})

    def test_a_catalogue_is_filtered_by_what_is_asked_for(self, catalogue):
        kept = catalogue.filtered(exclude=[catalogue.motors[0].id, catalogue.gears[-1].id])
        assert kept.motors == catalogue.motors[1:] and kept.gears == catalogue.gears[:-1]
        assert catalogue.filtered(makers=["Coil"]).gears == ()
        assert catalogue.filtered(voltage=48.0).motors == catalogue.motors


class CoupledMotors:
    """Motors that move two joints of an open chain together: θ = C q, and the power is the same on both sides."""

    def test_coupled_motors_bear_the_inverse_transpose_of_the_joints_torques(self, machine, sized, plain_loads):
        joints = [joint.name for joint in sized.joints[-2:]]
        names, ratings = ["left", "right"], {"ratio": 30.0, "efficiency": 0.8, "rotor_inertia": 3e-5}
        ratings |= {"rated_torque": 1.9, "peak_torque": 7.0, "rated_speed": 300.0, "max_speed": 700.0}
        changes = SIZED[machine.sized_name] | {
            "transmissions": [{"joints": joints, "motors": names, "matrix": [list(row) for row in COUPLING]}],
            "actuators": {"left": ratings, "right": ratings | {"ratio": 41.0}},
        }
        coupled = bc.size(bc.load_scene(machine.sized_name, changes))
        matrix, k = np.array(COUPLING), len(sized.joints) - 2
        assert [motor.name for motor in coupled.motors] == names
        along = [plain_loads.along(motion, 120) for motion in sized.inputs.motions]
        for place, motor in enumerate(coupled.motors):
            torque = [(loads.torque[:, k:] @ np.linalg.inv(matrix))[:, place] for loads in along]
            speed = [loads.speed[:, k:] @ matrix[place] for loads in along]
            rate = [loads.acceleration[:, k:] @ matrix[place] for loads in along]
            assert motor.joints == tuple(joints)
            for peak, row, key, values in (
                (motor.peak_torque, np.linalg.inv(matrix)[:, place], "torque", torque),
                (motor.peak_speed, matrix[place], "speed", speed),
            ):
                there = getattr(at_peak(sized, plain_loads, peak)[0], key)[0, k:] @ row
                assert abs(peak.value) == pytest.approx(abs(there), rel=1e-8)
                assert abs(peak.value) >= max(np.abs(each).max() for each in values) * (1.0 - 1e-8)
            rms = max(loads.rms(each) for loads, each in zip(along, torque, strict=True))
            assert motor.rms_torque == pytest.approx(rms, rel=1e-5)
            shafts = [
                PlainShaft(motor.shaft.actuator, *state, loads.weight)
                for loads, *state in zip(along, torque, speed, rate, strict=True)
            ]
            assert motor.shaft.rms_torque == pytest.approx(max(one.rms for one in shafts), rel=2e-3)
            most = max(np.abs(one.torque).max() for one in shafts)
            assert most * (1.0 - 1e-8) <= motor.shaft.peak_torque.value <= 1.05 * most
        wrist = bc.CoupledTransmission(tuple(joints), tuple(names), COUPLING)
        torque, speed = along[0].torque[:, k:], along[0].speed[:, k:]
        power = (wrist.motor_torques(torque) * wrist.motor_speeds(speed)).sum(axis=1)
        close(power, (torque * speed).sum(axis=1))
