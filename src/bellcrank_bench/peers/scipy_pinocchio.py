"""Python around Pinocchio: solve_ivp and a Runge-Kutta loop on pin.aba, or solve_ivp on pin.constraintDynamics.

Pinocchio has no rolling constraint, so the scenes that roll have no runs.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from bellcrank_bench.peers.peer import Outcome, Peer, Run, substeps
from bellcrank_bench.problems.checks import Array
from bellcrank_bench.problems.problem import Benchmark
from bellcrank_bench.textbook.bricard import BricardRing
from bellcrank_bench.textbook.four_bar import ReducedFourBar
from bellcrank_bench.textbook.pendulum import SimplePendulum
from bellcrank_bench.textbook.planar_2r import PlanarTwoLink
from bellcrank_bench.textbook.spring_pendulum import SpringPendulum

NAME = "SciPy"
TREE_TOOL, CONSTRAINED_TOOL, LOOP_TOOL = "SciPy + pin.aba", "SciPy + pin.constraintDynamics", "Pinocchio in Python"
TREE_NOTE = "solve_ivp with t_eval, Python around pin.aba"
CONSTRAINED_NOTE = "solve_ivp with t_eval, Python around pin.constraintDynamics, no Baumgarte terms (its default)"
Rates = Callable[[float, Array], Array]


def runs(benchmark: Benchmark, settings: Mapping[str, Any]) -> Iterator[Run]:
    """solve_ivp with every method at every tolerance, then RK4 in a Python loop at every step."""
    equations, start = benchmark.equations, benchmark.unreduced(np.array(benchmark.start))
    tool, note = (CONSTRAINED_TOOL, CONSTRAINED_NOTE) if benchmark.constrained else (TREE_TOOL, TREE_NOTE)
    if isinstance(equations, BricardRing):
        solve = partial(_solve_ring, benchmark, _ring(equations))
    elif isinstance(equations, ReducedFourBar):
        solve = partial(_solve, benchmark, _four_bar(equations), start=start)
    elif not benchmark.constrained:
        solve = partial(_solve, benchmark, _tree(benchmark), start=start)
    else:
        return
    for method, tolerances in settings.get("solve_ivp", {}).items():
        for tolerance in tolerances:
            once = partial(solve, method, tolerance)
            yield Run(tool=tool, method=method, setting=f"{tolerance:g}", note=note, once=once)
    for step in settings.get("RK4", ()):
        count, h = substeps(benchmark, step)
        once = partial(_rk4, benchmark, _tree(benchmark), count, h)
        yield Run(tool=LOOP_TOOL, method="RK4", setting=f"h {h:.3g}", note="Python loop around pin.aba", once=once)


def _tree(benchmark: Benchmark) -> Rates:
    """The state's rates by `pin.aba`, with Pinocchio's own joints and the spring as a joint force."""
    import pinocchio as pin

    equations = benchmark.equations
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
        assert isinstance(equations, PlanarTwoLink)
        parent, at = 0, pin.SE3.Identity()
        links = ((equations.m1, equations.r1, equations.i1), (equations.m2, equations.r2, equations.i2))
        for name, (mass, center, inertia) in zip(benchmark.joints, links, strict=True):
            parent = model.addJoint(parent, pin.JointModelRZ(), at, name)
            body = pin.Inertia(mass, np.array([center, 0.0, 0.0]), np.diag([inertia] * 3))
            model.appendBodyToJoint(parent, body, pin.SE3.Identity())
            at = pin.SE3(np.eye(3), np.array([equations.l1, 0.0, 0.0]))
        none = np.zeros(2)

        def force(x: Array) -> Array:
            return none

    data, aba, join, n = model.createData(), pin.aba, np.concatenate, benchmark.count

    def rates(_: float, x: Array) -> Array:
        v = x[n:]
        return join((v, aba(model, data, x[:n], v, force(x))))

    return rates


def _four_bar(equations: ReducedFourBar) -> Rates:
    """The rates of the angles and their velocities; the loop is a point constraint of two frames."""
    import pinocchio as pin

    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    parents, offsets, joints = (0, 1, 0), (0.0, equations.length[0], equations.ground), []
    for k, (parent, x) in enumerate(zip(parents, offsets, strict=True)):
        place = pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
        joints.append(model.addJoint(parent, pin.JointModelRZ(), place, f"joint {k}"))
        center, about = np.array([equations.center[k], 0.0, 0.0]), np.diag([equations.inertia[k]] * 3)
        model.appendBodyToJoint(joints[-1], pin.Inertia(equations.mass[k], center, about), pin.SE3.Identity())
    a, b = (pin.SE3(np.eye(3), np.array([length, 0.0, 0.0])) for length in equations.length[1:])
    closing = pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, joints[1], a, joints[2], b, pin.LOCAL)
    torque = np.zeros(3)

    def torques(q: Array) -> Array:
        torque[0] = equations.preload - equations.stiffness * q[0]
        return torque

    return _constrained(model, [closing], torques)


def _ring(equations: BricardRing) -> Rates:
    """The rates of hinge angles and velocities; the sixth hinge as point constraints at two of its points."""
    import pinocchio as pin

    model = pin.Model()
    model.gravity.linear = np.array([0.0, -equations.g, 0.0])
    kinds, joint, at = (pin.JointModelRY, pin.JointModelRZ, pin.JointModelRX), 0, np.zeros(3)
    for k, (rod, inertia) in enumerate(zip(equations.rods, equations.inertias, strict=True)):
        joint = model.addJoint(joint, kinds[k % 3](), pin.SE3(np.eye(3), at), f"hinge {k}")
        model.appendBodyToJoint(joint, pin.Inertia(1.0, rod / 2, inertia), pin.SE3.Identity())
        at = rod
    closings = [
        pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D, model, joint, pin.SE3(np.eye(3), at + along), 0,
            pin.SE3(np.eye(3), np.array([0.0, 0.0, 1.0]) + along), pin.LOCAL,
        )
        for along in (np.zeros(3), np.array([1.0, 0.0, 0.0]))
    ]  # fmt: skip
    none = np.zeros(5)
    return _constrained(model, closings, lambda _: none)


def _constrained(model: Any, closings: Sequence[Any], torques: Callable[[Array], Array]) -> Rates:
    """The rates of positions and velocities, under torques of the positions."""
    import pinocchio as pin

    loop, memory = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for closing in closings:
        loop.append(closing)
        memory.append(closing.createData())
    data = model.createData()
    pin.initConstraintDynamics(model, data, loop, memory)
    proximal = pin.ProximalSettings(1e-12, 1e-10, 10)
    solver, join, n = pin.constraintDynamics, np.concatenate, model.nv

    def rates(_: float, x: Array) -> Array:
        q, v = x[:n], x[n:]
        return join((v, solver(model, data, q, v, torques(q), loop, memory, proximal)))

    return rates


def _solve(
    benchmark: Benchmark,
    rates: Rates,
    method: str,
    tolerance: float,
    start: Sequence[float] | Array,
    width: int | None = None,
) -> Outcome:
    """solve_ivp from a start (n,), and its first `width` coordinates; without it, as many as are compared."""
    from scipy.integrate import solve_ivp

    begun = time.perf_counter()
    made: Any = solve_ivp(
        rates, (0.0, benchmark.duration), start, method, benchmark.times, rtol=tolerance, atol=tolerance
    )
    seconds = time.perf_counter() - begun
    position = made.y[: benchmark.compared_count if width is None else width].T
    return Outcome(seconds=seconds, position=position, evaluations=made.nfev)


def _solve_ring(benchmark: Benchmark, rates: Rates, method: str, tolerance: float) -> Outcome:
    """solve_ivp in the hinges' angles; the compared corner is computed after the clock has stopped."""
    made = _solve(benchmark, rates, method, tolerance, np.zeros(10), 5)
    return replace(made, position=benchmark.equations.corner_of(made.position))


def _rk4(benchmark: Benchmark, rates: Rates, count: int, h: float) -> Outcome:
    begun, n = time.perf_counter(), benchmark.count
    x = np.array(benchmark.start)
    position = [x[:n]]
    for _ in benchmark.times[1:]:
        for _ in range(count):
            k1 = rates(0.0, x)
            k2 = rates(0.0, x + 0.5 * h * k1)
            k3 = rates(0.0, x + 0.5 * h * k2)
            k4 = rates(0.0, x + h * k3)
            x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        position.append(x[:n])
    seconds = time.perf_counter() - begun
    steps = count * (len(position) - 1)
    return Outcome(seconds=seconds, position=np.array(position), evaluations=4 * steps, steps=steps)


PEER = Peer(NAME, "scipy", runs)
