"""An actuator of a motor and a gear: its figures follow from theirs, and what they do not state stays unknown."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.actuator_fields import actuator_data, actuator_from_fields
from bellcrank.actuators.catalogue.catalogue import load_catalogue
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.short_time_limits import ShortTimeRegion
from bellcrank.config.fields import Fields
from bellcrank.errors import InputError

# Round figures for hand calculation: k = 0.1 N m/A, R = 0.5 Ω, T_c = k I_0 = 0.01 N m.
MOTOR = Motor(
    id="m", maker="A", model="M", nominal_voltage=24.0, torque_constant=0.1, torque_constant_basis="dc",
    resistance=0.5, no_load_current=0.1, rotor_inertia=5e-5, nominal_torque=0.5, nominal_speed=150.0, peak_torque=1.5,
    max_speed=400.0, mass=0.6,
)  # fmt: skip
GEAR = Gear(id="g", maker="B", model="G", kind="planetary", ratio=50.0, efficiency=0.8, inertia=1e-5, mass=0.4)


def array(*values: float) -> np.ndarray:
    return np.array(values)


def test_torque_power_and_limits_by_hand() -> None:
    actuator = Actuator.of(MOTOR, GEAR, Conditions(safety_factor=1.2))
    assert not actuator.by_ratings and (actuator.ratio, actuator.safety_factor) == (50.0, 1.2)
    assert actuator.reflected_inertia == pytest.approx(2500 * 6e-5)
    # 10/(50·0.8) + 6e-5·50·3 = 0.259 N m driving; 10·0.8/50 + 0.009 = 0.169 N m driven
    torque = actuator.shaft_torque(array(10.0, 10.0), array(2.0, -2.0), array(3.0, 3.0))
    np.testing.assert_allclose(torque, [0.259, 0.169], rtol=1e-12)
    # T_e = 0.259 + 0.01 = 0.269: I = 2.69 A, R I² + T_e ω = 0.5·7.2361 + 0.269·100
    power = actuator.supply_power(array(0.259), array(100.0))
    np.testing.assert_allclose(power, 0.5 * 2.69**2 + 26.9, rtol=1e-12)
    assert actuator.continuous_torque(100.0) == 0.5 and actuator.continuous_torque(200.0) is None
    # the voltage: 0.9 · 24 = 21.6 V = R I + k ω; at 150 rad/s I = 13.2 A, T = 1.32 − 0.01 N m
    assert float(actuator.available_torque(array(150.0))[0]) == pytest.approx(1.31, rel=1e-12)
    np.testing.assert_allclose(actuator.curve_use(array(1.31), array(150.0)), 1.0, rtol=1e-12)
    np.testing.assert_allclose(actuator.curve_use(array(1.5), array(0.0)), 1.0, rtol=1e-12)
    # braking, the voltage of the current opposes that of the speed: 15 − 0.5·14.9 < 21.6 V
    assert float(actuator.curve_use(array(-1.5), array(150.0))[0]) == pytest.approx(1.0, rel=1e-12)
    assert not actuator.unknown_limits and not actuator.unknown_of_torque and not actuator.unknown_of_supply


def test_the_outline_holds_exactly_the_points_that_are_inside() -> None:
    from matplotlib.path import Path

    actuator = Actuator.of(MOTOR, GEAR)
    assert actuator.outline is not None
    outline = Path(actuator.outline)
    draw = np.random.default_rng(3)
    speed, torque = draw.uniform(-450, 450, 4000), draw.uniform(-2, 2, 4000)
    use = actuator.curve_use(torque, speed)
    clear = np.abs(use - 1.0) > 0.02
    np.testing.assert_array_equal(outline.contains_points(np.column_stack([speed, torque]))[clear], (use < 1.0)[clear])
    assert (use[clear] < 1.0).any() and (use[clear] > 1.0).any()


def test_what_a_row_does_not_state_is_unknown_and_never_a_pass() -> None:
    bare = Actuator.of(Motor(id="m", maker="", model="", torque_constant=0.1), replace(GEAR, efficiency=None))
    assert bare.unknown_of_torque == ("efficiency", "rotor_inertia")
    assert np.isnan(bare.shaft_torque(array(1.0), array(1.0), array(0.0))).all()
    assert np.isnan(bare.curve_use(array(1.0), array(1.0))).all() and not bare.has_limits
    assert bare.continuous_torque(0.0) is None and bare.outline is None and bare.reflected_inertia is None
    assert bare.known_inertia == pytest.approx(2500 * 1e-5)
    assert set(bare.unknown_limits) == {"the peak torque or current", "the voltage limit"}
    # an assumed value fills the hole, and only that
    filled = Actuator.of(MOTOR, replace(GEAR, efficiency=None), Conditions(assume={"gear.efficiency": 0.5}))
    np.testing.assert_allclose(filled.shaft_torque(array(10.0), array(1.0), array(0.0)), 10.0 / (50 * 0.5))
    assert filled.gear.efficiency is None and filled.efficiency == 0.5


def test_a_limit_that_is_known_is_compared_although_another_is_not() -> None:
    no_voltage = Actuator.of(replace(MOTOR, resistance=None, nominal_voltage=None), GEAR)
    assert no_voltage.unknown_limits == ("the voltage limit",)
    np.testing.assert_allclose(no_voltage.curve_use(array(3.0), array(10.0)), 2.0)
    assert np.isnan(no_voltage.available_torque(array(10.0))).all()


def test_a_motor_without_gear_and_an_actuator_sold_as_one() -> None:
    direct = Actuator.of(MOTOR)
    assert (direct.ratio, direct.gear) == (1.0, DIRECT)
    np.testing.assert_allclose(direct.shaft_torque(array(0.3), array(1.0), array(2.0)), 0.3 + 5e-5 * 2)
    with pytest.raises(InputError, match="sold with its gear"):
        Actuator.of(replace(MOTOR, kind="actuator", ratio=9.0), GEAR)
    with pytest.raises(InputError, match="gear 'g': its ratio is unknown"):
        Actuator.of(MOTOR, replace(GEAR, ratio=None))


@pytest.mark.tier2
def test_every_row_of_the_bundled_catalogue_makes_an_actuator_that_reads_back_as_written() -> None:
    catalogue = load_catalogue()
    for motor in catalogue.motors:
        actuator = Actuator.of(motor, None, Conditions(voltage=48.0))
        assert actuator_from_fields(Fields(actuator_data(actuator), "x.yaml")) == actuator
    for gear in catalogue.gears:
        if gear.ratio is None:  # offered with several ratios; `Actuator.of` refuses it
            continue
        actuator = Actuator.of(MOTOR, gear, Conditions(assume={"gear.efficiency": 0.7}))
        again = actuator_from_fields(Fields(actuator_data(actuator), "x.yaml"))
        assert not again.by_ratings
        assert replace(again.gear, ratio=gear.ratio) == gear
        assert again.ratio == pytest.approx(actuator.ratio, rel=1e-15) and again.conditions == actuator.conditions


def test_ids_mappings_and_conditions_are_read() -> None:
    data = {
        "motor": "maxon_re25_118743_12v",
        "gear": {
            "id": "own",
            "kind": "screw",
            "lead": "5 mm",
            "efficiency": "90%",
            "inertia": "20 g cm^2",
            "inertia_side": "input",
        },
        "voltage": "12 V",
        "voltage_reserve": "5%",
        "ambient": "40 °C",
        "safety_factor": 1.5,
        "assume": {"motor.max_speed": "9000 rpm"},
    }
    actuator = actuator_from_fields(Fields(data, "x.yaml", "actuators.lift"), load_catalogue)
    assert not actuator.by_ratings and actuator.motor.maker == "maxon"
    assert actuator.ratio == pytest.approx(2 * math.pi / 0.005) and actuator.gear_inertia == pytest.approx(2e-6)
    assert actuator.conditions == Conditions(
        voltage=12.0, voltage_reserve=0.05, ambient=40.0, safety_factor=1.5,
        assume={"motor.max_speed": actuator.max_speed},
    )  # fmt: skip
    assert actuator.max_speed == pytest.approx(300 * math.pi)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"motor": "maxon_re25_118743"}, "actuators.a.motor: unknown motor .*; did you mean 'maxon_re25_118743_12v'"),
        ({"gear": "hd_csf_17"}, "actuators.a.gear: unknown gear 'hd_csf_17'; did you mean"),
        ({"motor": None}, "actuators.a.motor: expected a text, found nothing"),
        ({"motor": {"torque_constant": "3 V"}}, "motor.torque_constant: expected a number in N m/A"),
        ({"motor": {"torque_constant": -1}}, "motor.torque_constant: expected more than 0"),
        ({"motor": {"torqe_constant": 1}}, "did you mean 'torque_constant'"),
        ({"motor": {"kind": "servos"}}, "did you mean 'servo'"),
        ({"gear": {"ratio": 50}}, "'kind' is missing"),
        ({"gear": {"kind": "screw", "ratio": 50}}, "this is of the kind screw"),
        ({"gear": {"kind": "spur", "ratio": 5, "inertia": 1e-6}}, "gear.inertia: its side is not said"),
        ({"gear": {"kind": "spur"}}, "its ratio is unknown"),
        ({"gear": {"kind": "spur", "ratio": 5, "efficiency": 1.5}}, "at most 1 .100 %"),
        ({"motor": {"continuous_curve": [[0, 1], [0, 2]]}}, "first numbers rise"),
        ({"motor": {"continuous_curve": 3}}, "a list of points"),
        ({"voltage": 0}, "actuators.a.voltage: expected more than 0 V"),
        ({"voltage_reserve": 2}, "at most 0.9"),
        ({"assume": {"gear.efficency": 0.7}}, "did you mean 'gear.efficiency'"),
        ({"assume": {"gear.efficiency": 7}}, "assume.gear.efficiency: expected at most 1"),
        ({"ratio": 50}, "unknown key 'ratio'"),
        ({"altitude": 9000}, "at most 4000"),
    ],
)
def test_bad_actuators_are_one_sentence_with_the_place(change: dict[str, object], message: str) -> None:
    data = {"motor": "maxon_re25_118743_12v"} | change
    with pytest.raises(InputError, match=message) as caught:
        actuator_from_fields(Fields(data, "x.yaml", "actuators.a"), load_catalogue)
    assert str(caught.value).startswith("x.yaml: actuators.a") and "\n" not in str(caught.value)


def test_a_printed_curve_is_the_whole_region() -> None:
    curve = ((0.0, 2.0), (100.0, 2.0), (200.0, 1.0))
    region = ShortTimeRegion(replace(MOTOR, resistance=None, peak_torque=None, peak_curve=curve), Conditions())
    assert region.known and not region.unknown and region.largest_speed == 200.0
    np.testing.assert_allclose(region.highest_torque(array(50.0, 150.0, 201.0)), [2.0, 1.5, -np.inf])
    np.testing.assert_allclose(region.use(array(2.0, 1.0), array(0.0, 200.0)), [1.0, 1.0])
