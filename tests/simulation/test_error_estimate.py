"""Error estimates and warnings of runs against known motions: reduced equations, closed forms, finer runs."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import bellcrank as bc
from bellcrank.cli import main
from bellcrank_bench.problems.n_four_bar import n_four_bar
from bellcrank_bench.problems.registry import benchmark

LEAST, MOST = 0.7, 40.0  # what the estimate may be of the true error; 0.77 is the least seen, near rounding
LUCKY = 100.0  # the same where the true error may by chance be far below the floor: 51 for five loops at 1e-13


def cranks(loops: NDArray[np.longdouble], times: NDArray[np.float64]) -> NDArray[np.longdouble]:
    """The cranks' angles from upright on the parallel branch, (n, k) rad, for k numbers of loops: a pendulum each of
    N + 1 cranks and N couplers of 1 m and 1 kg, by the classical Runge-Kutta method in extended precision.
    """
    rate = np.longdouble("9.81") * ((loops + 1) / 2 + loops) / ((loops + 1) / 3 + loops)
    x = np.stack([0 * rate, 0 * rate - 1])

    def f(x: NDArray[np.longdouble]) -> NDArray[np.longdouble]:
        return np.stack([x[1], rate * np.sin(x[0])])

    states, pieces = [x[0]], 120
    for gap in np.diff(times.astype(np.longdouble)):
        h = gap / pieces
        for _ in range(pieces):
            a = f(x)
            b = f(x + h / 2 * a)
            c = f(x + h / 2 * b)
            x = x + h / 6 * (a + 2 * b + 2 * c + f(x + h * c))
        states.append(x[0])
    return np.array(states)


@pytest.fixture(scope="module")
def parallel() -> Any:
    times, loops = np.linspace(0.0, 10.0, 201), (2, 5)
    angles = cranks(np.array(loops, dtype=np.longdouble), times)
    return {n: (n_four_bar(n), times, angles[:, k]) for k, n in enumerate(loops)}


@pytest.mark.tier2
@pytest.mark.parametrize("loops", [2, 5])
@pytest.mark.parametrize("tolerance", [1e-8, 1e-10, 1e-11, 1e-12, 1e-13])
def test_the_error_estimate_knows_the_floor_that_singular_positions_leave(parallel, loops, tolerance):
    scene, times, angle = parallel[loops]
    run = bc.simulate(scene, times=times, rtol=tolerance, atol=tolerance)
    signs = np.array([1 if name.startswith("crank") else -1 for name in run.robot.joint_names])
    true = float(np.abs(run.position - signs * angle[:, None]).max())
    assert LEAST * true < run.error_estimate() < LUCKY * true


@pytest.mark.tier2
@pytest.mark.parametrize("name", ["bricard", "four_bar", "rolling_disk", "planar_2r_swing", "spring_pendulum"])
def test_the_error_estimate_is_near_the_true_error_of_textbook_scenes(name):
    chosen = benchmark(name)
    states = solve_ivp(
        lambda _, x: chosen.equations.derivative(x), (0.0, chosen.duration), chosen.start, method="DOP853",
        rtol=1e-13, atol=1e-15, t_eval=chosen.times,
    ).y.T  # fmt: skip
    for tolerance in (1e-8, 1e-10):
        run = bc.simulate(name, duration=chosen.duration, times=chosen.times, rtol=tolerance, atol=tolerance)
        true = float(np.abs(chosen.positions_of(run) - chosen.positions(states)).max())
        assert LEAST * true < run.error_estimate()
        if name in ("planar_2r_swing", "spring_pendulum"):  # the others are compared in some of their coordinates
            assert run.error_estimate() < 1.5 * true


def test_an_estimate_where_the_largest_step_binds_is_not_zero(tmp_path):
    """A run again that takes the same steps would find no difference at all."""
    run = bc.simulate("planar_2r_swing", solver="RK45", rtol=1e-2, atol=1e-2, max_step=0.01)
    fine = bc.simulate("planar_2r_swing", rtol=1e-13, atol=1e-15)
    true = float(np.abs(run.position - fine.position).max())
    assert 1e-13 < LEAST * true < run.error_estimate() < MOST * true


@pytest.mark.tier2
@pytest.mark.parametrize("stabilisation", ["none", {"kind": "baumgarte", "gains": "auto"}])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
def test_a_run_that_leaves_the_branch_of_its_linkage_says_so(parallel, stabilisation, tolerance):
    scene, times, angle = parallel[2]
    run = bc.simulate(scene, times=times, rtol=tolerance, atol=tolerance, stabilisation=stabilisation)
    wrong = np.abs(run.position[:, run.robot.joint("crank_0").q] - angle) > 0.1
    assert wrong.any()  # otherwise nothing is tested
    told = [text for text in run.warnings if "the run differs from one with projection" in text]
    assert len(told) == 1
    since = float(re.search(r"from (\S+) s on", told[0])[1])
    assert since <= times[wrong.argmax()] * 1.001
    assert run.error_estimate() > 1.0


@pytest.mark.tier2
@pytest.mark.parametrize(
    "stabilisation", ["none", {"kind": "baumgarte", "gains": "auto"}, {"kind": "baumgarte", "alpha": 20, "beta": 20}]
)
@pytest.mark.parametrize("name", ["four_bar", "rolling_disk", "five_bar"])
def test_a_run_without_projection_that_stays_on_its_motion_is_not_warned_of(name, stabilisation):
    run = bc.simulate(name, duration=3.0, rtol=1e-9, atol=1e-9, stabilisation=stabilisation)
    assert run.warnings == ()
    kept = bc.simulate(name, duration=3.0, rtol=1e-11, atol=1e-11)
    assert run.error_estimate() > LEAST * np.abs(run.position - kept.position).max()


def test_the_command_line_exits_1_where_a_run_leaves_its_branch(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "n_four_bar_2", "--set", "simulate.stabilisation=none", "--no-plots"]) == 1
    assert "the run differs from one with projection" in capsys.readouterr().out


def test_the_command_line_and_the_file_of_a_run_tell_the_error_estimate(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "four_bar", "--no-plots"]) == 0
    told = float(re.search(r"error estimate +about (\S+)", capsys.readouterr().out)[1])
    loaded = bc.load_run("four_bar_run/run.npz")
    assert loaded.known_estimate == pytest.approx(told, rel=0.1)
    assert f"about {told:.1e} (rad or m) in positions" in loaded.table()


@pytest.mark.tier2
def test_an_estimate_that_is_not_computed_says_why(parallel):
    scene, times, _ = parallel[2]
    run = bc.simulate(scene, times=times)
    slow = dataclasses.replace(run, statistics=dataclasses.replace(run.statistics, kernel_time=1e3))
    assert "error estimate" in slow.table() and "not computed (it takes more than" in slow.table()
    assert slow.known_estimate is None
    assert slow.error_estimate() > 0.0  # on request it is
    assert "(rad or m) in positions" in slow.table()
    short = bc.simulate(scene, times=times, max_evaluations=500)
    assert "not computed (the run ended early)" in short.table()


def test_a_saved_run_of_an_earlier_version_with_constraints_is_read(tmp_path):
    """Its parameters have no regularisation at their end."""
    run = bc.simulate("four_bar", samples=11)
    loaded = bc.load_run(run.save(tmp_path / "run.npz"))
    assert np.array_equal(loaded.parameters, run.parameters)
    assert np.array_equal(loaded.multipliers, run.multipliers)
