"""Python on Pinocchio's constrained dynamics under SciPy's solve_ivp; of the loops, as it knows no rolling."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from bellcrank_bench.bench.bench_problem import Array, Outcome, Problem, Run
from bellcrank_bench.peers.scipy_pinocchio import Rates, solve
from bellcrank_bench.textbook.reduced_coordinates import BricardRing, FourBar

NOTE = "solve_ivp with t_eval, Python around pin.constraintDynamics, no Baumgarte terms (its default)"


def runs(problem: Problem, settings: Mapping[str, Mapping[str, Sequence[float]]]) -> Iterator[Run]:
    """solve_ivp over tolerances on `pin.constraintDynamics`; nothing for a scene without a loop."""
    equations = problem.equations
    if isinstance(equations, FourBar):
        rates, start = _four_bar(equations), problem.unreduced(np.array(problem.start))
        once = partial(solve, problem, rates, start=start)
    elif isinstance(equations, BricardRing):
        once = partial(_solve_ring, problem, _ring(equations))
    else:
        return
    for method, tolerances in settings["SciPy"].items():
        for tolerance in tolerances:
            yield Run(
                "SciPy + pin.constraintDynamics", method, f"{tolerance:g}", NOTE, partial(once, method, tolerance)
            )


def _four_bar(equations: FourBar) -> Rates:
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

    return _rates(model, [closing], torques)


def _ring(equations: BricardRing) -> Rates:
    """The rates of the hinges' angles and their velocities; the sixth hinge as point constraints at two of its points."""
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
    return _rates(model, closings, lambda _: none)


def _solve_ring(problem: Problem, rates: Rates, method: str, tolerance: float) -> Outcome:
    """solve_ivp in the hinges' angles; the corner that is compared is worked out after the clock has stopped."""
    made = solve(problem, rates, method, tolerance, np.zeros(10), 5)
    return replace(made, position=problem.equations.corner_of(made.position))


def _rates(model: Any, closings: Sequence[Any], torques: Callable[[Array], Array]) -> Rates:
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
