"""The stepper of many runs in SIMD lanes: agreement with lone runs, independence of neighbours, and how runs end."""

import itertools

import casadi as ca
import numpy as np
import pytest
from ensemble_runs import assert_equal_rows, integrate_ensemble, lone_runs, rows_of
from scipy.interpolate import CubicSpline
from stepper_problem import Problem

FINISHED, EVENT, TOO_SMALL, NON_FINITE, SPENT, INTERRUPTED = range(6)
EXPLICIT = ("RK4", "RK45", "DOP853")
TARGETS = ("native", "avx2", "baseline")


@pytest.fixture(scope="module")
def oscillator():
    """x'' = -p x³ - q x', with another entry outside the error norm where `norm_size` says so."""
    return Problem(
        "oscillator", lambda t, x, u, p: [x[1], -p[0] * x[0] ** 3 - p[1] * x[1], x[1] ** 2], [1, 0, 0], 6,
        parameters=[1, 0.1],
    )  # fmt: skip


def random_designs(count, seed=0):
    random = np.random.default_rng(seed)
    x0 = np.column_stack([random.uniform(-2, 2, count), random.uniform(-1, 1, count), np.zeros(count)])
    return x0, random.uniform([0.3, 0.0], [4, 0.5], (count, 2)), random.uniform(0.5, 7, count)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("method", EXPLICIT)
def test_lanes_take_the_steps_of_lone_runs(oscillator, method, target, monkeypatch):
    monkeypatch.setenv("BELLCRANK_TARGET", target)
    x0, p, t1 = random_designs(37)
    found = integrate_ensemble(oscillator, method, 1e-7, x0, p=p, t1=t1, norm_size=2)
    assert found.done.all() and not found.single.any() and (found.status == FINISHED).all()
    for row, run in enumerate(lone_runs(oscillator, method, 1e-7, x0, p=p, t1=t1, norm_size=2)):
        assert found.end_time[row] == run.end_time == t1[row]
        assert abs(found.accepted[row] - run.accepted) <= 1 and abs(found.rejected[row] - run.rejected) <= 1
        if (found.accepted[row], found.rejected[row]) == (run.accepted, run.rejected):
            assert found.evaluations[row] == run.evaluations
        np.testing.assert_allclose(found.end_state[row], run.end_state, atol=1e-9 if method != "RK4" else 1e-13)


@pytest.mark.parametrize("method", EXPLICIT)
def test_a_run_depends_on_nothing_but_itself(oscillator, method):
    x0, p, t1 = random_designs(61)
    x0[17, 0] = np.nan  # ends at once
    p[23] = 1e300, 0  # its step becomes too small, or it is not finite
    settings = {"rtol": np.geomspace(1e-9, 1e-4, 61), "max_step": np.geomspace(10, 0.05, 61)}

    def run(rows, threads=1):
        own = {name: values[rows] for name, values in settings.items()}
        return integrate_ensemble(oscillator, method, 1e-6, x0[rows], p=p[rows], t1=t1[rows], settings=own,
                                  threads=threads)  # fmt: skip

    every = np.arange(61)
    whole = run(every)
    assert len(set(whole.status)) > 1 and whole.done.all()
    for threads in (2, 3, 20):
        assert_equal_rows(run(every, threads), whole)
    shuffled = np.random.default_rng(4).permutation(61)
    assert_equal_rows(run(shuffled, 2), rows_of(whole, shuffled))
    for rows in (every[:1], every[16:18], every[20:23], every[:33], every[:0]):
        assert_equal_rows(run(rows), rows_of(whole, rows))


def test_settings_of_each_design_are_used(oscillator):
    x0, p, t1 = random_designs(24)
    choices = {
        "rtol": np.geomspace(1e-12, 1e-3, 24),
        "atol": np.geomspace(1e-3, 1e-12, 24),
        "max_step": np.geomspace(0.01, 9, 24),
        "first_step": np.where(np.arange(24) % 3, np.geomspace(1e-6, 1, 24), 0),
        "max_evaluations": np.linspace(40, 900, 24).round(),
    }
    for method, name in itertools.product(("RK45", "DOP853"), choices):
        own = {name: choices[name]}
        found = integrate_ensemble(oscillator, method, 1e-6, x0, p=p, t1=t1, settings=own)
        runs = lone_runs(oscillator, method, 1e-6, x0, p=p, t1=t1, settings=own)
        assert list(found.status) == [run.status for run in runs]
        assert len({run.accepted for run in runs}) > 5
        close = np.array([(run.accepted, run.rejected, run.evaluations) for run in runs])
        ours = np.column_stack([found.accepted, found.rejected, found.evaluations])
        assert (ours == close).mean() > 0.9
        np.testing.assert_allclose(found.end_state, [run.end_state for run in runs], atol=1e-5)


@pytest.mark.parametrize("method", EXPLICIT)
def test_fixed_steps_and_chosen_steps_side_by_side(oscillator, method):
    x0, p, t1 = random_designs(20)
    step = np.linspace(0.011, 0.2, 20)
    if method != "RK4":
        step[::3] = 0
    found = integrate_ensemble(oscillator, method, 1e-8, x0, p=p, t1=t1, settings={"step": step})
    for row, run in enumerate(lone_runs(oscillator, method, 1e-8, x0, p=p, t1=t1, settings={"step": step})):
        np.testing.assert_allclose(found.end_state[row], run.end_state, atol=1e-9 if step[row] == 0 else 1e-12)
        assert found.accepted[row] == run.accepted and found.end_time[row] == t1[row]


def test_the_order_of_each_method_in_lanes(oscillator):
    x0, p, _ = random_designs(8)
    exact = integrate_ensemble(oscillator, "DOP853", 1e-14, x0, p=p).end_state[:, :2]
    for method, order, step in (("RK4", 4, 0.03), ("RK45", 5, 0.06), ("DOP853", 8, 0.15)):
        errors = [
            np.abs(integrate_ensemble(oscillator, method, 1, x0, p=p, step=s).end_state[:, :2] - exact).max()
            for s in (step, step / 2)
        ]
        assert order - 0.6 < np.log2(errors[0] / errors[1]) < order + 2


@pytest.mark.parametrize("method", ("RK45", "DOP853"))
def test_runs_that_blow_up_end_where_lone_runs_do(method):
    problem = Problem("blow_up_p", lambda t, x, u, p: [p[0] * x[0] ** 2], [1], 2, parameters=[1])
    p = np.linspace(0.1, 1.4, 27)[:, None]
    found = integrate_ensemble(problem, method, 1e-6, np.ones((27, 1)), p=p)
    runs = lone_runs(problem, method, 1e-6, np.ones((27, 1)), p=p)
    assert list(found.status) == [run.status for run in runs] and {FINISHED, TOO_SMALL} == set(found.status)
    np.testing.assert_allclose(found.end_time, [run.end_time for run in runs], rtol=1e-6)
    assert np.isfinite(found.end_state).all()


@pytest.mark.parametrize("method", EXPLICIT)
def test_slopes_that_are_not_finite_end_a_run_at_its_last_good_state(method):
    problem = Problem("root_p", lambda t, x, u, p: [ca.sqrt(p[0] - t)], [0], 2, parameters=[1])
    p = np.linspace(-0.5, 2.5, 31)[:, None]
    fixed = {"step": 0.3} if method == "RK4" else {}
    found = integrate_ensemble(problem, method, 1e-7, np.zeros((31, 1)), p=p, **fixed)
    runs = lone_runs(problem, method, 1e-7, np.zeros((31, 1)), p=p, **fixed)
    assert list(found.status) == [run.status for run in runs] and {FINISHED, NON_FINITE} == set(found.status)
    np.testing.assert_allclose(found.end_time, [run.end_time for run in runs], atol=1e-6)
    np.testing.assert_allclose(found.end_state, [run.end_state for run in runs], atol=1e-6)
    assert (found.accepted[p[:, 0] < 0] == 0).all()


def test_stops_and_signals_are_those_of_lone_runs():
    """A signal with kinks, one that begins late and ends early, and jumps of the slope at stops."""
    random = np.random.default_rng(8)
    kinked = (np.array([0.4, 1.0, 1.7, 2.6]), random.normal(size=(3, 4, 1)), 2, True)
    places = np.array([0.3, 0.9, 1.1, 2.2, 2.4])
    spline = CubicSpline(places, random.normal(size=(5, 2)), bc_type="clamped")
    smooth = (places, spline.c[::-1].transpose(1, 0, 2).copy(), 1, False)
    problem = Problem("driven", lambda t, x, u, p: [x[1], u[0] + 0.1 * u[1] - u[2] + u[3] * u[5] - x[0] + u[4] * p[0]
                                                    + ca.if_else(t < 1.3, 1, -1)],
                      [1, 0], 3, inputs=7, parameters=[1])  # fmt: skip
    count = 23
    x0, p = random.normal(size=(count, 2)), random.normal(size=(count, 1))
    t1 = random.uniform(0.1, 3, count)
    t1[:5] = 0.4, 1.0, 1.3, 1.3 * (1 - 1e-16), 2.6
    for method in EXPLICIT:
        more = {"signals": [kinked, smooth], "stops": [1.3], "norm_size": 2}
        found = integrate_ensemble(problem, method, 1e-9, x0, p=p, t1=t1, **more)
        runs = lone_runs(problem, method, 1e-9, x0, p=p, t1=t1, **more)
        assert (found.status == FINISHED).all()
        np.testing.assert_allclose(found.end_state, [run.end_state for run in runs], atol=3e-9, err_msg=method)
        np.testing.assert_allclose(found.evaluations, [run.evaluations for run in runs], rtol=0.15)


def test_unit_parts_stay_unit_vectors():
    def slope(t, x, u, p):
        return [-p[0] * x[1], p[0] * x[0], -x[3], x[2]]

    problem = Problem("turning", slope, [1, 0, 0, 1], 5, parameters=[1])
    p = np.linspace(0.2, 3, 11)[:, None]
    found = integrate_ensemble(problem, "RK45", 1e-5, np.tile([2.0, 0, 0, 1], (11, 1)), p=p, unit_parts=[(0, 2)])
    np.testing.assert_allclose(np.linalg.norm(found.end_state[:, :2], axis=1), 1, atol=1e-15)
    assert np.abs(np.linalg.norm(found.end_state[:, 2:], axis=1) - 1).max() > 1e-9
    for row, run in enumerate(lone_runs(problem, "RK45", 1e-5, np.tile([2.0, 0, 0, 1], (11, 1)), p=p,
                                        unit_parts=[(0, 2)])):  # fmt: skip
        np.testing.assert_allclose(found.end_state[row], run.end_state, atol=1e-7)


def test_designs_of_no_duration_end_where_they_start(oscillator):
    x0, p, _ = random_designs(5)
    found = integrate_ensemble(oscillator, "DOP853", 1e-6, x0, p=p, t1=[0, 1, 0, 0, 2])
    assert (found.status == FINISHED).all() and list(found.accepted > 0) == [False, True, False, False, True]
    np.testing.assert_array_equal(found.end_state[[0, 2, 3]], x0[[0, 2, 3]])


def test_radau_and_systems_without_lanes_are_lone_runs_to_the_bit(oscillator):
    x0, p, t1 = random_designs(19)
    for method in ("Radau", "DOP853"):
        found = integrate_ensemble(oscillator, method, 1e-6, x0, p=p, t1=t1, lanes=False, threads=2)
        assert found.single.all() and found.done.all()
        for row, run in enumerate(lone_runs(oscillator, method, 1e-6, x0, p=p, t1=t1)):
            np.testing.assert_array_equal(found.end_state[row], run.end_state)
            assert (found.accepted[row], found.evaluations[row]) == (run.accepted, run.evaluations)


@pytest.mark.tier2
@pytest.mark.parametrize("lanes", [True, False])
def test_an_interrupted_ensemble_says_what_is_done(oscillator, lanes):
    x0, p, _ = random_designs(20000)
    seen = []

    def interrupt(done):
        seen.append(done)
        if len(seen) == 2:
            raise KeyboardInterrupt

    found = integrate_ensemble(oscillator, "DOP853", 1e-13, x0, p=p, t1=np.full(20000, 600), threads=2, lanes=lanes,
                               progress=interrupt)  # fmt: skip
    assert 0 < found.done.sum() < 20000 and seen == sorted(seen) and all(isinstance(n, int) for n in seen)
    assert (found.status[~found.done] == INTERRUPTED).all() and np.isnan(found.end_time[~found.done]).all()
    rows = np.flatnonzero(found.done)[:40]
    again = integrate_ensemble(
        oscillator, "DOP853", 1e-13, x0[rows], p=p[rows], t1=np.full(len(rows), 600), lanes=lanes
    )
    assert_equal_rows(rows_of(found, rows), again)


def test_what_progress_raises_is_raised(oscillator):
    x0, p, _ = random_designs(20000)

    def fail(done):
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        integrate_ensemble(oscillator, "DOP853", 1e-13, x0, p=p, t1=np.full(20000, 60), progress=fail)


def test_arrays_that_do_not_fit_are_refused(oscillator):
    x0, p, t1 = random_designs(4)
    for changes, text in [
        ({"t1": t1[:3]}, "one row a design"),
        ({"p": p[:3]}, "one row a design"),
        ({"t1": [-1, 1, 1, 1]}, "t1 must be finite"),
        ({"settings": {"rtol": np.ones(3)}}, "one number a design"),
        ({"settings": {"rtol": -np.ones(4)}}, "must not be negative"),
        ({"settings": {"speed": np.ones(4)}}, "unknown setting"),
    ]:
        with pytest.raises(ValueError, match=text):
            integrate_ensemble(oscillator, "DOP853", 1e-6, x0, **({"p": p, "t1": t1} | changes))
