"""The time per sample of batches of compiled dynamics, next to Pinocchio's C++ and casadi's generated C.

Every time is the best of several on one thread. The clock of bellcrank's rows covers the compiled call on allocated
arrays (a row each sample), that of Pinocchio's rows `rneaInParallel` or `abaInParallel` with one thread (a column each
sample), and that of the generated C a loop in C over the generated function.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen import llvm
from bellcrank.codegen.expression_graph import Graph
from bellcrank.codegen.llvm_ir import Lanes, sincos
from bellcrank.errors import InputError
from bellcrank.robot.load import load_robot
from bellcrank.robot.robot import Robot
from bellcrank_bench.measurements.dynamics_peers import generated_c, peak_kernel, pinocchio_parallel
from bellcrank_bench.measurements.machine import best_of, seconds_in_new_processes
from bellcrank_bench.measurements.row import Row

Array = NDArray[np.float64]
PINOCCHIO = "libpinocchio, C++"
GENERATED = "casadi's C, -O3 -march=native"
ROBOTS = ("ur5", "panda", "talos")
FLOATING = ("talos", "solo", "anymal", "go", "a1", "hyq", "g1", "bolt", "icub")


def random_states(robot: Robot, samples: int, seed: int = 0) -> tuple[Array, Array, Array]:
    """Random positions (rad, m), velocities, and accelerations or torques; quaternions and headings have norm 1."""
    random = np.random.default_rng(seed)
    q = random.uniform(-3, 3, (samples, robot.nq))
    for j in robot.joints:
        part = {"floating": slice(j.q + 3, j.q + 7), "planar": slice(j.q + 2, j.q + 4)}.get(j.kind)
        if part is not None:
            q[:, part] /= np.linalg.norm(q[:, part], axis=1, keepdims=True)
    return q, random.normal(size=(samples, robot.nv)), random.normal(size=(samples, robot.nv))


@contextmanager
def _targeting(name: str) -> Iterator[None]:
    before = os.environ.get("BELLCRANK_TARGET")
    os.environ["BELLCRANK_TARGET"] = name
    try:
        yield
    finally:
        if before is None:
            del os.environ["BELLCRANK_TARGET"]
        else:
            os.environ["BELLCRANK_TARGET"] = before


def targets() -> list[str]:
    """The instruction sets that this processor can execute, widest first."""
    usable = []
    for name in ("avx512", "avx2"):
        with _targeting(name):
            try:
                llvm.target()
            except InputError:
                continue
            usable.append(name)
    return usable or ["native"]


def measure_robot(name: str, algorithm: str, samples: int, repeats: int = 15) -> list[Row]:
    """The rows of one algorithm for one robot without friction; their errors are relative to Pinocchio."""
    robot = load_robot(name, friction="none", floating_base=name.startswith(FLOATING))
    states = random_states(robot, samples)
    compiled = robot.dynamics(algorithm)
    out = np.empty((samples, robot.nv))
    pinocchio = pinocchio_parallel(robot, algorithm, *states)
    if isinstance(pinocchio, str):
        pinocchio_run = None
        reference = _single(robot, algorithm, states)
        rows = [Row(subject=name, method=algorithm, tool=PINOCCHIO, note=pinocchio)]
    else:
        pinocchio_run, columns = pinocchio
        seconds = best_of(pinocchio_run, repeats)
        reference = columns.T.copy()
        rows = [Row(subject=name, method=algorithm, tool=PINOCCHIO, seconds=seconds / samples, error=0.0)]
    scale = float(np.abs(reference).max())

    def add(tool: str, run: Callable[[], Any], out: Array, note: str = "") -> None:
        seconds = best_of(run, repeats)
        if pinocchio_run is not None:  # Pinocchio again, close in time: a ratio must not mix two states of the machine
            again = best_of(pinocchio_run, 3) / samples
            rows[0] = replace(rows[0], seconds=min(rows[0].seconds, again))
        error = float(np.abs(out - reference).max()) / scale
        rows.append(Row(subject=name, method=algorithm, tool=tool, seconds=seconds / samples, error=error, note=note))

    for target in targets():
        with _targeting(target):
            note = _time_at_peak(compiled.graph)
            add(f"bellcrank, {target}", compiled.prepared(states, [out]), out, note)
    made = generated_c(robot, algorithm, *states)
    if isinstance(made, str):
        rows.append(Row(subject=name, method=algorithm, tool=GENERATED, note=made))
    else:
        add(GENERATED, *made)
    return rows


def _single(robot: Robot, algorithm: str, states: tuple[Array, Array, Array]) -> Array:
    """The results of the scalar code, sample by sample: the reference if Pinocchio has none."""
    function = robot.dynamics(algorithm)
    return np.array([function(*sample) for sample in zip(*states, strict=True)])


def _time_at_peak(graph: Graph) -> str:
    """The time of the operations at the measured peak rate, without fused multiply-adds, as text."""
    run, operations = peak_kernel(200_000)
    rate = operations / best_of(run, 10) * 1e-9  # vector operations a ns
    angles = {node.args[0] for node in graph.nodes if node.op in ("sin", "cos")}
    chosen = llvm.target()
    sine, *_ = sincos(Lanes(chosen.lanes), "t", "%x", chosen.fused)
    count = graph.flops + len(angles) * sum("bitcast" not in line for line in sine)
    floor = count / rate / chosen.lanes
    return f"{count} operations, at peak {floor:.1f} ns"


def first_use(name: str) -> dict[str, float]:
    """Seconds to load, trace and compile (batch inverse dynamics) with an empty cache, then again from the cache."""
    first, cached = seconds_in_new_processes(
        f"r = bellcrank.load_robot({name!r}, floating_base={name.startswith(FLOATING)!r})\n"
        "r.inverse_dynamics(numpy.tile(r.neutral, (16, 1)), numpy.zeros((16, r.nv)), numpy.zeros((16, r.nv)))",
        before="import numpy, llvmlite.binding, casadi, pinocchio, bellcrank, bellcrank._trace",
    )
    return {"first": first, "cached": cached}
