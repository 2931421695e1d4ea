"""Motors: what a row may hold, and figures that follow from it, against waveforms and makers' printed figures."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bellcrank.actuators import electrical
from bellcrank.actuators.catalogue.catalogue import load_catalogue
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.product_arrays import MotorArrays
from bellcrank.errors import InputError


def motor(**figures: Any) -> Motor:
    return Motor(**{"id": "m1", "maker": "", "model": "", **figures})


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [
        ("mass", -1.0, "motor 'm1': argument 'mass': expected a finite number of more than 0 and at most 1e+100"),
        ("mass", math.nan, "motor 'm1': argument 'mass': expected a finite number"),
        ("resistance", math.inf, "motor 'm1': argument 'resistance': expected a finite number"),
        ("rotor_inertia", 0.0, "argument 'rotor_inertia': expected a finite number of more than 0"),
        ("nominal_torque", "3", "argument 'nominal_torque': expected a finite number of more than 0"),
        ("nominal_torque", True, "argument 'nominal_torque'"),
        ("coulomb_friction", -0.1, "argument 'coulomb_friction': expected a finite number of at least 0"),
        ("max_efficiency", 1.01, "argument 'max_efficiency': expected a finite number of more than 0 and at most 1,"),
        ("max_winding_temperature", -300.0, "argument 'max_winding_temperature': expected a finite number"),
        ("pole_pairs", 2.5, "argument 'pole_pairs': expected a whole number, found 2.5"),
        ("kind", "servos", "argument 'kind': unknown choice 'servos'; did you mean 'servo'?"),
        ("kind", None, "argument 'kind': expected one of 'motor'"),
        ("torque_constant_basis", "rms", "argument 'torque_constant_basis': unknown choice 'rms'"),
        ("maker", 3, "motor 'm1': argument 'maker': expected a text, found 3"),
        ("id", "", "a motor: argument 'id': expected a name of the row"),
        ("continuous_curve", [(0.0, 1.0)], "argument 'continuous_curve': expected at least two points"),
        ("continuous_curve", "0 1", "argument 'continuous_curve': expected at least two points"),
        ("continuous_curve", [(0.0, 1.0), (1.0, 1.0, 1.0)], "argument 'continuous_curve': expected 2 numbers"),
        ("continuous_curve", [(1.0, 1.0), (2.0, 1.0)], "a first point at speed 0 with a torque of more than 0"),
        ("peak_curve", [(0.0, 0.0), (2.0, 1.0)], "a first point at speed 0 with a torque of more than 0"),
        ("peak_curve", [(0.0, 1.0), (2.0, 1.0), (1.0, 0.5)], "first numbers of 0 or more that rise"),
        ("peak_curve", [(0.0, 1.0), (2.0, -1.0)], "second numbers of 0 or more, found -1"),
        ("peak_curve", [(0.0, 1.0), (1.0, 1.0), (2.0, 2.1)], "do not rise faster than in proportion to the speed"),
    ],
)  # fmt: skip
def test_a_row_with_an_impossible_figure_is_refused(field: str, value: Any, text: str) -> None:
    with pytest.raises(InputError) as error:
        motor(**{field: value})
    assert text in str(error.value)


def test_the_largest_winding_temperature_is_above_the_reference() -> None:
    with pytest.raises(
        InputError, match=r"'max_winding_temperature': expected more than the reference temperature, 40 °C"
    ):
        motor(reference_temperature=40, max_winding_temperature=40)


def test_numbers_become_floats_and_points_tuples() -> None:
    one = motor(mass=np.float32(0.5), pole_pairs=7, peak_curve=[[0, 2], [10, 1]])
    assert (one.mass, one.pole_pairs, one.peak_curve) == (0.5, 7.0, ((0.0, 2.0), (10.0, 1.0)))
    assert type(one.mass) is float and type(one.pole_pairs) is float
    assert one == motor(mass=0.5, pole_pairs=7.0, peak_curve=((0.0, 2.0), (10.0, 1.0)))


def test_what_is_not_stated_stays_unknown() -> None:
    one = motor(torque_constant=0.5)  # without its basis
    assert one.dc_torque_constant is None and one.motor_constant is None
    assert one.coulomb_torque is None and one.viscous_coefficient is None
    assert one.continuous_torque is None and one.peak_electrical_torque is None and one.power_rate is None
    arrays = MotorArrays.of([one])
    assert np.isnan(arrays.dc_torque_constant).all() and np.isnan(arrays.nominal_torque).all()
    assert motor(coulomb_friction=0.1).coulomb_torque is None  # the part that grows with speed is not known
    # Without the basis it is not known whether currents are on it.
    currents = motor(torque_constant=0.5, no_load_current=0.1, nominal_current=1.0, peak_current=4.0)
    assert currents.coulomb_torque is None and currents.continuous_torque is None
    assert currents.peak_electrical_torque is None


# ---- the DC equivalent of a sinusoidal motor, against the waveforms of its three phases


@pytest.mark.tier2
@given(st.floats(0.01, 2.0), st.floats(0.05, 5.0), st.floats(0.5, 40.0), st.floats(1.0, 500.0), st.integers(1, 20))
def test_the_dc_equivalent_has_the_loss_and_the_voltage_of_three_phases(
    flux: float, phase_resistance: float, amplitude: float, speed: float, pole_pairs: int
) -> None:
    """A star-connected motor in time: flux linkage of a phase ψ cos θ, current in phase with the induced voltage."""
    inductance = 1e-3 * phase_resistance  # of a phase, with its share of the other phases'
    angle = np.linspace(0.0, 2.0 * np.pi, 3601)[:-1]  # electrical
    phases = angle[:, None] - 2.0 * np.pi / 3.0 * np.arange(3)
    omega = pole_pairs * speed
    induced = omega * flux * np.cos(phases)
    current = amplitude * np.cos(phases)
    torque = (induced * current).sum(axis=1) / speed
    assert torque == pytest.approx(torque.mean(), rel=1e-9)
    torque = torque.mean()
    loss = (phase_resistance * current**2).sum(axis=1).mean()
    without = phase_resistance * current + induced
    with_inductance = without - omega * inductance * amplitude * np.sin(phases)

    def between_lines(voltage: Any) -> float:
        return float(np.abs(voltage - np.roll(voltage, 1, axis=1)).max())

    figures = {"resistance": 2.0 * phase_resistance, "inductance": 2.0 * inductance, "pole_pairs": pole_pairs}
    rms = motor(torque_constant=torque / (amplitude / math.sqrt(2.0)), torque_constant_basis="phase_rms", **figures)
    peak = motor(torque_constant=torque / amplitude, torque_constant_basis="phase_peak", **figures)
    assert rms.dc_torque_constant == pytest.approx(peak.dc_torque_constant, rel=1e-12)
    motors = MotorArrays.of([rms, peak])
    assert electrical.copper_loss(motors, torque) == pytest.approx([loss] * 2, rel=1e-9)
    # The largest sample of a sine is within 1e-6 of its amplitude.
    assert electrical.voltage(motors, torque, speed) == pytest.approx([between_lines(without)] * 2, rel=2e-6)
    found = electrical.voltage_with_inductance(motors, torque, speed)
    assert found == pytest.approx([between_lines(with_inductance)] * 2, rel=2e-6)
    assert electrical.electrical_power(motors, torque, speed) == pytest.approx([loss + torque * speed] * 2, rel=1e-9)


def test_an_actuator_turns_its_motor_by_the_ratio() -> None:
    figures = {"torque_constant": 6.0, "torque_constant_basis": "phase_rms", "inductance": 1e-3, "pole_pairs": 7}
    assert motor(kind="actuator", ratio=50, **figures).reactance_per_speed == pytest.approx(50 * 7 * 1e-3)
    assert motor(kind="actuator", **figures).reactance_per_speed is None
    assert motor(kind="servo", **figures).reactance_per_speed == pytest.approx(7e-3)
    assert motor(**{**figures, "torque_constant_basis": "dc"}).reactance_per_speed is None


# ---- printed figures

MECHANICAL_TIME_CONSTANTS = [  # maxon catalogue pages: torque constant, resistance, rotor inertia, time constant
    ("EC 45 flat 70 W, 24 V", 0.0404, 0.573, 1.81e-5, 0.00635),
    ("EC 90 flat 90 W, 24 V", 0.0705, 0.363, 3.06e-4, 0.0223),
    ("EC 90 flat 90 W, 48 V", 0.217, 2.3, 3.06e-4, 0.0149),
    ("EC-4pole 30 200 W, 24 V", 0.0136, 0.102, 3.33e-6, 0.00182),
    ("EC 45 flat 50 W, 24 V", 0.036, 0.942, 1.35e-5, 0.00979),
]


@pytest.mark.parametrize(("name", "constant", "resistance", "inertia", "printed"), MECHANICAL_TIME_CONSTANTS)
def test_the_motor_constant_gives_the_printed_mechanical_time_constant(
    name: str, constant: float, resistance: float, inertia: float, printed: float
) -> None:
    one = motor(torque_constant=constant, torque_constant_basis="dc", resistance=resistance, rotor_inertia=inertia)
    assert one.motor_constant is not None
    assert inertia / one.motor_constant**2 == pytest.approx(printed, rel=0.01), name  # figures of three digits


@pytest.mark.parametrize(
    ("torque", "inertia", "power_rate", "acceleration"),
    [(1.27, 4.86e-5, 33.1e3, 26100.0), (1.91, 8.0e-5, 45.6e3, 23800.0), (0.637, 2.63e-5, 15.4e3, 24200.0)],
)
def test_the_printed_power_rates_of_yaskawa_motors(
    torque: float, inertia: float, power_rate: float, acceleration: float
) -> None:
    """Yaskawa SGM7J-04A, -06A, -02A, ratings of the servomotors (manual of the sigma-7 series); three digits printed.

    The printed accelerations and power rates are of inertias and torques that are rounded themselves.
    """
    one = motor(nominal_torque=torque, rotor_inertia=inertia)
    assert one.power_rate == pytest.approx(power_rate, rel=0.005)
    assert one.nominal_acceleration == pytest.approx(acceleration, rel=0.005)


def test_the_no_load_current_gives_the_friction_and_the_nominal_current_the_torque() -> None:
    """maxon EC 45 flat 70 W, 24 V: k_M (I_n - I_0) is the nominal torque 0.134 N m but for iron losses and rounding."""
    figures = {
        "torque_constant": 0.0404,
        "torque_constant_basis": "dc",
        "no_load_current": 0.27,
        "nominal_current": 3.29,
    }
    one = motor(**figures)
    assert one.coulomb_torque == pytest.approx(0.0404 * 0.27)
    assert one.continuous_torque == pytest.approx(0.0404 * (3.29 - 0.27))
    assert one.continuous_torque == pytest.approx(0.134, rel=0.1)
    assert motor(**figures, nominal_torque=0.134).continuous_torque == 0.134
    # The no-load current of a sinusoidal motor is on the basis of its torque constant, not of the DC equivalent.
    assert motor(**{**figures, "torque_constant_basis": "phase_rms"}).coulomb_torque == pytest.approx(0.0404 * 0.27)
    # With both friction figures the no-load current is not used.
    both = motor(**figures, coulomb_friction=0.01, viscous_friction=1e-4, nominal_speed=400.0)
    assert (both.coulomb_torque, both.viscous_coefficient) == (0.01, 1e-4)
    assert both.continuous_torque == pytest.approx(0.0404 * 3.29 - 0.01 - 0.04)
    assert motor(**figures, coulomb_friction=0.01, viscous_friction=1e-4).continuous_torque is None  # at which speed?


def test_a_stated_voltage_constant_is_the_back_emf_and_leaves_losses_alone():
    figures = {"torque_constant": 50.0, "torque_constant_basis": "phase_rms", "resistance": 3.0}
    plain, stated = motor(**figures), motor(**figures, voltage_constant=49.0)
    assert plain.dc_voltage_constant == plain.dc_torque_constant == pytest.approx(50.0 * math.sqrt(2.0 / 3.0))
    assert stated.dc_torque_constant == plain.dc_torque_constant and stated.dc_voltage_constant == 49.0
    arrays = MotorArrays.of([plain, stated])
    torque, speed = 20.0, 3.0
    drops = electrical.voltage(arrays, np.full(2, torque), np.full(2, speed))
    ohmic = 3.0 * torque / plain.dc_torque_constant
    assert drops == pytest.approx([ohmic + plain.dc_torque_constant * speed, ohmic + 49.0 * speed], rel=1e-12)
    assert len(set(electrical.copper_loss(arrays, np.full(2, torque)))) == 1


def test_the_back_emf_of_a_printed_actuator_is_that_of_its_motor_at_every_speed():
    # Harmonic Drive CHA-25A: 37 V rms per 1000 rpm of the motor, line to line; 100:1; largest output speed 56 rpm.
    (actuator,) = [one for one in load_catalogue().motors if one.id == "hd_cha_25a_100"]
    arrays = MotorArrays.of([actuator])
    found = electrical.voltage(arrays, np.zeros(1), np.array([56.0 * math.pi / 30.0]))
    assert found == pytest.approx(math.sqrt(2.0) * 37.0 * 5.6, rel=1e-4)
    assert actuator.dc_voltage_constant > actuator.dc_torque_constant, "the torque constant has the gear's losses in it"
