"""The reference problems: every one is solved within its tolerances, and a wrong run of it is found out."""

import numpy as np
import pytest

from bellcrank.errors import InputError
from bellcrank.simulation.simulate import simulate
from bellcrank_bench.measurements import hard_cases
from bellcrank_bench.measurements.friction_and_stops import friction_and_stops
from bellcrank_bench.problems.checks import Check
from bellcrank_bench.problems.free_body import INERTIA, spin_closed_form
from bellcrank_bench.problems.light_cart_pole import reference
from bellcrank_bench.problems.planar_2r import fall_time
from bellcrank_bench.problems.registry import PROBLEMS, problem

LONG_TO_COMPILE = {"chain_100", "n_four_bar_40"}  # `bellcrank bench --hard` runs it
AT_REST = {"tracking", "ur5_held", "panda_held"}  # exact at any tolerance: the motion never departs from its target


@pytest.mark.tier2
@pytest.mark.parametrize("name", sorted(set(PROBLEMS) - LONG_TO_COMPILE))
def test_the_known_answer_is_met(name):
    checks = problem(name).checks()
    assert len(checks) >= 2
    assert [check for check in checks if not check.passed] == []


@pytest.mark.tier2
@pytest.mark.parametrize("name", sorted(set(PROBLEMS) - LONG_TO_COMPILE - AT_REST))
def test_a_run_with_loose_tolerances_is_judged_wrong(name):
    p = problem(name)
    run = simulate(p.make(), **(p.settings | {"rtol": 1e-2, "atol": 1e-2}))
    assert any(not check.passed for check in p.judge(run)[1:])


@pytest.mark.parametrize("name", sorted(AT_REST))
def test_a_robot_that_leaves_its_target_is_judged_wrong(name):
    p = problem(name)
    scene = p.make()
    joint = scene.robot.joint_names[1]
    run = simulate(scene, **p.settings, overrides={f"initial.velocity.{joint}": 1e-6})
    assert any(not check.passed for check in p.judge(run)[1:])


def test_a_check_of_a_number_that_is_not_finite_never_passes():
    assert not Check("drift", float("nan"), 1.0).passed
    assert not Check("ratio", float("inf"), 20.0, at_least=True).passed
    assert Check("ratio", 21.0, 20.0, at_least=True).passed
    assert not Check("ratio", 19.0, 20.0, at_least=True).passed


def test_an_unknown_problem_is_refused_with_what_there_is():
    with pytest.raises(InputError, match=r"unknown problem 'pendulm'.*upright_pendulum"):
        problem("pendulm")


def test_the_hard_cases_name_every_problem_and_its_seconds(monkeypatch):
    few = {name: problem(name) for name in ("upright_pendulum", "middle_axis_flips")}
    monkeypatch.setattr(hard_cases, "PROBLEMS", few)
    for slow in ("friction_and_stops", "chain_speed", "loop_speed", "first_runs", "compile_time"):
        monkeypatch.setattr(hard_cases, slow, lambda: [Check("time", 1.0, 2.0, "s")])
    begun = []
    cases = hard_cases.hard_cases(begun.append)
    assert [case.name for case in cases] == begun
    assert begun[:2] == ["upright_pendulum", "middle_axis_flips"] and "first_runs" in begun
    assert all(check.passed for case in cases for check in case.checks)
    assert all(case.seconds >= 0.0 for case in cases)


@pytest.mark.tier2
def test_friction_and_stops_follow_their_closed_forms():
    checks = friction_and_stops()
    assert len([check for check in checks if check.unit == "s"]) == 3
    assert all(check.passed for check in checks if check.unit == "s")


# ---- the references themselves


def test_the_cart_poles_reference_obeys_newtons_law():
    """In its accelerations by differences: (M + m) ẍ + m (θ̈ cos θ - θ̇² sin θ) = 0 and θ̈ + ẍ cos θ + g sin θ = 0."""
    t, h = np.array([0.05, 0.2, 0.35, 0.6, 1.1, 1.6, 5.0, 9.3]), 1e-3
    rows = np.array([reference(t + k * h) for k in range(-4, 5)])
    slopes = np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / (840 * h)
    curves = np.array([-9, 128, -1008, 8064, -14350, 8064, -1008, 128, -9]) / (5040 * h * h)
    x, angle = rows[4].T
    rate = np.tensordot(slopes, rows, 1)[:, 1]
    ax, aa = np.tensordot(curves, rows, 1).T
    np.testing.assert_allclose((1 + 1e-6) * ax + aa * np.cos(angle) - rate**2 * np.sin(angle), 0, atol=1e-5)
    np.testing.assert_allclose(aa + ax * np.cos(angle) + 9.81 * np.sin(angle), 0, atol=1e-5)
    np.testing.assert_allclose((1 + 1e-6) * x + np.sin(angle), 1, rtol=1e-15)


def test_the_spinning_bodys_closed_form_obeys_eulers_equations():
    t, h = np.linspace(0.1, 20, 50), 1e-3
    inertia = np.array(INERTIA)
    ahead, behind, twice, back = (spin_closed_form(t + k * h) for k in (1, -1, 2, -2))
    rate = (8 * (ahead - behind) - (twice - back)) / (12 * h)
    omega = spin_closed_form(t)
    np.testing.assert_allclose(inertia * rate, -np.cross(omega, inertia * omega), atol=1e-7)
    np.testing.assert_allclose(spin_closed_form(np.zeros(1))[0], [0, 2 * np.pi, 0.02 * np.pi], atol=1e-14)


def test_three_methods_agree_on_the_arms_fall_from_upright():
    falls = [fall_time("DOP853", 1e-12), fall_time("RK45", 1e-10), fall_time("LSODA", 1e-11)]
    assert np.ptp(falls) < 1e-8
