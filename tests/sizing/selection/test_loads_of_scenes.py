"""Loads under the forces of a scene: tables that jump inside a motion, friction and springs, against bellcrank.size."""

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.dynamics.inverse.mechanism import mechanism_of
from bellcrank.motion.motion_entry import checked_duty
from bellcrank.sizing.selection.axis_loads_of import axis_loads
from tests.support.crane import FILES

STEPS = "time [s],elbow torque [N m]\n0,0.0\n0.7,25.0\n1.2,-5.0\n3,-5.0\n"


@pytest.fixture
def crane(tmp_path):
    stepped = FILES["scene.yaml"].replace("interpolation: linear", "interpolation: hold")
    for name, text in {**FILES, "scene.yaml": stepped, "torque.csv": STEPS}.items():
        (tmp_path / name).write_text(text)
    scene = bc.load_scene(tmp_path / "scene.yaml")
    return mechanism_of(scene), scene.motion("swing")


@pytest.mark.tier2
def test_forces_that_jump_inside_a_motion(crane):
    mechanism, motion = crane
    [cycle], sizing = axis_loads(mechanism, [motion]).cycles, bc.size(mechanism, [motion])
    for k, joint in enumerate(sizing.joints):
        assert np.abs(cycle.torque[:, k]).max() == pytest.approx(joint.peak_torque, rel=1e-9)
        rms = np.sqrt(cycle.weight @ cycle.torque[:, k] ** 2 / cycle.duration)
        assert rms == pytest.approx(joint.rms_torque, rel=1e-7)
    for jump, change in ((0.7, -25.0), (1.2, 30.0)):  # both limits are there, as the table adds to the motor
        at = np.flatnonzero(np.abs(cycle.time - jump) < 1e-9)
        assert len(at) == 2
        assert cycle.torque[at[1], 1] - cycle.torque[at[0], 1] == pytest.approx(change)


def test_a_pause_keeps_the_value_of_a_table_at_the_end_of_the_motion(crane):
    mechanism, motion = crane
    loads = axis_loads(mechanism, [motion], checked_duty(["swing", {"pause": 2}]))
    [cycle] = loads.cycles
    assert any(
        "the tables of the scene's forces are evaluated at the times of each motion" in n for n in loads.warnings
    )
    rest = np.zeros((1, 3))
    held = mechanism.torques(np.array([2.0 - 1e-9]), motion.position[-1:], rest, rest)[0][0]
    assert cycle.torque[-1] == pytest.approx(held) and cycle.weight[-1] == pytest.approx(2.0)
    assert cycle.static_torque[-1] == pytest.approx(held)
