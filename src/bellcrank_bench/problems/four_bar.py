"""Reference problems of the four-bar linkage: the time of its lock, from several starts, and its swing without a stop.

Source: A. Ghosal, Dynamics and Control of Mechanical Systems, NPTEL 2022, lecture 18.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import radians
from typing import Any, Final

import numpy as np

from bellcrank.scene.scene import Scene, load_scene
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank_bench.problems.checks import Check, constraints_satisfied, finished, largest
from bellcrank_bench.problems.problem import LECTURE, Benchmark, Problem
from bellcrank_bench.textbook.four_bar import FourBarWithMultipliers, ReducedFourBar
from bellcrank_bench.textbook.integrate import integrate

LOCK_ANGLE = 150.462301525  # deg, of the crank: 2 asin((l2 + l3)/(2 l1))
LOCK_FORCE = (1500.133, -380.510)  # N, in the joint between coupler and rocker, from a start at 1 deg
LOCK_FORCE_MAGNITUDE = 1547.6395  # N
LOCK_ENERGY = 4.7680791696  # J, work of the spring from 1 deg to the lock: 1.96 (θ − θ0) − 0.05 (θ² − θ0²)
TOLERANCES: Final = {"rtol": 1e-12, "atol": 1e-12}
REDUCED = ReducedFourBar()


@dataclass(frozen=True)
class Lock:
    """A start of the four-bar and the known time of its lock.

    Attributes:
        crank: Initial angle of the crank, as a scene takes it.
        time: Time of the lock, s.
        tolerance: How closely a run must meet it, s.
        overrides: Other changes of the scene.
    """

    crank: str | float
    time: float
    tolerance: float = 1e-7
    overrides: Mapping[str, Any] = field(default_factory=dict)


LOCKS = {
    "four_bar": Lock("1 deg", 12.267788975800),
    "four_bar_half_a_degree": Lock("0.5 deg", 12.285590752040),
    "four_bar_a_degree_and_a_half": Lock("1.4985536871 deg", 12.250),
    "four_bar_folded_back": Lock(
        "1 deg", 10.702473965165,
        overrides={"initial.coupler": {"guess": "180 deg"}, "initial.rocker": {"guess": "180 deg"}},
    ),
    "four_bar_1e-3_rad": Lock(1e-3, 12.3013203095),
    "four_bar_1e-6_rad": Lock(1e-6, 12.303351822, tolerance=1e-5),  # the constraint Jacobian loses rank at 0 rad
}  # fmt: skip
BENCHMARK = Benchmark(  # to 12 s: it locks at 12.268 s
    scene="four_bar",
    equations=REDUCED,
    joints=("crank", "coupler", "rocker"),
    start=(radians(1.0), 0.0),
    duration=12.0,
    unit="rad",
    count=3,
    compared_count=3,
    unreduced=REDUCED.angles,
    constrained=True,
    reference_steps=(1, 2),
)


def lock_problem(name: str) -> Problem:
    """The four-bar that opens until coupler and rocker line up, from one of the starts of LOCKS."""
    lock = LOCKS[name]

    def make() -> Scene:
        return load_scene("four_bar", {"initial.crank": lock.crank, **lock.overrides})

    def judge(run: Trajectory) -> list[Check]:
        """Known: the angle in closed form; the time by an integrator of order 8 at rtol = atol = 1e-13 and by a second
        method, both on the lecture's equations.
        """
        event = next((event for event in run.events if event.name == "lock"), None)
        angle, time = (np.nan, np.nan) if event is None else (np.degrees(event.position[0]), event.time)
        checks = [
            Check("lock angle", abs(angle - LOCK_ANGLE), 1e-6, "deg"),
            Check("lock time", abs(time - lock.time), lock.tolerance, "s"),
            *constraints_satisfied(run),
            Check("energy drift", run.energy_drift(), 1e-10),
        ]
        if lock.crank == "1 deg":
            force = run.multipliers[-1]
            magnitude = float(np.linalg.norm(force))
            checks += [
                Check("force at the lock", largest(force - LOCK_FORCE), 5e-4, "N"),
                Check("its magnitude", abs(magnitude / LOCK_FORCE_MAGNITUDE - 1), 1e-6, "relative"),
                Check("energy at the lock", abs(run.kinetic_energy[-1] - LOCK_ENERGY), 1e-9, "J"),
            ]
        return checks

    return Problem(
        name=name,
        title=f"four-bar to its lock, from {lock.crank if isinstance(lock.crank, str) else f'{lock.crank:g} rad'}",
        source=LECTURE,
        make=make,
        judge=judge,
        settings=TOLERANCES | {"duration": 20.0, "times": "steps"},
        benchmark=BENCHMARK if name == "four_bar" else None,
    )


def swing_scene() -> Scene:
    """The four-bar without a stop."""
    return load_scene("four_bar", {"events": []})


def judge_swing(run: Trajectory) -> list[Check]:
    """Known: the lecture's equations with multipliers, integrated by DOP853; after the lock the crank reverses."""
    equations = FourBarWithMultipliers()
    x = integrate(equations.derivative, np.r_[run.position[0], run.velocity[0]], run.time)
    acceleration, force = equations.accelerations(x[:, :3], x[:, 3:])
    return [
        finished(run),
        Check("angles", largest(run.position - x[:, :3]), 1e-8, "rad"),
        Check("accelerations", largest(run.acceleration - acceleration) / largest(acceleration), 1e-7, "relative"),
        Check("forces", largest(run.multipliers - force) / largest(force), 1e-7, "relative"),
        Check("the crank reverses", float(run.velocity[-1, 0]), -0.1, "rad/s"),
        *constraints_satisfied(run),
    ]


PROBLEMS = (
    *(lock_problem(name) for name in LOCKS),
    Problem(
        name="four_bar_swings_through",
        title="four-bar without a stop, 14 s",
        source=LECTURE,
        make=swing_scene,
        judge=judge_swing,
        settings=TOLERANCES | {"duration": 14.0},
    ),
)
