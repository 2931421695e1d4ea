"""Reference problem: a cart on two wheels of one axle that turns steadily."""

from __future__ import annotations

import numpy as np

from bellcrank.scene.scene import load_scene
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank_bench.problems.checks import Check, finished, largest
from bellcrank_bench.problems.problem import Benchmark, Problem
from bellcrank_bench.textbook.two_wheeler import SteadyTurn

TURN = SteadyTurn()
MASS = 7.0  # kg


def judge(run: Trajectory) -> list[Check]:
    """Known: both wheels keep their speeds and the cart its circle of radius b; the floor's force along the axle is
    m v²/b in all. The rows of the two wheels repeat each other, so the minimum-norm multipliers are half of it each.
    """
    x, y, _ = run.output("cart").T
    angle, radius = TURN.rate * run.time, TURN.speed / TURN.rate
    force = np.stack([run.constraint(name).multipliers[:, 2] for name in ("left_floor", "right_floor")], -1)
    return [
        finished(run),
        Check("position", largest([x - radius * np.sin(angle), y + radius * np.cos(angle)]), 1e-6, "m"),
        Check("force along the axle", largest(force.sum(1) - MASS * TURN.speed**2 / radius), 1e-5, "N"),
        Check("difference between the wheels", largest(force[:, 0] - force[:, 1]), 1e-4, "N"),
        Check("position residual", run.constraint_residual(), 1e-12, "m"),
        Check("slip", run.velocity_residual(), 1e-10, "m/s"),
        Check("energy drift", run.energy_drift(), 1e-6),
    ]


PROBLEMS = (
    Problem(
        name="two_wheeler",
        title="cart on two wheels of one axle, 10 s",
        source="closed form",
        make=lambda: load_scene("two_wheeler"),
        judge=judge,
        settings={"duration": 10.0, "rtol": 1e-11, "atol": 1e-11},
        benchmark=Benchmark(
            scene="two_wheeler",
            equations=TURN,
            joints=("root_joint",),
            start=(0.0, -2.2, 0.0),
            duration=10.0,
            unit="m",
            count=3,
            compared_count=3,
            compared=TURN.place,
            output="cart",
            constrained=True,
            c_baseline=False,
            reference_steps=(1, 2),
            remarks=("C baseline, MuJoCo, Drake, Exudyn: not set up, as its steady turn is known in closed form",),
        ),
    ),
)
