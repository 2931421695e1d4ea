"""Falls from within 1e-9 rad of upright: how long they take tells how well the smallest deviation is carried along."""

from __future__ import annotations

from math import asinh, pi, sin

import numpy as np

from bellcrank.scene.scene import Scene
from bellcrank.simulation.trajectory import Trajectory
from bellcrank_bench.problems import urdf_texts
from bellcrank_bench.problems.problem import Figure, Problem, ended, scene_of
from bellcrank_bench.textbook.open_chains import PlanarTwoLink

LEAN = 1e-9  # rad
G = 9.81  # m/s²
HALF_PI_ROUNDING = 6.123233995736766e-17  # π/2 less the double nearest to it


def pendulum_scene() -> Scene:
    """A pendulum of 1 m, its joint 0 where it stands, until it is level."""
    level = {"name": "level", "when": {"joint": "swing", "position": pi / 2}, "stop": True}
    data = {"gravity": [0.0, -G, 0.0], "initial": {"swing": LEAN}, "events": [level]}
    return scene_of(urdf_texts.upright_pendulum(), data)


def judge_pendulum(run: Trajectory) -> list[Figure]:
    """Known: from the energy, with k = cos(θ0/2) and l = 1 m, t = sqrt(l/g) (K(k) - F(φ, k)), sin φ = sin(π/4) / k.

    F(φ, 1) = asinh(tan φ), and 1 - k² = 2.5e-19. Source: L. Landau, E. Lifshitz, Mechanics (1976), §11.
    """
    from scipy.special import ellipkm1

    fall = (ellipkm1(sin(LEAN / 2) ** 2) - asinh(1.0)) / np.sqrt(G)
    return [ended(run), Figure("time of the fall", abs(run.time[-1] - fall), 1e-6, "s")]


def arm_scene() -> Scene:
    """The lecture's 2R arm, stretched upwards, until its elbow has folded to -90 deg."""
    folded = {"name": "folded", "when": {"joint": "elbow", "position": -pi / 2}, "stop": True}
    data = {"urdf": "planar_2r", "gravity": [0.0, -G, 0.0], "initial": {"shoulder": pi / 2 + LEAN}, "events": [folded]}
    return scene_of(None, data)


def judge_arm(run: Trajectory) -> list[Figure]:
    """Known: the lecture's equations with δ = θ1 - π/2 for the first angle, which carry a deviation of 1e-9 rad with
    all digits, integrated by SciPy's DOP853 at rtol = 3e-14, atol = 1e-24 (its RK45 and Radau agree to 1e-9 s).
    """
    return [ended(run), Figure("time of the fall", abs(run.time[-1] - arm_fall("DOP853", 3e-14)), 1e-6, "s")]


def arm_fall(method: str, rtol: float) -> float:
    """Seconds until the elbow passes -π/2, in coordinates that are 0 where the arm stands."""
    from scipy.integrate import solve_ivp

    arm = PlanarTwoLink()
    inner, outer = (arm.m2 * arm.l1 + arm.m1 * arm.r1) * arm.g, arm.m2 * arm.g * arm.r2
    level = PlanarTwoLink(g=0.0)  # mass matrix and Coriolis terms do not depend on the first angle

    def rate(_: float, x: np.ndarray) -> np.ndarray:
        deviation = x[:2]
        second = outer * np.sin(deviation.sum())
        gravity = -np.array([inner * np.sin(x[0]) + second, second])  # cos(π/2 + δ) = -sin δ
        return np.hstack([x[2:], level.forward_dynamics(deviation, x[2:], -gravity)])

    def folded(_: float, x: np.ndarray) -> float:
        return float(x[1] + pi / 2)

    folded.terminal = True  # type: ignore[attr-defined]
    start = (pi / 2 + LEAN) - pi / 2 - HALF_PI_ROUNDING  # of the double that the scene starts from
    found = solve_ivp(rate, (0.0, 20.0), [start, 0, 0, 0], method, rtol=rtol, atol=1e-24, events=folded)
    return float(found.t_events[0][0])


# Tolerances stand against θ, but the deviation is what matters. The pendulum's coordinate is the deviation, and takes
# an absolute tolerance far below it. The arm's shoulder is near π/2 and can move by 2e-16 rad at the least; there the
# velocities, which start from 0, hold the error: the absolute tolerance must neither drown them nor ask for digits that
# such a position does not have. With rtol = 1e-12, from 1e-15 to 1e-17 serve; at 1e-12 the fall is off by 3e-4 s.
PROBLEMS = (
    Problem(
        "upright_pendulum", "pendulum 1e-9 rad from upright, until it is level", pendulum_scene, judge_pendulum,
        {"duration": 20.0, "rtol": 1e-12, "atol": 1e-18},
    ),
    Problem(
        "upright_2r", "2R arm 1e-9 rad from upright, until its elbow has folded", arm_scene, judge_arm,
        {"duration": 20.0, "rtol": 1e-12, "atol": 1e-16},
    ),
)  # fmt: skip
