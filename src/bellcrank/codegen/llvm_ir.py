"""LLVM IR of the operations of a graph, for any number of SIMD lanes, with sine and cosine written here.

The argument is reduced to r = x - k pi/2 with |r| <= pi/4 (Cody & Waite, Software Manual for the
Elementary Functions, 1980): with a fused multiply-add three 53-bit parts of pi/2 suffice, because
x - k P1 is then exact; without one, four parts short enough for exact products. The polynomials are
the double-precision ones of S. L. Moshier's Cephes library (sin.c). Beyond 1e5 (and for infinities
and NaN) the caller takes the C library's sine and cosine instead, which are exact to the last bit or so.

Compiled functions are pure and return a status (0). Products and sums are fused where `expression_graph.contracted`
says so, by the same rule at every optimisation level; nothing is reordered, so infinities, NaN and signs are as in IEEE
754. Inputs and outputs must not overlap. Scratch memory is on the stack, up to some hundred kB for the largest graphs.
kernels.py makes the functions for one sample and for batches.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from bellcrank._codegen import schedule as divided
from bellcrank._codegen import write
from bellcrank.codegen.expression_graph import LONG, Graph

LIMIT = 1e5

_SIN = (
    1.58962301576546568060e-10,
    -2.50507477628578072866e-8,
    2.75573136213857245213e-6,
    -1.98412698295895385996e-4,
    8.33333333332211858878e-3,
    -1.66666666666666307295e-1,
)
_COS = (
    -1.13585365213876817300e-11,
    2.08757008419747316778e-9,
    -2.75573141792967388112e-7,
    2.48015872888517045348e-5,
    -1.38888888888730564116e-3,
    4.16666666666665929218e-2,
)
# pi/2 in parts: P1 + P2 + P3 to about 160 bits, and four parts of 33 bits for products without rounding.
_FUSED = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591833e-33)
_SHORT = (1.57079632673412561417e0, 6.07710050630396597660e-11, 2.02226624871116645580e-21, 8.47842766036889956997e-32)
_TWO_OVER_PI = 0.6366197723675814
_ROUND = 6755399441055744.0  # 1.5 * 2^52: adding it leaves the nearest integer in the low bits
# The C library's sines and cosines of the first n numbers of a buffer, into its second and third region.
EXACT_SINCOS = """
define internal void @exact_sincos(ptr %buffer, i64 %n, i64 %region) noinline cold {
entry:
  br label %loop
loop:
  %i = phi i64 [ 0, %entry ], [ %next, %loop ]
  %js = add i64 %i, %region
  %jc = add i64 %js, %region
  %px = getelementptr double, ptr %buffer, i64 %i
  %ps = getelementptr double, ptr %buffer, i64 %js
  %pc = getelementptr double, ptr %buffer, i64 %jc
  %x = load double, ptr %px
  %s = call double @sin(double %x)
  %c = call double @cos(double %x)
  store double %s, ptr %ps
  store double %c, ptr %pc
  %next = add i64 %i, 1
  %more = icmp ult i64 %next, %n
  br i1 %more, label %loop, label %end
end:
  ret void
}
"""
PART = 400  # operations per function of a divided graph
WHOLE = 16_000  # the most operations that the optimiser joins
WAITING = 750  # the most live values in functions that it joins
ROLLED = 3_000  # operations from which on repetitions are written as loops
_TWO_OPERANDS = {"pow", "atan2", "hypot", "fmod"}  # of the C library functions that are called lane by lane
METADATA = """
!0 = distinct !{!0}
!1 = !{!3}
!2 = !{!"branch_weights", i32 1, i32 100000}
!3 = distinct !{!3, !0}
"""


def literal(value: float) -> str:
    """A double as LLVM writes it, to the bit."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


class Lanes:
    """Type names and constants for a vector of `width` doubles (a plain double where it is 1)."""

    def __init__(self, width: int) -> None:
        self.width = width
        vector = width > 1
        self.double = f"<{width} x double>" if vector else "double"
        self.integer = f"<{width} x i64>" if vector else "i64"
        self.bit = f"<{width} x i1>" if vector else "i1"
        self.suffix = f"v{width}f64" if vector else "f64"

    def number(self, value: float) -> str:
        """A constant in every lane."""
        return f"splat (double {literal(value)})" if self.width > 1 else literal(value)

    def whole(self, value: int) -> str:
        """A 64-bit integer in every lane."""
        return f"splat (i64 {value})" if self.width > 1 else str(value)


def sincos(lanes: Lanes, tag: str, x: str, fused: bool) -> tuple[list[str], str, str, str]:
    """IR lines for the sine and cosine of `x`, and the names of: sine, cosine, "beyond the limit" bit."""
    d, i, b = lanes.double, lanes.integer, lanes.bit
    n = f"%{tag}."
    lines: list[str] = []

    def put(name: str, text: str) -> str:
        lines.append(f"  {n}{name} = {text}")
        return n + name

    def fma(name: str, a: str, y: str, c: str) -> str:
        if fused:
            return put(name, f"call {d} @llvm.fma.{lanes.suffix}({d} {a}, {d} {y}, {d} {c})")
        product = put(name + "p", f"fmul {d} {a}, {y}")
        return put(name, f"fadd {d} {product}, {c}")

    size = put("abs", f"call {d} @llvm.fabs.{lanes.suffix}({d} {x})")
    beyond = put("beyond", f"fcmp ugt {d} {size}, {lanes.number(LIMIT)}")
    shifted = fma("shifted", x, lanes.number(_TWO_OVER_PI), lanes.number(_ROUND))
    k = put("k", f"fsub {d} {shifted}, {lanes.number(_ROUND)}")
    r = x
    if fused:
        for j, part in enumerate(_FUSED):
            early, r = r, fma(f"r{j}", k, lanes.number(-part), r)
    else:  # the products of the first two parts are exact; what the second subtraction rounds off is carried along
        first = fma("r0", k, lanes.number(-_SHORT[0]), r)
        second = put("p1", f"fmul {d} {k}, {lanes.number(_SHORT[1])}")
        high = put("high", f"fsub {d} {first}, {second}")
        low = put("low0", f"fsub {d} {first}, {high}")
        low = put("low1", f"fsub {d} {low}, {second}")
        for j, part in enumerate(_SHORT[2:]):
            low = fma(f"low{j + 2}", k, lanes.number(-part), low)
        early = r = put("r", f"fadd {d} {high}, {low}")
    # r before its last correction, of 1e-28 at most, is good enough for the polynomials, and there sooner
    z = put("z", f"fmul {d} {early}, {early}")
    zz = put("zz", f"fmul {d} {z}, {z}")

    def polynomial(name: str, c: tuple[float, ...]) -> str:
        """Estrin's scheme: as many operations as Horner's, for z² is there anyway, and a chain half as long."""
        pairs = [fma(f"{name}{j}", lanes.number(c[j]), z, lanes.number(c[j + 1])) for j in (0, 2, 4)]
        return fma(f"{name}8", fma(f"{name}7", pairs[0], zz, pairs[1]), zz, pairs[2])

    s = polynomial("s", _SIN)
    rz = put("rz", f"fmul {d} {early}, {z}")
    sine = fma("sine", rz, s, r)
    c_ = polynomial("c", _COS)
    half = fma("half", z, lanes.number(-0.5), lanes.number(1.0))
    if fused:
        cosine = fma("cosine", zz, c_, half)
    else:  # the rounding of 1 - z/2 is added back: without fused operations it would cost half an ulp too much
        lost = put("lost", f"fsub {d} {lanes.number(1.0)}, {half}")
        lost = fma("lost.z", z, lanes.number(-0.5), lost)
        tail = fma("tail", zz, c_, lost)
        cosine = put("cosine", f"fadd {d} {half}, {tail}")
    bits = put("bits", f"bitcast {d} {shifted} to {i}")
    parity = put("parity", f"and {i} {bits}, {lanes.whole(1)}")
    odd = put("odd", f"icmp ne {i} {parity}, {'zeroinitializer' if lanes.width > 1 else '0'}")
    s0 = put("s.swapped", f"select {b} {odd}, {d} {cosine}, {d} {sine}")
    c0 = put("c.swapped", f"select {b} {odd}, {d} {sine}, {d} {cosine}")
    up = put("up", f"shl {i} {bits}, {lanes.whole(62)}")
    sign = lanes.whole(-(2**63))
    s_sign = put("s.sign", f"and {i} {up}, {sign}")
    next_ = put("next", f"add {i} {bits}, {lanes.whole(1)}")
    next_up = put("next.up", f"shl {i} {next_}, {lanes.whole(62)}")
    c_sign = put("c.sign", f"and {i} {next_up}, {sign}")
    out = []
    for name, value, flip in (("s", s0, s_sign), ("c", c0, c_sign)):
        raw = put(f"{name}.raw", f"bitcast {d} {value} to {i}")
        flipped = put(f"{name}.flipped", f"xor {i} {raw}, {flip}")
        out.append(put(f"{name}.out", f"bitcast {i} {flipped} to {d}"))
    return lines, out[0], out[1], beyond


# ---- The division of large graphs into functions, and the order in which their operations are written.


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
