"""A selection judges each axis under the conditions that hold there, says where they come from, and writes them."""

import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from own_products import write_products

import bellcrank as bc
from bellcrank.actuators.catalogue.catalogue import load_catalogue
from bellcrank.actuators.conditions import Conditions
from bellcrank.errors import InputError
from bellcrank.sizing.drive_verdicts import conditions_of
from bellcrank.sizing.selection.selection_files import json_text

ROBOT = {
    "voltage": 60.0,
    "voltage_reserve": 0.15,
    "winding_temperature": 70.0,
    "ambient": 40.0,
    "altitude": 1234.5,
    "safety_factor": 1.05,
    "life": 100.0,
    "brake": False,
    "bus_capacitance": 0.001,
    "bus_max_voltage": 80.1,
    "brake_resistor_power": 200.3,
    "supply_power": 1e5,
    "momentary_loads": {"shoulder": 3.3, "elbow": 2.2},
    "assume": {"gear.efficiency": 0.61},
}
ELBOW = {
    "voltage": 50.0,
    "voltage_reserve": 0.1,
    "winding_temperature": 25.0,
    "ambient": 45.5,
    "altitude": 0.0,
    "safety_factor": 1.2,
    "life": 1.0 / 3.0,
    "assume": {"motor.rotor_inertia": 1e-5 / 3.0},
}
GIVEN = {"ambient": 25.0, "assume": {"gear.mass": 0.1}}  # 25 °C is the default, and yet given


@pytest.fixture(scope="module")
def products(tmp_path_factory):
    return load_catalogue(write_products(tmp_path_factory.mktemp("own")), shipped=False)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """The planar arm, whose elbow has a motor and gear with conditions of its own."""
    data = {
        "urdf": "planar_2r",
        "gravity": [0, -9.81, 0],
        "motions": {"lift": {"kind": "waypoints", "times": [0, 1], "positions": [{}, {"elbow": 1.0, "shoulder": 0.5}]}},
        "conditions": ROBOT,
        "actuators": {"elbow": {"motor": {"id": "m", "nominal_torque": 1.0}} | ELBOW},
    }
    path = tmp_path_factory.mktemp("arm") / "arm.yaml"
    path.write_text(yaml.safe_dump(data))
    return bc.load_scene(path)


@pytest.fixture(scope="module")
def chosen(scene, products):
    return bc.select(scene, None, products, conditions=GIVEN, candidates=2)


def test_each_axis_has_what_is_given_then_its_own_then_those_of_the_robot(scene, chosen):
    assert chosen.conditions == Conditions(
        **ROBOT | {"ambient": 25.0, "assume": {"gear.efficiency": 0.61, "gear.mass": 0.1}}
    )
    shoulder, elbow = (chosen.axis(name).conditions for name in ("shoulder", "elbow"))
    assert shoulder == chosen.conditions
    assert elbow == Conditions(
        **ROBOT | ELBOW | {"ambient": 25.0, "assume": ROBOT["assume"] | ELBOW["assume"] | GIVEN["assume"]}
    )
    assert elbow.sources == conditions_of(scene.config, "elbow", GIVEN).sources
    assert {elbow.sources[name] for name in ("voltage", "assume.motor.rotor_inertia")} == {"actuators.elbow"}
    assert elbow.sources["ambient"] == elbow.sources["assume.gear.mass"] == "given"
    assert elbow.sources["supply_power"] == shoulder.sources["voltage"] == "conditions"


def test_the_criteria_of_an_axis_are_judged_under_its_conditions(scene, products, chosen):
    """As those of the same pairs where its conditions are given for the whole robot."""
    keep = {one.axis.name: one.chosen.id for one in chosen.axes}
    for one in chosen.axes:
        same = bc.select(scene, None, products, conditions=one.conditions, keep=keep, candidates=1, effort=0)
        for alone, among in zip(same.axis(one.axis.name).chosen.criteria, one.chosen.criteria, strict=True):
            assert replace(alone, use=None) == replace(among, use=None)
            assert alone.use == (
                among.use and pytest.approx(among.use, rel=1e-14)
            )  # sums of other arrays may round differently
    robot = bc.select(scene, None, products, conditions=chosen.conditions, keep=keep, candidates=1, effort=0)
    assert [*robot.axis("elbow").chosen.criteria] != [*chosen.axis("elbow").chosen.criteria]


def test_tables_and_json_say_where_each_condition_comes_from(chosen):
    text = " ".join(str(chosen).split())
    for part in (
        "voltage 60 V (conditions) less 15% (conditions)",
        "ambient 25 °C (given)",
        "momentary load of elbow 2.2 (conditions)",
        "voltage 50 V (actuators.elbow)",
        "safety factor 1.2 (actuators.elbow)",
        "assumed gear.mass 0.1 (given)",
    ):
        assert part in text, part
    document = json.loads(json_text(chosen))
    for found, held in [
        (document, chosen.conditions),
        *((one, chosen.axis(one["name"]).conditions) for one in document["axes"]),
    ]:
        read = dict(found["conditions"])
        assert read.pop("sources") == held.sources and Conditions(**read) == held


def test_a_written_configuration_has_the_same_conditions_to_the_last_digit(chosen, tmp_path):
    path = chosen.write_config(tmp_path / "chosen.yaml")
    data, again = yaml.safe_load(path.read_text()), bc.load_scene(path, trust="/").config
    assert again.conditions == chosen.conditions
    for one in chosen.axes:
        name = one.axis.name
        assert again.actuators[name].conditions == conditions_of(again, name) == one.conditions
    assert set(data["actuators"]["shoulder"]) <= {"motor", "gear"}  # what holds for the whole robot is written once
    assert set(data["actuators"]["elbow"]) - {"motor", "gear"} == set(ELBOW) - {"ambient"}
    assert data["actuators"]["elbow"]["assume"] == ELBOW["assume"]


def test_ratings_with_a_safety_factor_are_selected_for_with_it(products):
    found = bc.select("planar_2r", ["elbow_up"], products, candidates=1, effort=0)
    assert [one.conditions.safety_factor for one in found.axes] == [1.2, 1.2]
    assert found.conditions == Conditions()
    given = bc.select("planar_2r", ["elbow_up"], products, conditions={"safety_factor": 1.0}, candidates=1, effort=0)
    assert [one.conditions.safety_factor for one in given.axes] == [1.0, 1.0]


def test_momentary_loads_name_axes(products):
    with pytest.raises(InputError, match="momentary_loads: unknown axis 'wrist'"):
        bc.select("planar_2r", ["elbow_up"], products, conditions={"momentary_loads": {"wrist": 1.0}})


def test_every_command_says_that_the_rows_of_a_motion_do_not_determine_the_peaks(tmp_path) -> None:
    """Of five rows of a file, another sampling changes the peaks by more than 2 %; of 200 it does not."""
    few = load_catalogue().only(["rexroth_mhp093a_024", "maxon_607930", "beckhoff_tp050_ma_110", "apex_af060_50"])
    for rows, known in ((5, False), (200, True)):
        time = np.linspace(0.0, 2.0, rows)
        text = "".join(f"{t:.9f},{60.0 + 20.0 * np.sin(0.7 * t) ** 2:.12f},{-40.0 - 20.0 * t:.12f}\n" for t in time)
        file = tmp_path / f"rows_{rows}.csv"
        file.write_text(f"time [s],shoulder position [deg],elbow position [deg]\n{text}", encoding="utf-8")
        scene = bc.load_scene("planar_2r", {"motions": {"file": {"kind": "csv", "file": str(file)}}}, trust=[tmp_path])
        sizing, judged, chosen = bc.size(scene), bc.judge(scene), bc.select(scene, catalogue=few)
        swept = bc.sweep(scene, {"gravity.1": [-9.81]}, size=True)
        assert bool(sizing.undetermined) is bool(judged.undetermined) is bool(chosen.undetermined) is not known
        assert sizing.inside is judged.inside is chosen.inside is known
        assert swept.status[0] == ("pass" if known else "unknown")
        assert known or "every other row" in swept.reasons[0]
        for each in (sizing, judged, chosen):
            assert ("Not known: peaks that the rows of a motion do not determine" in str(each)) is not known


def test_given_motions_are_cycles_of_their_own_in_every_command(tmp_path) -> None:
    """The duty program of a configuration names its own motions; where others are given, it is said not to be used."""
    text = (
        "urdf: planar_2r\nmotions:\n"
        "  there: {kind: waypoints, times: [0, 2], positions: [{elbow: 0.2}, {elbow: 1}]}\n"
        "  back: {kind: waypoints, times: [0, 3], positions: [{elbow: 1}, {elbow: 0.2}]}\n"
        "duty: [there, {pause: 5}, back]\n"
        "actuators: {elbow: {ratio: 100, rated_torque: 2, peak_torque: 6, rated_speed: 300, max_speed: 500}}\n"
    )
    (tmp_path / "arm.yaml").write_text(text)
    few = load_catalogue().only(["rexroth_mhp093a_024", "beckhoff_tp050_ma_110"])
    used = {}
    for motions in (None, "there"):
        found = (
            bc.size(tmp_path / "arm.yaml", motions), bc.judge(tmp_path / "arm.yaml", motions),
            bc.select(tmp_path / "arm.yaml", motions, few),
        )  # fmt: skip
        for each in found:
            assert any("is not used: the given motions" in text for text in each.warnings) is (motions is not None)
        sizing, judged, _ = found
        used[motions] = judged.of("elbow").margins
        assert dict(sizing.joint("elbow").shaft.margins) == pytest.approx(used[motions], rel=1e-9)
    assert used[None]["continuous torque"] != pytest.approx(used["there"]["continuous torque"], abs=1e-3)


def test_a_judge_refuses_what_it_could_not_compare(tmp_path) -> None:
    with pytest.raises(InputError, match=r"momentary_loads: unknown axis 'elbw'; did you mean 'elbow'"):
        bc.judge("planar_2r", conditions={"momentary_loads": {"elbw": 3.0}})
    links = "".join(f'<link name="l{k}"/>' for k in (0, 1))
    joint = '<joint name="j" type="revolute"><parent link="l0"/><child link="l1"/><axis xyz="0 0 1"/>'
    limit = '<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>'
    (tmp_path / "bare.urdf").write_text(f'<robot name="bare">{links}{joint}{limit}</robot>')
    robot = bc.load_robot(tmp_path / "bare.urdf")
    motion = bc.waypoints(robot, [0.0, 1.0], [{}, {"j": 1.0}])
    actuators = {"j": bc.Actuator(10.0, 1.0, 2.0, 300.0, 400.0)}
    with pytest.raises(InputError, match=r"verdicts for bare: .*'l1'"):
        bc.judge(robot, motion, actuators)
    allowed = bc.judge(robot, motion, actuators, allow_massless=["l1"])
    assert allowed.inside and any("l1" in text for text in allowed.warnings)
