"""The problem of `arm_design` for MAPTOR, which solves it by collocation on a mesh that it refines."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from bellcrank_bench.measurements.arm_design import (
    ARM,
    FASTEST,
    FROM,
    LENGTH,
    LOAD,
    LOWEST,
    OF_SQUARES,
    OF_TORQUES,
    STRONGEST,
    TO,
    posture,
)  # fmt: skip

INTERVALS, DEGREE = 10, 4  # of the mesh at the start
LEAST_TORQUE, GUESSED_TIME, GUESSED_TORQUE = 5.0, 4.0, 2.0  # N m, s, N m
ITERATIONS, DEGREES = 15, (3, 8)
IPOPT = {"ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.max_iter": 3000, "ipopt.tol": 1e-6, "print_time": 0}


@dataclass(frozen=True)
class Collocation:
    """What MAPTOR found at a tolerance: objective, largest torques (N m), duration (s); time of the processor, s."""

    tolerance: float
    objective: float
    torques: tuple[float, float]
    duration: float
    seconds: float


def maptor_optimum(tolerance: float) -> Collocation:
    """The optimum by MAPTOR with a tolerance of its mesh. Raises ImportError where it is not installed."""
    import casadi
    import maptor

    begin_at = time.process_time()
    problem = maptor.Problem("arm")
    phase = problem.set_phase(1)
    (a1, a2), (b1, b2) = posture(*FROM), posture(*TO)
    t = phase.time(initial=0.0)
    q1 = phase.state("q1", initial=a1, final=b1, boundary=(0.0, np.pi))
    q2 = phase.state("q2", initial=a2, final=b2, boundary=(-np.pi, np.pi))
    v1, v2 = (phase.state(name, initial=0.0, final=0.0, boundary=(-FASTEST, FASTEST)) for name in ("v1", "v2"))
    most = [problem.parameter(name, boundary=(LEAST_TORQUE, STRONGEST)) for name in ("m1", "m2")]
    u1, u2 = (phase.control(name, boundary=(-STRONGEST, STRONGEST)) for name in ("u1", "u2"))
    # M a + C + G = τ (textbook/planar_2r.py), with the weight as a force at the tip.
    cos, first, both = casadi.cos(q2), casadi.cos(q1), casadi.cos(q1 + q2)
    m22 = ARM.i2 + ARM.m2 * ARM.r2**2
    m12 = m22 + ARM.m2 * LENGTH * ARM.r2 * cos
    m11 = ARM.i1 + ARM.m1 * ARM.r1**2 + ARM.m2 * LENGTH**2 + m12 + ARM.m2 * LENGTH * ARM.r2 * cos
    h = ARM.m2 * LENGTH * ARM.r2 * casadi.sin(q2)
    outer = (ARM.m2 * ARM.r2 + LOAD * LENGTH) * ARM.g * both
    inner = (ARM.m1 * ARM.r1 + ARM.m2 * LENGTH + LOAD * LENGTH) * ARM.g * first
    r1, r2 = u1 + h * (2.0 * v1 + v2) * v2 - inner - outer, u2 - h * v1**2 - outer
    det = m11 * m22 - m12**2
    phase.dynamics({q1: v1, q2: v2, v1: (m22 * r1 - m12 * r2) / det, v2: (m11 * r2 - m12 * r1) / det})
    height = LENGTH * casadi.sin(q1) + LENGTH * casadi.sin(q1 + q2)
    bounds = [sign * u <= limit for u, limit in zip((u1, u2), most, strict=True) for sign in (1.0, -1.0)]
    phase.path_constraints(height >= LOWEST, *bounds)
    squares = phase.add_integral(u1**2 + u2**2)
    problem.minimize(t.final + OF_TORQUES[0] * most[0] + OF_TORQUES[1] * most[1] + OF_SQUARES * squares)
    phase.mesh([DEGREE] * INTERVALS, np.linspace(-1.0, 1.0, INTERVALS + 1))
    states, controls = [], []
    for k in range(INTERVALS):
        s = (k + np.linspace(0.0, 1.0, DEGREE + 1)) / INTERVALS
        speed = np.sin(np.pi * s) / GUESSED_TIME
        rows = [a1 + (b1 - a1) * s, a2 + (b2 - a2) * s, (b1 - a1) * speed, (b2 - a2) * speed]
        states.append(np.array(rows))
        controls.append(np.full((2, DEGREE), GUESSED_TORQUE))
    phase.guess(states=states, controls=controls, terminal_time=GUESSED_TIME, integrals=10.0)
    problem.parameter_guess(m1=0.5 * STRONGEST, m2=0.5 * STRONGEST)
    found = maptor.solve_adaptive(
        problem, error_tolerance=tolerance, max_iterations=ITERATIONS, min_polynomial_degree=DEGREES[0],
        max_polynomial_degree=DEGREES[1], nlp_options=IPOPT, show_summary=False,
    )  # fmt: skip
    torques = tuple(float(x) for x in found.parameters["values"])
    duration = float(found.phases[1]["times"]["final"])
    seconds = time.process_time() - begin_at
    return Collocation(tolerance, float(found.status["objective"]), (torques[0], torques[1]), duration, seconds)
