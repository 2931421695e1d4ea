"""Time single-sample calls of compiled forward dynamics, as a stepper makes them, beside libpinocchio and C by hand.

The loop over states is native code, and what each call reads is written just before from the result of the call
before it (times zero): a stepper's next stage waits for the last one too, so calls must not overlap in the processor.
"""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen import llvm as machine
from bellcrank.codegen.compile import Compiled
from bellcrank.errors import BellcrankError
from bellcrank.files.temporaries import temporary_folder
from bellcrank.robot.catalog import find_urdf
from bellcrank.robot.load import load_robot
from bellcrank.robot.robot import Robot
from bellcrank.robot.xml_tree import read_text
from bellcrank_bench.bench import kernel_peers
from bellcrank_bench.bench.dynamics_calls import FLOATING, PINOCCHIO, Row, best_of, random_states
from bellcrank_bench.c_baseline.c_baseline import FLAGS

Array = NDArray[np.float64]
ROBOTS = ("planar_2r", "ur5", "panda", "talos")
BY_HAND = "C by hand"
COMPILED = "bellcrank, a sample a call"
SAMPLES = 512  # states in turn: more than branch predictors learn by heart, few enough to stay in the cache

_MIMIC = re.compile(r"<mimic\b[^<>]*/>")
_WRAPPER = """#define _GNU_SOURCE
#include "planar_2r_swing.h"
int evaluate(const double *const *in, double *const *out) { rhs(in[0], out[0]); return 0; }
"""


def forward_dynamics_calls(robot_name: str, repeats: int = 40) -> list[Row]:
    """ns a call of forward dynamics (q, v, tau) -> a without friction, first libpinocchio's, then bellcrank's.

    planar_2r, with gravity along -y, adds the right-hand side (q, v) -> (v, a) of the arm, by hand and compiled: the
    lecture's equations (A. Ghosal, NPTEL 2022, lecture 18; c_baseline/planar_2r_swing.h). Joints that mimic others are
    independent here, because libpinocchio's algorithm does not take them.
    """
    robot = _without_mimics(robot_name)
    states = random_states(robot, SAMPLES)
    code = robot.dynamics("forward_dynamics")
    out = np.empty((SAMPLES, robot.nv))
    run = loop(code.address("scalar"), states, [out])
    made = kernel_peers.pinocchio_parallel(robot, "forward_dynamics", *states)
    if isinstance(made, str):
        raise BellcrankError(f"{robot_name}: {made}")
    beside, columns = made
    rows = [
        Row(robot_name, "forward_dynamics", PINOCCHIO, float("inf"), 0.0),
        Row(robot_name, "forward_dynamics", COMPILED, float("inf"), 0.0),
    ]
    rows = _time(rows, [beside, run], repeats)
    reference = columns.T
    rows[1] = replace(rows[1], error=float(np.abs(out - reference).max() / np.abs(reference).max()))
    return rows + (_by_hand(robot, repeats) if robot_name == "planar_2r" else [])


def loop(address: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> Callable[[], int]:
    """A native loop that calls a function of scalar.py's kind on each row of C-contiguous (n, m) arrays."""
    chosen = machine.target()
    ir = _loop_ir([x.shape[1] for x in inputs], [x.shape[1] for x in outputs])
    loaded = machine.Loaded("calls", machine.object_code(ir, chosen), chosen)
    pointer = ctypes.c_void_p
    call = ctypes.CFUNCTYPE(ctypes.c_int32, pointer, pointer, pointer, ctypes.c_int64)(loaded.address)
    ins = (pointer * len(inputs))(*[x.ctypes.data for x in inputs])
    outs = (pointer * len(outputs))(*[x.ctypes.data for x in outputs])
    held = (loaded, inputs, outputs)
    return lambda: int(call(address, ins, outs, len(held[1][0])))


def _loop_ir(input_sizes: list[int], output_sizes: list[int]) -> str:
    begin, body = [], []
    for kind, sizes in (("in", input_sizes), ("out", output_sizes)):
        for k, size in enumerate(sizes):
            name = f"{kind}{k}"
            begin += [
                f"  %{name}.at = getelementptr ptr, ptr %{kind}, i64 {k}",
                f"  %{name} = load ptr, ptr %{name}.at",
                f"  %{name}.place = getelementptr ptr, ptr %{kind}s, i64 {k}",
            ]
            body += [
                f"  %{name}.offset = mul i64 %i, {size}",
                f"  %{name}.row = getelementptr double, ptr %{name}, i64 %{name}.offset",
            ]
            if kind == "out":
                body.append(f"  store ptr %{name}.row, ptr %{name}.place")
                continue
            begin += [
                f"  %{name}.copy = alloca [{max(size, 1)} x double], align 64",
                f"  store ptr %{name}.copy, ptr %{name}.place",
            ]
            body += _copy(name, size)
    return "\n".join([
        "define i32 @evaluate(ptr %function, ptr %in, ptr %out, i64 %n) {", "entry:",
        f"  %ins = alloca [{len(input_sizes)} x ptr]", f"  %outs = alloca [{len(output_sizes)} x ptr]", *begin,
        "  br label %loop", "loop:", "  %i = phi i64 [ 0, %entry ], [ %next, %loop ]",
        "  %before = phi double [ 0.0, %entry ], [ %result, %loop ]", "  %none1 = fmul double %before, 0.0",
        *[f"  %none4.{j} = insertelement <4 x double> {f'%none4.{j - 1}' if j else 'poison'}, double %none1, i64 {j}"
          for j in range(4)],
        *body, "  %status = call i32 %function(ptr %ins, ptr %outs)",
        f"  %last = getelementptr double, ptr %out0.row, i64 {output_sizes[0] - 1}",
        "  %result = load double, ptr %last",
        "  %next = add i64 %i, 1", "  %more = icmp slt i64 %next, %n", "  br i1 %more, label %loop, label %end",
        "end:", "  ret i32 %status", "}",
    ])  # fmt: skip


def _copy(name: str, size: int) -> list[str]:
    """A row plus nothing into `copy`, in vectors of four and then singly, as a stepper writes the next state."""
    lines = []
    at = 0
    while at < size:
        width = 4 if size - at >= 4 else 1
        kind, nothing = ("<4 x double>", "%none4.3") if width == 4 else ("double", "%none1")
        lines += [
            f"  %{name}.from{at} = getelementptr double, ptr %{name}.row, i64 {at}",
            f"  %{name}.to{at} = getelementptr double, ptr %{name}.copy, i64 {at}",
            f"  %{name}.x{at} = load {kind}, ptr %{name}.from{at}, align 8",
            f"  %{name}.y{at} = fadd {kind} %{name}.x{at}, {nothing}",
            f"  store {kind} %{name}.y{at}, ptr %{name}.to{at}, align 8",
        ]
        at += width
    return lines


def _time(rows: list[Row], runs: Sequence[Callable[[], object]], repeats: int) -> list[Row]:
    """The rows with their best times, in turns: a ratio must not mix two states of the machine."""
    best = [float("inf")] * len(runs)
    for _ in range(repeats):
        for k, run in enumerate(runs):
            best[k] = min(best[k], best_of(run, 3))
    return [replace(row, ns=seconds / SAMPLES * 1e9) for row, seconds in zip(rows, best, strict=True)]


def _without_mimics(name: str) -> Robot:
    gravity = (0.0, -9.81, 0.0) if name == "planar_2r" else (0.0, 0.0, -9.81)
    robot = load_robot(name, gravity, floating_base=name.startswith(FLOATING), friction="none")
    if not robot.mimics():
        return robot
    with temporary_folder("bench") as folder:
        path = folder / f"{name}.urdf"
        path.write_text(_MIMIC.sub("", read_text(find_urdf(name))), encoding="utf-8")
        independent = load_robot(path, gravity, floating_base=name.startswith(FLOATING), friction="none")
        independent.dynamics("forward_dynamics").address("scalar")  # traced and compiled while the file is there
        independent.model  # noqa: B018  likewise
        return independent


def _by_hand(robot: Robot, repeats: int) -> list[Row]:
    """The 2R arm's right-hand side x = (q, v) -> dx/dt without torques: hand-written C, and the compiled graph."""
    x = np.hstack(random_states(robot, SAMPLES, seed=1)[:2])
    code = right_hand_side(robot)
    outs = [np.empty_like(x), np.empty_like(x)]
    try:
        library = _c_library()
    except BellcrankError as failure:
        return [Row(robot.name, "right_hand_side", BY_HAND, float("inf"), float("inf"), str(failure))]
    address = ctypes.cast(library.evaluate, ctypes.c_void_p).value or 0
    runs = [loop(address, [x], outs[:1]), loop(code.address("scalar"), [x], outs[1:])]
    rows = [
        Row(robot.name, "right_hand_side", BY_HAND, float("inf"), 0.0, " ".join(FLAGS)),
        Row(robot.name, "right_hand_side", COMPILED, float("inf"), 0.0),
    ]
    rows = _time(rows, runs, repeats)
    error = float(np.abs(outs[0] - outs[1]).max() / np.abs(outs[0]).max())
    return [rows[0], replace(rows[1], error=error)]


def right_hand_side(robot: Robot) -> Compiled:
    """(q, v) as one vector -> (dq/dt, dv/dt) under gravity alone, for robots whose dq/dt is v."""

    import casadi

    def build() -> casadi.Function:
        x = casadi.SX.sym("x", 2 * robot.nv)
        q, v = x[: robot.nv], x[robot.nv :]
        forward = robot.equations.dynamics("forward_dynamics")
        return casadi.Function("right_hand_side", [x], [casadi.vertcat(v, forward(q, v, casadi.SX(robot.nv, 1)))])

    return robot.compiled("right_hand_side", build)


def _c_library() -> ctypes.CDLL:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise BellcrankError("no C compiler: install gcc or cc")
    headers = Path(__file__).parent.parent / "c_baseline"
    with temporary_folder("bench") as folder:
        source, built = folder / "rhs.c", folder / "rhs.so"
        source.write_text(_WRAPPER, encoding="utf-8")
        command = [compiler, *FLAGS, f"-I{headers}", "-shared", "-fPIC", str(source), "-o", str(built), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise BellcrankError(f"the C compiler failed: {(done.stderr.splitlines() or [str(done.returncode)])[0]}")
        return ctypes.CDLL(str(built))
