"""Python on Pinocchio's constrained dynamics under SciPy's solve_ivp; of the loops, as it knows no rolling."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from bellcrank.validation.bench_problem import Array, Problem, Run
from bellcrank.validation.reduced import FourBar
from bellcrank.validation.rivals.scipy_pinocchio import Rates, solve

NOTE = "solve_ivp with t_eval, Python around pin.constraintDynamics, no Baumgarte terms (its default)"


def runs(problem: Problem, settings: Mapping[str, Mapping[str, Sequence[float]]]) -> Iterator[Run]:
    """solve_ivp over tolerances on `pin.constraintDynamics`; nothing for a scene without a loop."""
    equations = problem.equations
    if isinstance(equations, FourBar):
        rates, start = _rates(equations), problem.unreduced(np.array(problem.start))
        for method, tolerances in settings["SciPy"].items():
            for tolerance in tolerances:
                once = partial(solve, problem, rates, method, tolerance, start)
                yield Run("SciPy + pin.constraintDynamics", method, f"{tolerance:g}", NOTE, once)


def _rates(equations: FourBar) -> Rates:
    """The rates of the angles and their velocities; the loop is a point closure of two frames."""
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
    loop, memory = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    loop.append(closing)
    memory.append(closing.createData())
    data = model.createData()
    pin.initConstraintDynamics(model, data, loop, memory)
    proximal = pin.ProximalSettings(1e-12, 1e-10, 10)
    solver, join, torque = pin.constraintDynamics, np.concatenate, np.zeros(3)

    def rates(_: float, x: Array) -> Array:
        v = x[3:]
        torque[0] = equations.preload - equations.stiffness * x[0]
        return join((v, solver(model, data, x[:3], v, torque, loop, memory, proximal)))

    return rates
