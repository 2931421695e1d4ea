"""`scene_casadi` of scenes with switching formulas and sampled controllers."""

import json

import casadi
import numpy as np
import pytest

import bellcrank as bc


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("switching") / "scene.yaml"
    force = {"name": "push", "kind": "joint_force", "joint": "swing",
             "value": "3 * abs(swing.position) + 2 * step(swing.velocity) + min(t, 0.2)"}  # fmt: skip
    control = {"name": "servo", "kind": "state_space", "joint": "swing", "inputs": ["-swing.position"], "D": [[4]],
               "sample_time": 0.05}  # fmt: skip
    data = {"urdf": "pendulum", "actuated": ["swing"], "initial": {"swing": -0.5}, "forces": [force],
            "control": [control], "simulate": {"duration": 4.0}}  # fmt: skip
    path.write_text(json.dumps(data))
    return bc.load_scene(path)


def test_switching_formulas_follow_the_state_and_held_torques_are_inputs(scene):
    """At every row of a run the accelerations are those of the run, whatever the entries of sides are."""
    run, function = bc.simulate(scene), bc.scene_casadi(scene)
    torque = run.joint("swing").actuator_torque
    rng = np.random.default_rng(3)
    smooth = np.abs(np.mod(run.time, 0.05) - 0.025) < 0.02  # between samples, where the torque has one value
    rows = np.flatnonzero(smooth & (np.abs(run.velocity[:, 0]) > 1e-3) & (np.abs(run.position[:, 0]) > 1e-3))
    assert len(rows) > 20 and (run.velocity[rows] > 0).any() and (run.velocity[rows] < 0).any()
    for k in rows[:: len(rows) // 20]:
        u = np.zeros(function.size1_in("u"))
        u[:-2] = rng.integers(0, 2, len(u) - 2)
        u[-1] = torque[k]
        found = function(run.time[k], run.position[k], run.velocity[k], u, scene.own_parameters)[1]
        assert float(found) == pytest.approx(run.acceleration[k, 0], rel=1e-9, abs=1e-9)


def test_the_slope_by_a_held_torque_is_the_inverse_of_the_inertia(scene):
    function = bc.scene_casadi(scene)
    u = casadi.SX.sym("u", function.size1_in("u"))
    slope = casadi.jacobian(function(0.1, 0.3, 0.2, u, scene.own_parameters)[1], u)
    values = np.array(casadi.Function("slope", [u], [slope])(np.zeros(u.numel()))).ravel()
    assert values[-1] == pytest.approx(1.0 / scene.robot.mass_matrix([0.3])[0, 0], rel=1e-12)
    assert not values[:-1].any()
