"""Reference problems of the spring pendulum: a swing of 20 s, and a very stiff spring.

Source: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18.
"""

from __future__ import annotations

from math import cos, pi
from typing import Any, Final

import numpy as np

from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank_bench.problems.checks import Array, Check, extremes, finished, largest, turning_points
from bellcrank_bench.problems.problem import LECTURE, Benchmark, Problem
from bellcrank_bench.textbook.spring_pendulum import SpringPendulum

SWING_END = (-0.32885524, 6.70749476, -0.6952644, -3.54642339)  # angle (rad), length (m) and their rates after 20 s
STIFF = SpringPendulum(stiffness=1e8)
STIFF_SETTINGS: Final[dict[str, Any]] = {"duration": 10.0, "solver": "Radau", "rtol": 1e-6, "atol": 1e-6}


def swing_scene() -> Scene:
    """The spring pendulum."""
    return load_scene("spring_pendulum", {"events": turning_points("slide")})


def judge_swing(run: Trajectory) -> list[Check]:
    """Known: end values, and the range over rows every 20 ms, to the digits printed, by an integrator of order 8 at
    rtol = atol = 1e-13 and by a second method, both on the lecture's equations; the turning points by SciPy's DOP853
    and its events.
    """
    low, high = extremes(run)
    rows = run.joint("slide").position
    return [
        finished(run),
        Check("end values", largest(np.r_[run.position[-1], run.velocity[-1]] - SWING_END), 1e-7, "rad, m, 1/s"),
        Check("range over rows every 20 ms", largest([rows.min() - 4.9215774, rows.max() - 7.97662165]), 1e-8, "m"),
        Check("range between rows", largest([low[1] - 4.921419494723, high[1] - 7.976774573993]), 1e-9, "m"),
        Check("energy drift", run.energy_drift(), 1e-10),
    ]


def stiff_scene() -> Scene:
    """The spring pendulum with a spring of 1e8 N/m, released where the spring just carries the weight."""
    length = STIFF.free_length + STIFF.mass * STIFF.g * cos(pi / 4) / STIFF.stiffness
    start = {"swing": pi / 4, "slide": length}
    return load_scene("spring_pendulum", {"forces.spring.stiffness": STIFF.stiffness, "initial": start})


def judge_stiff(run: Trajectory) -> list[Check]:
    """Known: on its slow motion the spring carries the load, r = l + ε (g cos θ + l θ̇²) + O(ε²) with ε = m/k = 2e-8,
    which leaves an equation for θ alone that is not stiff (singular perturbation); SciPy's DOP853 integrates it.

    The spring's own period is 0.9 ms, and that motion is not excited; DOP853 at the same tolerances takes steps as
    short only because its stability demands them.
    """
    from scipy.integrate import solve_ivp

    p, epsilon = STIFF, STIFF.mass / STIFF.stiffness

    def slow_rate(_: float, x: Array) -> list[float]:
        angle, rate = x
        r = p.free_length + epsilon * (p.g * np.cos(angle) + p.free_length * rate**2)
        speed = -3.0 * epsilon * p.g * np.sin(angle) * rate  # dr/dt with θ̈ = -(g/l) sin θ
        return [rate, -(2 * speed * rate + p.g * np.sin(angle)) / r]

    angle, rate = solve_ivp(slow_rate, (0.0, 10.0), [pi / 4, 0.0], "DOP853", run.time, rtol=1e-13, atol=1e-14).y
    expected = np.stack([angle, p.free_length + epsilon * (p.g * np.cos(angle) + p.free_length * rate**2)], -1)
    explicit, auto = (simulate(run.scene, **(STIFF_SETTINGS | {"solver": solver})) for solver in ("DOP853", "auto"))
    cost, more = run.statistics, explicit.statistics.evaluations
    with_jacobians = cost.evaluations + 4 * cost.jacobians
    return [
        finished(run),
        Check("error of Radau", largest(run.position - expected), 5e-5, "rad, m"),
        Check("error of DOP853", largest(explicit.position - expected), 5e-5, "rad, m"),
        Check("error of auto", largest(auto.position - expected), 5e-5, "rad, m"),
        Check("evaluations, auto / Radau", auto.statistics.evaluations / cost.evaluations, 1.3, "times"),
        Check("evaluations, DOP853 / Radau", more / cost.evaluations, 20.0, "times", at_least=True),
        Check("the same, a Jacobian counted as 4", more / with_jacobians, 20.0, "times", at_least=True),
    ]


PROBLEMS = (
    Problem(
        name="spring_pendulum",
        title="spring pendulum, 20 s",
        source=LECTURE,
        make=swing_scene,
        judge=judge_swing,
        settings={"rtol": 1e-12, "atol": 1e-12, "duration": 20.0},
        benchmark=Benchmark(
            scene="spring_pendulum",
            equations=SpringPendulum(),
            joints=("swing", "slide"),
            start=(pi / 4, 5.0, 0.2, 0.1),
            duration=20.0,
            unit="rad | m",
            known_end=SWING_END,
            count=2,
            compared_count=2,
        ),
    ),
    Problem(
        name="stiff_spring",
        title="spring pendulum with a spring of 1e8 N/m on its slow motion, 10 s",
        source="singular perturbation",
        make=stiff_scene,
        judge=judge_stiff,
        settings=STIFF_SETTINGS,
    ),
)
