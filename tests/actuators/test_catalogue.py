"""The shipped catalogue, and `Catalogue` with its filters."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pytest

import bellcrank as bc
from bellcrank.actuators.catalogue.catalogue import SHIPPED
from bellcrank.actuators.catalogue.catalogue_checks import contradictions
from bellcrank.actuators.catalogue.catalogue_columns import QUALITIES
from bellcrank.sizing.selection.pairs import Pairs

WHOLE = bc.load_catalogue(contradicting=True)
RPM = math.pi / 30.0


@pytest.mark.parametrize("file", sorted(SHIPPED.glob("*.csv")), ids=lambda path: path.name)
def test_every_shipped_row_says_where_it_is_from(file: Path) -> None:
    with file.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert rows
    for row in rows:
        if "curve" not in row:
            assert row["source"].strip() and row["checked"].strip() and row["quality"] in QUALITIES[:-1], row["id"]
            assert "index id" not in row["source"] + row["notes"], row["id"]  # nobody else can look such a number up


def test_the_shipped_catalogue_has_the_products_of_its_files_and_no_id_twice() -> None:
    ids = [product.id for product in WHOLE.products]
    assert len(ids) == len(set(ids)) and len(WHOLE.motors) >= 77 and len(WHOLE.gears) >= 42
    assert json.dumps(sorted(ids))  # plain texts


def test_figures_are_in_si_units() -> None:
    """maxon EC 45 flat 70 W, 24 V, as its catalogue page prints it."""
    motor = WHOLE.motor("maxon_ec45flat_70w_24v")
    assert motor.no_load_speed == pytest.approx(5600.0 * RPM, rel=1e-12)
    assert motor.speed_constant == pytest.approx(236.0 * RPM, rel=1e-12)
    assert motor.rotor_inertia == pytest.approx(181e-7, rel=1e-12)
    assert motor.inductance == pytest.approx(0.301e-3, rel=1e-12)
    assert motor.mechanical_time_constant == pytest.approx(6.35e-3, rel=1e-12)
    assert motor.max_efficiency == pytest.approx(0.849, rel=1e-12)
    assert (motor.nominal_voltage, motor.torque_constant, motor.resistance) == (24.0, 0.0404, 0.573)


def test_figures_of_actuators_hold_at_the_output() -> None:
    """AK80-64: rotor inertia 564.5 g cm² and torque constant 0.136 N m/A before a gear of 64; mini cheetah, gear 6."""
    actuator = WHOLE.motor("cubemars_ak80_64")
    assert actuator.rotor_inertia == pytest.approx(564.5e-7 * 64**2, rel=1e-12)
    assert actuator.torque_constant == pytest.approx(0.136 * 64, rel=1e-12) and actuator.torque_constant_basis is None
    assert actuator.speed_constant == pytest.approx(80.0 * RPM / 64, rel=1e-12)
    assert actuator.backlash == pytest.approx(math.radians(0.18), rel=1e-12)
    assert WHOLE.motor("mit_mini_cheetah").rotor_inertia == pytest.approx(6.3e-5 * 36, rel=1e-12)


def test_resistances_are_line_to_line_at_25_degrees() -> None:
    """mj5208: 0.05 Ω phase to neutral. Faulhaber: 0.46 Ω at 22 °C, copper 0.39 %/K related to 25 °C."""
    assert WHOLE.motor("mjbots_mj5208").resistance == pytest.approx(0.1)
    assert WHOLE.motor("faulhaber_4221_bxth_18v").resistance == pytest.approx(0.46 / (1.0 - 3 * 0.0039), rel=1e-4)


def test_a_stall_torque_is_known_at_standstill_only() -> None:
    assert WHOLE.motor("kollmorgen_tbm_6013_a").nominal_speed == 0.0


@pytest.mark.parametrize("gear", [gear for gear in WHOLE.gears if "sgmah" in gear.id], ids=lambda gear: gear.id)
def test_built_in_gears_agree_with_the_printed_output_torque(gear: bc.Gear) -> None:
    """Output torque = motor torque x ratio x efficiency, Yaskawa Sigma-II manual, section 3.1; rounded to 1.2 %."""
    motor_torque = {"30": 0.0955, "50": 0.159, "100": 0.318, "200": 0.637}[gear.id.split("_")[2].removesuffix("w")]
    assert gear.ratio is not None and gear.efficiency is not None and gear.average_torque is not None
    assert gear.average_torque == pytest.approx(motor_torque * gear.ratio * gear.efficiency, rel=0.0125)
    assert gear.input_flange == f"Yaskawa SGMAH {gear.id.split('_')[2].removesuffix('w')} W"


def test_built_in_gears_go_with_their_own_motors_only() -> None:
    gear = WHOLE.gear("yaskawa_sgmah_50w_gear_1_5")
    own = bc.Motor(id="own", maker="Yaskawa", model="SGMAH-A5A", flange="Yaskawa SGMAH 50 W")
    pairs = Pairs.possible([*WHOLE.motors, own], [gear], "rotary")
    geared = {pairs.rows(k)[0].id for k in range(len(pairs)) if pairs.rows(k)[1].kind != "direct"}
    assert geared == {"own"}


@pytest.mark.parametrize(
    ("name", "power_rate", "acceleration"),
    [("04a", 33.1e3, 26100.0), ("06a", 45.6e3, 23800.0), ("02a", 15.4e3, 24200.0), ("a5a", 6.4e3, 40200.0)],
)
def test_printed_power_rates(name: str, power_rate: float, acceleration: float) -> None:
    """Rated power rate T²/J and rated angular acceleration T/J, Yaskawa Sigma-7 manual, section 4.2.2."""
    motor = WHOLE.motor(f"yaskawa_sgm7j_{name}")
    assert motor.nominal_torque is not None and motor.rotor_inertia is not None
    assert motor.nominal_torque**2 / motor.rotor_inertia == pytest.approx(power_rate, rel=0.01)
    assert motor.nominal_torque / motor.rotor_inertia == pytest.approx(acceleration, rel=0.01)


def test_products_that_contradict_themselves_are_left_out_unless_asked_for() -> None:
    usual = bc.load_catalogue()
    wrong = {one.product.id for one in contradictions(WHOLE.products)}
    assert "lk_mg10015" in wrong and wrong == {one.product.id for one in usual.left_out}
    assert {one.id for one in WHOLE.products} - {one.id for one in usual.products} == wrong
    assert not WHOLE.left_out
    with pytest.raises(bc.InputError, match="unknown motor 'lk_mg10015'"):
        usual.motor("lk_mg10015")


def test_filters() -> None:
    chosen = WHOLE.filtered(makers=["MAXON"], kinds=["motor", "planetary"], voltage=24.0)
    assert {one.maker for one in chosen.products} == {"maxon"} and chosen.gears
    assert {one.nominal_voltage for one in chosen.motors} == {24.0} and {one.kind for one in chosen.motors} == {"motor"}
    servos = WHOLE.filtered(kinds="servo")
    assert {one.kind for one in servos.motors} == {"servo"} and servos.gears == WHOLE.gears
    screws = WHOLE.filtered(kinds=["strain_wave"])
    assert {one.kind for one in screws.gears} == {"strain_wave"} and screws.motors == WHOLE.motors
    one = WHOLE.motors[0].id
    assert one not in {motor.id for motor in WHOLE.filtered(exclude=[one]).motors}
    assert [product.id for product in WHOLE.only([one]).products] == [one]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"makers": ["maxxon"]}, "unknown maker 'maxxon'; did you mean 'maxon'"),
        ({"kinds": ["planet"]}, "unknown kind 'planet'"),
        ({"exclude": ["maxon_ec45flat_70w_25v"]}, "did you mean 'maxon_ec45flat_70w_24v'"),
        ({"voltage": -1.0}, "argument 'voltage'"),
        ({"makers": [3]}, "argument 'makers'"),
    ],
)
def test_filters_refuse_what_is_not_there(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(bc.InputError, match=message):
        WHOLE.filtered(**arguments)  # type: ignore[arg-type]


def test_an_id_is_refused_twice_and_foreign_objects_are_refused() -> None:
    motor = WHOLE.motors[0]
    with pytest.raises(bc.InputError, match="occurs twice"):
        bc.Catalogue((motor, motor))
    with pytest.raises(bc.InputError, match="argument 'motors'"):
        bc.Catalogue((WHOLE.gears[0],))  # type: ignore[arg-type]
    with pytest.raises(bc.InputError, match="argument 'folders'"):
        bc.load_catalogue(3)  # type: ignore[arg-type]
    assert not bc.load_catalogue(shipped=False).products
