"""Checks of products against themselves: each is passed by a sound row and failed by one with a wrong figure."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import bellcrank as bc
from bellcrank.actuators.catalogue.catalogue_checks import GEAR_CHECKS, checks_applied, contradictions
from bellcrank.actuators.catalogue.motor_checks import MOTOR_CHECKS

RPM = math.pi / 30.0
# Made from U = 24 V, R = 0.6 Ω, k = 0.04 N m/A, J = 2e-5 kg m² by the formulas that the checks compare.
MOTOR = bc.Motor(
    id="sound",
    maker="M",
    model="M",
    nominal_voltage=24.0,
    torque_constant=0.04,
    torque_constant_basis="dc",
    speed_constant=25.0,
    resistance=0.6,
    inductance=3e-4,
    no_load_current=0.25,
    no_load_speed=(24.0 - 0.6 * 0.25) / 0.04,
    rotor_inertia=2e-5,
    nominal_torque=0.12,
    nominal_speed=500.0,
    nominal_current=3.2,
    peak_torque=0.75,
    peak_current=20.0,
    stall_torque=1.6,
    stall_current=40.0,
    max_speed=1000.0,
    mechanical_time_constant=2e-5 * 0.6 / 0.04**2,
    resistance_winding_housing=4.0,
    resistance_housing_ambient=3.0,
    time_constant_winding=30.0,
    time_constant_motor=200.0,
    max_winding_temperature=125.0,
    max_housing_temperature=100.0,
    reference_temperature=25.0,
    max_efficiency=(1.0 - math.sqrt(0.25 / 40.0)) ** 2,
    mass=0.15,
)
ACTUATOR = bc.Motor(
    id="sound_actuator",
    maker="M",
    model="M",
    kind="actuator",
    nominal_voltage=48.0,
    ratio=9.0,
    torque_constant=0.9,
    speed_constant=100.0 * RPM / 9.0,
    no_load_speed=570.0 * RPM,
    nominal_torque=9.0,
    nominal_speed=390.0 * RPM,
    nominal_current=12.0,
    peak_torque=22.0,
    rotor_inertia=1.1e-4 * 81,
    backlash=math.radians(0.25),
    mass=0.49,
)
GEAR = bc.Gear(
    id="sound_gear",
    maker="M",
    model="M",
    kind="planetary",
    ratio=50.0,
    stages=2.0,
    efficiency=0.9,
    back_efficiency=0.85,
    inertia=3e-6,
    inertia_side="input",
    rated_torque=22.0,
    rated_speed=200.0,
    average_torque=25.0,
    repeated_peak_torque=40.0,
    momentary_torque=66.0,
    average_speed=300.0,
    max_speed=600.0,
    life=20000.0,
    life_exponent=3.0,
    stiffness=1e4,
    backlash=math.radians(0.1),
    starting_torque=0.02,
    mass=0.8,
)
WRONG: list[tuple[Any, str, dict[str, Any]]] = [  # product, name of the check, the figures that are wrong
    (MOTOR, "stall current", {"nominal_voltage": 36.0}),
    (MOTOR, "stall torque", {"torque_constant_basis": "phase_peak"}),
    (MOTOR, "stall torque", {"torque_constant_basis": "phase_rms"}),
    (MOTOR, "mechanical time constant", {"rotor_inertia": 2e-4}),
    (MOTOR, "torque and speed constant", {"torque_constant_basis": "phase_rms"}),
    (MOTOR, "no-load speed", {"no_load_speed": 596.25 * 1.22}),
    (MOTOR, "speed constant", {"speed_constant": 25.0 * RPM}),
    (MOTOR, "nominal torque and current", {"nominal_torque": 0.3}),
    (MOTOR, "peak torque and current", {"peak_torque": 1.3}),
    (MOTOR, "nominal point below the voltage line", {"nominal_speed": 700.0}),
    (MOTOR, "thermal limit of the current", {"resistance_housing_ambient": 30.0}),
    (MOTOR, "efficiency at the nominal point", {"nominal_speed": 5000.0 * 0.2}),
    (MOTOR, "largest efficiency", {"max_efficiency": 0.6}),
    (MOTOR, "nominal torque and peak torque", {"nominal_torque": 0.75, "peak_torque": 0.12}),
    (MOTOR, "nominal torque and stall torque", {"nominal_torque": 1.7}),
    (MOTOR, "nominal current and peak current", {"nominal_current": 21.0}),
    (MOTOR, "nominal current and stall current", {"nominal_current": 41.0}),
    (MOTOR, "no-load current and nominal current", {"no_load_current": 3.3}),
    (MOTOR, "nominal speed and no-load speed", {"nominal_speed": 620.0}),
    (MOTOR, "nominal speed and max speed", {"max_speed": 400.0}),
    (MOTOR, "time constant winding and time constant motor", {"time_constant_winding": 250.0}),
    (MOTOR, "max housing temperature and max winding temperature", {"max_housing_temperature": 150.0}),
    (MOTOR, "heat capacities", {"resistance_winding_housing": 0.1}),
    (MOTOR, "heat capacity per mass", {"mass": 0.00015}),
    (MOTOR, "winding temperature", {"max_winding_temperature": 311.0}),
    (MOTOR, "time to accelerate", {"rotor_inertia": 2e-7}),
    (MOTOR, "inertia and mass", {"rotor_inertia": 2e-1}),
    (MOTOR, "torque per mass", {"nominal_torque": 120.0}),
    (MOTOR, "power per mass", {"mass": 150.0}),
    (MOTOR, "rotor speed", {"max_speed": 1e5}),
    (MOTOR, "electrical time constant", {"inductance": 0.3}),
    (ACTUATOR, "torque and speed constant, basis unknown", {"torque_constant": 8.0}),
    (ACTUATOR, "time to accelerate", {"rotor_inertia": 1.1e-4}),  # not reflected to the output
    (ACTUATOR, "inertia and mass", {"rotor_inertia": 1.1e-4 * 81 * 81}),  # reflected twice
    (ACTUATOR, "output torque per mass", {"nominal_torque": 9000.0}),
    (ACTUATOR, "backlash", {"backlash": 15.0 / 60.0}),  # degrees written as radians
    (ACTUATOR, "efficiency at the nominal point", {"nominal_current": 6.0}),
    (GEAR, "rated torque and repeated peak torque", {"rated_torque": 41.0}),
    (GEAR, "average torque and repeated peak torque", {"average_torque": 41.0}),
    (GEAR, "rated torque and momentary torque", {"rated_torque": 67.0}),
    (GEAR, "repeated peak torque and momentary torque", {"momentary_torque": 39.0}),
    (GEAR, "average speed and max speed", {"average_speed": 700.0}),
    (GEAR, "rated speed and max speed", {"rated_speed": 700.0}),
    (GEAR, "back efficiency and efficiency", {"back_efficiency": 0.95}),
    (GEAR, "efficiency", {"efficiency": 0.009, "back_efficiency": None}),
    (GEAR, "ratio per stage", {"stages": 1.0}),
    (GEAR, "twist at the rated torque", {"stiffness": 1e4 * math.pi / 180 / 60}),  # N m/arcmin as N m/rad
    (GEAR, "inertia and mass", {"inertia": 3e-6 * 2500}),  # at the output
    (GEAR, "torque per mass", {"rated_torque": 22000.0}),
    (GEAR, "backlash", {"backlash": 6.0}),
    (GEAR, "starting torque", {"starting_torque": 2.0}),
    (GEAR, "life", {"life": 20.0}),
    (GEAR, "life exponent", {"life_exponent": 0.3}),
]


@pytest.mark.parametrize("product", [MOTOR, ACTUATOR, GEAR], ids=lambda product: product.id)
def test_a_sound_product_passes_every_check_that_its_figures_allow(product: Any) -> None:
    assert contradictions([product]) == () and checks_applied(product) >= 10


@pytest.mark.parametrize(("product", "check", "changes"), WRONG, ids=[f"{check}-{c}" for _, check, c in WRONG])
def test_a_wrong_figure_is_found(product: Any, check: str, changes: dict[str, Any]) -> None:
    found = contradictions([replace(product, **changes)])
    assert check in {one.check for one in found}
    text = next(one.text for one in found if one.check == check)
    assert "expected" in text and ";" in text and len(text.splitlines()) == 1


def test_every_check_has_a_row_that_fails_it_and_says_why_it_has_its_bounds() -> None:
    checks = [*MOTOR_CHECKS, *GEAR_CHECKS]
    assert {one.name for one in checks} == {check for _, check, _ in WRONG}
    for one in checks:
        assert one.formula and one.source and one.reason and one.advice and one.least < one.most
        assert one.least <= 1.0 or "plausible" not in one.source


def test_a_product_without_figures_allows_no_check() -> None:
    bare = bc.Motor(id="bare", maker="M", model="M")
    gear = bc.Gear(id="bare_gear", maker="M", model="M", kind="spur")
    assert checks_applied(bare) == checks_applied(gear) == 0 and contradictions([bare, gear]) == ()


def test_limits_of_screws_are_forces_and_not_compared_as_torques() -> None:
    screw = bc.Gear(id="s", maker="M", model="M", kind="screw", ratio=1256.0, rated_torque=2e4, mass=1.0, stiffness=1e8)
    assert contradictions([screw]) == ()


EXTREME = st.none() | st.floats(5e-324, 1e100) | st.sampled_from([5e-324, 1e-160, 1.0, 25.0, 1e100])
FIGURES = [one.name for one in fields(bc.Motor) if "float" in str(one.type) and one.name != "pole_pairs"]
OF_GEARS = [one.name for one in fields(bc.Gear) if "float" in str(one.type)]


@pytest.mark.tier2
@given(st.fixed_dictionaries({name: EXTREME for name in FIGURES}), st.sampled_from([None, "dc", "phase_rms"]))
def test_checks_of_extreme_motors_say_something_or_nothing(values: dict[str, Any], basis: Any) -> None:
    values["max_efficiency"] = None
    if values["max_winding_temperature"] is not None:
        values["reference_temperature"] = None
    for kind in ("motor", "actuator"):
        motor = bc.Motor(id="m", maker="M", model="M", kind=kind, torque_constant_basis=basis, **values)  # type: ignore[arg-type]
        assert all(len(one.text.splitlines()) == 1 for one in contradictions([motor]))


@given(st.fixed_dictionaries({name: EXTREME for name in OF_GEARS}), st.sampled_from([1.0, 3.0, 300.0]))
def test_checks_of_extreme_gears_say_something_or_nothing(values: dict[str, Any], stages: float) -> None:
    values |= {"efficiency": None, "back_efficiency": None, "stages": stages}
    for kind in ("planetary", "screw"):
        gear = bc.Gear(id="g", maker="M", model="M", kind=kind, **values)  # type: ignore[arg-type]
        assert all(len(one.text.splitlines()) == 1 for one in contradictions([gear]))


def test_what_is_wrong_in_the_shipped_catalogue() -> None:
    """Every inconsistency of the shipped rows; a row that is added here has its reason in this text.

    AK80-64: 75 rpm at 48 V against KV80 / 64. The page of the MG actuators contradicts itself, as its row says. U8: no
    basis explains 0.14 N m/A at KV100. EC 45 flat 30 W, 36 V (2012): k from the stall torque is 11 % below the printed
    one, k from the nominal torque 11 % above.
    """
    catalogue = bc.load_catalogue(contradicting=True)
    assert {(one.product.id, one.check) for one in contradictions(catalogue.products)} == {
        ("cubemars_ak80_64", "speed constant"),
        ("lk_mg4005", "speed constant"),
        ("lk_mg8010", "torque and speed constant, basis unknown"),
        ("lk_mg8016", "torque and speed constant, basis unknown"),
        ("lk_mg10015", "torque and speed constant, basis unknown"),
        ("lk_mg10015", "efficiency at the nominal point"),
        ("tmotor_u8_kv100", "torque and speed constant, basis unknown"),
        ("maxon_ec45flat_30w_36v", "stall torque"),
        ("maxon_ec45flat_30w_36v", "nominal torque and current"),
    }


def test_the_guide_names_every_check() -> None:
    guide = (Path(__file__).parents[2] / "docs" / "guide" / "catalogue.md").read_text(encoding="utf-8")
    guide = " ".join(guide.split())
    missing = [one.name for one in (*MOTOR_CHECKS, *GEAR_CHECKS) if one.name not in guide]
    assert not missing
