"""The time of the derivatives of dynamics, in batches and single calls from native code, next to Pinocchio's C++.

Every time is the best of several on one thread, taken in turns. The clock of bellcrank's batches covers the compiled
call on allocated arrays, that of its single calls a native loop over the code for one sample, and that of Pinocchio a
loop in C++ whose results stay in Pinocchio's own data. A batch is so long that its results take 16 MB: longer ones
measure the memory.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen.full_tier import wait_for_optimised_code
from bellcrank.errors import BellcrankError
from bellcrank.robot.robot import Robot
from bellcrank_bench.measurements.dynamics_speed import PINOCCHIO, random_states
from bellcrank_bench.measurements.machine import best_of
from bellcrank_bench.measurements.native_loop import loop
from bellcrank_bench.measurements.pinocchio_derivatives import PinocchioDerivatives
from bellcrank_bench.measurements.row import Row
from bellcrank_bench.measurements.single_calls import COMPILED, SAMPLES, without_mimics

Array = NDArray[np.float64]
ALGORITHMS = ("inverse_dynamics", "forward_dynamics")
BATCH = "bellcrank, batches"
NUMBERS = 2_000_000  # of the results of a batch


def derivative_rows(robot_name: str, repeats: int = 10) -> list[Row]:
    """The rows of both algorithms for one robot without friction; mimicking joints are independent here, because
    Pinocchio's derivatives do not take them. Errors are relative to Pinocchio's, to the largest entry of each matrix.
    """
    robot = without_mimics(robot_name)
    seconds = {algorithm: _seconds_to_compile(robot, algorithm) for algorithm in ALGORITHMS}
    try:
        pinocchio = PinocchioDerivatives(robot)
    except BellcrankError as error:
        return [Row(subject=robot_name, method="derivatives", tool=PINOCCHIO, failure=str(error))]
    return [
        replace(row, note=f"{row.note}, traced and compiled in {seconds[algorithm]:.2f} s of CPU time")
        if row.tool == BATCH
        else row
        for algorithm in ALGORITHMS
        for row in _rows(robot, robot_name, algorithm, pinocchio, repeats)
    ]


def _seconds_to_compile(robot: Robot, algorithm: str) -> float:
    """The CPU time to trace and compile the code for batches; from the cache, to load it."""
    begun = time.process_time()
    robot.derivative_code(algorithm).address("batch")
    seconds = time.process_time() - begun
    robot.derivative_code(algorithm).address("scalar")
    return seconds


def _rows(robot: Robot, name: str, algorithm: str, pinocchio: PinocchioDerivatives, repeats: int) -> list[Row]:
    code = robot.derivative_code(algorithm)
    operations = code.graph.operations
    many = max(SAMPLES, NUMBERS // (3 * robot.nv**2))
    batch, few = random_states(robot, many), random_states(robot, SAMPLES)
    forward = algorithm == "forward_dynamics"
    outs = [[np.empty((n, robot.nv**2)) for _ in range(3)] for n in (many, SAMPLES)]
    runs: list[tuple[str, int, Callable[[], object], str]] = [
        (PINOCCHIO, SAMPLES, pinocchio.loop(forward, few), ""),
        (BATCH, many, code.prepared(batch, outs[0]), f"{operations} operations"),
        (COMPILED, SAMPLES, loop(code.address("scalar"), few, outs[1]), ""),
    ]
    best = [float("inf")] * 3
    wait_for_optimised_code()
    for _ in range(repeats):
        for k, (_, samples, run, _) in enumerate(runs):
            best[k] = min(best[k], best_of(run, 3) / samples)
    errors = [0.0, _error(outs[0], pinocchio.results(forward, batch)), _error(outs[1], pinocchio.results(forward, few))]
    return [
        Row(subject=name, method=f"{algorithm}, derivatives", tool=tool, seconds=best[k], error=errors[k],
            note=note)
        for k, (tool, _, _, note) in enumerate(runs)
    ]  # fmt: skip


def _error(found: Sequence[Array], expected: Sequence[Array]) -> float:
    pairs = zip(found, expected, strict=True)
    return max(float((np.abs(x.reshape(y.shape) - y).max((1, 2)) / np.abs(y).max((1, 2))).max()) for x, y in pairs)
