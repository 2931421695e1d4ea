"""Scenes' equations as casadi Functions against the code that simulations run."""

import casadi
import numpy as np
import pytest

import bellcrank as bc
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.dynamics.postures.consistent_start import consistent_start

SCENES = ("pendulum", "planar_2r_tracking", "four_bar", "rolling_disk", "bricard", "spring_pendulum")


@pytest.mark.parametrize("name", SCENES)
def test_the_right_hand_side_is_that_of_the_compiled_code(name):
    scene = bc.load_scene(name)
    system, function = system_of(scene), bc.scene_casadi(scene)
    q, v = consistent_start(scene)
    v = v + (0.0 if scene.constraints else 0.3)
    t = np.array([0.4])
    u = scene.signals_at(t)[0]
    x = np.concatenate([q, v, [0.0] * system.has_work])
    code = system.fallback if scene.constraints else system.rhs
    expected = code(t, x, u, system_parameters(scene))[: len(q) + len(v)]
    q_rate, a, multipliers = function(t, q, v, u, scene.own_parameters)
    found = np.concatenate([np.array(q_rate)[:, 0], np.array(a)[:, 0]])
    assert np.abs(found - expected).max() <= 1e-12 * max(1.0, np.abs(expected).max())
    assert multipliers.numel() == len(system.multiplier_names)


def test_casadi_differentiates_by_a_parameter():
    scene = bc.load_scene("four_bar")
    function = bc.scene_casadi(scene)
    q, v = consistent_start(scene)
    p = casadi.SX.sym("p", len(scene.own_parameters))
    slope = casadi.Function("slope", [p], [casadi.jacobian(function(0, q, v, [], p)[1], p)])
    given, step = scene.own_parameters, 1e-5
    for k in range(len(given)):
        higher, lower = (np.array(function(0, q, v, [], given + s * step * np.eye(len(given))[k])[1]) for s in (1, -1))
        expected = ((higher - lower) / (2 * step))[:, 0]
        found = np.array(slope(given))[:, k]
        assert np.abs(found - expected).max() < 1e-6 * max(1.0, np.abs(expected).max())
