"""Python on Pinocchio's forward dynamics: SciPy's solve_ivp, and a Runge-Kutta loop of one's own."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from bellcrank_bench.bench.bench_problem import Array, Outcome, Problem, Run
from bellcrank_bench.peers import substeps
from bellcrank_bench.textbook.open_chains import SimplePendulum, SpringPendulum

Rates = Callable[[float, Array], Array]


def runs(problem: Problem, settings: Mapping[str, Mapping[str, Sequence[float]]]) -> Iterator[Run]:
    """solve_ivp over tolerances and RK4 over steps, both on `pin.aba`."""
    rates = _rates(problem)
    for method, tolerances in settings["SciPy"].items():
        for tolerance in tolerances:
            once = partial(solve, problem, rates, method, tolerance, problem.start)
            yield Run("SciPy + pin.aba", method, f"{tolerance:g}", "solve_ivp with t_eval, Python around pin.aba", once)
    for step in settings["Pinocchio"]["RK4"]:
        count, h = substeps(problem, step)
        once = partial(_rk4, problem, rates, count, h)
        yield Run("Pinocchio in Python", "RK4", f"h {h:.3g}", "Python loop around pin.aba", once)


def _rates(problem: Problem) -> Rates:
    """The state's rates by `pin.aba`; Pinocchio's own URDF joints, the spring as a joint force."""
    import pinocchio as pin

    equations = problem.equations
    model = pin.Model()
    model.gravity.linear = np.array([0.0, -equations.g, 0.0])
    if isinstance(equations, SpringPendulum):
        swing = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "swing")
        along = pin.JointModelPrismaticUnaligned(np.array([0.0, -1.0, 0.0]))
        slide = model.addJoint(swing, along, pin.SE3.Identity(), "spring")
        point = pin.Inertia(equations.mass, np.zeros(3), np.zeros((3, 3)))
        model.appendBodyToJoint(slide, point, pin.SE3.Identity())
        stiffness, length = equations.stiffness, equations.free_length

        def force(x: Array) -> Array:
            return np.array((0.0, stiffness * (length - x[1])))
    elif isinstance(equations, SimplePendulum):
        swing, none = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "swing"), np.zeros(1)
        point = pin.Inertia(equations.mass, np.array([0.0, -equations.length, 0.0]), np.zeros((3, 3)))
        model.appendBodyToJoint(swing, point, pin.SE3.Identity())

        def force(x: Array) -> Array:
            return none
    else:
        parent, at = 0, pin.SE3.Identity()
        links = ((equations.m1, equations.r1, equations.i1), (equations.m2, equations.r2, equations.i2))
        for name, (mass, center, inertia) in zip(problem.joints, links, strict=True):
            parent = model.addJoint(parent, pin.JointModelRZ(), at, name)
            body = pin.Inertia(mass, np.array([center, 0.0, 0.0]), np.diag([inertia] * 3))
            model.appendBodyToJoint(parent, body, pin.SE3.Identity())
            at = pin.SE3(np.eye(3), np.array([equations.l1, 0.0, 0.0]))
        none = np.zeros(2)

        def force(x: Array) -> Array:
            return none

    data, aba, join, n = model.createData(), pin.aba, np.concatenate, problem.count

    def rates(_: float, x: Array) -> Array:
        v = x[n:]
        return join((v, aba(model, data, x[:n], v, force(x))))

    return rates


def solve(
    problem: Problem,
    rates: Rates,
    method: str,
    tolerance: float,
    start: Sequence[float] | Array,
    count: int | None = None,
) -> Outcome:
    """solve_ivp from a start (n,); its first `count` coordinates, which are the compared ones where it is left out."""
    from scipy.integrate import solve_ivp

    begun = time.perf_counter()
    made: Any = solve_ivp(rates, (0.0, problem.duration), start, method, problem.times, rtol=tolerance, atol=tolerance)
    return Outcome(
        time.perf_counter() - begun,
        made.y[: problem.compared_count if count is None else count].T,
        evaluations=made.nfev,
    )


def _rk4(problem: Problem, rates: Rates, count: int, h: float) -> Outcome:
    begun, n = time.perf_counter(), problem.count
    x = np.array(problem.start)
    position = [x[:n]]
    for _ in problem.times[1:]:
        for _ in range(count):
            k1 = rates(0.0, x)
            k2 = rates(0.0, x + 0.5 * h * k1)
            k3 = rates(0.0, x + 0.5 * h * k2)
            k4 = rates(0.0, x + h * k3)
            x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        position.append(x[:n])
    seconds = time.perf_counter() - begun
    steps = count * (len(position) - 1)
    return Outcome(seconds, np.array(position), evaluations=4 * steps, steps=steps)
