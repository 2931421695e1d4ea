"""LLVM IR of the operations of a graph, for any number of SIMD lanes (written by src/cpp/codegen).

Compiled functions are pure and return a status (0). Products and sums are fused where `expression_graph.contracted`
says so, by the same rule at every optimisation level; nothing is reordered, so infinities, NaN and signs are as in IEEE
754. Inputs and outputs must not overlap. Scratch memory is on the stack, up to some hundred kB for the largest graphs.
kernels.py makes the functions for one sample and for batches.
"""

from __future__ import annotations

from dataclasses import dataclass

from bellcrank._codegen import schedule as divided
from bellcrank._codegen import write
from bellcrank.codegen.expression_graph import LONG, Graph
from bellcrank.codegen.vector_math import EXACT_SINCOS, Lanes, sincos

# ---- The division of large graphs into functions, and the order in which their operations are written.

PART = 400  # operations per function of a divided graph
WHOLE = 16_000  # the most operations that the optimiser joins
WAITING = 750  # the most live values in functions that it joins
ROLLED = 3_000  # operations from which on repetitions are written as loops


@dataclass(frozen=True)
class Limits:
    """How a graph is divided: the constants above, that of long code, and whether it is called for some rows only."""

    whole: int
    part: int
    waiting: int
    rolled: int
    lengthy: int
    seldom: bool


def limits_of(graph: Graph) -> Limits:
    """The limits for a graph."""
    return Limits(WHOLE, PART, WAITING, ROLLED, LONG, graph.seldom)


@dataclass(frozen=True)
class Schedule:
    """The steps of each function, and the memory slots in which values are passed to later functions.

    A step is a node, or -1 - w for wave w: angles whose sines and cosines are computed together. `slots` has the nodes
    that are passed; nodes share a slot if the last function that reads one comes before the function that writes the
    next. `joined`: optimised code is one function.
    """

    parts: tuple[tuple[int, ...], ...]
    waves: tuple[tuple[int, ...], ...]
    slots: dict[int, int]
    memory: int
    joined: bool


def schedule(graph: Graph) -> Schedule:
    """The straight-line code of a graph as it is divided and ordered."""
    parts, waves, slots, memory, joined = divided(graph, limits_of(graph))
    return Schedule(
        tuple(tuple(part) for part in parts),
        tuple(tuple(wave) for wave in waves),
        {node: slot for node, slot in enumerate(slots) if slot >= 0},
        memory,
        joined,
    )


_TWO_OPERANDS = {"pow", "atan2", "hypot", "fmod"}  # of the C library functions that are called lane by lane

METADATA = """
!0 = distinct !{!0}
!1 = !{!3}
!2 = !{!"branch_weights", i32 1, i32 100000}
!3 = distinct !{!3, !0}
"""


def declarations(library: set[str], lanes: Lanes) -> list[str]:
    """IR declarations of the C library functions and intrinsics that a body may call."""
    lines = []
    for symbol in sorted(library):
        count = 2 if symbol in _TWO_OPERANDS else 1
        lines.append(f"declare double @{symbol}({', '.join(['double'] * count)})")
    for width in sorted({1, 2, 4, 8} if lanes.width == 1 else {lanes.width}):
        used = Lanes(width)
        for name, count in (("fma", 3), ("sqrt", 1), ("floor", 1), ("ceil", 1), ("fabs", 1), ("copysign", 2)):
            lines.append(f"declare {used.double} @llvm.{name}.{used.suffix}({', '.join([used.double] * count)})")
    return lines


@dataclass(frozen=True)
class Code:
    """The operations of a graph in LLVM IR: `lines` of `evaluate`, its allocas, and what stands before it."""

    lines: list[str]
    allocas: list[str]
    label: str  # the basic block in which `lines` end; they begin in "body"
    before: list[str]


def operations(
    graph: Graph, lanes: Lanes, fused: bool, load: str, store: str, pointers: list[str], packed: int = 1
) -> Code:
    """The operations of a graph.

    `load` and `store` are formats over {k}, {i}, {name}, and {at} for the name of a place, that may use `pointers`;
    `packed` is how many angles of one sample may share a vector.
    """
    widths = [lanes.width] if lanes.width > 1 else [w for w in (1, 2, 4, 8) if w <= packed]
    codes = {w: _sine_code(Lanes(w), fused) for w in widths}
    limits = limits_of(graph)
    lines, allocas, label, functions, library = write(
        graph, limits, lanes.width, fused, packed, load, store, pointers, codes
    )
    before = declarations(library, lanes)
    if "sin" in library:
        before.append(EXACT_SINCOS)
    return Code(_texts(lines), allocas, label, before + _texts(functions))


def _sine_code(lanes: Lanes, fused: bool) -> tuple[str, str, str, str]:
    lines, sine, cosine, beyond = sincos(lanes, "{tag}", "{x}", fused)
    return "\n".join(lines), sine, cosine, beyond


def _texts(text: str) -> list[str]:
    return [text.removesuffix("\n")] if text else []
