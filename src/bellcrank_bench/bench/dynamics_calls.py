"""Time a sample of compiled dynamics beside Pinocchio's C++ and casadi's generated C, in one run.

Every figure is the best of several on one thread. The clock of bellcrank's rows covers the compiled call on
arrays that exist (rows: samples), that of Pinocchio's rows `rneaInParallel`/`abaInParallel` with one thread (columns:
samples), that of the C rows a C loop over the generated function.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from importlib import metadata
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen import llvm as machine
from bellcrank.codegen.expression_graph import Graph
from bellcrank.codegen.vector_math import Lanes, sincos
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.temporaries import temporary_folder
from bellcrank.robot.load import load_robot
from bellcrank.robot.robot import Robot
from bellcrank_bench.bench import kernel_peers

Array = NDArray[np.float64]
PINOCCHIO = "libpinocchio, C++"
GENERATED = "casadi's C, -O3 -march=native"
ROBOTS = ("ur5", "panda", "talos")
FLOATING = ("talos", "solo", "anymal", "go", "a1", "hyq", "g1", "bolt", "icub")


@dataclass(frozen=True)
class Row:
    """One measured way to compute one algorithm: ns a sample, and the largest difference from Pinocchio (relative)."""

    robot: str
    algorithm: str
    way: str
    ns: float
    error: float
    note: str = ""


def best_of(function: Callable[[], Any], repeats: int, seconds: float = 2.0) -> float:
    """The shortest of several timed calls, s; stops early when they take longer than `seconds` in all."""
    best, begun = float("inf"), time.perf_counter()
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        end = time.perf_counter()
        best = min(best, end - start)
        if end - begun > seconds:
            break
    return best


def random_states(robot: Robot, samples: int, seed: int = 0) -> tuple[Array, Array, Array]:
    """Random position (rad, m), velocity and acceleration or torque; quaternions and planar headings are unit."""
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
    """The targets that this processor can run, widest first."""
    usable = []
    for name in ("avx512", "avx2"):
        with _targeting(name):
            try:
                machine.target()
            except InputError:
                continue
            usable.append(name)
    return usable or ["native"]


def bench_robot(name: str, algorithm: str, samples: int, repeats: int = 15) -> list[Row]:
    """All ways of one algorithm for one robot, friction-free."""
    robot = load_robot(name, friction="none", floating_base=name.startswith(FLOATING))
    states = random_states(robot, samples)
    compiled = robot.dynamics(algorithm)
    out = np.empty((samples, robot.nv))
    pinocchio = kernel_peers.pinocchio_parallel(robot, algorithm, *states)
    if isinstance(pinocchio, str):
        beside = None
        reference = _single(robot, algorithm, states)
        rows = [Row(name, algorithm, PINOCCHIO, float("inf"), float("inf"), pinocchio)]
    else:
        beside, columns = pinocchio
        seconds = best_of(beside, repeats)
        reference = columns.T.copy()
        rows = [Row(name, algorithm, PINOCCHIO, seconds / samples * 1e9, 0.0)]
    scale = float(np.abs(reference).max())

    def add(way: str, run: Callable[[], Any], out: Array, note: str = "") -> None:
        seconds = best_of(run, repeats)
        if beside is not None:  # Pinocchio again, close in time: a ratio must not mix two states of the machine
            again = best_of(beside, 3) / samples * 1e9
            rows[0] = replace(rows[0], ns=min(rows[0].ns, again))
        error = float(np.abs(out - reference).max()) / scale
        rows.append(Row(name, algorithm, way, seconds / samples * 1e9, error, note))

    for target in targets():
        with _targeting(target):
            note = _distance_from_peak(compiled.graph)
            add(f"bellcrank, {target}", compiled.prepared(states, [out]), out, note)
    made = kernel_peers.generated_c(robot, algorithm, *states)
    if isinstance(made, str):
        rows.append(Row(name, algorithm, GENERATED, float("inf"), float("inf"), made))
    else:
        add(GENERATED, *made)
    return rows


def _single(robot: Robot, algorithm: str, states: tuple[Array, Array, Array]) -> Array:
    """The answers of the scalar code, sample by sample: the reference where Pinocchio has none."""
    function = robot.dynamics(algorithm)
    return np.array([function(*sample) for sample in zip(*states, strict=True)])


def _distance_from_peak(graph: Graph) -> str:
    """What the operations would take at the vector units' measured rate, before multiply-adds are fused."""
    run, operations = kernel_peers.peak_kernel(200_000)
    rate = operations / best_of(run, 10) * 1e-9  # vector operations a ns
    angles = {node.args[0] for node in graph.nodes if node.op in ("sin", "cos")}
    chosen = machine.target()
    sine, *_ = sincos(Lanes(chosen.lanes), "t", "%x", chosen.fused)
    count = graph.flops + len(angles) * sum("bitcast" not in line for line in sine)
    floor = count / rate / chosen.lanes
    return f"{count} operations, at peak {floor:.1f} ns"


def first_use(name: str) -> dict[str, float]:
    """Seconds to load, trace and compile (batch inverse dynamics) with an empty cache, then again from it."""
    script = (
        "import time, numpy, llvmlite.binding, casadi, pinocchio, bellcrank, bellcrank._trace\n"
        "t = time.perf_counter()\n"
        f"r = bellcrank.load_robot({name!r}, floating_base={name.startswith(FLOATING)!r})\n"
        "r.inverse_dynamics(numpy.tile(r.neutral, (16, 1)), numpy.zeros((16, r.nv)), numpy.zeros((16, r.nv)))\n"
        "print(time.perf_counter() - t)\n"
    )
    with temporary_folder("bench") as folder:
        environment = {**os.environ, "BELLCRANK_CACHE": str(folder)}
        times = []
        for _ in range(2):
            done = subprocess.run(
                [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False
            )
            if done.returncode:
                raise BellcrankError(f"timing the first use of {name} failed: {done.stderr.strip().splitlines()[-1:]}")
            times.append(float(done.stdout))
    return {"first": times[0], "cached": times[1]}


def machine_facts() -> dict[str, Any]:
    """Processor, versions and settings that a figure belongs to."""
    packages = ("libpinocchio", "casadi", "llvmlite", "numpy")
    return {
        "cpu": machine.processor(), "cores": os.cpu_count(), "target": asdict(machine.target()),
        "python": platform.python_version(),
        "versions": {p: metadata.version(p) for p in packages},
    }  # fmt: skip
