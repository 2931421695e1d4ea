"""Old names of sizing still work in 0.5, and each says its new name."""

import importlib
import json
import sys

import pytest

import bellcrank as bc
from bellcrank.commands.size import chosen


def test_old_names_of_sizing_give_the_new_objects_with_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    config = bc.load_robot_config("geared_pendulum")
    robot = config.robot()
    motion = config.motion(robot, "lift_and_return")
    with pytest.warns(DeprecationWarning, match=r"size\(drives=…\)' is now 'size\(actuators=…\)'"):
        sizing = bc.size(robot, motion, drives=config.actuators)
    assert sizing.joints == bc.size(robot, motion, config.actuators).joints
    with pytest.warns(DeprecationWarning, match=r"'Sizing.study' is now 'Sizing.inputs'"):
        mechanism, motions, actuators = sizing.study
    assert (mechanism, motions, actuators) == sizing.inputs and actuators == config.actuators
    with pytest.warns(DeprecationWarning, match=r"'Sizing.undriven' is now"):
        assert sizing.undriven == sizing.joints_without_actuator == ()
    shaft = sizing.joint("shoulder").shaft
    with pytest.warns(DeprecationWarning, match=r"'ShaftSizing.drive' is now 'ShaftSizing.actuator'"):
        assert shaft.drive is shaft.actuator is config.actuators["shoulder"]
    with pytest.warns(DeprecationWarning, match="mechanism_and_motions"):
        _, [same] = chosen(config, robot, [])
    assert same.name == motion.name
    monkeypatch.delitem(sys.modules, "bellcrank.sizing.report", raising=False)
    with pytest.warns(DeprecationWarning, match=r"'bellcrank.sizing.report' is now 'bellcrank.sizing.sizing_files'"):
        old = importlib.import_module("bellcrank.sizing.report")
    assert old.csv_text(sizing).startswith("joint,torque unit")
    document = json.loads(old.json_text(sizing))
    assert document["joints_without_drive"] == document["joints_without_actuator"] == []
    [joint] = document["joints"]
    assert joint["shaft"]["drive"] == joint["shaft"]["actuator"] and joint["shaft"]["drive"]["ratio"] == 50.0
