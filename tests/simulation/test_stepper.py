"""The stepper: orders, agreement with SciPy, events, signals, unit parts, and how runs end."""

import subprocess
import sys
import textwrap
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.special import ellipk
from stepper_problem import METHODS, Problem

from bellcrank import _step

FINISHED, EVENT, TOO_SMALL, NON_FINITE, SPENT, INTERRUPTED = range(6)


def arm_slope(t, x, u, p):
    """Free swing of a planar arm: two links of 12.456 kg, 1 m, 1.042 kg m^2, with centres at 0.773 and 0.583 m."""
    m, r1, r2, inertia, g = 12.456, 0.773, 0.583, 1.042, 9.81
    s2, c2, c12 = ca.sin(x[1]), ca.cos(x[1]), ca.cos(x[0] + x[1])
    m22 = inertia + m * r2 * r2
    m12 = m22 + m * r2 * c2
    m11 = inertia + m + m * r1 * r1 + m22 + 2 * m * r2 * c2
    b1 = m * r2 * s2 * (2 * x[2] + x[3]) * x[3] - m * g * ((1 + r1) * ca.cos(x[0]) + r2 * c12)
    b2 = -m * r2 * s2 * x[2] ** 2 - m * g * r2 * c12
    determinant = m11 * m22 - m12 * m12
    return [x[2], x[3], (m22 * b1 - m12 * b2) / determinant, (m11 * b2 - m12 * b1) / determinant]


def robertson_slope(t, x, u, p):
    slow, fast, product = 0.04 * x[0], 1e4 * x[1] * x[2], 3e7 * x[1] ** 2
    return [-slow + fast, slow - fast - product, product]


@pytest.fixture(scope="module")
def arm():
    return Problem("arm", arm_slope, [-np.pi / 2, np.pi / 4, 0, 0], 10)


@pytest.fixture(scope="module")
def kepler():
    """An orbit of eccentricity 0.3 over one period, and y' = y cos t: after 2 pi everything is where it began."""

    def slope(t, x, u, p):
        r3 = (x[0] ** 2 + x[1] ** 2) ** 1.5
        return [x[2], x[3], -x[0] / r3, -x[1] / r3, x[4] * ca.cos(t)]

    return Problem("kepler", slope, [0.7, 0, 0, np.sqrt(1.3 / 0.7), 1], 2 * np.pi)


@pytest.fixture(scope="module")
def pendulum():
    """x'' = -sin x from rest at 2 rad; events: lowest points, turning points, and a level just below the highest."""
    return Problem("pendulum", lambda t, x, u, p: [x[1], -ca.sin(x[0])], [2, 0], 20,
                   events=lambda t, x, u, p: [x[0], x[1], x[0] - 1.9999])  # fmt: skip


@pytest.fixture(scope="module")
def projectile():
    """Height and speed of a throw at 9 m/s from 1 m; events: ground, a height of 5 m twice, the top."""
    return Problem("projectile", lambda t, x, u, p: [x[1], -9.81], [1, 9], 3,
                   events=lambda t, x, u, p: [x[0], x[0] - 5, x[1]])  # fmt: skip


def passes(height):
    return [(9 - side * np.sqrt(81 - 2 * 9.81 * (height - 1))) / 9.81 for side in (1, -1)]


# -- tables


def trees(vertices):
    """Rooted trees with so many vertices, as sorted tuples of subtrees."""

    def forests(total, largest):
        if total == 0:
            yield ()
        for size in range(min(total, largest), 0, -1):
            for first in trees(size):
                for rest in forests(total - size, size):
                    if not rest or rest[0] <= first:
                        yield (first, *rest)

    return list(dict.fromkeys(tuple(sorted(f)) for f in forests(vertices - 1, vertices - 1)))


def size(tree):
    return 1 + sum(size(branch) for branch in tree)


def density(tree):
    return size(tree) * int(np.prod([density(branch) for branch in tree]))


def stage_weights(tree, a):
    product = np.ones(len(a))
    for branch in tree:
        product = product * (a @ stage_weights(branch, a))
    return product


@pytest.mark.parametrize("method", METHODS)
def test_a_method_has_the_order_its_table_declares(method):
    table = _step.tableau(method)
    a, b, c, order = np.array(table["a"]), np.array(table["b"]), np.array(table["c"]), table["order"]
    assert _step.methods()[method] == order
    assert np.abs(a.sum(1) - c).max() < 2e-14 and abs(b.sum() - 1) < 2e-15

    def residual(vertices):  # Butcher's conditions: b . Phi(tree) = 1 / gamma(tree)
        return max(abs(b @ stage_weights(tree, a) - 1 / density(tree)) for tree in trees(vertices))

    assert [len(trees(k)) for k in range(1, 6)] == [1, 1, 2, 4, 9]
    assert max(residual(k) for k in range(1, order + 1)) < 1e-13
    assert residual(order + 1) > 1e-6


def test_radau_transformation_makes_the_inverse_of_a_block_diagonal():
    table = _step.tableau("Radau")
    transformation = np.array(table["transformation"])
    mu, real, imaginary = table["eigenvalues"]
    blocks = np.array([[mu, 0, 0], [0, real, imaginary], [0, -imaginary, real]])
    found = np.array(table["inverse_transformation"]) @ np.linalg.inv(table["a"]) @ transformation
    assert np.abs(np.array(table["inverse_transformation"]) @ transformation - np.eye(3)).max() < 1e-13
    assert np.abs(found - blocks).max() < 1e-12


# -- orders


def slopes(errors):
    return np.log2(np.array(errors[:-1]) / errors[1:])


@pytest.fixture(scope="module")
def known():
    """Four equations with closed-form solutions, one of them non-autonomous and one non-linear."""
    return Problem("known", lambda t, x, u, p: [x[0] * ca.cos(t), -(x[1] ** 2), x[3], -x[2]], [1, 1, 1, 0], 10)


def known_states(t):
    return np.stack([np.exp(np.sin(t)), 1 / (1 + t), np.cos(t), -np.sin(t)], axis=-1)


@pytest.mark.parametrize(("method", "first", "margin"), [("RK4", 48, 0.2), ("RK45", 16, 0.2), ("DOP853", 6, 0.5),
                                                         ("Radau", 16, 0.2)])  # fmt: skip
def test_fixed_steps_converge_with_the_declared_order(known, method, first, margin):
    counts = [first * 2**k for k in range(4)]
    runs = [known.run(method, step=10 / count) for count in counts]
    assert [run.accepted for run in runs] == counts
    errors = [np.abs(run.end_state - known_states(10.0)).max() for run in runs]
    assert errors[0] < 1e-3 and errors[-1] > 1e-12
    assert abs(slopes(errors).mean() - _step.methods()[method]) < margin


@pytest.mark.parametrize(("method", "first", "order"), [("RK4", 96, 4), ("RK45", 32, 5), ("DOP853", 10, 8),
                                                        ("Radau", 64, 4)])  # fmt: skip
def test_dense_output_converges_with_its_order(known, method, first, order):
    times = np.linspace(0, 10, 2001)
    errors = []
    for k in range(4):
        run = known.run(method, step=10 / (first * 2**k), times=times)
        errors.append(np.abs(run.state - known_states(times))[:, [0, 2, 3]].max())
    assert errors[0] < 1e-3 and errors[-1] > 1e-14
    assert slopes(errors).mean() > order - 0.3


def test_outputs_at_step_ends_are_the_steps_own_states(arm):
    every = arm.run("DOP853", every_step=True)
    assert np.array_equal(every.time, every.steps)
    again = arm.run("DOP853", times=every.steps)
    assert np.array_equal(again.state, every.state)
    assert again.evaluations == every.evaluations


def test_dop853_spends_three_evaluations_in_steps_with_outputs_only(arm):
    plain = arm.run("DOP853")
    inside = 0.5 * (plain.steps[5] + plain.steps[6])
    times = [inside, inside + 1e-3 * (plain.steps[6] - inside), 0.5 * (plain.steps[9] + plain.steps[10])]
    run = arm.run("DOP853", times=times)
    assert run.evaluations == plain.evaluations + 6
    assert np.array_equal(run.steps, plain.steps)


# -- step sizes


@pytest.mark.tier2
@pytest.mark.parametrize("tolerance", [1e-4, 1e-7, 1e-9])
@pytest.mark.parametrize("method", ["RK45", "DOP853", "Radau"])
def test_adaptive_steps_are_those_of_scipy(arm, kepler, method, tolerance):
    for problem, exact in [(arm, None), (kepler, kepler.x0)]:
        ours, theirs = problem.run(method, tolerance), problem.scipy(method, tolerance)
        assert ours.status == FINISHED
        assert abs(ours.accepted - (len(theirs.t) - 1)) <= 0.02 * ours.accepted + 1
        assert ours.evaluations <= 1.05 * theirs.nfev
        if exact is None:
            exact = problem.run("DOP853", 1e-13).end_state
        their_error = np.abs(theirs.y[:, -1] - exact).max()
        assert np.abs(ours.end_state - exact).max() < 3 * their_error + 1e-12


@pytest.mark.tier2
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_radau_solves_stiff_problems_as_scipy_does(tolerance):
    van_der_pol = Problem("vdp", lambda t, x, u, p: [x[1], 1e3 * (1 - x[0] ** 2) * x[1] - x[0]], [2, 0], 2000)
    robertson = Problem("robertson", robertson_slope, [1, 0, 0], 1e4)
    for problem, small in [(van_der_pol, 1), (robertson, 1e-6)]:
        ours = problem.run("Radau", tolerance, atol=small * tolerance)
        theirs = problem.scipy("Radau", tolerance, atol=small * tolerance)
        exact = problem.run("Radau", 1e-11, atol=small * 1e-11).end_state
        assert abs(ours.accepted - (len(theirs.t) - 1)) <= 0.2 * ours.accepted
        assert abs(ours.jacobians - theirs.njev) <= 0.2 * theirs.njev + 2
        assert ours.factorisations <= 1.2 * theirs.nlu + 2
        their_error = np.abs(theirs.y[:, -1] - exact).max()
        assert np.abs(ours.end_state - exact).max() < 3 * their_error + 1e-10
        explicit = problem.run("DOP853", tolerance, atol=small * tolerance,
                               max_evaluations=10 * ours.evaluations)  # fmt: skip
        assert explicit.status == SPENT  # it is stiff


def test_radau_takes_the_same_steps_with_a_tangent_kernel(arm):
    jacobian = arm.run("Radau")
    tangent = arm.run("Radau", jacobian=0, tangent=arm.tangent.address("batch"))
    assert tangent.accepted == jacobian.accepted and tangent.jacobians == jacobian.jacobians
    assert np.abs(tangent.end_state - jacobian.end_state).max() < 1e-9


@pytest.mark.parametrize("states", [1, 2, 3, 5, 8, 9, 13, 16, 17, 30])
def test_any_number_of_states(states):
    rates = np.linspace(0.1, 1, states)
    problem = Problem(f"decay{states}", lambda t, x, u, p: [-p[i] * x[i] for i in range(states)], np.ones(states), 2,
                      parameters=rates)  # fmt: skip
    for method in METHODS:
        run = problem.run(method, 1e-9, times=[1.0])
        assert np.abs(run.end_state - np.exp(-2 * rates)).max() < 1e-7
        assert np.abs(run.state[0] - np.exp(-rates)).max() < 1e-7


def test_step_limits_and_first_step(arm):
    run = arm.run("DOP853", max_step=0.05, first_step=0.01)
    assert run.steps[1] == 0.01 and np.diff(run.steps).max() <= 0.05 * (1 + 1e-12)
    fixed = arm.run("RK45", step=0.03)
    assert np.array_equal(fixed.steps[:-1], 0.03 * np.arange(334)) and fixed.steps[-1] == 10


@pytest.mark.parametrize("method", ["RK45", "DOP853", "Radau"])
def test_tiny_first_steps_and_spans_are_stepped_over(arm, method):
    run = arm.run(method, first_step=1e-320)
    assert run.status == FINISHED and run.steps[1] <= 1e-300
    assert np.abs(run.end_state - arm.run(method).end_state).max() < 1e-3
    run = arm.run(method, t1=1e-320, times=[1e-320])
    assert run.status == FINISHED and run.end_time == 1e-320 and np.abs(run.end_state - arm.x0).max() < 1e-300
    assert arm.run(method, t0=1e9, t1=1e9 + 1, first_step=1e-30).status == FINISHED


# -- events


@pytest.mark.parametrize("method", METHODS)
def test_projectile_events_are_found_to_rounding_even_two_in_one_step(projectile, method):
    run = projectile.run(method, step=1.6)  # both passes of 5 m and the top lie in the first step
    assert list(run.event_index) == [1, 2, 1, 0]
    expected = [passes(5)[0], 9 / 9.81, passes(5)[1], passes(0)[1]]
    assert np.abs(run.event_time - expected).max() < 1e-13
    assert abs(run.event_state[3, 0]) < 1e-13 and run.status == FINISHED and run.end_time == 3


@pytest.mark.parametrize(
    ("method", "tolerance", "error"),
    [("RK4", 1e-9, 1e-8), ("RK45", 1e-12, 1e-10), ("DOP853", 1e-12, 1e-11), ("Radau", 1e-11, 1e-11)],
)
def test_pendulum_passes_at_quarter_periods(pendulum, method, tolerance, error):
    run = pendulum.run(method, tolerance)
    period = 4 * ellipk(np.sin(1) ** 2)
    lowest, turning = (run.event_time[run.event_index == k] for k in (0, 1))
    assert len(lowest) == 5 and np.abs(lowest - period * (0.25 + 0.5 * np.arange(5))).max() < error
    assert len(turning) == 4 and np.abs(turning - period * 0.5 * np.arange(1, 5)).max() < error  # not at the start
    assert np.abs(run.event_state[run.event_index == 0, 0]).max() < 4e-15


@pytest.mark.parametrize("method", ["RK45", "DOP853", "Radau"])
def test_two_close_crossings_between_samples_are_found(pendulum, method):
    run = pendulum.run(method, 1e-6)
    near_top = run.event_time[run.event_index == 2]
    assert len(near_top) == 5  # once on leaving, then in pairs 0.03 s apart, in steps ten times as long
    assert np.diff(run.steps).max() > 0.1
    assert np.all(np.diff(near_top)[1::2] < 0.031)


def test_event_directions(projectile):
    falling = projectile.run("DOP853", direction=[0, -1, 1])
    assert list(falling.event_index) == [1, 0] and abs(falling.event_time[0] - passes(5)[1]) < 1e-13
    rising = projectile.run("DOP853", direction=[1, 1, -1])
    assert list(rising.event_index) == [1, 2] and abs(rising.event_time[0] - passes(5)[0]) < 1e-13


@pytest.mark.parametrize("method", METHODS)
def test_terminal_event_ends_the_run_at_its_state(projectile, method):
    times = np.linspace(0, 3, 31)
    run = projectile.run(method, terminal=[True, False, False], times=times)
    assert run.status == EVENT and abs(run.end_time - passes(0)[1]) < 1e-13
    assert run.steps[-1] == run.end_time == run.event_time[-1]
    assert np.array_equal(run.end_state, run.event_state[-1]) and abs(run.end_state[0]) < 1e-13
    assert np.array_equal(run.time, [*times[times <= run.end_time], run.end_time])  # the end is one more row
    assert np.abs(run.state[:, 0] - (1 + 9 * run.time - 0.5 * 9.81 * run.time**2)).max() < 1e-12


def test_simultaneous_events_are_all_reported():
    problem = Problem("ramp", lambda t, x, u, p: [1.0], [-1], 3,
                      events=lambda t, x, u, p: [3 * x[0], x[0] - 1, -x[0], x[0] ** 3])  # fmt: skip
    run = problem.run("RK45", terminal=[True, False, False, False])
    assert sorted(run.event_index) == [0, 2, 3] and np.abs(run.event_time - 1).max() < 1e-5
    assert run.status == EVENT and run.end_time == 1


def test_reaching_exactly_zero_counts_once_and_starting_there_does_not():
    problem = Problem("grid", lambda t, x, u, p: [1.0], [0], 2, events=lambda t, x, u, p: [x[0], x[0] - 1])
    run = problem.run("RK4", step=0.5)
    assert list(run.event_index) == [1] and list(run.event_time) == [1]


@pytest.mark.parametrize("method", METHODS)
def test_an_event_that_rests_at_zero_lies_where_it_arrives(method):
    """x = exp(-t): max(x - 0.1, 0) is zero from ln 10 on, the second falls to a rest between 0.35 and 0.25."""
    problem = Problem("rest", lambda t, x, u, p: [-x[0]], [1], 5, events=lambda t, x, u, p: [
        ca.fmax(x[0] - 0.1, 0), ca.fmax(x[0] - 0.35, 0) - ca.fmax(0.25 - x[0], 0)])  # fmt: skip
    run = problem.run(method, 1e-10, step=0.5 if method == "RK4" else 0)
    assert list(run.event_index) == [1, 0]
    assert np.abs(run.event_state[:, 0] - [0.35, 0.1]).max() < 1e-15
    if method != "RK4":
        assert np.abs(run.event_time + np.log([0.35, 0.1])).max() < 1e-8
    stopped = problem.run(method, 1e-10, step=0.5 if method == "RK4" else 0, terminal=[True, False])
    assert stopped.status == EVENT and stopped.end_time == run.event_time[1]
    assert abs(stopped.end_state[0] - 0.1) < 1e-15


def test_event_of_a_signal_that_jumps_lies_at_the_jump():
    problem = Problem("jump", lambda t, x, u, p: [u[0]], [0], 3, inputs=1, events=lambda t, x, u, p: [u[0]])
    signal = (np.array([0.0, 1.0, 3.0]), np.array([1.0, -1.0]).reshape(2, 1, 1), 0, True)
    run = problem.run("DOP853", signals=[signal])
    assert len(run.event_time) == 1 and abs(run.event_time[0] - 1) < 1e-12
    assert abs(run.end_state[0] + 1) < 1e-13


# -- signals, stops, quadratures, unit parts


def integral(breaks, coefficients, derivative, end):
    total = 0.0
    for piece, left in zip(coefficients[:, :, 0], breaks[:-1], strict=True):
        width = min(max(end - left, 0), (breaks[1:] - breaks[:-1])[list(breaks[:-1]).index(left)])
        polynomial = (
            np.polynomial.Polynomial(piece).deriv(derivative) if derivative else np.polynomial.Polynomial(piece)
        )
        total += polynomial.integ()(width)
    return total


@pytest.mark.parametrize("method", METHODS)
def test_signals_with_jumps_integrate_exactly(method):
    random = np.random.default_rng(3)
    problem = Problem("signals", lambda t, x, u, p: [u[0], u[1], u[2], u[3]], np.zeros(4), 2.0, inputs=4)
    breaks = np.array([0.2, 0.5, 0.9, 1.7])
    pieces = random.normal(size=(3, 4, 1))
    flat = (np.array([0.0, 2.0]), np.full((1, 1, 1), 3.0), 0, False)
    run = problem.run(method, 1e-3, step=0.4 if method == "RK4" else 0, signals=[(breaks, pieces, 2, True), flat])
    start, end = pieces[0, 0, 0], np.polynomial.Polynomial(pieces[2, :, 0])(0.8)
    held = 0.2 * start + 0.3 * end  # the end values are held outside the breaks, their derivatives are zero
    expected = [integral(breaks, pieces, d, 2.0) for d in range(3)]
    expected[0] += held
    assert np.abs(run.end_state - [*expected, 6.0]).max() < 1e-13
    assert set(breaks) <= set(run.steps)


def test_smooth_signals_are_followed_without_stops():
    breaks = np.linspace(0.5, 3, 6)
    whole = np.polynomial.Polynomial([1, -2, 0.5, 0.25])
    pieces = np.array([[whole.deriv(k)(b) / np.prod(np.arange(1, k + 1)) for k in range(4)] for b in breaks[:-1]])
    problem = Problem("follow", lambda t, x, u, p: [u[0] - x[0], u[1]], [0, 0], 2.5, inputs=2)
    # from 0.5 to 3: the time of the run starts where the signal does
    run = problem.run("DOP853", 1e-11, t0=0.5, t1=3.0, signals=[(breaks, pieces[:, :, None].copy(), 1, False)])
    assert run.accepted < 20 and not set(breaks[1:-1]) & set(run.steps)
    assert abs(run.end_state[1] - (whole(3) - whole(0.5))) < 1e-13
    particular = whole - whole.deriv() + whole.deriv(2) - whole.deriv(3)  # of x' = u - x
    assert abs(run.end_state[0] - (particular(3) - particular(0.5) * np.exp(-2.5))) < 1e-10


@pytest.mark.parametrize("method", METHODS)
def test_no_step_crosses_a_stop_and_each_side_sees_its_own_slope(method):
    problem = Problem("switch", lambda t, x, u, p: [ca.if_else(t < 1, 1, ca.if_else(t < 1.5, -2, 5))], [0], 2)
    run = problem.run(method, stops=[1.0, 1.5], step=0.3)
    assert {1.0, 1.5} <= set(run.steps)
    assert abs(run.end_state[0] - (1 - 1 + 2.5)) < 1e-13
    if method != "RK4":
        assert abs(problem.run(method, 1e-8, stops=[1.0, 1.5]).end_state[0] - 2.5) < 1e-13


@pytest.mark.parametrize("end", [2.0, np.nextafter(2, 0), np.nextafter(2, 3)])
@pytest.mark.parametrize("method", METHODS)
def test_a_stop_at_the_end_is_seen_from_before(method, end):
    problem = Problem("switch_at_end", lambda t, x, u, p: [ca.if_else(t < 2, ca.cos(t), 1e3)], [0], end)
    errors = []
    for count in (8, 16, 32):
        run = problem.run(method, stops=[2.0], step=2 / count)
        assert run.accepted == count
        errors.append(abs(run.end_state[0] - np.sin(2)))
    assert errors[0] < 1e-4 and (errors[-1] < 1e-13 or slopes(errors).mean() > _step.methods()[method] - 0.3)
    if method != "RK4":
        free = Problem("no_switch", lambda t, x, u, p: [ca.cos(t)], [0], end)
        adaptive = problem.run(method, stops=[2.0])
        assert adaptive.rejected == free.run(method).rejected and adaptive.accepted == free.run(method).accepted


def test_the_work_of_a_linear_force_is_exact_between_the_steps_of_radau():
    """2 kg under a force of 3 - 5 t, from rest: speed, path and work are polynomials of degree 2, 3 and 4."""
    problem = Problem("block", lambda t, x, u, p: [x[1], u[0] / 2, u[0] * x[1]], np.zeros(3), 2, inputs=1)
    signal = (np.array([0.0, 2.0]), np.array([3.0, -5.0]).reshape(1, 2, 1), 0, True)
    times = np.linspace(0, 2, 301)
    for step in (0.0, 0.7):
        run = problem.run("Radau", norm_size=2, step=step, signals=[signal], times=times)
        path, speed = 0.75 * times**2 - 5 / 12 * times**3, 1.5 * times - 1.25 * times**2
        assert np.abs(run.state - np.stack([path, speed, speed**2], axis=1)).max() < 1e-12
        plain = problem.run("Radau", norm_size=2, step=step, signals=[signal])
        assert plain.accepted < 10 and np.array_equal(run.end_state, plain.end_state)
        inside = sum(np.any((a < times) & (times < b)) for a, b in zip(run.steps[:-1], run.steps[1:], strict=True))
        assert run.evaluations == plain.evaluations + 2 * inside


def test_work_of_damping_balances_the_energy_between_the_steps_of_radau():
    """x'' = -x - 0.4 x': energy less the damper's work stays, about as well between steps as at their ends."""
    problem = Problem("damped", lambda t, x, u, p: [x[1], -x[0] - 0.4 * x[1], -0.4 * x[1] ** 2], [1, 0, 0], 10)
    errors = []
    for count in (20, 40, 80, 160):
        run = problem.run("Radau", norm_size=2, step=10 / count, times=np.linspace(0, 10, 1001))
        exact = problem.run("DOP853", 1e-12, norm_size=2, times=np.linspace(0, 10, 1001)).state
        errors.append(np.abs(run.state[:, 2] - exact[:, 2]).max())
    assert errors[0] < 1e-4 and slopes(errors).mean() > 4.3  # the state has order 4 there


@pytest.mark.parametrize("method", ["RK45", "DOP853", "Radau"])
def test_a_quadrature_rides_along_outside_the_error_norm(method):
    def slope(t, x, u, p):
        return [x[1], -x[0]]

    bare = Problem("oscillator", slope, [1, 0], 5)
    with_work = Problem("oscillator_work", lambda t, x, u, p: [*slope(t, x, u, p), 1e6 * x[1] ** 2], [1, 0, 0], 5)
    plain = bare.run(method, 1e-8)
    run = with_work.run(method, 1e-8, norm_size=2)
    assert run.accepted == plain.accepted and np.abs(run.steps - plain.steps).max() < 1e-6
    assert abs(run.end_state[2] / 1e6 - (2.5 - np.sin(10) / 4)) < 2e-7


@pytest.mark.parametrize("method", METHODS)
def test_quaternion_stays_unit_and_keeps_the_order(method):
    """A symmetric top in free rotation: spin about its own axis inside a turn about the angular momentum."""
    turn, spin, tilt = 1.3, 2.1, 0.7

    def slope(t, q, u, p):  # q' = q (0, w) / 2, q = (x, y, z, w), w in the body's frame
        w = [turn * np.sin(tilt) * ca.sin(spin * t), turn * np.sin(tilt) * ca.cos(spin * t), turn * np.cos(tilt) + spin]
        v, s = q[:3], q[3]
        rate = ca.vertcat(*w)
        return [*ca.vertsplit(0.5 * (s * rate + ca.cross(v, rate))), -0.5 * ca.dot(v, rate)]

    def product(a, b):
        return np.append(a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3]), a[3] * b[3] - a[:3] @ b[:3])

    def exact(t):
        about_momentum = np.array([0, 0, np.sin(turn * t / 2), np.cos(turn * t / 2)])
        tilted = np.array([np.sin(tilt / 2), 0, 0, np.cos(tilt / 2)])
        own = np.array([0, 0, np.sin(spin * t / 2), np.cos(spin * t / 2)])
        return product(product(about_momentum, tilted), own)

    problem = Problem("top", slope, exact(0), 6)
    times = np.linspace(0, 6, 50)
    errors = []
    for count in (20, 40, 80, 160) if method != "DOP853" else (8, 16, 32):
        run = problem.run(method, step=6 / count, unit_parts=[(0, 4)], times=times, every_step=False)
        assert np.abs(np.linalg.norm(run.state, axis=1) - 1).max() < 1e-15
        errors.append(np.abs(run.end_state - exact(6)).max())
    assert slopes(errors)[-1] > _step.methods()[method] - 0.3
    adaptive = problem.run("DOP853", 1e-12, unit_parts=[(0, 4)], every_step=True)
    assert np.abs(np.linalg.norm(adaptive.state, axis=1) - 1).max() < 1e-15
    assert np.abs(adaptive.end_state - exact(6)).max() < 1e-11


# -- how runs end


def test_blow_up_ends_where_the_step_becomes_too_small():
    problem = Problem("blow_up", lambda t, x, u, p: [x[0] ** 2], [1], 2)
    for method in ("RK45", "DOP853", "Radau"):
        run = problem.run(method)
        assert run.status == TOO_SMALL and abs(run.end_time - 1) < 1e-4 and np.isfinite(run.end_state).all()


def test_non_finite_slopes_end_a_run_at_the_last_good_state():
    problem = Problem("root", lambda t, x, u, p: [ca.sqrt(1 - t)], [0], 2)
    for method in ("RK45", "DOP853", "Radau"):
        run = problem.run(method)
        assert run.status == NON_FINITE and 1 - 1e-6 < run.end_time <= 1
        assert abs(run.end_state[0] - 2 / 3) < 1e-6 and run.rejected > 0
    for method in METHODS:
        run = problem.run(method, step=0.3)
        assert run.status == NON_FINITE and abs(run.end_time - 0.9) < 1e-15 and run.accepted == 3
    growth = Problem("growth_nan", lambda t, x, u, p: [x[0]], [np.nan], 1)
    for method in METHODS:
        run = growth.run(method)
        assert run.status == NON_FINITE and run.end_time == 0 and run.accepted == 0


def test_evaluations_can_be_limited(arm):
    for method in METHODS:
        run = arm.run(method, max_evaluations=200, times=np.linspace(0, 10, 101))
        assert run.status == SPENT and 200 <= run.evaluations < 240
        assert run.end_time == run.steps[-1] and run.time[-1] <= run.end_time < run.time[-1] + 0.1


def test_nothing_to_do():
    problem = Problem("still", lambda t, x, u, p: [1.0], [3], 0)
    for method in METHODS:
        run = problem.run(method, times=[0.0])
        assert run.status == FINISHED and run.accepted == 0
        assert list(run.end_state) == [3] and run.state.tolist() == [[3.0]]


def test_wrong_arguments_are_refused(arm):
    for changes, text in [({"method": "Euler"}, "unknown method"), ({"norm_size": 5}, "norm_size"),
                          ({"times": [2.0, 1.0]}, "ascend"), ({"unit_parts": [(2, 3)]}, "unit part"),
                          ({"step": 0.0}, "RK4 needs a step"), ({"t1": np.nan}, "finite")]:  # fmt: skip
        with pytest.raises(ValueError, match=text):
            arm.run(**({"method": "RK4"} | changes))


def test_progress_is_told_and_may_stop_the_run(arm):
    told = []

    def progress(t):
        told.append(t)
        if len(told) == 2:
            raise KeyboardInterrupt

    run = arm.run("DOP853", t1=1e6, progress=progress, max_evaluations=10**12)
    assert run.status == INTERRUPTED and len(told) == 2 and 0 < told[0] < told[1] <= run.end_time

    def broken(t):
        raise RuntimeError("cannot draw")

    with pytest.raises(RuntimeError, match="cannot draw"):
        arm.run("DOP853", t1=1e6, progress=broken, max_evaluations=10**12)


@pytest.mark.tier2
def test_control_c_stops_a_run_and_keeps_what_was_computed():
    script = textwrap.dedent("""
        import os, signal, sys, threading, time
        sys.path.insert(0, sys.argv[1])
        from stepper_problem import Problem
        import casadi as ca, numpy as np
        problem = Problem("swing", lambda t, x, u, p: [x[1], -ca.sin(x[0])], [2, 0], 1e9)
        problem.run("RK45", t1=1.0)
        threading.Timer(0.2, os.kill, [os.getpid(), signal.SIGINT]).start()
        run = problem.run("RK45", max_step=1e-3, times=np.arange(1e4), max_evaluations=10**15)
        print(run.status, len(run.time), run.end_time)
    """)
    folder = str(Path(__file__).parents[1] / "support")
    done = subprocess.run(
        [sys.executable, "-c", script, folder], capture_output=True, text=True, timeout=60, check=True
    )
    status, outputs, end = (float(v) for v in done.stdout.split())
    assert status == INTERRUPTED and end > 1 and outputs == np.floor(end) + 2  # the end is one more row


def test_result_arrays_outlive_the_result(arm):
    state = arm.run("RK45", every_step=True).state
    kept = state.copy()
    for _ in range(9):
        arm.run("RK45", every_step=True)
    assert np.array_equal(state, kept)


def test_a_problem_keeps_its_arrays_alive_and_converts_other_numbers(arm):
    """What only the record refers to lives as long as the run; whole numbers become doubles."""
    plain = arm.run("DOP853", times=[1.0, 2.0])
    freed = arm.run("DOP853", times=np.array([1, 2]), x0=np.array(arm.x0), progress=lambda t: np.empty(1000).fill(t))
    assert np.array_equal(freed.state, plain.state)
    for changes in ({"x0": "a text"}, {"lanes": 1.5}, {"unit_parts": 3}):
        with pytest.raises(TypeError, match=f"'{next(iter(changes))}'"):
            _step.PreparedProblem(arm.problem("DOP853", **changes))
