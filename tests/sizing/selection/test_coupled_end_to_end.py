"""Motors of coupled transmissions from selection to `size` of the written file: the same loads by both routes."""

import json

import numpy as np
import pytest
from coupled_robots import SCARA, WRIST
from sized_catalogue import sized_catalogue

import bellcrank as bc
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.powertrain import PowerTrains
from bellcrank.sizing.sizing_files import json_text
from tests.support.written import csv_text

pytestmark = pytest.mark.tier2

SCARA_CONFIG = """name: SCARA
urdf: scara.urdf
motions:
  lift: {kind: waypoints, times: [0, 0.6, 1.4], positions: [{}, {z: 0.2, w: 3.0, shoulder: 0.5}, {}], samples: 401}
transmissions:
  - {joints: [z, w], motors: [nut, spline], matrix: [[314.1592653589793, 1], [0, 1]]}
"""
WRIST_CONFIG = """name: Wrist
urdf: wrist.urdf
motions:
  bow: {kind: waypoints, times: [0, 0.5, 1.5], positions: [{}, {pitch: 0.5, roll: 1.0}, {}], samples: 401}
  turn: {kind: waypoints, times: [0, 0.8], positions: [{}, {roll: -2.0}], samples: 401}
transmissions:
  - {joints: [pitch, roll], motors: [left, right], matrix: [[1, 1], [1, -1]]}
"""
RATED = "{ratio: 20, rated_torque: 1, peak_torque: 3, rated_speed: 300, max_speed: 900, rotor_inertia: 1.0e-5}"


@pytest.fixture(params=["scara", "wrist"])
def config_path(request, tmp_path):
    for name, urdf, text in (("scara", SCARA, SCARA_CONFIG), ("wrist", WRIST, WRIST_CONFIG)):
        (tmp_path / f"{name}.urdf").write_text(urdf)
        (tmp_path / f"{name}.yaml").write_text(text)
    return tmp_path / f"{request.param}.yaml"


def test_size_of_the_written_file_judges_the_motors_as_the_selection_does(config_path, tmp_path):
    selection = bc.select(config_path, None, sized_catalogue(4, 12, 6), conditions=Conditions(voltage=48.0))
    assert all(one.chosen is not None for one in selection.axes)
    sizing = bc.size(selection.write_config(tmp_path / "chosen.yaml"))
    coupled = [motor.name for motor in sizing.motors]
    assert coupled in (["nut", "spline"], ["left", "right"]) and not sizing.unsizable
    assert set(dict(sizing.shafts)) == {one.axis.name for one in selection.axes}
    for k, one in enumerate(selection.axes):
        train, shaft = PowerTrains.of(one.chosen.motor, one.chosen.gear), dict(sizing.shafts)[one.axis.name]
        torques = [train.shaft_torque(c.torque[:, k], c.speed[:, k], c.acceleration[:, k]) for c in selection.cycles]
        means = [np.sqrt(c.weight @ t**2 / c.duration) for c, t in zip(selection.cycles, torques, strict=True)]
        speed = max(np.abs(c.speed[:, k]).max() for c in selection.cycles) * one.chosen.gear.ratio
        # `size` refines the peak at the shaft; the samples of a selection hold those of the joints, next to it
        sampled = max(np.abs(t).max() for t in torques)
        assert shaft.peak_torque.value == pytest.approx(sampled, rel=1e-4) and shaft.peak_torque.value >= sampled - 1e-9
        assert shaft.rms_torque == pytest.approx(max(means), rel=1e-6)
        assert shaft.peak_speed.value == pytest.approx(speed, rel=1e-6)
        uses = {each.name: each.use for each in one.chosen.criteria}
        assert shaft.margins["motor speed"] == pytest.approx(1.0 - uses["motor speed"], rel=1e-6)
        assert shaft.margins["peak torque"] == pytest.approx(1.0 - uses["peak torque"], rel=1e-4)
        assert shaft.margins["continuous torque"] == pytest.approx(1.0 - uses["continuous torque"], rel=1e-6)
    for motor in sizing.motors:
        k = [one.axis.name for one in selection.axes].index(motor.name)
        assert motor.joints == selection.axes[k].axis.joints
        felt = max(cycle.inertia[:, k].max() for cycle in selection.cycles)
        assert motor.shaft.inertia_ratio * motor.shaft.actuator.reflected_inertia == pytest.approx(felt, rel=1e-4)
    assert sizing.inside == selection.inside and "tightest margin" in str(sizing)


def test_motors_of_a_wrist_by_hand(config_path, tmp_path):
    """τ_left = (τ_pitch + τ_roll)/2, τ_right = (τ_pitch − τ_roll)/2 from the rows of the joints' histories."""
    (tmp_path / "rated.yaml").write_text(WRIST_CONFIG + f"actuators: {{left: {RATED}, right: {RATED}}}\n")
    sizing = bc.size(tmp_path / "rated.yaml", "bow")
    history = sizing.histories["bow"]
    pitch, roll = history.joint("pitch"), history.joint("roll")
    supply = np.zeros(len(pitch.torque))
    for motor, sign in zip(sizing.motors, (1.0, -1.0), strict=True):
        torque, speed = (pitch.torque + sign * roll.torque) / 2.0, pitch.velocity + sign * roll.velocity
        shaft = torque / 20.0 + 1e-5 * 20.0 * (pitch.acceleration + sign * roll.acceleration)
        supply += shaft * 20.0 * speed
        assert abs(motor.peak_torque.value) == pytest.approx(np.abs(torque).max(), rel=1e-4)
        assert motor.peak_speed.value == pytest.approx(np.abs(speed).max(), rel=1e-4)
        assert motor.shaft.peak_torque.value == pytest.approx(np.abs(shaft).max(), rel=1e-4)
        assert motor.shaft.margins["peak torque"] == pytest.approx(1.0 - np.abs(shaft).max() / 3.0, rel=1e-4)
    assert sizing.peak_supply_power == pytest.approx(supply.max(), rel=1e-3)
    # The links' masses scale the torque at a motor's axis: twice the tolerance, twice the change.
    tolerant = [bc.size(tmp_path / "rated.yaml", "bow", mass_tolerance=share).motors[0] for share in (0.1, 0.2)]
    changes = [abs(one.peak_torque.value) - abs(sizing.motors[0].peak_torque.value) for one in tolerant]
    assert changes[0] > 0.0 and changes[1] == pytest.approx(2.0 * changes[0], rel=0.02)


def test_motors_are_in_tables_files_and_the_verdict(config_path, tmp_path):
    weak = RATED.replace("peak_torque: 3", "peak_torque: 0.001").replace("rated_torque: 1,", "rated_torque: 0.001,")
    (tmp_path / "weak.yaml").write_text(WRIST_CONFIG + f"actuators: {{left: {weak}, right: {RATED}}}\n")
    sizing = bc.size(tmp_path / "weak.yaml")
    assert not sizing.inside
    assert any(text.startswith("motor 'left': peak torque is exceeded") for text in sizing.exceeded)
    assert not any("right" in text for text in sizing.exceeded) and sizing.joints_without_actuator == ()
    text = str(sizing)
    assert (
        "joint or motor" in text and "\nleft " in text and "motor 'left'" in text and "without an actuator" not in text
    )
    rows = [line.split(",") for line in csv_text(sizing).splitlines()]
    assert [row[0] for row in rows] == ["joint", "pitch", "roll", "left", "right"]
    assert len({len(row) for row in rows}) == 1 and rows[3][-1] == "exceeded"
    document = json.loads(json_text(sizing))
    assert [(one["name"], one["joints"]) for one in document["motors"]] == [
        ("left", ["pitch", "roll"]), ("right", ["pitch", "roll"]),
    ]  # fmt: skip
