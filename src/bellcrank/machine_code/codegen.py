"""From an expression graph to LLVM IR: the straight-line code of its operations, for any number of lanes.

Compiled functions are pure and return a status (0). Floating-point expressions may be contracted to fused
multiply-adds; nothing else is reordered, so infinities, NaN and signs keep their meaning. Inputs and outputs
must not overlap. For one sample the function is

    i32 evaluate(const double *const *inputs, double *const *outputs)

and simd.py wraps the same operations for batches.
"""

from __future__ import annotations

from collections.abc import Iterator

from bellcrank.errors import CompileError
from bellcrank.machine_code.graph import Graph
from bellcrank.machine_code.vector_math import Lanes, sincos

_LIBRARY = {  # C library functions, called lane by lane
    "exp": 1, "log": 1, "pow": 2, "constpow": 2, "tan": 1, "asin": 1, "acos": 1, "atan": 1, "atan2": 2, "sinh": 1,
    "cosh": 1, "tanh": 1, "log1p": 1, "expm1": 1, "hypot": 2, "fmod": 2,
}  # fmt: skip
_SYMBOL = {"constpow": "pow"}
_ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_INTRINSIC = {"sqrt": "sqrt", "floor": "floor", "ceil": "ceil", "fabs": "fabs", "fmin": "minnum", "fmax": "maxnum",
              "copysign": "copysign"}  # fmt: skip
_COMPARE = {"lt": "olt", "le": "ole", "eq": "oeq", "ne": "une"}


class Body:
    """The straight-line code of a graph for one block of lanes, between given loads and stores."""

    def __init__(self, graph: Graph, lanes: Lanes, fused: bool, store: str, load: str = "") -> None:
        self.graph, self.lanes, self.fused = graph, lanes, fused
        # format strings over {k}, {i}, {name}; without `load` entry i of input k is there already as %in{k}.{i}
        self.load, self.store = load, store
        self.lines: list[str] = []
        self.library: set[str] = set()
        self.allocas: list[str] = []
        self.label = "body"  # the basic block being written, for phi nodes
        self.names: dict[int, str] = {}
        self.sines: dict[int, tuple[str, str]] = {}  # node of the angle -> sine, cosine

    def write(self) -> list[str]:
        """The lines of the body: sines in waves first, then the rest in the graph's order, stores last."""
        waves = self._waves()
        for angles in waves:
            for index in self._ancestors(angles):
                self._emit(index)
            self._trig_wave(angles)
        wanted = [node for _, entries in self.graph.outputs for node in entries.values()]
        for index in self._ancestors(wanted):
            self._emit(index)
        for k, (size, entries) in enumerate(self.graph.outputs):
            for i in range(size):
                value = self.names[entries[i]] if i in entries else self.lanes.number(0.0)
                self.lines.append("  " + self.store.format(k=k, i=i, name=value))
        return self.lines

    def _waves(self) -> list[list[int]]:
        """The angles whose sine or cosine is taken, grouped by how many sines deep they lie."""
        nodes = self.graph.nodes
        depth = [0] * len(nodes)
        waves: list[dict[int, None]] = []
        for index, node in enumerate(nodes):
            below = max((depth[a] for a in node.args), default=0)
            if node.op in ("sin", "cos"):
                if len(waves) <= below:
                    waves.append({})
                waves[below][node.args[0]] = None
                below += 1
            depth[index] = below
        return [list(wave) for wave in waves]

    def _ancestors(self, roots: list[int]) -> Iterator[int]:
        """The nodes that the roots need and that are not written yet, in the graph's order."""
        nodes = self.graph.nodes
        needed: set[int] = set()
        stack = [r for r in roots if r not in self.names]
        while stack:
            index = stack.pop()
            if index in needed or index in self.names:
                continue
            needed.add(index)
            stack.extend(nodes[index].args)
        return iter(sorted(needed))

    def _trig_wave(self, angles: list[int]) -> None:
        """Sines and cosines of several angles; where one is too large, all by the C library."""
        lanes, d, tag = self.lanes, self.lanes.double, f"w{len(self.sines)}"
        fast: list[tuple[int, str, str]] = []
        beyond = ""
        for index in angles:
            lines, sine, cosine, flag = sincos(lanes, f"t{index}", self.names[index], self.fused)
            self.lines += lines
            fast.append((index, sine, cosine))
            if beyond:
                self.lines.append(f"  %{tag}.any{index} = or {lanes.bit} {beyond}, {flag}")
                beyond = f"%{tag}.any{index}"
            else:
                beyond = flag
        if lanes.width > 1:
            self.lines += [
                f"  %{tag}.mask = bitcast {lanes.bit} {beyond} to i{lanes.width}",
                f"  %{tag}.slow = icmp ne i{lanes.width} %{tag}.mask, 0",
            ]
        else:
            self.lines.append(f"  %{tag}.slow = or i1 {beyond}, false")
        n = len(angles)
        self.allocas.append(f"  %{tag}.buffer = alloca [{3 * n} x {d}], align 64")
        self.library.update(("sin", "cos"))
        before = self.label
        self.lines.append(f"  br i1 %{tag}.slow, label %{tag}.exact, label %{tag}.done, !prof !2")
        self.lines.append(f"{tag}.exact:")
        for j, index in enumerate(angles):
            self.lines += [
                f"  %{tag}.a{j} = getelementptr {d}, ptr %{tag}.buffer, i64 {j}",
                f"  store {d} {self.names[index]}, ptr %{tag}.a{j}",
            ]
        self.lines.append(f"  call void @exact_sincos(ptr %{tag}.buffer, i64 {n * lanes.width})")
        for j in range(n):
            for kind, base in (("s", n), ("c", 2 * n)):
                self.lines += [
                    f"  %{tag}.{kind}p{j} = getelementptr {d}, ptr %{tag}.buffer, i64 {base + j}",
                    f"  %{tag}.{kind}x{j} = load {d}, ptr %{tag}.{kind}p{j}",
                ]
        self.lines += [f"  br label %{tag}.done", f"{tag}.done:"]
        for j, (index, sine, cosine) in enumerate(fast):
            for kind, value in (("s", sine), ("c", cosine)):
                self.lines.append(
                    f"  %{tag}.{kind}{j} = phi {d} [ {value}, %{before} ], [ %{tag}.{kind}x{j}, %{tag}.exact ]"
                )
            self.sines[index] = (f"%{tag}.s{j}", f"%{tag}.c{j}")
        self.label = f"{tag}.done"

    def _emit(self, index: int) -> None:
        node = self.graph.nodes[index]
        lanes, d = self.lanes, self.lanes.double
        name = f"%v{index}"
        args = [self.names[a] for a in node.args]
        op = node.op
        put = self.lines.append
        if op == "const":
            name = lanes.number(node.value)
        elif op == "input":
            k, i = node.place
            if self.load:
                put("  " + self.load.format(k=k, i=i, name=name))
            else:
                name = f"%in{k}.{i}"
        elif op in _ARITHMETIC:
            put(f"  {name} = {_ARITHMETIC[op]} contract {d} {args[0]}, {args[1]}")
        elif op in ("sin", "cos"):
            name = self.sines[node.args[0]][op == "cos"]
        elif op == "neg":
            put(f"  {name} = fneg {d} {args[0]}")
        elif op == "sq":
            put(f"  {name} = fmul contract {d} {args[0]}, {args[0]}")
        elif op == "twice":
            put(f"  {name} = fadd contract {d} {args[0]}, {args[0]}")
        elif op == "inv":
            put(f"  {name} = fdiv {d} {lanes.number(1.0)}, {args[0]}")
        elif op in _INTRINSIC:
            listed = ", ".join(f"{d} {a}" for a in args)
            put(f"  {name} = call {d} @llvm.{_INTRINSIC[op]}.{lanes.suffix}({listed})")
        elif op in _COMPARE:
            put(f"  {name}.b = fcmp {_COMPARE[op]} {d} {args[0]}, {args[1]}")
            put(f"  {name} = uitofp {lanes.bit} {name}.b to {d}")
        elif op in ("not", "and", "or", "if_else_zero", "sign"):
            self._logical(name, op, args)
        elif op in _LIBRARY:
            self._library_call(name, op, args)
        else:
            raise CompileError(f"the operation '{op}' cannot be compiled; write the expression without it")
        self.names[index] = name

    def _logical(self, name: str, op: str, args: list[str]) -> None:
        lanes, d, b = self.lanes, self.lanes.double, self.lanes.bit
        zero, one = lanes.number(0.0), lanes.number(1.0)
        put = self.lines.append
        if op == "sign":
            put(f"  {name}.one = call {d} @llvm.copysign.{lanes.suffix}({d} {one}, {d} {args[0]})")
            put(f"  {name}.z = fcmp oeq {d} {args[0]}, {zero}")
            put(f"  {name} = select {b} {name}.z, {d} {args[0]}, {d} {name}.one")
            return
        for j, a in enumerate(args[: 1 if op in ("not", "if_else_zero") else 2]):
            put(f"  {name}.t{j} = fcmp une {d} {a}, {zero}")
        if op == "if_else_zero":
            put(f"  {name} = select {b} {name}.t0, {d} {args[1]}, {d} {zero}")
        elif op == "not":
            put(f"  {name} = select {b} {name}.t0, {d} {zero}, {d} {one}")
        else:
            put(f"  {name}.r = {op} {b} {name}.t0, {name}.t1")
            put(f"  {name} = uitofp {b} {name}.r to {d}")

    def _library_call(self, name: str, op: str, args: list[str]) -> None:
        symbol = _SYMBOL.get(op, op)
        self.library.add(symbol)
        width, d = self.lanes.width, self.lanes.double
        put = self.lines.append
        if width == 1:
            put(f"  {name} = call double @{symbol}({', '.join(f'double {a}' for a in args)})")
            return
        whole = "poison"
        for lane in range(width):
            for j, a in enumerate(args):
                put(f"  {name}.{lane}.{j} = extractelement {d} {a}, i64 {lane}")
            listed = ", ".join(f"double {name}.{lane}.{j}" for j in range(len(args)))
            put(f"  {name}.{lane} = call double @{symbol}({listed})")
            result = name if lane == width - 1 else f"{name}.w{lane}"
            put(f"  {result} = insertelement {d} {whole}, double {name}.{lane}, i64 {lane}")
            whole = result


_EXACT_SINCOS = """
define internal void @exact_sincos(ptr %buffer, i64 %n) noinline cold {
entry:
  br label %loop
loop:
  %i = phi i64 [ 0, %entry ], [ %next, %loop ]
  %js = add i64 %i, %n
  %jc = add i64 %js, %n
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
        count = _LIBRARY.get(symbol, 1)
        lines.append(f"declare double @{symbol}({', '.join(['double'] * count)})")
    for name, count in (("fma", 3), ("sqrt", 1), ("floor", 1), ("ceil", 1), ("fabs", 1), ("minnum", 2), ("maxnum", 2),
                        ("copysign", 2)):  # fmt: skip
        lines.append(f"declare {lanes.double} @llvm.{name}.{lanes.suffix}({', '.join([lanes.double] * count)})")
    return lines


def scalar_ir(graph: Graph, fused: bool) -> str:
    """LLVM IR that evaluates the graph for one sample."""
    lanes = Lanes(1)
    entry: list[str] = []
    for kind, count in (("in", len(graph.input_sizes)), ("out", len(graph.outputs))):
        for k in range(count):
            entry += [
                f"  %{kind}.at{k} = getelementptr ptr, ptr %{kind}, i64 {k}",
                f"  %{kind}{k} = load ptr, ptr %{kind}.at{k}",
            ]
    used = sorted({node.place for node in graph.nodes if node.op == "input"})
    for k, i in used:
        entry += [
            f"  %in{k}.{i}.p = getelementptr double, ptr %in{k}, i64 {i}",
            f"  %in{k}.{i} = load double, ptr %in{k}.{i}.p, !noalias !1",
        ]
    for k, (size, _) in enumerate(graph.outputs):
        entry += [f"  %out{k}.{i}.p = getelementptr double, ptr %out{k}, i64 {i}" for i in range(size)]
    body = Body(
        graph, lanes, fused,
        store="store double {name}, ptr %out{k}.{i}.p, !alias.scope !1",
    )  # fmt: skip
    lines = body.write()
    text = ["define i32 @evaluate(ptr noalias %in, ptr noalias %out) {", "entry:"]
    text += body.allocas + entry + ["  br label %body", "body:"] + lines + ["  ret i32 0", "}"]
    return "\n".join(declarations(body.library, lanes) + text) + helpers(body) + METADATA


def helpers(body: Body) -> str:
    """The internal functions that the body calls."""
    return _EXACT_SINCOS if "sin" in body.library else ""
