"""Stiffness: its detection, the warning, and solver "auto", which switches between DOP853 and Radau."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scene_ensemble import SceneEnsemble, assert_equal_rows
from stepper_problem import Problem

import bellcrank as bc
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.simulation.integration import integration
from bellcrank.simulation.integration.integration_problem import DerivativeKernels
from bellcrank_bench.problems.spring_pendulum import STIFF_SETTINGS, stiff_scene

STIFF = {key: value for key, value in STIFF_SETTINGS.items() if key != "solver"}


def van_der_pol(t, x, u, p):
    """E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, sec. IV.10, as x'' = mu (1 - x²) x' - x with
    mu = 1000 and the time divided by mu: eps = 1e-6.
    """
    return [x[1], 1e6 * ((1 - x[0] ** 2) * x[1] - x[0])]


def robertson(t, x, u, p):
    slow, fast, product = 0.04 * x[0], 1e4 * x[1] * x[2], 3e7 * x[1] ** 2
    return [-slow + fast, slow - fast - product, product]


@pytest.fixture(scope="module")
def oscillator():
    return Problem("van_der_pol", van_der_pol, [2, 0], 2, events=lambda t, x, u, p: [x[0]])


@pytest.fixture(scope="module")
def kinetics():
    return Problem("robertson_kinetics", robertson, [1, 0, 0], 1e11)


@pytest.fixture(scope="module")
def passing():
    """x = cos t: stiff until about t = 5 (Prothero and Robinson's equation), and not stiff from then on."""

    def slope(t, x, u, p):
        return [-(1 + 1e5 / (1 + ca.exp(40 * (t - 5)))) * (x[0] - ca.cos(t)) - ca.sin(t)]

    return Problem("passing", slope, [1], 40, events=lambda t, x, u, p: [x[0]])


# -- test problems


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_auto_solves_van_der_pols_equation(oscillator, tolerance):
    """At t = 2: 1.706167732170483, -0.8928097010248 (Hairer and Wanner, sec. IV.10)."""
    run, implicit = (oscillator.run(method, tolerance) for method in ("auto", "Radau"))
    assert run.status == 0 and run.switches >= 1 and run.stiff_since < run.switch_time[0] < 1e-3
    assert abs(run.end_state[0] - 1.706167732170483) < 100 * tolerance
    assert abs(run.end_state[1] + 0.8928097010248) < 100 * tolerance
    assert run.evaluations < 1.3 * implicit.evaluations and 0 < run.implicit_steps < run.accepted
    assert abs(run.event_time[0] - 0.8071) < 1e-3 and run.event_counts[0] == 2


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_auto_solves_robertsons_kinetics(kinetics, tolerance):
    """The state at t = 1e11 is that of Hairer and Wanner, sec. IV.10."""
    run, implicit = (kinetics.run(method, tolerance, atol=1e-6 * tolerance) for method in ("auto", "Radau"))
    assert run.status == 0 and run.switches == 1
    np.testing.assert_allclose(run.end_state, [0.2083340149701255e-7, 0.8333360770334713e-13, 0.999999979166505],
                               rtol=100 * tolerance)  # fmt: skip
    assert run.evaluations < 1.3 * implicit.evaluations


def test_auto_returns_to_dop853(passing):
    """The motion is stiff for 5 s of 40 s: outputs, events and statistics across two switches."""
    times = np.linspace(0, 40, 161)
    run = passing.run("auto", 1e-9, times=times)
    assert run.switches == 2
    to_radau, back = run.switch_time
    assert to_radau < 0.1 and 4.5 < back < 8.0
    # between the ends of Radau's long steps the cubic is less accurate than they are: 5e-6
    assert np.abs(run.state[:, 0] - np.cos(times)).max() < 1e-5
    ends = passing.run("auto", 1e-9, every_step=True)
    assert np.abs(ends.state[:, 0] - np.cos(ends.time)).max() < 1e-8
    expected = np.pi * (0.5 + np.arange(13))
    assert np.abs(run.event_time - expected[expected < 40]).max() < 1e-7
    explicit, implicit = run.accepted - run.implicit_steps, run.evaluations - run.implicit_evaluations
    assert explicit > 10 and run.implicit_steps > 10 and implicit > 12 * explicit
    again = passing.run("auto", 1e-9, times=times)
    assert (again.state == run.state).all() and (again.steps == run.steps).all()


def test_auto_leaves_short_runs_to_dop853(passing):
    """A run that DOP853 ends within 20,000 evaluations is not worth derivatives."""
    run, explicit = (passing.run(method, 1e-6, t1=0.01, times=[0.005, 0.01]) for method in ("auto", "DOP853"))
    assert run.switches == 0 and run.stiff_steps > 0 and (run.state == explicit.state).all()


@pytest.mark.parametrize(("method", "rate"), [("DOP853", 1e4), ("RK45", 1e4)])
def test_explicit_methods_count_stiff_steps(method, rate):
    problem = Problem("decay_to_cosine", lambda t, x, u, p: [-p[0] * (x[0] - ca.cos(t))], [0], 1, parameters=[rate])
    run = problem.run(method, 1e-6)
    assert run.stiff_steps > 0.9 * run.accepted and run.stiff_since < 0.01
    assert problem.run(method, 1e-6, parameters=np.ones(1)).stiff_steps == 0


def test_the_derivatives_are_asked_for_once_and_only_when_needed(passing):
    asked = []

    def derivatives():
        asked.append(1)
        return DerivativeKernels(jacobian=passing.jacobian.address("scalar"))

    problem = passing.problem("auto", 1e-6, jacobian=0, derivatives=derivatives)
    prepared = bc._step.PreparedProblem(problem)
    assert not asked
    runs = [prepared.run() for _ in range(2)]
    assert asked == [1] and (runs[0].end_state == runs[1].end_state).all()


def test_errors_while_derivatives_are_made_reach_the_caller(passing):
    def derivatives():
        raise MemoryError("no room for code")

    problem = passing.problem("auto", 1e-6, jacobian=0, derivatives=derivatives)
    with pytest.raises(MemoryError, match="no room for code"):
        bc._step.PreparedProblem(problem).run()


# -- scenes


def test_auto_is_the_default():
    assert bc.results.Settings().solver == "auto"


@pytest.mark.parametrize("name", ["planar_2r_swing", "spring_pendulum", "four_bar", "ur5_falling", "rolling_disk"])
def test_auto_is_dop853_where_nothing_is_stiff(name):
    auto, explicit = (bc.simulate(name, solver=solver) for solver in ("auto", "DOP853"))
    assert (auto.state == explicit.state).all() and (auto.steps == explicit.steps).all()
    assert auto.statistics.evaluations == explicit.statistics.evaluations and auto.statistics.switches == 0
    assert [event.time for event in auto.events] == [event.time for event in explicit.events]
    assert auto.statistics.stiff_steps == 0


@pytest.fixture(scope="module")
def stiff_run():
    return bc.simulate(stiff_scene(), solver="auto", **STIFF)


def test_auto_solves_the_stiff_spring(stiff_run):
    implicit = bc.simulate(stiff_scene(), solver="Radau", **STIFF)
    cost = stiff_run.statistics
    assert stiff_run.success and cost.switches == 1 and cost.evaluations < 1.3 * implicit.statistics.evaluations
    assert np.abs(stiff_run.position - implicit.position).max() < 1e-4
    assert not [text for text in stiff_run.warnings if "stiff" in text]
    assert f"DOP853, Radau from {cost.switch_times[0]:.6g} s" in stiff_run.table()
    assert stiff_run.error_estimate() < 1e-3


def test_explicit_solvers_warn_of_stiffness():
    run = bc.simulate(stiff_scene(), solver="DOP853", **STIFF | {"duration": 2.0})
    assert run.success
    (warning,) = (text for text in run.warnings if "stiff" in text)
    assert "take solver: auto or Radau" in warning
    assert warning.startswith(f"the equations are stiff from {run.statistics.stiff_since:.4g} s on")
    assert "stiff from" in run.table()


def test_a_saved_run_keeps_its_switches(stiff_run, tmp_path):
    assert bc.load_run(stiff_run.save(tmp_path / "run.npz")).statistics == stiff_run.statistics


def test_checkpoints_hold_the_switches(tmp_path):
    run = bc.simulate(stiff_scene(), solver="auto", checkpoint=tmp_path / "run.npz", checkpoint_every=1e-9, **STIFF)
    again = bc.load_run(tmp_path / "run.npz")
    assert again.statistics == run.statistics and (again.state == run.state).all()


def test_a_run_that_becomes_stiff_leaves_its_lane():
    scene = stiff_scene().with_overrides(
        {
            "parameters": {"k": {"value": 1e3, "sets": ["forces.spring.stiffness"]}},
            "simulate": {"duration": 2.0, "solver": "auto", "rtol": 1e-6, "atol": 1e-6},
        }
    )
    ensemble = SceneEnsemble(scene, [{"parameters.k": k} for k in (100.0, 1e8, 1000.0, 2e8)])
    found = ensemble.run()
    runs = [ensemble.lone(row) for row in range(4)]
    assert found.single.tolist() == [False, True, False, True]
    assert [run.statistics.switches > 0 for run in runs] == [False, True, False, True]
    for row in (1, 3):
        assert (found.end_state[row] == runs[row].state[-1]).all()
    for row in (0, 2):
        np.testing.assert_allclose(found.end_state[row], runs[row].state[-1], atol=1e-3)
    assert_equal_rows(ensemble.run(threads=2), found)
    assert_equal_rows(ensemble.run(slice(1, 3)), found, slice(1, 3))


# -- linear algebra


@pytest.mark.tier2
@pytest.mark.parametrize("name", ["panda_held", "talos_free_fall", "n_four_bar_40"])
def test_the_reduced_linear_systems_give_the_run_of_the_whole_ones(name, monkeypatch):
    """With a floating base (quaternion), with constraints, and with the work W after the velocities."""
    settings = {"solver": "Radau", "duration": 0.1, "rtol": 1e-6, "atol": 1e-6, "samples": 11}
    reduced = bc.simulate(bc.load_scene(name), **settings)
    layout = integration.state_layout
    monkeypatch.setattr(integration, "state_layout", lambda scene: replace(layout(scene), joints=()))
    whole = bc.simulate(bc.load_scene(name), **settings)
    assert reduced.success and reduced.statistics.steps == whole.statistics.steps
    assert reduced.statistics.evaluations == whole.statistics.evaluations
    assert np.abs(reduced.state - whole.state).max() < 1e-9 * np.abs(whole.state).max()


@pytest.mark.tier2
@pytest.mark.parametrize("name", ["four_bar", "n_four_bar_2", "rolling_disk"])
def test_the_jacobian_with_constraints_is_that_of_the_right_hand_side(name):
    """Central differences of the compiled right-hand side; their rounding errors are of 1e-10 / 1e-6."""
    scene = bc.load_scene(name)
    system, p = system_of(scene), system_parameters(scene)
    q, v = consistent_start(scene)
    x = np.zeros(system.size)
    x[: len(q)], x[len(q) : len(q) + len(v)] = q, v + np.linspace(0.1, 0.2, len(v))
    t, u = np.zeros(1), np.zeros(0)
    matrix = system.tangent(t, x, u, p, np.eye(system.size)).T
    step = 1e-6 * np.eye(system.size)
    slopes = [(system.rhs(t, x + d, u, p)[0] - system.rhs(t, x - d, u, p)[0]) / 2e-6 for d in step]
    assert np.abs(matrix - np.array(slopes).T).max() < 1e-6 * (1 + np.abs(matrix).max())
