"""Reference problems of the planar 2R arm: free swings, extreme mass ratios, tracking, a fall from upright.

Source: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import degrees, pi

import numpy as np

from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank_bench.problems import urdf_texts
from bellcrank_bench.problems.checks import Array, Check, extremes, finished, largest, turning_points
from bellcrank_bench.problems.problem import LECTURE, Benchmark, Problem, scene_of
from bellcrank_bench.textbook.integrate import integrate
from bellcrank_bench.textbook.planar_2r import PlanarTwoLink

G = 9.81  # m/s²
FINE = {"rtol": 1e-12, "atol": 1e-12}
SWING_END = (-1.6288964, 0.4774930, -1.4299024, 2.5688865)  # position (rad) and velocity (rad/s) after 10 s
PERIOD = 10.0  # s, once round the circle that is tracked
KP, KD = 100.0, 20.0  # 1/s², 1/s: of the bundled scene planar_2r_tracking
MASS_ERROR = 0.1  # relative, of the controller's model
LEAN = 1e-9  # rad from upright, of the fall
HALF_PI_ROUNDING = 6.123233995736766e-17  # rad: π/2 minus the double nearest to it


# ---- free swing


def swing_scene() -> Scene:
    """The arm released at rest with the upper link vertical and the elbow at 45 deg."""
    return load_scene("planar_2r_swing", {"events": turning_points("shoulder", "elbow")})


def judge_swing(run: Trajectory) -> list[Check]:
    """Known: end values and ranges to the digits printed, by an integrator of order 8 at rtol = atol = 1e-13 and by a
    second method, both on the lecture's equations.
    """
    low, high = np.degrees(extremes(run))
    return [
        finished(run),
        Check("end values", largest(np.r_[run.position[-1], run.velocity[-1]] - SWING_END), 1e-7, "rad, rad/s"),
        Check("lowest angles", largest(low - (-114.71306, -44.67125)), 6e-6, "deg"),
        Check("highest angles", largest(high - (-65.22107, 45.0)), 6e-6, "deg"),
        Check("energy drift", run.energy_drift(), 1e-10),
    ]


def judge_long_swing(run: Trajectory) -> list[Check]:
    """Known: the energy is conserved."""
    return [finished(run), Check("energy drift", run.energy_drift(), 1e-9)]


# ---- extreme mass ratios


def mass_ratio_problem(heavy: str, light: int) -> Problem:
    """The arm with the mass and inertia of link number `light` divided by a million; `heavy` names the other."""
    arm = PlanarTwoLink()
    arm = replace(arm, **{name: getattr(arm, name) * 1e-6 for name in (f"m{light}", f"i{light}")})

    def make() -> Scene:
        start = {"shoulder": -pi / 2, "elbow": pi / 4}
        return scene_of(urdf_texts.two_link(arm), {"gravity": [0.0, -arm.g, 0.0], "initial": start})

    def judge(run: Trajectory) -> list[Check]:
        """Known: the analytic equations, integrated by SciPy's DOP853."""
        expected = integrate(arm.derivative, np.r_[run.position[0], run.velocity[0]], run.time)
        return [
            finished(run),
            Check("largest difference", largest(run.position - expected[:, :2]), 1e-7, "rad"),
            Check("accelerations", acceleration_error(run, arm.derivative), 1e-9, "relative"),
            Check("energy drift", run.energy_drift(), 1e-9),
        ]

    return Problem(
        name=f"mass_ratio_{heavy}",
        title=f"2R arm with its {heavy} link 1e6 times as heavy as the other, 10 s",
        source=LECTURE,
        make=make,
        judge=judge,
        settings=FINE | {"duration": 10.0},
    )


def acceleration_error(run: Trajectory, derivative: Callable[[Array], Array]) -> float:
    """The largest difference of the run's accelerations from analytic ones, relative to each joint's largest one."""
    expected = derivative(np.hstack([run.position, run.velocity]))[:, 2:]
    return largest((run.acceleration - expected) / np.abs(expected).max(0))


# ---- tracking


def tracking_scene(mass_error: float) -> Scene:
    """The arm on the lecture's circle under computed torque, whose model has this relative error of the masses."""
    return load_scene("planar_2r_tracking", {"mass_error": mass_error})


def judge_tracking(run: Trajectory) -> list[Check]:
    """Known: with an exact model the tracking error stays 0, so the tip stays on the circle, φ uniform."""
    phi = 2 * pi * run.time / PERIOD
    circle = np.stack([1.2 + 0.2 * np.cos(phi), 1.2 + 0.2 * np.sin(phi), 0 * phi], -1)
    return [
        finished(run),
        Check("tip off the circle", largest(run.output("tip") - circle), 1e-8, "m"),
        Check("energy drift", run.energy_drift(), 1e-9),
    ]


def judge_tracking_with_mass_error(run: Trajectory) -> list[Check]:
    """Known: the differential equation of the tracking error, integrated by SciPy's DOP853.

    With links (1 + ε) times as heavy in the model, M a + h = (1 + ε)(M (a_d - kd ė - kp e) + h), where e is the
    position minus its reference, so ë + (1 + ε)(kd ė + kp e) = ε (a_d + M⁻¹ h), in the closed forms of circle and arm.
    """
    from scipy.integrate import solve_ivp

    arm, rate, zero = PlanarTwoLink(), 2 * pi / PERIOD, np.zeros(2)

    def error_rate(t: float, x: Array) -> Array:
        q, v, a = arm.circle(np.array(rate * t), rate, -1)
        e, de = x[:2], x[2:]
        drift = -arm.forward_dynamics(q + e, v + de, zero)  # M⁻¹ h at the arm's own state
        return np.hstack([de, MASS_ERROR * (a + drift) - (1 + MASS_ERROR) * (KD * de + KP * e)])

    expected = solve_ivp(
        error_rate, (0.0, PERIOD), np.zeros(4), method="DOP853", rtol=1e-10, atol=1e-12, t_eval=run.time
    ).y[:2].T  # fmt: skip
    wanted, _, _ = arm.circle(rate * run.time, rate, -1)
    error = run.position - wanted
    return [
        finished(run),
        Check("tracking error against its equation", largest(error - expected), 1e-8, "rad"),
        Check("largest tracking error", degrees(largest(error[len(error) // 2 :])), 0.5, "deg", at_least=True),
    ]


# ---- fall from upright


def upright_scene() -> Scene:
    """The arm stretched upwards, 1e-9 rad from upright, until its elbow has folded to -90 deg."""
    folded = {"name": "folded", "when": {"joint": "elbow", "position": -pi / 2}, "stop": True}
    data = {"urdf": "planar_2r", "gravity": [0.0, -G, 0.0], "initial": {"shoulder": pi / 2 + LEAN}, "events": [folded]}
    return scene_of(None, data)


def judge_fall(run: Trajectory) -> list[Check]:
    """Known: the lecture's equations with δ = θ1 - π/2 as the first angle, which resolve a deviation of 1e-9 rad with
    all digits, integrated by SciPy's DOP853 at rtol = 3e-14, atol = 1e-24 (its RK45 and Radau agree to 1e-9 s).
    """
    return [finished(run), Check("time of the fall", abs(run.time[-1] - fall_time("DOP853", 3e-14)), 1e-6, "s")]


def fall_time(method: str, rtol: float) -> float:
    """The time, s, at which the elbow passes -π/2, by a method of SciPy in coordinates that are 0 upright."""
    from scipy.integrate import solve_ivp

    arm = PlanarTwoLink()
    inner, outer = (arm.m2 * arm.l1 + arm.m1 * arm.r1) * arm.g, arm.m2 * arm.g * arm.r2
    weightless = PlanarTwoLink(g=0.0)  # mass matrix and Coriolis terms do not depend on the first angle

    def rate(_: float, x: np.ndarray) -> np.ndarray:
        deviation = x[:2]
        second = outer * np.sin(deviation.sum())
        gravity = -np.array([inner * np.sin(x[0]) + second, second])  # cos(π/2 + δ) = -sin δ
        return np.hstack([x[2:], weightless.forward_dynamics(deviation, x[2:], -gravity)])

    def folded(_: float, x: np.ndarray) -> float:
        return float(x[1] + pi / 2)

    folded.terminal = True  # type: ignore[attr-defined]
    start = (pi / 2 + LEAN) - pi / 2 - HALF_PI_ROUNDING  # of the double at which the scene starts
    found = solve_ivp(rate, (0.0, 20.0), [start, 0, 0, 0], method, rtol=rtol, atol=1e-24, events=folded)
    return float(found.t_events[0][0])


PROBLEMS = (
    Problem(
        name="planar_2r_swing",
        title="planar 2R arm, free swing of 10 s",
        source=LECTURE,
        make=swing_scene,
        judge=judge_swing,
        settings=FINE | {"duration": 10.0},
        benchmark=Benchmark(
            scene="planar_2r_swing",
            equations=PlanarTwoLink(),
            joints=("shoulder", "elbow"),
            start=(-pi / 2, pi / 4, 0.0, 0.0),
            duration=10.0,
            unit="rad",
            known_end=SWING_END,
            count=2,
            compared_count=2,
        ),
    ),
    Problem(
        name="planar_2r_1000_s",
        title="planar 2R arm, free swing of 1,000 s",
        source="conservation of energy",
        make=swing_scene,
        judge=judge_long_swing,
        settings=FINE | {"duration": 1000.0},
    ),
    mass_ratio_problem("outer", light=1),
    mass_ratio_problem("inner", light=2),
    Problem(
        name="tracking",
        title="2R arm on the lecture's circle, computed torque with an exact model",
        source=LECTURE,
        make=lambda: tracking_scene(0.0),
        judge=judge_tracking,
        settings={"duration": PERIOD, "rtol": 1e-11, "atol": 1e-11},
    ),
    Problem(
        name="tracking_mass_error",
        title="2R arm on the lecture's circle, computed torque with a model 10 % too heavy",
        source=LECTURE,
        make=lambda: tracking_scene(MASS_ERROR),
        judge=judge_tracking_with_mass_error,
        settings={"duration": PERIOD, "rtol": 1e-11, "atol": 1e-11},
    ),
    # The deviation from upright is what matters, but the tolerance applies to the shoulder's angle near π/2, whose
    # resolution is 2e-16 rad. The velocities, which start from 0, carry the error there: the absolute tolerance must be
    # small beside them, and yet not ask for digits that the position does not have. With rtol = 1e-12, atol from 1e-15
    # to 1e-17 serves; at atol = 1e-12 the time of the fall is off by 3e-4 s.
    Problem(
        name="upright_2r",
        title="2R arm 1e-9 rad from upright, until its elbow has folded",
        source=LECTURE,
        make=upright_scene,
        judge=judge_fall,
        settings={"duration": 20.0, "rtol": 1e-12, "atol": 1e-16},
    ),
)
