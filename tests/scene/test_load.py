"""`bc.load` reads any file that describes a machine, and every function takes what it returns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import bellcrank as bc

PENDULUM = (
    '<mujoco><option gravity="0 0 -9.8"/><worldbody><body name="b" pos="0 0 1">'
    '<joint name="j" type="hinge" axis="0 1 0" armature="0.1" damping="0.2"/>'
    '<geom type="sphere" size="0.1" pos="0.3 0 0" mass="2"/></body></worldbody>MORE</mujoco>'
)
MOTOR = '<actuator><motor name="m" joint="j" gear="50"/></actuator>'


def test_a_tree_is_a_robot_and_whatever_says_more_is_a_scene(tmp_path: Path) -> None:
    plain, driven = tmp_path / "plain.xml", tmp_path / "driven.xml"
    plain.write_text(PENDULUM.replace("MORE", ""))
    driven.write_text(PENDULUM.replace("MORE", MOTOR))
    assert isinstance(bc.load(plain), bc.Robot) and isinstance(bc.load("talos"), bc.Robot)
    assert isinstance(bc.load(driven), bc.Scene) and isinstance(bc.load("ur5"), bc.Scene)
    changed = bc.load(plain, {"gravity": [0, 0, 0]})
    assert isinstance(changed, bc.Scene) and not changed.robot.gravity.any()


def test_a_robot_is_simulated_as_it_was_loaded(tmp_path: Path) -> None:
    file = tmp_path / "pendulum.xml"
    file.write_text(PENDULUM.replace("MORE", ""))
    robot = bc.load_robot(
        file, gravity=(0, 0, -1.62), payloads=[bc.Payload(0.5, "b", (0.1, 0.0, 0.0))], friction={"j": (0.1, 0.0)},
        rotor_inertia={"j": 0.2}, frames={"tip": ("b", (0.3, 0.0, 0.0), (0.0, 0.0, 0.0))},
    )  # fmt: skip
    run = bc.simulate(robot, duration=0.5, overrides={"initial.j": 0.3})
    q, v = run.position[-1], run.velocity[-1]
    expected = robot.forward_dynamics(q, v, np.zeros(1))
    assert run.acceleration[-1] == pytest.approx(expected, rel=1e-12) and run.frame("tip").position.shape[1] == 3
    assert bc.linearise(robot).A.shape == (2, 2) and bc.mobility(robot) is not None


def test_a_robot_that_no_scene_describes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(bc.InputError, match="a scene cannot say how it was loaded"):
        bc.simulate(bc.load_robot("planar_2r", clean=False))
    springs = tmp_path / "spring.xml"
    springs.write_text(PENDULUM.replace("MORE", "").replace('damping="0.2"', 'damping="0.2" stiffness="3"'))
    with pytest.raises(bc.InputError, match="closes loops or has springs, which a Robot leaves out"):
        bc.simulate(bc.load_robot(springs), duration=0.1)
