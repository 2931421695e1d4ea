"""Conditions of an axis: each field is what is given, or that of the axis, or of the configuration, or the default."""

import dataclasses

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import bellcrank as bc
from bellcrank.actuators.actuator_fields import KEYS, OF_AN_AXIS, UNITS, condition_data, given_conditions
from bellcrank.actuators.conditions import Conditions
from bellcrank.config.fields import Fields
from bellcrank.config.yaml_file import read_yaml
from bellcrank.errors import InputError
from bellcrank.sizing.drive_verdicts import conditions_of

MOTOR = "motor: {id: m, nominal_torque: 1 N m, rotor_inertia: 1.0e-5}, gear: {id: g, kind: spur, ratio: 5}"
ROBOT = {  # a value for every key, none of which is a default
    "voltage": ("48 V", 48.0),
    "voltage_ratio": (3, 3.0),
    "voltage_reserve": ("20 %", 0.2),
    "winding_temperature": ("80 °C", 80.0),
    "ambient": ("40 °C", 40.0),
    "altitude": (1500, 1500.0),
    "safety_factor": (1.5, 1.5),
    "inertia_ratio": (7, 7.0),
    "commutation": ("brushless", "brushless"),
    "construction": ("housed", "housed"),
    "life": ("20000 h", 20000.0),
    "brake": (True, True),
    "bus_capacitance": ("470 µF", 470e-6),
    "bus_max_voltage": (60, 60.0),
    "brake_resistor_power": ("0.1 kW", 100.0),
    "brake_resistance": ("12 ohm", 12.0),
    "brake_resistor_peak_power": ("2 kW", 2000.0),
    "supply_power": ("2 kW", 2000.0),
    "momentary_loads": ({"shoulder": "80 N m"}, (("shoulder", 80.0),)),
    "assume": ({"motor.rotor_inertia": "3 g cm^2"}, (("motor.rotor_inertia", 3e-7),)),
}
AXIS = {
    "voltage": 24.0,
    "voltage_ratio": 1.5,
    "voltage_reserve": 0.3,
    "winding_temperature": 90.0,
    "ambient": 25.0,  # the default, which differs from what the robot says
    "altitude": 0.0,
    "safety_factor": 1.0,
    "inertia_ratio": 5.0,
    "commutation": "brushed",
    "construction": "frameless",
    "life": 1000.0,
    "brake": False,
    "assume": {"gear.efficiency": 0.6},
}
GIVEN = {
    "voltage": 36.0,
    "voltage_ratio": 2.0,
    "voltage_reserve": 0.1,
    "winding_temperature": 25.0,
    "ambient": 30.0,
    "altitude": 500.0,
    "safety_factor": 2.0,
    "inertia_ratio": 10.0,
    "commutation": None,
    "construction": "housed",
    "life": None,
    "brake": True,
    "bus_capacitance": None,
    "bus_max_voltage": 70.0,
    "brake_resistor_power": 0.0,
    "brake_resistance": None,
    "brake_resistor_peak_power": 50.0,
    "supply_power": None,
    "momentary_loads": {"elbow": 5.0},
    "assume": {"gear.mass": 0.5},
}


def config_of(folder, conditions=None, elbow=None, actuator=MOTOR):
    own = "".join(
        f", {yaml.safe_dump({key: value}, default_flow_style=True).strip()[1:-1]}"
        for key, value in (elbow or {}).items()
    )
    text = f"urdf: planar_2r\nactuators:\n  elbow: {{{actuator}{own}}}\n"
    text += "" if conditions is None else yaml.safe_dump({"conditions": conditions}, allow_unicode=True)
    (folder / "arm.yaml").write_text(text, encoding="utf-8")
    return bc.load_scene(folder / "arm.yaml").config


def entries(name, value):
    """The names in `sources` of a field and its values."""
    return (
        {f"{name}.{entry}": x for entry, x in dict(value).items()}
        if name in ("assume", "momentary_loads")
        else {name: value}
    )


def value_of(conditions, source):
    name, _, entry = source.partition(".")
    return dict(getattr(conditions, name)).get(entry) if entry else getattr(conditions, name)


def test_the_tables_have_every_key():
    names = {field.name for field in dataclasses.fields(Conditions)} - {"sources"}
    assert set(ROBOT) == set(GIVEN) == set(KEYS) == names and set(AXIS) == set(OF_AN_AXIS) and set(UNITS) <= names


def test_every_key_of_the_configuration_is_read_with_its_unit(tmp_path):
    config = config_of(tmp_path, {name: text for name, (text, _) in ROBOT.items()})
    for name, (_, value) in ROBOT.items():
        assert getattr(config.conditions, name) == (pytest.approx(value) if name in UNITS else value)
    assert set(config.conditions.sources.values()) == {"conditions"}
    assert {name.partition(".")[0] for name in config.conditions.sources} == set(KEYS)
    assert config.actuators["elbow"].conditions == config.conditions  # `size` judges motors under them


@pytest.mark.parametrize("name", KEYS)
def test_each_field_is_given_or_of_the_axis_or_of_the_robot_or_the_default(tmp_path, name):
    robot, given = {name: ROBOT[name][0]}, {name: GIVEN[name]}
    axis = {name: AXIS[name]} if name in AXIS else {}
    for has_robot in (False, True):
        for has_axis in (False, True) if axis else (False,):
            config = config_of(tmp_path, robot if has_robot else None, axis if has_axis else None)
            for told in (None, given, Conditions(**given)):
                found = conditions_of(config, "elbow", told)
                expected = entries(name, getattr(Conditions(), name))
                sources = {}
                if has_robot:
                    expected |= entries(name, ROBOT[name][1])
                    sources |= dict.fromkeys(entries(name, ROBOT[name][1]), "conditions")
                if has_axis:
                    expected |= entries(name, AXIS[name])
                    sources |= dict.fromkeys(entries(name, AXIS[name]), "actuators.elbow")
                if told is not None:
                    expected |= entries(name, GIVEN[name])
                    sources |= dict.fromkeys(entries(name, GIVEN[name]), "given")
                assert {each: value_of(found, each) for each in expected} == pytest.approx(expected)
                assert found.sources == sources
                others = [each for each in KEYS if each != name]
                assert all(getattr(found, each) == getattr(Conditions(), each) for each in others)


def test_the_whole_robot_and_other_axes_have_nothing_of_an_axis(tmp_path):
    config = config_of(tmp_path, {"ambient": 40}, {"ambient": 60, "voltage": 24})
    assert conditions_of(config) == conditions_of(config, "shoulder") == Conditions(ambient=40.0)
    assert conditions_of(None, "elbow", {"ambient": 30.0}) == Conditions(ambient=30.0)


def test_ratings_have_a_safety_factor_of_the_axis_or_of_the_robot(tmp_path):
    ratings = "ratio: 50, rated_torque: 1, peak_torque: 3, rated_speed: 300, max_speed: 500"
    config = config_of(tmp_path, {"safety_factor": 1.5}, actuator=ratings)
    assert config.actuators["elbow"].safety_factor == 1.5
    assert conditions_of(config, "elbow").sources == {"safety_factor": "conditions"}
    config = config_of(tmp_path, {"safety_factor": 1.5}, {"safety_factor": 1.2}, ratings)
    assert config.actuators["elbow"].safety_factor == conditions_of(config, "elbow").safety_factor == 1.2
    assert conditions_of(config, "elbow").sources == {"safety_factor": "actuators.elbow"}


@pytest.mark.parametrize(
    ("conditions", "message"),
    [
        ({"ambiant": 30}, r"arm.yaml: conditions.ambiant \(line 5\): unknown key 'ambiant'; did you mean 'ambient'?"),
        ({"voltage": "48 A"}, r"arm.yaml: conditions.voltage \(line 5\): expected a number in V"),
        ({"voltage": None}, "conditions.voltage .*expected a number in V, found nothing"),
        ({"safety_factor": 0.5}, "conditions.safety_factor .*expected a finite number of at least 1"),
        ({"ambient": 900}, "conditions.ambient .*expected at most 300 °C"),
        ({"ambient": -200}, "conditions.ambient .*expected a finite number of at least -100"),
        ({"brake": 1}, "conditions.brake .*expected true or false"),
        ({"assume": {"gear.efficency": 0.5}}, "conditions.assume.gear.efficency .*did you mean 'gear.efficiency'"),
        ({"momentary_loads": {"elbow": "5 kg"}}, "conditions.momentary_loads.elbow .*expected a number in N m or N"),
        ({"momentary_loads": 5}, "conditions.momentary_loads .*expected a mapping"),
        ({"assumed": {}}, "unknown key 'assumed'; did you mean 'assume'"),
    ],
)
def test_wrong_conditions_are_one_sentence_with_file_line_and_key(tmp_path, conditions, message):
    with pytest.raises(InputError, match=message):
        config_of(tmp_path, conditions)


def test_an_axis_has_no_conditions_of_the_bus(tmp_path):
    with pytest.raises(InputError, match=r"actuators.elbow.supply_power .*unknown key 'supply_power'"):
        config_of(tmp_path, elbow={"supply_power": 100})


def test_a_default_that_is_given_counts_and_replace_keeps_what_is_given():
    cool = Conditions(ambient=25.0)
    assert cool == Conditions() and cool.sources == {"ambient": "given"}
    assert Conditions(ambient=40.0).updated(cool).ambient == 25.0
    changed = dataclasses.replace(Conditions(voltage=48.0), altitude=2000.0)
    assert changed.given == {"voltage": 48.0, "altitude": 2000.0}
    assert dataclasses.replace(Conditions(assume={"motor.mass": 1.0}), assume={}).sources == {}


@pytest.mark.parametrize("given", [{"ambience": 1.0}, {"sources": {}}, 3, {"ambient": "hot"}])
def test_wrong_given_conditions_are_refused(given):
    with pytest.raises(InputError, match=r"ambien|sources|Conditions"):
        Conditions().updated(given)


NUMBERS = {
    "voltage": st.floats(1e-3, 1e4),
    "voltage_ratio": st.floats(1.001, 1e3),
    "voltage_reserve": st.floats(0.0, 0.9),
    "winding_temperature": st.floats(-200.0, 400.0),
    "ambient": st.floats(-100.0, 300.0),
    "altitude": st.floats(-500.0, 4000.0),
    "safety_factor": st.floats(1.0, 1e6),
    "inertia_ratio": st.floats(1e-3, 1e6),
    "commutation": st.sampled_from(["brushed", "brushless"]),
    "construction": st.sampled_from(["housed", "frameless"]),
    "life": st.none() | st.floats(1e-3, 1e9),
    "brake": st.booleans(),
    "bus_capacitance": st.floats(1e-12, 1e3),
    "bus_max_voltage": st.floats(1e-3, 1e4),
    "brake_resistor_power": st.floats(0.0, 1e30),
    "brake_resistance": st.floats(1e-3, 1e6),
    "brake_resistor_peak_power": st.floats(1e-3, 1e30),
    "supply_power": st.floats(1e-300, 1e99),
    "momentary_loads": st.dictionaries(st.sampled_from(["elbow", "a.b", "0"]), st.floats(0.0, 1e9)),
    "assume": st.dictionaries(st.sampled_from(["gear.efficiency", "motor.mass"]), st.floats(1e-9, 1.0)),
}


@settings(max_examples=60, deadline=None)
@given(
    robot=st.fixed_dictionaries({}, optional=NUMBERS),
    axis=st.fixed_dictionaries({}, optional={name: NUMBERS[name] for name in OF_AN_AXIS if name != "life"}),
)
def test_what_is_written_reads_back_to_the_last_digit(tmp_path_factory, robot, axis):
    path = tmp_path_factory.mktemp("written") / "c.yaml"
    common = Conditions(**robot)
    of_axis = common.updated(axis)
    written = {"robot": condition_data(common), "axis": condition_data(of_axis, common, OF_AN_AXIS)}
    path.write_text(yaml.safe_dump(written, allow_unicode=True), encoding="utf-8")
    read = Fields(read_yaml(path), str(path))
    again = Conditions().updated(given_conditions(read.mapping("robot")))
    assert again == common and again.updated(given_conditions(read.mapping("axis"), OF_AN_AXIS)) == of_axis
    repeated = {name for name, value in written["axis"].items() if value == written["robot"].get(name)}
    assert not repeated
