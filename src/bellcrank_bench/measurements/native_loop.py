"""A loop in native code over single calls of a compiled function.

What each call reads is written just before from the result of the previous call (times zero). A stepper's next stage
also waits for the last one, so calls must not overlap in the processor.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen import llvm

Array = NDArray[np.float64]


def loop(address: int, inputs: Sequence[Array], outputs: Sequence[Array]) -> Callable[[], int]:
    """A native loop that calls the scalar function at `address` on each row of C-contiguous arrays (n, m)."""
    chosen = llvm.target()
    ir = _loop_ir([x.shape[1] for x in inputs], [x.shape[1] for x in outputs])
    loaded = llvm.Loaded("calls", llvm.object_code(ir, chosen), chosen)
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
        "  %before = phi double [ 0.0, %entry ], [ %result, %loop ]", "  %zero1 = fmul double %before, 0.0",
        *[f"  %zero4.{j} = insertelement <4 x double> {f'%zero4.{j - 1}' if j else 'poison'}, double %zero1, i64 {j}"
          for j in range(4)],
        *body, "  %status = call i32 %function(ptr %ins, ptr %outs)",
        f"  %last = getelementptr double, ptr %out0.row, i64 {output_sizes[0] - 1}",
        "  %result = load double, ptr %last",
        "  %next = add i64 %i, 1", "  %more = icmp slt i64 %next, %n", "  br i1 %more, label %loop, label %end",
        "end:", "  ret i32 %status", "}",
    ])  # fmt: skip


def _copy(name: str, size: int) -> list[str]:
    """The code that adds zero to a row and writes it to `copy`, four numbers at a time, as a stepper would."""
    lines = []
    at = 0
    while at < size:
        width = 4 if size - at >= 4 else 1
        kind, zero = ("<4 x double>", "%zero4.3") if width == 4 else ("double", "%zero1")
        lines += [
            f"  %{name}.from{at} = getelementptr double, ptr %{name}.row, i64 {at}",
            f"  %{name}.to{at} = getelementptr double, ptr %{name}.copy, i64 {at}",
            f"  %{name}.x{at} = load {kind}, ptr %{name}.from{at}, align 8",
            f"  %{name}.y{at} = fadd {kind} %{name}.x{at}, {zero}",
            f"  store {kind} %{name}.y{at}, ptr %{name}.to{at}, align 8",
        ]
        at += width
    return lines
