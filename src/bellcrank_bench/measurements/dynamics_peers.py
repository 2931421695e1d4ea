"""What batches of dynamics are compared with: Pinocchio's C++ loop, casadi's generated C, the peak rate."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen import llvm
from bellcrank.codegen.llvm_ir import Lanes
from bellcrank.errors import BellcrankError
from bellcrank.files.temporaries import temporary_folder
from bellcrank.robot.robot import Robot
from bellcrank_bench.c_baseline.compiler import shared_library

Array = NDArray[np.float64]

_DRIVER = """
#include <stdlib.h>
int drive(const double *q, const double *v, const double *a, double *out, long n) {
  casadi_int sz_arg, sz_res, sz_iw, sz_w;
  %(name)s_work(&sz_arg, &sz_res, &sz_iw, &sz_w);
  const double **arg = calloc(sz_arg + 1, sizeof(*arg));
  double **res = calloc(sz_res + 1, sizeof(*res));
  casadi_int *iw = calloc(sz_iw + 1, sizeof(*iw));
  double *w = calloc(sz_w + 1, sizeof(*w));
  int status = 0;
  for (long i = 0; i < n; ++i) {
    arg[0] = q + i * %(nq)d, arg[1] = v + i * %(nv)d, arg[2] = a + i * %(nv)d;
    res[0] = out + i * %(nv)d;
    status |= %(name)s(arg, res, iw, w, 0);
  }
  free(arg), free(res), free(iw), free(w);
  return status;
}
"""


def pinocchio_parallel(
    robot: Robot, algorithm: str, q: Array, v: Array, third: Array
) -> tuple[Callable[[], Any], Array] | str:
    """libpinocchio's batch loop in C++ on one thread, and its results (nv, n); or why there is none."""
    if robot.mimics() and (algorithm == "forward_dynamics" or robot.model.nv != robot.nv):
        return "Pinocchio's algorithm does not take mimic joints"  # aba would end the process
    import pinocchio as pin

    pool = pin.ModelPool(robot.model, 1)
    columns = [np.asfortranarray(x.T) for x in (q, v, third)]
    out = np.zeros((robot.nv, len(q)), order="F")
    function = pin.rneaInParallel if algorithm == "inverse_dynamics" else pin.abaInParallel
    return lambda: function(1, pool, *columns, out), out


def generated_c(
    robot: Robot, algorithm: str, q: Array, v: Array, third: Array
) -> tuple[Callable[[], Any], Array] | str:
    """casadi's generated C of the same graph at -O3 -march=native, and its results (n, nv); or why there is none."""
    import casadi

    function = robot.equations.dynamics(algorithm)
    with temporary_folder("bench") as folder:
        generator = casadi.CodeGenerator(f"{algorithm}.c")
        generator.add(function)
        generator.generate(f"{folder}/")
        source = folder / f"{algorithm}.c"
        with source.open("a") as file:
            file.write(_DRIVER % {"name": algorithm, "nq": robot.nq, "nv": robot.nv})
        try:
            drive = shared_library(source).drive
        except BellcrankError as error:
            return str(error)
    drive.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_long]
    out = np.empty((len(q), robot.nv))
    held = [np.ascontiguousarray(x) for x in (q, v, third)]
    return lambda: drive(*[x.ctypes.data for x in held], out.ctypes.data, len(q)), out


def peak_kernel(repeats: int) -> tuple[Callable[[], Any], int]:
    """A loop of independent fused multiply-adds in full vectors, and the number of its vector operations."""
    chosen = llvm.target()
    lanes, chains = Lanes(chosen.lanes), 16
    d = lanes.double
    body, phis = [], []
    for k in range(chains):
        phis.append(f"  %x{k} = phi {d} [ {lanes.number(1.0 + k)}, %entry ], [ %y{k}, %loop ]")
        if chosen.fused:
            factors = f"{d} {lanes.number(0.5)}, {d} {lanes.number(1.5)}"
            body.append(f"  %y{k} = call {d} @llvm.fma.{lanes.suffix}({d} %x{k}, {factors})")
        else:
            body.append(f"  %y{k} = fmul {d} %x{k}, {lanes.number(0.999)}")
    total = "%y0"
    sums = []
    for k in range(1, chains):
        sums.append(f"  %s{k} = fadd {d} {total}, %y{k}")
        total = f"%s{k}"
    ir = "\n".join([
        f"declare {d} @llvm.fma.{lanes.suffix}({d}, {d}, {d})",
        "define i32 @evaluate(ptr %out, i64 %n) {", "entry:", "  br label %loop", "loop:",
        "  %i = phi i64 [ 0, %entry ], [ %next, %loop ]", *phis, *body, "  %next = add i64 %i, 1",
        "  %more = icmp ult i64 %next, %n", "  br i1 %more, label %loop, label %end", "end:", *sums,
        f"  store {d} {total}, ptr %out, align 8", "  ret i32 0", "}",
    ])  # fmt: skip
    loaded = llvm.Loaded("peak", llvm.object_code(ir, chosen), chosen)
    call = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_int64)(loaded.address)
    out = np.empty(16)
    held = (loaded, out)
    return lambda: call(held[1].ctypes.data, repeats), repeats * chains
