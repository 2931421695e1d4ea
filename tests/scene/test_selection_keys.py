"""The keys transmissions, mounts and duty of robot configurations, and what other commands say about them."""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.actuators.coupled_transmission import CoupledTransmission
from bellcrank.actuators.mount import Mount
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.errors import InputError
from bellcrank.motion.motion_entry import DutyStep
from bellcrank.simulation.trajectory.scene_notes import scene_notes

ACTUATOR = "{ratio: 50, rated_torque: 1, peak_torque: 3, rated_speed: 300, max_speed: 500, rotor_inertia: 1.0e-5}"
CONFIG = f"""urdf: planar_2r
gravity: [0, -9.81, 0]
motions:
  there: {{kind: waypoints, times: [0, 1], positions: [{{}}, {{elbow: 1.0}}]}}
  back: {{kind: waypoints, times: [0, 1], positions: [{{elbow: 1.0}}, {{}}]}}
actuators: {{left: {ACTUATOR}, right: {ACTUATOR}}}
transmissions:
  - {{joints: [shoulder, elbow], motors: [left, right], matrix: [[1, 1], [1, -1]]}}
mounts:
  left: {{included_mass: 500 g}}
  right: {{link: link_1, axis: [0, 1, 0], included_axial_inertia: 10 kg cm^2}}
duty: [there, {{motion: back, repeat: 1}}, {{pause: 1 min}}]
"""


def scene_of(folder, text=CONFIG):
    (folder / "arm.yaml").write_text(text)
    return bc.load_scene(folder / "arm.yaml")


def test_the_keys_are_read(tmp_path):
    config = scene_of(tmp_path).config
    assert config.transmissions == (
        CoupledTransmission(("shoulder", "elbow"), ("left", "right"), ((1.0, 1.0), (1.0, -1.0))),
    )
    assert config.mounts == {
        "left": Mount(included_mass=0.5),
        "right": Mount(link="link_1", axis=(0.0, 1.0, 0.0), included_axial_inertia=1e-3),
    }
    assert config.duty == (DutyStep("there"), DutyStep("back"), DutyStep(pause=60.0))
    assert config.coupled_motors == ("left", "right")
    assert config.joints_with_actuators == ("shoulder", "elbow")
    assert not config.robot().rotor_inertia.any()  # the rotors of coupled motors belong to no single joint
    assert bc.load_scene(tmp_path / "arm.yaml").config.duty == config.duty


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "matrix: [[1, 1], [1, -1]]",
            "matrix: [[1, 1], [1, 1]]",
            "transmissions[1].matrix (line 8): a matrix with an accurate inverse is required",
        ),
        ("matrix: [[1, 1], [1, -1]]", "matrix: [[1, 1]]", "matrix"),
        ("matrix: [[1, 1], [1, -1]]", "matrix: [[1, a], [1, 1]]", "matrix (line 8): expected a number"),
        (
            "motors: [left, right]",
            "motors: [left]",
            "transmissions[1].motors (line 8): expected as many motors as joints",
        ),
        ("motors: [left, right]", "motors: left", "expected a list of motors"),
        ("joints: [shoulder, elbow]", "joint: [shoulder, elbow]", "did you mean 'joints' by 'joint'?"),
        ("included_mass: 500 g", "included_mass: -1", "mounts.left.included_mass (line 10): expected 0 kg or more"),
        ("included_mass: 500 g", "included_mas: 1", "unknown key 'included_mas'; did you mean 'included_mass'?"),
        ("axis: [0, 1, 0]", "axis: [0, 0, 0]", "mounts.right.axis (line 11): expected a direction"),
        ("duty: [there,", "duty: [ther,", "duty (line 12): unknown motion 'ther'; did you mean 'there'?"),
        ("pause: 1 min", "pause: 0", "duty[3].pause"),
        ("repeat: 1}", "repeat: 1.5}", "duty[2].repeat (line 12): expected a whole number"),
        ("duty: [there, {", "duty: [{", ""),
        ("actuators: {left", "actuators: {shoulder", "joint 'shoulder' belongs to a coupled transmission"),
    ],
)
def test_wrong_keys_are_told_with_their_place(tmp_path, old, new, message):
    assert old in CONFIG
    if not message:
        assert scene_of(tmp_path, CONFIG.replace(old, new)).config.duty[0] == DutyStep("back")
        return
    with pytest.raises(InputError) as caught:
        scene_of(tmp_path, CONFIG.replace(old, new))
    assert message in str(caught.value)
    assert "arm.yaml" in str(caught.value) and "\n" not in str(caught.value)


def test_a_motion_of_the_program_must_be_there(tmp_path):
    with pytest.raises(InputError, match="duty"):
        scene_of(tmp_path, CONFIG.replace("duty: [", "duty: [there, away, ").replace("away", "awry"))


def test_size_says_what_it_leaves_out(tmp_path):
    sizing = bc.size(scene_of(tmp_path))
    plain = bc.size(scene_of(tmp_path, CONFIG[: CONFIG.index("actuators:")]))
    assert not sizing.unsizable and [motor.name for motor in sizing.motors] == ["left", "right"]
    assert sum("are judged along the duty program of the configuration" in text for text in sizing.warnings) == 1
    assert all("in 'duty'" in one.text for motor in sizing.motors for one in motor.shaft.judged.judged)
    assert sum("torques and speeds of shoulder, elbow are those of the joints" in text for text in sizing.warnings) == 1
    assert [joint.peak_torque for joint in sizing.joints] == pytest.approx([one.peak_torque for one in plain.joints])
    assert all(joint.shaft is None for joint in sizing.joints)


def test_simulate_says_that_coupled_rotors_are_left_out(tmp_path):
    scene_of(tmp_path)
    scene = bc.load_scene(tmp_path / "arm.yaml")
    assert any(
        "the rotors of the motors of coupled transmissions are not included: left, right" in n
        for n in scene_notes(scene)
    )
    run = bc.simulate(scene, duration=0.05)
    assert np.isfinite(run.position).all()


def test_a_linkage_takes_the_joints_of_coupled_motors_as_actuated(tmp_path):
    text = f"""urdf: five_bar
gravity: [0, -9.81, 0]
frames: {{right_tip: {{link: right_forearm, xyz: [0.09, 0, 0]}}}}
constraints:
  - {{name: tool_pin, kind: point, frame_a: tool, frame_b: right_tip}}
actuators: {{one: {ACTUATOR}, two: {ACTUATOR}}}
transmissions:
  - {{joints: [left_motor, right_motor], motors: [one, two], matrix: [[1, 1], [0, 2]]}}
initial: {{left_motor: 110 deg, right_motor: 95 deg, left_elbow: {{guess: -60 deg}}, right_elbow: {{guess: 50 deg}}}}
"""
    (tmp_path / "bar.yaml").write_text(text)
    linkage = Linkage(bc.load_scene(tmp_path / "bar.yaml"))
    assert [joint.name for joint in linkage.motors] == ["left_motor", "right_motor"]
