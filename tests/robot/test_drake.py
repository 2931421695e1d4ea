"""Elements that Drake adds to URDF against Drake: its figures at 100 random states are stored (drake.json)."""

import json
from pathlib import Path

import numpy as np
import pytest

import bellcrank as bc

DRAKE = json.loads((Path(__file__).parent / "drake.json").read_text())
JOINTS = DRAKE["joints"]


def scene(tmp_path, element):
    (tmp_path / "arms.urdf").write_text(DRAKE[element]["urdf"])
    return bc.load_scene(tmp_path / "arms.urdf", {"simulate.duration": 1e-6, "simulate.samples": 2})


@pytest.mark.parametrize("element", ["bushing", pytest.param("spring", marks=pytest.mark.tier2)])
def test_accelerations_of_a_spring_damper_and_a_bushing_are_drakes(element, tmp_path):
    """Two arms of three skew joints, with gravity, at random positions and velocities."""
    arms, states = scene(tmp_path, element), np.array(DRAKE[element]["states"])
    assert DRAKE["source"].startswith("Drake") and states.shape == (100, 18)
    assert [joint.name for joint in arms.robot.joints] == JOINTS
    for q, v, a in zip(*np.split(states, 3, axis=1), strict=True):
        start = {**dict(zip(JOINTS, q, strict=True)), "velocity": dict(zip(JOINTS, v, strict=True))}
        run = bc.simulate(arms, overrides={"initial": start})
        np.testing.assert_allclose(run.acceleration[0], a, rtol=0.0, atol=1e-9 * np.abs(a).max())


def test_the_points_of_a_ball_constraint_are_drakes(tmp_path):
    """The vector between them in the world, where the constraint is not satisfied."""
    (tmp_path / "arms.urdf").write_text(DRAKE["ball"]["urdf"])
    arms = bc.load_scene(tmp_path / "arms.urdf", {"initial": {joint: {"guess": 0.5} for joint in JOINTS}})
    [ball] = arms.constraints
    assert ball.kind == "point"
    for *q, x, y, z in DRAKE["ball"]["states"]:
        ends = [arms.robot.frame_pose(frame, q)[0] for frame in (ball.frame_a, ball.frame_b)]
        np.testing.assert_allclose(ends[1] - ends[0], [x, y, z], rtol=0.0, atol=1e-9)
