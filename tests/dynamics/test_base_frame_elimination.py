"""What the bodies next to the world make simpler: the same M, Jacobians and drift as without it, to the last digits."""

import casadi
import numpy as np
import pytest

from bellcrank import load_robot
from bellcrank.dynamics.constraints.constraint_derivatives import differentiate_constraints, time_derivative
from bellcrank.dynamics.equations.base_frame_elimination import BaseRotation, mass_matrix
from bellcrank.elements.symbols import Symbols
from bellcrank.robot.model.joints import random_posture
from bellcrank.scene.scene import load_scene

INERTIA = '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.3"/>'
MIMICKED_ROOT = f"""<robot name="scissors">
  <link name="base"/>
  <link name="a"><inertial><origin xyz="0.5 0.1 0"/><mass value="2"/>{INERTIA}</inertial></link>
  <link name="b"><inertial><origin xyz="0.3 0 0.1"/><mass value="1"/>{INERTIA}</inertial></link>
  <joint name="first" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
  <joint name="second" type="continuous"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>
    <mimic joint="first" multiplier="-2"/></joint>
</robot>"""


def mass_of(robot, q):
    s = Symbols(robot)
    return np.array(casadi.DM(casadi.Function("m", [s.q, s.p], [mass_matrix(s)])(q, [])))


@pytest.mark.parametrize("case", ["four_bar", "rolling_disk", "mimicked root"])
def test_mass_matrix_is_that_of_the_robot_wherever_it_stands(case, tmp_path):
    if case == "mimicked root":
        (tmp_path / "scissors.urdf").write_text(MIMICKED_ROOT)
        robot = load_robot(tmp_path / "scissors.urdf")
    else:
        robot = load_scene(case).robot
    random = np.random.default_rng(1)
    for _ in range(5):
        q = random_posture(robot, random)
        np.testing.assert_allclose(mass_of(robot, q), robot.mass_matrix(q), atol=1e-12)


def test_mass_matrix_of_a_disk_keeps_its_digits_a_hundred_kilometres_away():
    robot = load_scene("rolling_disk").robot
    q = np.array([1e5, -1e5, 0.1, 0.5, 0.5, -0.5, 0.5])
    np.testing.assert_array_equal(mass_of(robot, q), np.diag([0.5, 0.5, 0.5, 0.00125, 0.0025, 0.00125]))


def test_constraints_of_a_free_body_differentiate_to_what_the_quaternion_gives():
    scene = load_scene("rolling_disk")
    s = Symbols(scene.robot, scene.parameters, scene.frames)
    c = differentiate_constraints(scene.constraints, None, s)
    residuals = [constraint.residual(s) for constraint in scene.constraints]
    speed = casadi.vertcat(*[time_derivative(r.position, s) for r in residuals], *[r.velocity for r in residuals])
    by_quaternion = [speed, casadi.jacobian(speed, s.v), time_derivative(speed, s)]
    by_rotation = [c.velocity_residual, c.jacobian, c.drift]
    both = casadi.Function("f", [s.q, s.v, s.t, s.u, s.p], [casadi.densify(x) for x in (*by_rotation, *by_quaternion)])
    random = np.random.default_rng(2)
    for _ in range(5):
        values = both(random_posture(scene.robot, random), random.normal(size=6), 0.0, [], scene.parameter_values)
        for ours, theirs in zip(values[:3], values[3:], strict=True):
            np.testing.assert_allclose(np.array(ours), np.array(theirs), atol=1e-12)


def test_frames_in_the_base_s_rotation_are_the_frames():
    scene = load_scene("rolling_disk")
    s = Symbols(scene.robot)
    base = BaseRotation(s)
    ours, theirs = (each.frame("disk") for each in (base, s))
    flat = casadi.vertcat(*[base.expand(casadi.vec(x)) for x in ours], *[casadi.vec(x) for x in theirs])
    values = np.array(
        casadi.Function("f", [s.q, s.v], [flat])(random_posture(scene.robot, np.random.default_rng(3)), range(6))
    )
    np.testing.assert_allclose(values[:18], values[18:], atol=1e-14)
