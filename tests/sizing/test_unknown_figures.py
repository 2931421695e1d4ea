"""Actuators with unknown figures: sizing says what it could not compare, and never takes it for a pass."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.errors import InputError
from bellcrank.reports.input_tables import actuator_table
from bellcrank.sizing.plots import sizing_figures
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.selection.judged_axes import MAIN
from bellcrank.sizing.size import size
from bellcrank.sizing.sizing_files import json_text, write_histories
from bellcrank.sizing.tables import sizing_html, table, verdict
from tests.support.written import csv_text

MOTOR = Motor(
    id="m", maker="A", model="M", nominal_voltage=48.0, torque_constant=0.1, torque_constant_basis="dc",
    resistance=0.5, no_load_current=0.1, rotor_inertia=5e-6, nominal_torque=0.5, nominal_speed=300.0, peak_torque=1.5,
    max_speed=400.0, mass=0.6, resistance_winding_housing=1.0, resistance_housing_ambient=3.0,
    time_constant_winding=20.0, time_constant_motor=600.0, max_winding_temperature=155.0, peak_time=3.0,
)  # fmt: skip
GEAR = Gear(
    id="g", maker="B", model="G", kind="planetary", ratio=50.0, efficiency=0.8, inertia=1e-6, mass=0.4,
    max_speed=500.0, average_speed=300.0, repeated_peak_torque=40.0, average_torque=20.0,
    life_exponent=3.0,
)  # fmt: skip
OF_GEAR_SPEED = {"gear largest input speed", "gear average input speed"}
OF_GEAR_TORQUE = {"gear repeated peak torque", "gear average torque"}
OF_SHAFT = {"continuous torque", "peak torque", "voltage limit", "peak duration", "winding temperature"}
OF_INERTIA = OF_SHAFT | {"inertia ratio"}


def sized(motor: Motor = MOTOR, gear: Gear = GEAR, conditions: Conditions | None = None) -> Sizing:
    light = {"inertia_ratio": 50.0}  # the pendulum has 40 times the inertia of this rotor
    conditions = Conditions(**light) if conditions is None else conditions.updated(light)
    return size("geared_pendulum", actuators={"shoulder": Actuator.of(motor, gear, conditions)})


def refuse(constant: str) -> None:
    raise AssertionError(f"{constant} in JSON")


def test_a_complete_motor_is_judged_as_ratings_are() -> None:
    """The pendulum of 9.81 N m behind 50:1 and 80 %: peak and RMS at the shaft as with ratings of the same figures."""
    sizing, ratings = sized(), size("geared_pendulum")
    shaft, before = sizing.joint("shoulder").shaft, ratings.joint("shoulder").shaft
    assert shaft is not None and before is not None and shaft.peak_torque is not None and before.peak_torque is not None
    assert shaft.peak_torque.value == pytest.approx(before.peak_torque.value, rel=1e-9)
    assert shaft.rms_torque == pytest.approx(before.rms_torque, rel=1e-9)
    assert shaft.margins["peak torque"] == pytest.approx(1 - shaft.peak_torque.value / 1.5)
    assert shaft.margins["continuous torque"] == pytest.approx(1 - (shaft.rms_torque or 0.0) / 0.5)
    assert not sizing.unknown and shaft.state == "inside" and sizing.inside
    assert sizing.peak_supply_power is not None and sizing.peak_supply_power > 20.51  # of the joint, plus losses


@pytest.mark.tier2
@pytest.mark.parametrize(
    ("motor", "gear", "unknown", "missing"),
    [
        ({}, {"efficiency": None}, OF_SHAFT, "the gear's efficiency"),
        ({"rotor_inertia": None}, {}, OF_INERTIA, "the motor's rotor inertia"),
        ({}, {"inertia": None}, OF_INERTIA, "the gear's inertia"),
        ({}, {"max_speed": None, "average_speed": None}, OF_GEAR_SPEED, "speed"),
        ({}, {"repeated_peak_torque": None, "average_torque": None}, OF_GEAR_TORQUE, "torque"),
        ({"max_speed": None, "nominal_speed": None}, {}, {"motor speed"}, "the motor's max speed"),
        ({"peak_torque": None, "nominal_torque": 0.2}, {}, {"peak torque"}, "the motor's peak torque"),
        ({"resistance": None}, {}, {"voltage limit", "winding temperature"}, "the motor's resistance"),
    ],
)
def test_an_unknown_figure_is_said_everywhere(
    motor: dict[str, Any], gear: dict[str, Any], unknown: set[str], missing: str, tmp_path: Path
) -> None:
    sizing = sized(replace(MOTOR, **motor), replace(GEAR, **gear))
    shaft = sizing.joint("shoulder").shaft
    assert shaft is not None and set(shaft.unknown) == unknown and all(missing in one for one in shaft.unknown.values())
    assert {name for name, margin in shaft.margins.items() if margin is None} == unknown
    state = "not verified" if unknown & MAIN else "inside as far as known"
    assert sizing.inside and shaft.state == state and sizing.verified == (not unknown & MAIN)
    assert "as far as known" in repr(sizing)
    for text in (verdict(sizing), sizing_html(sizing)):
        assert "Inside as far as known" in text and "All inside" not in text and missing.split("'")[-1] in text
    assert "unknown" in table(sizing) and "nan" not in table(sizing)
    document = json.loads(json_text(sizing), parse_constant=refuse)
    assert document["unknown"] == list(sizing.unknown) and len(document["unknown"]) == len(unknown)
    margins = document["joints"][0]["shaft"]["margins"]
    assert {name for name, margin in margins.items() if margin is None} == unknown
    [row] = csv.DictReader(csv_text(sizing).splitlines())
    assert row["shaft verdict"] == state
    assert all((row[f"{name} margin [1]"] == "") == (name in unknown) for name in margins)
    assert all("nan" not in path.read_text() for path in write_histories(sizing, tmp_path))
    assert sizing_figures(sizing)["motor_torque_speed.png"].axes
    assert sizing.inputs is not None and all(
        "nan" not in cell for cell in actuator_table(sizing.inputs.actuators).rows[0]
    )


def test_the_rated_torque_shows_that_a_smaller_load_is_below_an_unknown_peak_torque() -> None:
    shaft, full = (sized(motor).joint("shoulder").shaft for motor in (replace(MOTOR, peak_torque=None), MOTOR))
    assert shaft is not None and full is not None and shaft.peak_torque is not None and not shaft.unknown
    bound, exact = shaft.margins["peak torque"], full.margins["peak torque"]
    assert bound == pytest.approx(1 - shaft.peak_torque.value / 0.5) and exact is not None and 0.0 < bound <= exact


def test_an_exceeded_limit_stays_exceeded_beside_unknown_ones() -> None:
    sizing = sized(replace(MOTOR, nominal_speed=50.0, max_speed=100.0), replace(GEAR, efficiency=None))
    shaft = sizing.joint("shoulder").shaft
    assert not sizing.inside and shaft is not None and shaft.tightest == "motor speed"
    assert shaft.verdict == "exceeded (motor speed -47.3%; 5 unknown)"
    assert "EXCEEDED: 1 limit" in verdict(sizing) and "Unknown, because" in verdict(sizing)


def test_a_voltage_that_does_not_reach_the_speed_is_exceeded_whatever_the_peak_torque_is() -> None:
    sizing = sized(replace(MOTOR, peak_torque=None), conditions=Conditions(voltage=4.0))
    shaft = sizing.joint("shoulder").shaft
    assert shaft is not None and not sizing.inside and (shaft.margins["voltage limit"] or 0.0) < 0.0


def test_the_power_of_all_joints_is_unknown_where_one_is() -> None:
    for sizing, missing in (
        (sized(gear=replace(GEAR, efficiency=None)), "the gear's efficiency"),
        (sized(replace(MOTOR, no_load_current=None)), "the motor's friction"),
    ):
        assert sizing.supply_peak is None and sizing.peak_supply_power is None and sizing.peak_regeneration is None
        assert "power unknown" in table(sizing)
        assert any("power of all joints together is unknown" in text and missing in text for text in sizing.warnings)
        assert json.loads(json_text(sizing))["supply"] is None


def test_the_limits_of_the_gear_are_compared() -> None:
    """9.81 N m at its output: 20 N m are enough; 7 N m, are not."""
    for limit, inside in ((20.0, True), (7.0, False)):
        sizing = sized(gear=replace(GEAR, repeated_peak_torque=limit))
        shaft = sizing.joint("shoulder").shaft
        assert shaft is not None and shaft.margins["gear repeated peak torque"] == pytest.approx(1 - 9.81 / limit)
        assert sizing.inside is inside


def test_nothing_known_is_not_called_inside_with_a_margin() -> None:
    bare = sized(Motor(id="m", maker="", model=""), Gear(id="g", maker="", model="", kind="spur", ratio=9.0))
    shaft = bare.joint("shoulder").shaft
    assert shaft is not None and shaft.tightest is None and not bare.verified and "Not verified" in verdict(bare)
    assert shaft.verdict == "not verified (11 unknown)" and len(shaft.unknown) == 11


CONFIG = """
urdf: geared_pendulum
motions:
  lift: {kind: waypoints, times: [0, 1], positions: [{shoulder: 0}, {shoulder: 90 deg}]}
"""


@pytest.fixture
def config(tmp_path: Path) -> Callable[[str], Path]:
    def write(actuators: str) -> Path:
        path = tmp_path / "robot.yaml"
        path.write_text(f"{CONFIG}{actuators}\n")
        return path

    return write


def test_a_rotor_of_unknown_inertia_is_said_and_left_out(config: Callable[[str], Path]) -> None:
    path = config("actuators: {shoulder: {motor: {id: m, rotor_inertia: 50 g cm^2}, gear: {kind: spur, ratio: 20}}}")
    robot = bc.load_scene(path).config.robot()
    assert float(robot.rotor_inertia[0]) == pytest.approx(400 * 5e-6)
    [text] = [text for text in robot.inertia_warnings if "gear inertia is not stated" in text]
    assert "assume gear.inertia" in text and text in size(path).warnings


def test_a_folder_of_the_robots_own_catalogue(config: Callable[[str], Path], tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "motors.csv").write_text(
        "id,maker,model,kind,torque_constant [N m/A],rotor_inertia [g cm^2],mass [g],source\n"
        "mine,me,M1,motor,0.05,60,250,measured\n"
    )
    path = config("catalogue: own\nactuators: {shoulder: {motor: mine, gear: direct}}")
    actuator = bc.load_scene(path).config.actuators["shoulder"]
    assert actuator.rotor_inertia == pytest.approx(6e-6) and actuator.ratio == 1.0
    np.testing.assert_allclose(bc.load_scene(path).config.robot().rotor_inertia, 6e-6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("catalogue: gone", "catalogue .line 5.: there is no folder"),
        ("catalogue: empty", "has no file"),
        ("catalogue: /etc", "is not allowed"),
        ("catalogue: linked", "may not name"),
        ("actuators: {shoulder: {motor: nothing}}", "actuators.shoulder.motor .line 5.: unknown motor 'nothing'"),
        ("actuators: {shoulder: {gear: {kind: spur, ratio: 3}}}", "'motor' is missing"),
    ],
)
def test_what_a_configuration_cannot_name(
    config: Callable[[str], Path], tmp_path: Path, text: str, message: str
) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "linked").mkdir()
    (tmp_path / "linked" / "motors.csv").symlink_to("/etc/hostname")
    with pytest.raises(InputError, match=message) as caught:
        bc.load_scene(config(text))
    assert "\n" not in str(caught.value)


def test_a_saved_run_holds_the_figures_of_its_motors(config: Callable[[str], Path], tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    table_of_motors = tmp_path / "own" / "motors.csv"
    table_of_motors.write_text("id,maker,model,kind,rotor_inertia [kg m^2]\nmine,me,M1,motor,0.001\n")
    run = bc.simulate(config("catalogue: own\nactuators: {shoulder: {motor: mine}}"), duration=0.05)
    saved = run.save(tmp_path / "run.npz")
    table_of_motors.unlink()
    again = bc.load_run(saved)
    assert again.scene.config.actuators == run.scene.config.actuators
    assert float(again.robot.rotor_inertia[0]) == 0.001
