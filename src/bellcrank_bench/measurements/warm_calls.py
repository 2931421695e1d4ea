"""What calls cost beside what they compute: warm `simulate()`, single inverse dynamics, and the start of a process."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bellcrank.robot.load import load_robot
from bellcrank.scene.scene import load_scene
from bellcrank.simulation.simulate import simulate
from bellcrank.simulation.trajectory.trajectory import Trajectory
from bellcrank_bench.measurements.dynamics_speed import random_states
from bellcrank_bench.measurements.ensemble_row import Duration, EnsembleRow, best_in_turns, clocked
from bellcrank_bench.measurements.machine import seconds_in_new_processes

Array = NDArray[np.float64]
SAMPLES = 500  # single calls, each with another state
RUNS = 40  # of simulate() a turn
PROCESSES = 3


def simulate_rows(name: str, repeats: int) -> list[EnsembleRow]:
    """The stepping time of a warm `simulate()` of a loaded scene, and what the whole call takes longer."""
    scene = load_scene(name)
    stepping, beside = [], []

    def turn() -> Duration:
        for _ in range(RUNS):
            made: list[Trajectory] = []
            whole = clocked(lambda made=made: made.append(simulate(scene)))  # type: ignore[misc]
            stepping.append(made[0].statistics.kernel_time)
            beside.append(whole.seconds - stepping[-1])
        return Duration()

    best_in_turns([turn], repeats)
    base, beyond = (Duration(least, least) for least in (min(stepping), min(beside)))
    return [
        EnsembleRow(subject=name, tool="simulate(), stepping", time=base, base=base),
        EnsembleRow(subject=name, tool="simulate(), beside stepping", time=beyond, base=base,
                    note="least of the whole call less its stepping"),
    ]  # fmt: skip


def inverse_dynamics_rows(name: str, repeats: int) -> list[EnsembleRow]:
    """Inverse dynamics of one sample a call, next to Pinocchio's Python binding on its own model."""
    import pinocchio as pin

    robot = load_robot(name, friction="none")
    states = list(zip(*random_states(robot, SAMPLES), strict=True))
    model, data = robot.model, robot.model.createData()
    error = max(_relative_difference(robot.inverse_dynamics(*each), pin.rnea(model, data, *each)) for each in states)
    calls = (partial(pin.rnea, model, data), robot.inverse_dynamics)
    binding, own = best_in_turns([partial(_calls, call, states) for call in calls], 10 * repeats)
    return [
        EnsembleRow(subject=name, tool="pin.rnea, one sample", time=binding, base=binding),
        EnsembleRow(subject=name, tool="inverse_dynamics, one sample", time=own, base=binding, error=error,
                    note="error: from pin.rnea, relative"),
    ]  # fmt: skip


def _relative_difference(found: Array, expected: Array) -> float:
    return float(np.abs(found - expected).max() / np.abs(expected).max())


def _calls(call: Callable[..., object], states: Sequence[tuple[Array, ...]]) -> Duration:
    def loop() -> None:
        for q, v, a in states:
            call(q, v, a)

    return clocked(loop) / len(states)


def first_use_rows(name: str) -> list[EnsembleRow]:
    """From the start of Python's imports to the first inverse dynamics of a robot, without a cache and from it."""
    statements = (
        "import numpy, bellcrank\n"
        f"robot = bellcrank.load_robot({name!r})\n"
        "robot.inverse_dynamics(robot.neutral, numpy.zeros(robot.nv), numpy.zeros(robot.nv))"
    )
    found = [seconds_in_new_processes(statements) for _ in range(PROCESSES)]
    first, cached = (min(times) for times in zip(*found, strict=True))
    note = "import bellcrank to the first inverse dynamics, in a new process"
    return [
        EnsembleRow(
            subject=name, tool="first use", setting=setting, time=Duration(seconds), base=Duration(first), note=note
        )
        for setting, seconds in (("empty cache", first), ("from the cache", cached))
    ]
