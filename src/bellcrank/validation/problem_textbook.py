"""The lecture's planar 2R arm and spring pendulum: free swings, long ones, extreme masses, a stiff spring, tracking.

Source of the scenes: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import cos, degrees, pi
from typing import Any

import numpy as np

from bellcrank.scene.scene import Scene
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory import Trajectory
from bellcrank.validation import problem_urdf
from bellcrank.validation.problem_base import Array, Figure, Problem, ended, largest, scene_of
from bellcrank.validation.textbook import PlanarTwoLink, SpringPendulum

DOWN = [0.0, -9.81, 0.0]  # m/s²
STIFF = SpringPendulum(stiffness=1e8)
GAINS = {"kp": 100.0, "kd": 20.0}
MASS_ERROR = 0.1


def swing_scene(**more: Any) -> Scene:
    """The 2R arm let go with the upper link hanging and the elbow at 45 deg."""
    start = {"shoulder": "-90 deg", "elbow": "45 deg"}
    return scene_of(None, {"urdf": "planar_2r", "gravity": DOWN, "initial": start, **more})


def spring_scene(**more: Any) -> Scene:
    """The spring pendulum."""
    p = SpringPendulum()
    spring = {"kind": "joint_spring", "joint": "spring", "stiffness": p.stiffness, "rest": p.free_length}
    start = {"swing": pi / 4, "spring": 5.0, "velocity": {"swing": 0.2, "spring": 0.1}}
    data = {"gravity": DOWN, "forces": [spring], "initial": start, **more}
    return scene_of(problem_urdf.spring_pendulum(p.mass), data)


def judge_swing(run: Trajectory) -> list[Figure]:
    """Known: end values and ranges to the digits printed, by an 8th-order integrator at rtol = atol = 1e-13 and a
    second method from the lecture's equations.
    """
    end = np.r_[run.position[-1], run.velocity[-1]] - (-1.6288964, 0.4774930, -1.4299024, 2.5688865)
    turns = np.degrees(run.position)
    # 1,001 rows miss a turning point by up to ½ |a| (h/2)²
    lows, highs = turns.min(0) - (-114.71306, -44.67125), turns.max(0) - (-65.22107, 45.0)
    return [
        ended(run),
        Figure("end values", largest(end), 1e-7, "rad, rad/s"),
        Figure("ranges of the angles", largest(np.r_[lows, highs]), 2e-5, "deg"),
        Figure("energy drift", run.energy_drift(), 1e-10),
    ]


def judge_spring(run: Trajectory) -> list[Figure]:
    """Known: end values and range to the digits printed, by an 8th-order integrator at rtol = atol = 1e-13 and a second
    method from the lecture's equations.
    """
    end = np.r_[run.position[-1], run.velocity[-1]] - (-0.32885524, 6.70749476, -0.6952644, -3.54642339)
    length = run.joint("spring").position
    return [
        ended(run),
        Figure("end values", largest(end), 1e-7, "rad, m, 1/s"),
        Figure("range of the length", largest([length.min() - 4.9215774, length.max() - 7.97662165]), 1e-7, "m"),
        Figure("energy drift", run.energy_drift(), 1e-10),
    ]


def judge_long_swing(run: Trajectory) -> list[Figure]:
    """Known: nothing takes energy out, so it stays."""
    return [ended(run), Figure("energy drift", run.energy_drift(), 1e-9)]


# ---- extreme masses


def mass_ratio(outer: float) -> Problem:
    """The 2R arm with link `outer` (1 or 2) a million times as heavy as the other, mass and inertia."""
    arm = PlanarTwoLink()
    light = {"m1": arm.m1 * 1e-6, "i1": arm.i1 * 1e-6} if outer == 2 else {"m2": arm.m2 * 1e-6, "i2": arm.i2 * 1e-6}
    arm = replace(arm, **light)

    def make() -> Scene:
        start = {"shoulder": -pi / 2, "elbow": pi / 4}
        return scene_of(problem_urdf.two_link(arm), {"gravity": DOWN, "initial": start})

    def judge(run: Trajectory) -> list[Figure]:
        """Known: the analytic equations, integrated by SciPy's DOP853."""
        reference = analytic(arm.derivative, run, rtol=1e-13, atol=1e-14)
        return [
            ended(run),
            Figure("largest difference", largest(run.position - reference[:, :2]), 1e-7, "rad"),
            Figure("accelerations", accelerations(run, arm.derivative), 1e-9, "relative"),
            Figure("energy drift", run.energy_drift(), 1e-10),
        ]

    which = "outer" if outer == 2 else "inner"
    return Problem(
        f"mass_ratio_{which}", f"2R arm with its {which} link 1e6 times as heavy as the other, 10 s", make, judge,
        {"duration": 10.0, "rtol": 1e-12, "atol": 1e-12},
    )  # fmt: skip


def analytic(derivative: Callable[[Array], Array], run: Trajectory, rtol: float, atol: float, **more: Any) -> Array:
    """States (n, 4) of analytic equations at the run's times, from its start, by SciPy: DOP853 unless told."""
    from scipy.integrate import solve_ivp

    x0 = np.r_[run.position[0], run.velocity[0]]
    options = {"method": "DOP853", "t_eval": run.time} | more
    span = (0.0, float(run.time[-1]))
    return np.asarray(solve_ivp(lambda _, x: derivative(x), span, x0, rtol=rtol, atol=atol, **options).y.T)


def accelerations(run: Trajectory, derivative: Callable[[Array], Array]) -> float:
    """The largest difference of the run's accelerations from analytic ones, each as a share of the joint's largest."""
    expected = derivative(np.hstack([run.position, run.velocity]))[:, 2:]
    return largest((run.acceleration - expected) / np.abs(expected).max(0))


# ---- stiff spring


def stiff_scene() -> Scene:
    """The spring pendulum with a spring of 1e8 N/m, let go where the spring just carries the weight."""
    spring = {"kind": "joint_spring", "joint": "spring", "stiffness": STIFF.stiffness, "rest": STIFF.free_length}
    length = STIFF.free_length + STIFF.mass * STIFF.g * cos(pi / 4) / STIFF.stiffness
    data = {"gravity": DOWN, "forces": [spring], "initial": {"swing": pi / 4, "spring": length}}
    return scene_of(problem_urdf.spring_pendulum(STIFF.mass), data)


def judge_stiff(run: Trajectory) -> list[Figure]:
    """Known: SciPy's Radau with the analytic equations at rtol = 1e-11, another implementation on other equations.

    The spring's own period is 0.9 ms, and its motion is not excited: DOP853 at the same tolerances has to follow it for
    stability alone.
    """
    reference = analytic(STIFF.derivative, run, rtol=1e-11, atol=1e-13, method="Radau")[:, :2]
    explicit = simulate(run.scene, **(STIFF_SETTINGS | {"solver": "DOP853"}))
    cost = run.statistics
    with_jacobians = cost.evaluations + run.scene.robot.nv * 2 * cost.jacobians  # as if by differences
    return [
        ended(run),
        Figure("error of Radau", largest(run.position - reference), 1e-4, "rad, m"),
        Figure("error of DOP853", largest(explicit.position - reference), 1e-4, "rad, m"),
        Figure("evaluations, DOP853 / Radau", explicit.statistics.evaluations / cost.evaluations, 20.0, "times", True),
        Figure("the same, a Jacobian as 4", explicit.statistics.evaluations / with_jacobians, 20.0, "times", True),
    ]


STIFF_SETTINGS: dict[str, Any] = {"duration": 10.0, "solver": "Radau", "rtol": 1e-6, "atol": 1e-6}


# ---- tracking


def tracking_scene(mass_error: float) -> Scene:
    """The 2R arm round the lecture's circle under computed torque, whose model is wrong by `mass_error`."""
    circle = {
        "kind": "circle", "frame": "tip", "center": [1.2, 1.2, 0.0], "radius": 0.2, "duration": 10.0,
        "profile": "constant", "samples": 1001, "start": {"elbow": -1.0},
    }  # fmt: skip
    control = {"kind": "computed_torque", "motion": "circle", "mass_error": mass_error, **GAINS}
    data = {
        "urdf": "planar_2r", "gravity": DOWN, "friction": "none", "motions": {"circle": circle},
        "control": [control], "initial": {"motion": "circle"}, "outputs": {"tip": {"frame": "tip"}},
    }  # fmt: skip
    return scene_of(None, data)


def judge_tracking(run: Trajectory) -> list[Figure]:
    """Known: with an exact model the error stays 0, so the tip stays on the circle, φ uniform."""
    phi = 2 * pi * run.time / 10.0
    circle = np.stack([1.2 + 0.2 * np.cos(phi), 1.2 + 0.2 * np.sin(phi), 0 * phi], -1)
    return [
        ended(run),
        Figure("tip off the circle", largest(run.output("tip") - circle), 1e-8, "m"),
        Figure("energy drift", run.energy_drift(), 1e-9),
    ]


def judge_tracking_with_mass_error(run: Trajectory) -> list[Figure]:
    """Known: with links (1 + ε) times too heavy in the model, M a + h = (1 + ε)(M (a_d - kd ė - kp e) + h), e the
    position less the wanted one, so that ë + (1 + ε)(kd ė + kp e) = ε (a_d + M⁻¹ h): integrated by SciPy from the closed forms of circle
    and arm.
    """
    from scipy.integrate import solve_ivp

    arm, kp, kd = PlanarTwoLink(), GAINS["kp"], GAINS["kd"]
    rate, zero = 2 * pi / 10.0, np.zeros(2)

    def error_rate(t: float, x: Array) -> Array:
        q, v, a = arm.circle(np.array(rate * t), rate, -1)
        e, de = x[:2], x[2:]
        drift = -arm.forward_dynamics(q + e, v + de, zero)  # M⁻¹ h at the arm's own state
        return np.r_[de, MASS_ERROR * (a + drift) - (1 + MASS_ERROR) * (kd * de + kp * e)]

    expected = solve_ivp(
        error_rate, (0.0, 10.0), np.zeros(4), method="DOP853", rtol=1e-10, atol=1e-12, t_eval=run.time
    ).y[:2].T  # fmt: skip
    wanted, _, _ = arm.circle(rate * run.time, rate, -1)
    error = run.position - wanted
    return [
        ended(run),
        Figure("tracking error against its equation", largest(error - expected), 1e-8, "rad"),
        Figure("largest tracking error", degrees(largest(error[len(error) // 2 :])), 0.5, "deg", at_least=True),
    ]


FINE = {"rtol": 1e-12, "atol": 1e-12}
PROBLEMS = (
    Problem(
        "planar_2r_swing", "planar 2R arm, free swing of 10 s", swing_scene, judge_swing, FINE | {"duration": 10.0}
    ),
    Problem(
        "spring_pendulum", "spring pendulum, 20 s", spring_scene, judge_spring,
        FINE | {"duration": 20.0, "samples": 20_001},
    ),
    Problem(
        "planar_2r_1000_s", "planar 2R arm, free swing of 1,000 s", swing_scene, judge_long_swing,
        FINE | {"duration": 1000.0},
    ),
    mass_ratio(2),
    mass_ratio(1),
    Problem(
        "stiff_spring", "spring pendulum with a spring of 1e8 N/m on its slow motion, 10 s", stiff_scene, judge_stiff,
        STIFF_SETTINGS,
    ),
    Problem(
        "tracking", "2R arm round the lecture's circle, computed torque with an exact model",
        lambda: tracking_scene(0.0), judge_tracking, {"duration": 10.0, "rtol": 1e-11, "atol": 1e-11},
    ),
    Problem(
        "tracking_mass_error", "the same with a model 10 % too heavy",
        lambda: tracking_scene(MASS_ERROR), judge_tracking_with_mass_error,
        {"duration": 10.0, "rtol": 1e-11, "atol": 1e-11},
    ),
)  # fmt: skip
