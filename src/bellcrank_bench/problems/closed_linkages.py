"""Closed linkages with known answers: the lecture's four-bar, the N four-bar and Bricard mechanisms, a five-bar robot.

Sources: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18; IFToMM library of computational
benchmark problems, A01, A02 and A04, for the mechanisms.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.system import system_of
from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory import Trajectory
from bellcrank_bench.problems.linkages import n_four_bar
from bellcrank_bench.problems.problem import Figure, Problem, ended, largest
from bellcrank_bench.textbook.closed_linkages import ClosedFourBar, ParallelCranks, solve_along

FINE: Final = {"rtol": 1e-12, "atol": 1e-12}
LOCK_ANGLE = 150.462301525  # deg: 2 asin((l2 + l3)/(2 l1))
LOCK_FORCE = (1500.133, -380.510)  # N, from 1 deg; 1547.64 N in all
WORK_OF_THE_SPRING = 4.7680791696  # J from 1 deg to the lock: 1.96 (θ − θ0) − 0.05 (θ² − θ0²)
FOLDED_BACK = {"initial.coupler": {"guess": "180 deg"}, "initial.rocker": {"guess": "180 deg"}}
LOCKS = {  # name: (crank's start, other changes, lock time in s, its bar)
    "four_bar": ("1 deg", {}, 12.267788975800, 1e-7),
    "four_bar_half_a_degree": ("0.5 deg", {}, 12.285590752040, 1e-7),
    "four_bar_a_degree_and_a_half": ("1.4985536871 deg", {}, 12.250, 1e-7),
    "four_bar_folded_back": ("1 deg", FOLDED_BACK, 10.702473965165, 1e-7),
    "four_bar_1e-3_rad": (1e-3, {}, 12.3013203095, 1e-7),
    "four_bar_1e-6_rad": (1e-6, {}, 12.303351822, 1e-5),  # at 0 rad J loses rank
}
PENDULUM = {  # closed form in Jacobi's elliptic functions, 40 digits: t: (x, y)
    0.5: (-0.391048791550546388, -0.920369948785192204), 1.0: (0.986291751131875319, -0.165010853125541169),
    3.0: (0.176651789922838189, -0.984273409737892617), 5.0: (-0.942305435043757335, -0.334754338414000581),
    7.0: (-0.998618779175479798, -0.0525407829982987163),
}  # fmt: skip
BRICARD = {  # P3, m: null-space reduction of the tree, DOP853 at rtol 1e-12, projected every 10 ms; t: (x, y, z)
    0.5: (0.968283679107, -1.22462515944, 0.750146609438), 1.0: (0.510501461187, -1.64916759939, 0.140123114553),
    2.0: (-0.969340344778, -1.22124689496, 0.75427801078), 3.0: (-0.967199800049, -1.22802021467, 0.745983176176),
    4.0: (0.524899593391, -1.64387600134, 0.148835846116), 5.0: (0.9999999977, -1.000067258, 0.99993274),
}  # fmt: skip


def kept(run: Trajectory) -> list[Figure]:
    """How well constraints are kept at every row of the run."""
    return [
        Figure("closures", run.constraint_residual(), 1e-12, "m or rad"),
        Figure("closing speeds", run.velocity_residual(), 1e-12, "m/s or rad/s"),
    ]


# ---- the four-bar


def lock(name: str) -> Problem:
    """The four-bar that opens until coupler and rocker line up, from one of the starts of LOCKS."""
    start, changes, time, bar = LOCKS[name]

    def make() -> Scene:
        return load_scene("four_bar", {"initial.crank": start, **changes})

    def judge(run: Trajectory) -> list[Figure]:
        """Known: the lock's angle in closed form; its time by an 8th-order integrator at rtol = atol = 1e-13 and a
        second method on the lecture's equations.
        """
        event = next((event for event in run.events if event.name == "lock"), None)
        angle, when = (np.nan, np.nan) if event is None else (np.degrees(event.position[0]), event.time)
        figures = [
            Figure("lock angle", abs(angle - LOCK_ANGLE), 1e-6, "deg"),
            Figure("lock time", abs(when - time), bar, "s"),
            *kept(run),
            Figure("energy drift", run.energy_drift(), 1e-10),
        ]
        if start == "1 deg":
            force = run.multipliers[-1] - LOCK_FORCE
            figures += [
                Figure("force at the lock", largest(force), 5e-4, "N"),
                Figure("its size", abs(float(np.linalg.norm(run.multipliers[-1])) / 1547.6395 - 1), 1e-6, "relative"),
                Figure("energy at the lock", abs(run.kinetic_energy[-1] - WORK_OF_THE_SPRING), 1e-9, "J"),
            ]
        return figures

    title = f"four-bar to its lock, from {start if isinstance(start, str) else f'{start:g} rad'}"
    return Problem(name, title, make, judge, FINE | {"duration": 20.0, "times": "steps"})


def swinging_four_bar() -> Scene:
    """The four-bar without a stop."""
    return load_scene("four_bar", {"events": []})


def judge_swinging(run: Trajectory) -> list[Figure]:
    """Known: the lecture's equations with multipliers (textbook_closed.py), integrated by SciPy's DOP853; past the lock
    the crank turns back.
    """
    book = ClosedFourBar()
    x = solve_along(book.derivative, np.r_[run.position[0], run.velocity[0]], run.time)
    acceleration, force = book.accelerations(x[:, :3], x[:, 3:])
    return [
        ended(run),
        Figure("angles", largest(run.position - x[:, :3]), 1e-8, "rad"),
        Figure("accelerations", largest(run.acceleration - acceleration) / largest(acceleration), 1e-7, "relative"),
        Figure("forces", largest(run.multipliers - force) / largest(force), 1e-7, "relative"),
        Figure("the crank turns back", float(run.velocity[-1, 0]), -0.1, "rad/s"),
        *kept(run),
    ]


# ---- the N four-bar


def judge_n_four_bar(run: Trajectory) -> list[Figure]:
    """Known: one degree of freedom on the parallel branch (textbook_closed.ParallelCranks), integrated by SciPy's
    DOP853. Whenever the links lie flat J loses rank N, and the motion goes through. The library's limit is 1e-3 m.
    """
    loops, top = len(run.scene.constraints), _parallel_top(run)
    flat = np.count_nonzero(np.diff(np.sign(top[:, 1])))
    cranks = [run.robot.joint(f"crank_{k}").q for k in range(loops + 1)]
    apart = run.position[:, cranks] - run.position[:, cranks[:1]]
    return [
        ended(run),
        Figure("times flat", float(flat), 10.0, at_least=True),
        Figure("B0", largest(run.output("B0") - top), 1e-6, "m"),
        Figure("cranks apart", largest(apart), 1e-6, "rad"),
        Figure("energy drift", run.energy_drift(), 1e-7),
        Figure("closures", run.constraint_residual(), 1e-12, "m"),
    ]


def loops_at_speed(counts: tuple[int, ...] = (5, 10, 20, 40, 80)) -> list[Figure]:
    """Seconds of stepping a loop and evaluation, against the fewest loops, over 1.1 s, which lie flat once: flat where
    cost is proportional to N. Then for each N the whole 20 s at 1e-8, kernel and all of simulate(), and the error of
    B0 at 400 times. The best of 5 runs taken in turns, of whole ones of 2.
    """
    scenes = {n: n_four_bar(n) for n in counts}
    best = dict.fromkeys(counts, float("inf"))
    for _ in range(5):
        for n, scene in scenes.items():
            cost = simulate(scene, duration=1.1, rtol=1e-9, atol=1e-9).statistics
            best[n] = min(best[n], cost.kernel_time / cost.evaluations / n)
    figures = [
        Figure(f"{n} loops, {best[n] * 1e9:.1f} ns", best[n] / best[counts[0]], 2.0, "times") for n in counts[1:]
    ]
    return figures + [figure for n, scene in scenes.items() for figure in _whole_run(n, scene)]


def _whole_run(loops: int, scene: Scene) -> list[Figure]:
    settings: dict[str, Any] = {"duration": 20.0, "rtol": 1e-8, "atol": 1e-8, "times": np.linspace(0.0, 20.0, 401)}
    kernel = whole = float("inf")
    for _ in range(2):
        begun = time.perf_counter()
        run = simulate(scene, **settings)
        whole = min(whole, time.perf_counter() - begun)
        kernel = min(kernel, run.statistics.kernel_time)
    each, unbounded = f"{loops} loops, 20 s", float("inf")
    lean = run.position[:, run.robot.joint("crank_0").q]  # B0 of it: the outputs need not be compiled
    top = np.stack([-np.sin(lean), np.cos(lean), 0 * lean], -1)
    return [
        Figure(f"{each}: kernel, {run.statistics.evaluations} evaluations", kernel * 1e3, unbounded, "ms"),
        Figure(f"{each}: all of simulate()", whole * 1e3, unbounded, "ms"),
        Figure(f"{each}: B0", largest(top - _parallel_top(run)), 1e-3, "m"),
    ]


def _parallel_top(run: Trajectory) -> NDArray[np.float64]:
    """B0 at the run's times, (n, 3), m, on the parallel branch (textbook_closed.ParallelCranks)."""
    cranks = ParallelCranks(len(run.scene.constraints))
    angle, _ = solve_along(cranks.derivative, np.array([np.pi / 2, -1.0]), run.time).T
    return np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)


# ---- A01, A04, the five-bar robot


def judge_pendulum(run: Trajectory) -> list[Figure]:
    """Known: the closed form in Jacobi's elliptic functions."""
    return [
        ended(run),
        Figure("P1", largest(run.output("P1")[:, :2] - list(PENDULUM.values())), 1e-9, "m"),
        Figure("energy drift", run.energy_drift(), 1e-10),
    ]


def judge_bricard(run: Trajectory) -> list[Figure]:
    """Known: P3 by a null-space reduction; one row of the constraint repeats the others all the time."""
    return [
        ended(run),
        Figure("P3", largest(run.output("P3") - list(BRICARD.values())), 1e-6, "m"),
        Figure("smallest singular value", _dependence(run), 1e-9, "of the largest"),
        *kept(run),
        Figure("energy drift", run.energy_drift(), 1e-9),
    ]


def _dependence(run: Trajectory) -> float:
    """The largest share, over the rows of the run, that the least singular value of J is of the greatest."""
    system, shares = system_of(run.scene), []
    for t, x, u in zip(run.time, run.state, run.inputs, strict=True):
        jacobian = system.linearised_constraints(np.array([t]), x, u, run.parameters)[2]
        values = np.linalg.svd(jacobian, compute_uv=False)
        shares.append(values[-1] / values[0])
    return float(max(shares))


def judge_five_bar(run: Trajectory) -> list[Figure]:
    """Known: energy is what motors and bearings put in; at rest in the end, the motors' torques balance the weight in
    every motion that the constraint allows.
    """
    system = system_of(run.scene)
    jacobian = system.linearised_constraints(run.time[-1:], run.state[-1], run.inputs[-1], run.parameters)[2]
    free = np.linalg.svd(jacobian)[2][2:]
    weight = run.robot.inverse_dynamics(run.position[-1], np.zeros(system.nv), np.zeros(system.nv))
    return [
        ended(run),
        Figure("speed in the end", largest(run.velocity[-1]), 1e-4, "rad/s"),
        Figure("torques less weight", largest(free @ (run.torque[-1] - weight)), 1e-4, "N m"),
        Figure("energy drift", run.energy_drift(), 1e-8),
        *kept(run),
    ]


def _settings(times: Mapping[float, Any]) -> dict[str, Any]:
    return FINE | {"duration": 10.0, "times": list(times)}


def _bundled(loops: int, duration: float) -> Problem:
    name = f"n_four_bar_{loops}"
    settings = {"duration": duration, "rtol": 1e-10, "atol": 1e-10, "samples": 401}
    return Problem(
        name, f"N four-bar, N = {loops}, {duration:g} s", lambda: load_scene(name), judge_n_four_bar, settings
    )


PROBLEMS = (
    *(lock(name) for name in LOCKS),
    Problem(
        "four_bar_swings_through", "four-bar without a stop, 14 s", swinging_four_bar, judge_swinging,
        FINE | {"duration": 14.0},
    ),
    _bundled(2, 10.0),
    _bundled(40, 20.0),
    Problem("pendulum", "simple pendulum, A01", lambda: load_scene("pendulum"), judge_pendulum, _settings(PENDULUM)),
    Problem("bricard", "Bricard mechanism, A04", lambda: load_scene("bricard"), judge_bricard, _settings(BRICARD)),
    Problem(
        "five_bar", "five-bar robot under PD control, 3 s", lambda: load_scene("five_bar"), judge_five_bar,
        {"duration": 3.0, "rtol": 1e-10, "atol": 1e-10},
    ),
)  # fmt: skip
