"""The lecture's planar 2R arm and spring pendulum: free swings, long ones, extreme masses, a stiff spring, tracking.

Source of the scenes: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import cos, degrees, pi
from typing import Any, Final

import numpy as np

from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory import Trajectory
from bellcrank_bench.problems import urdf_texts
from bellcrank_bench.problems.problem import Array, Figure, Problem, ended, largest, scene_of
from bellcrank_bench.textbook.open_chains import PlanarTwoLink, SpringPendulum

STIFF = SpringPendulum(stiffness=1e8)
KP, KD = 100.0, 20.0  # 1/s², 1/s: of robots/planar_2r_tracking.yaml
MASS_ERROR = 0.1


def swing_scene() -> Scene:
    """The 2R arm let go with the upper link hanging and the elbow at 45 deg."""
    return load_scene("planar_2r_swing", {"events": turns("shoulder", "elbow")})


def spring_scene() -> Scene:
    """The spring pendulum."""
    return load_scene("spring_pendulum", {"events": turns("slide")})


def turns(*joints: str) -> list[dict[str, Any]]:
    """Events where a joint turns back, so that its extremes are known as exactly as the run itself."""
    return [{"name": f"{name} turns", "when": {"joint": name, "velocity": 0}} for name in joints]


def extremes(run: Trajectory) -> tuple[Array, Array]:
    """Least and greatest positions (nq,) at the start, the end and the events."""
    rows = np.array([run.position[0], *(event.position for event in run.events), run.position[-1]])
    return rows.min(0), rows.max(0)


def judge_swing(run: Trajectory) -> list[Figure]:
    """Known: end values and ranges to the digits printed, by an 8th-order integrator at rtol = atol = 1e-13 and a
    second method from the lecture's equations.
    """
    end = np.r_[run.position[-1], run.velocity[-1]] - (-1.6288964, 0.4774930, -1.4299024, 2.5688865)
    low, high = np.degrees(extremes(run))
    return [
        ended(run),
        Figure("end values", largest(end), 1e-7, "rad, rad/s"),
        Figure("lowest angles", largest(low - (-114.71306, -44.67125)), 6e-6, "deg"),
        Figure("highest angles", largest(high - (-65.22107, 45.0)), 6e-6, "deg"),
        Figure("energy drift", run.energy_drift(), 1e-10),
    ]


def judge_spring(run: Trajectory) -> list[Figure]:
    """Known: end values, and the range at every 20 ms, to the digits printed, by an 8th-order integrator at rtol =
    atol = 1e-13 and a second method from the lecture's equations; the turning points by SciPy's DOP853 and its events.
    """
    end = np.r_[run.position[-1], run.velocity[-1]] - (-0.32885524, 6.70749476, -0.6952644, -3.54642339)
    low, high = extremes(run)
    rows = run.joint("slide").position
    return [
        ended(run),
        Figure("end values", largest(end), 1e-7, "rad, m, 1/s"),
        Figure("range at every 20 ms", largest([rows.min() - 4.9215774, rows.max() - 7.97662165]), 1e-8, "m"),
        Figure("range between", largest([low[1] - 4.921419494723, high[1] - 7.976774573993]), 1e-9, "m"),
        Figure("energy drift", run.energy_drift(), 1e-10),
    ]


def judge_long_swing(run: Trajectory) -> list[Figure]:
    """Known: nothing takes energy out, so it stays."""
    return [ended(run), Figure("energy drift", run.energy_drift(), 1e-9)]


# ---- extreme masses


def mass_ratio(heavy: str, light: int) -> Problem:
    """The 2R arm with the mass and inertia of its link `light` (1 or 2) a million times less, so that `heavy` rules."""
    arm = PlanarTwoLink()
    arm = replace(arm, **{name: getattr(arm, name) * 1e-6 for name in (f"m{light}", f"i{light}")})

    def make() -> Scene:
        start = {"shoulder": -pi / 2, "elbow": pi / 4}
        return scene_of(urdf_texts.two_link(arm), {"gravity": [0.0, -arm.g, 0.0], "initial": start})

    def judge(run: Trajectory) -> list[Figure]:
        """Known: the analytic equations, integrated by SciPy's DOP853."""
        reference = analytic(arm.derivative, run)
        return [
            ended(run),
            Figure("largest difference", largest(run.position - reference[:, :2]), 1e-7, "rad"),
            Figure("accelerations", accelerations(run, arm.derivative), 1e-9, "relative"),
            Figure("energy drift", run.energy_drift(), 1e-9),
        ]

    return Problem(
        f"mass_ratio_{heavy}", f"2R arm with its {heavy} link 1e6 times as heavy as the other, 10 s", make, judge,
        {"duration": 10.0, "rtol": 1e-12, "atol": 1e-12},
    )  # fmt: skip


def analytic(derivative: Callable[[Array], Array], run: Trajectory) -> Array:
    """States (n, 4) of analytic equations at the run's times, from its start, by SciPy's DOP853."""
    from scipy.integrate import solve_ivp

    x0, span = np.r_[run.position[0], run.velocity[0]], (0.0, float(run.time[-1]))
    found = solve_ivp(lambda _, x: derivative(x), span, x0, "DOP853", run.time, rtol=1e-13, atol=1e-14)
    return np.asarray(found.y.T)


def accelerations(run: Trajectory, derivative: Callable[[Array], Array]) -> float:
    """The largest difference of the run's accelerations from analytic ones, each as a share of the joint's largest."""
    expected = derivative(np.hstack([run.position, run.velocity]))[:, 2:]
    return largest((run.acceleration - expected) / np.abs(expected).max(0))


# ---- stiff spring


def stiff_scene() -> Scene:
    """The spring pendulum with a spring of 1e8 N/m, let go where the spring just carries the weight."""
    length = STIFF.free_length + STIFF.mass * STIFF.g * cos(pi / 4) / STIFF.stiffness
    start = {"swing": pi / 4, "slide": length}
    return load_scene("spring_pendulum", {"forces.spring.stiffness": STIFF.stiffness, "initial": start})


def judge_stiff(run: Trajectory) -> list[Figure]:
    """Known: on its slow motion the spring carries the load, r = l + ε (g cos θ + l θ̇²) + O(ε²) with ε = m/k = 2e-8,
    which leaves an equation for θ alone that is not stiff (singular perturbation); SciPy's DOP853 integrates it.

    The spring's own period is 0.9 ms, and its motion is not excited: DOP853 at the same tolerances follows it for
    stability alone.
    """
    from scipy.integrate import solve_ivp

    p, thin = STIFF, STIFF.mass / STIFF.stiffness

    def slow_rate(_: float, x: Array) -> list[float]:
        angle, rate = x
        r = p.free_length + thin * (p.g * np.cos(angle) + p.free_length * rate**2)
        speed = -3.0 * thin * p.g * np.sin(angle) * rate  # dr/dt with θ̈ = -(g/l) sin θ
        return [rate, -(2 * speed * rate + p.g * np.sin(angle)) / r]

    angle, rate = solve_ivp(slow_rate, (0.0, 10.0), [pi / 4, 0.0], "DOP853", run.time, rtol=1e-13, atol=1e-14).y
    reference = np.stack([angle, p.free_length + thin * (p.g * np.cos(angle) + p.free_length * rate**2)], -1)
    explicit = simulate(run.scene, **(STIFF_SETTINGS | {"solver": "DOP853"}))
    cost, more = run.statistics, explicit.statistics.evaluations
    return [
        ended(run),
        Figure("error of Radau", largest(run.position - reference), 5e-5, "rad, m"),
        Figure("error of DOP853", largest(explicit.position - reference), 5e-5, "rad, m"),
        Figure("evaluations, DOP853 / Radau", more / cost.evaluations, 20.0, "times", at_least=True),
        Figure(
            "the same, a Jacobian as 4", more / (cost.evaluations + 4 * cost.jacobians), 20.0, "times", at_least=True
        ),
    ]


STIFF_SETTINGS: Final[dict[str, Any]] = {"duration": 10.0, "solver": "Radau", "rtol": 1e-6, "atol": 1e-6}


# ---- tracking


def tracking_scene(mass_error: float) -> Scene:
    """The 2R arm round the lecture's circle under computed torque, whose model is wrong by `mass_error`."""
    return load_scene("planar_2r_tracking", {"mass_error": mass_error})


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
    """Known: with links (1 + ε) times as heavy in the model, M a + h = (1 + ε)(M (a_d - kd ė - kp e) + h), e being the
    position less the wanted one, so ë + (1 + ε)(kd ė + kp e) = ε (a_d + M⁻¹ h): the closed forms of circle and arm,
    integrated by SciPy.
    """
    from scipy.integrate import solve_ivp

    arm, rate, zero = PlanarTwoLink(), 2 * pi / 10.0, np.zeros(2)

    def error_rate(t: float, x: Array) -> Array:
        q, v, a = arm.circle(np.array(rate * t), rate, -1)
        e, de = x[:2], x[2:]
        drift = -arm.forward_dynamics(q + e, v + de, zero)  # M⁻¹ h at the arm's own state
        return np.hstack([de, MASS_ERROR * (a + drift) - (1 + MASS_ERROR) * (KD * de + KP * e)])

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
        FINE | {"duration": 20.0},
    ),
    Problem(
        "planar_2r_1000_s", "planar 2R arm, free swing of 1,000 s", swing_scene, judge_long_swing,
        FINE | {"duration": 1000.0},
    ),
    mass_ratio("outer", light=1),
    mass_ratio("inner", light=2),
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
