"""casadi Functions of robots against their compiled code."""

import runpy
from pathlib import Path

import casadi
import numpy as np
import pytest

import bellcrank as bc
from bellcrank.robot.dynamics.robot_derivatives import SIGNATURES

PARAMETERS = ["link.forearm_link.mass", "joint.elbow_joint.origin.x"]


@pytest.fixture(scope="module", params=["ur5", "solo12"])
def robot(request):
    return bc.load_robot(request.param, floating_base=request.param == "solo12")


@pytest.fixture
def state(robot):
    random = np.random.default_rng(2)
    q = random.uniform(-1.5, 1.5, robot.nq)
    if robot.floating_base:
        q[3:7] /= np.linalg.norm(q[3:7])
    return q, random.normal(size=robot.nv), random.normal(size=robot.nv)


def compiled(robot, name, q, v, third):
    if name == "frame":
        return (*robot.frame_pose(robot.frame_names[-1], q), *robot.frame_velocity(robot.frame_names[-1], q, v))
    arguments = (q, v, third)[: len(SIGNATURES[name][0])]
    found = getattr(robot, name)(*arguments)
    return found if isinstance(found, tuple) else (found,)


@pytest.mark.tier2
@pytest.mark.parametrize("name", SIGNATURES)
def test_values_are_those_of_the_compiled_code(robot, state, name):
    function = robot.casadi(name, frame=robot.frame_names[-1] if name == "frame" else None)
    inputs, outputs = SIGNATURES[name]
    assert (function.name_in(), function.name_out()) == (list(inputs), list(outputs))
    found = function(**dict(zip(inputs, state, strict=False)))
    for output, expected in zip(outputs, compiled(robot, name, *state), strict=True):
        value = np.array(found[output]).reshape(np.shape(expected))
        assert np.abs(value - expected).max() <= 1e-12 * max(1e-3, np.abs(expected).max())


def test_parameters_are_an_input_and_are_differentiated():
    robot = bc.load_robot("ur5", friction={"elbow_joint": (0.3, 0.2)})
    random = np.random.default_rng(1)
    q, v, a = random.normal(size=(3, 6))
    function = robot.casadi("inverse_dynamics", parameters=PARAMETERS)
    tree = robot.equations.tree
    forearm, elbow = tree.frames[tree.frame_index("forearm_link")], tree.frames[tree.frame_index("elbow_joint")]
    values = [forearm.mass, elbow.in_parent.translation[0]]
    assert np.abs(np.array(function(q, v, a, values))[:, 0] - robot.inverse_dynamics(q, v, a)).max() < 1e-11
    p = casadi.SX.sym("p", 2)
    slope = casadi.Function("slope", [p], [casadi.jacobian(function(q, v, a, p), p)])
    expected = robot.inverse_dynamics_parameter_derivatives(q, v, a, PARAMETERS)
    assert np.abs(np.array(slope(values)) - expected).max() <= 1e-12 * np.abs(expected).max()


def test_wrong_names_are_told():
    robot = bc.load_robot("planar_2r")
    for arguments, message in (
        ({"name": "inverse_dynamic"}, "did you mean 'inverse_dynamics'"),
        ({"name": "frame"}, "the name of a frame"),
        ({"name": "energy", "frame": "tip"}, "None for other functions"),
        ({"name": "frame", "frame": "tipp"}, "tip"),
        ({"name": "energy", "parameters": ["link.link_3.mass"]}, "link_2"),
        ({"name": "configuration_rate", "parameters": ["link.link_1.mass"]}, "has no parameters"),
    ):
        with pytest.raises(bc.InputError, match=message):
            robot.casadi(**arguments)


@pytest.mark.tier2
def test_ipopt_swings_the_arm_up_in_the_example(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(Path(__file__).parents[2] / "examples" / "planar_2r_swing_up.py"), run_name="__main__")
    assert (tmp_path / "planar_2r_swing_up.html").stat().st_size > 100_000
