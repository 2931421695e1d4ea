"""Writes LLVM IR for an expression graph: straight-line code of its operations, for any number of SIMD lanes.

Compiled functions are pure and return a status (0). Products and sums are fused where contraction.py says so, by the
same rule at every optimisation level; nothing is reordered, so infinities, NaN and signs are as in IEEE 754. Inputs and
outputs must not overlap. Scratch memory is on the stack, up to some hundred kB for the largest graphs. kernels.py makes
the functions for one sample and for batches.
"""

from __future__ import annotations

from dataclasses import dataclass

from bellcrank.codegen.contraction import contracted
from bellcrank.codegen.expression_graph import Graph
from bellcrank.codegen.schedule import Schedule, Wave, schedule
from bellcrank.codegen.vector_math import EXACT_SINCOS, Lanes, sincos
from bellcrank.errors import CompileError

_LIBRARY = {  # C library functions, called lane by lane
    "exp": 1, "log": 1, "pow": 2, "constpow": 2, "tan": 1, "asin": 1, "acos": 1, "atan": 1, "atan2": 2, "sinh": 1,
    "cosh": 1, "tanh": 1, "log1p": 1, "expm1": 1, "hypot": 2, "fmod": 2,
}  # fmt: skip
_ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_INTRINSIC = {"sqrt": "sqrt", "floor": "floor", "ceil": "ceil", "fabs": "fabs", "copysign": "copysign"}
_COMPARE = {"lt": "olt", "le": "ole", "eq": "oeq", "ne": "une"}


class Body:
    """The straight-line code of one function for one block of lanes, between given loads and stores."""

    def __init__(
        self, graph: Graph, plan: Schedule, lanes: Lanes, fused: bool, load: str, store: str, packed: int
    ) -> None:
        self.graph, self.plan, self.lanes, self.fused = graph, plan, lanes, fused
        self.load, self.store = load, store  # format strings over {k}, {i}, {name}
        self.packed = packed  # how many angles of one sample may share a vector
        self.lines: list[str] = []
        self.library: set[str] = set()
        self.allocas: list[str] = []
        self.label = "body"  # the basic block being written
        self.names: dict[int, str] = {}

    def write(self, part: int) -> None:
        """Write the code of a part; the first part also stores outputs that are zeros, constants or inputs."""
        for step in self.plan.parts[part]:
            if isinstance(step, Wave):
                self._wave(step.angles)
            else:
                self._emit(step)
                self._hand_on(step)
        for k, (size, entries) in enumerate(self.graph.outputs if part == 0 else ()):
            for i in range(size):
                if i not in entries:
                    self._put(self.store.format(k=k, i=i, name=self.lanes.number(0.0)))
                elif not self.graph.nodes[entries[i]].args:
                    self._put(self.store.format(k=k, i=i, name=self._value(entries[i])))

    def _put(self, line: str) -> None:
        self.lines.append("  " + line)

    def _value(self, index: int) -> str:
        """The name of a node's value in this function; loaded from memory if another function computes it."""
        name = self.names.get(index)
        if name is None:
            node = self.graph.nodes[index]
            name = f"%v{index}"
            if node.op == "const":
                name = self.lanes.number(node.value)
            elif node.op == "input":
                self._put(self.load.format(k=node.place[0], i=node.place[1], name=name))
            else:
                self._put(f"{name} = load {self.lanes.double}, ptr {self._slot(index)}")
            self.names[index] = name
        return name

    def _slot(self, index: int) -> str:
        self._put(f"%v{index}.at = getelementptr {self.lanes.double}, ptr %passed, i64 {self.plan.slots[index]}")
        return f"%v{index}.at"

    def _hand_on(self, index: int) -> None:
        """Store a value that is an output or that a later function reads."""
        for k, i in self.plan.places.get(index, ()):
            self._put(self.store.format(k=k, i=i, name=self.names[index]))
        if index in self.plan.slots:
            self._put(f"store {self.lanes.double} {self.names[index]}, ptr {self._slot(index)}")

    def _groups(self, angles: tuple[int, ...]) -> list[tuple[Lanes, tuple[int, ...]]]:
        """The angles of a wave, grouped by vector: one each in a batch, packed for one sample."""
        if self.lanes.width > 1:
            return [(self.lanes, (a,)) for a in angles]
        groups = []
        while angles:
            width = self.packed
            while width >= 2 * len(angles):
                width //= 2
            groups.append((Lanes(width), angles[:width]))
            angles = angles[width:]
        return groups

    def _pack(self, lanes: Lanes, tag: str, angles: tuple[int, ...]) -> str:
        """The values of angles side by side, zeros after them."""
        if lanes.width == self.lanes.width:
            return self._value(angles[0])
        whole = "zeroinitializer"
        for j, angle in enumerate(angles):
            node = self.graph.nodes[angle]
            if node.op == "input" and angle not in self.names:
                # A vector load of what the caller has just stored in other pieces would wait until the cache has it;
                # "volatile" keeps LLVM from making one.
                self.names[angle] = f"%v{angle}"
                self._put(self.load.replace(" load ", " load volatile ").format(
                    k=node.place[0], i=node.place[1], name=f"%v{angle}"))  # fmt: skip
            value = self._value(angle)
            self._put(f"%{tag}.{j} = insertelement {lanes.double} {whole}, double {value}, i64 {j}")
            whole = f"%{tag}.{j}"
        return whole

    def _wave(self, angles: tuple[int, ...]) -> None:
        """Sines and cosines of several angles; those of angles that are too large are the C library's.

        The result of a lane depends on the angle in that lane alone.
        """
        tag = f"w{angles[0]}"
        groups = self._groups(angles)
        count = sum(lanes.width for lanes, _ in groups)
        region = -(-count // 8) * 8  # the buffer holds angles, sines and cosines, in regions of whole vectors
        self.allocas.append(f"  %{tag} = alloca [{3 * region} x double], align 64")
        packs: list[tuple[int, Lanes, str, tuple[int, ...], tuple[str, str], str]] = []
        beyond: dict[int, str] = {}  # by width
        at = 0
        for lanes, members in groups:
            x = self._pack(lanes, f"{tag}.x{at}", members)
            lines, sine, cosine, flag = sincos(lanes, f"{tag}.t{at}", x, self.fused)
            self.lines += lines
            packs.append((at, lanes, x, members, (sine, cosine), flag))
            if lanes.width in beyond:
                self._put(f"%{tag}.any{at} = or {lanes.bit} {beyond[lanes.width]}, {flag}")
                flag = f"%{tag}.any{at}"
            beyond[lanes.width] = flag
            at += lanes.width
        slow = "false"
        for w, flag in beyond.items():
            self._put(f"%{tag}.mask{w} = bitcast {Lanes(w).bit} {flag} to i{w}")
            self._put(f"%{tag}.lane{w} = icmp ne i{w} %{tag}.mask{w}, 0")
            self._put(f"%{tag}.slow{w} = or i1 %{tag}.lane{w}, {slow}")
            slow = f"%{tag}.slow{w}"
        self.library.update(("sin", "cos"))
        before, self.label = self.label, f"{tag}.done"
        self._put(f"br i1 {slow}, label %{tag}.exact, label %{self.label}, !prof !2")
        self.lines.append(f"{tag}.exact:")
        for at, lanes, x, *_ in packs:
            self._put(f"store {lanes.double} {x}, ptr {self._buffer(tag, at)}")
        self._put(f"call void @exact_sincos(ptr %{tag}, i64 {count}, i64 {region})")
        for at, lanes, _, _, fast, flag in packs:
            for offset, value in zip((at + region, at + 2 * region), fast, strict=True):
                self._put(f"%{tag}.c{offset} = load {lanes.double}, ptr {self._buffer(tag, offset)}")
                both = f"{lanes.double} %{tag}.c{offset}, {lanes.double} {value}"
                self._put(f"%{tag}.e{offset} = select {lanes.bit} {flag}, {both}")
        self._put(f"br label %{self.label}")
        self.lines.append(f"{self.label}:")
        for at, lanes, _, _, fast, _ in packs:
            for offset, value in zip((at + region, at + 2 * region), fast, strict=True):
                exact = f"[ %{tag}.e{offset}, %{tag}.exact ]"
                self._put(f"%{tag}.r{offset} = phi {lanes.double} [ {value}, %{before} ], {exact}")
        for at, lanes, _, members, *_ in packs:
            for j, angle in enumerate(members):
                for kind, node in enumerate(self.plan.sines[angle]):
                    if node >= 0:
                        self._unpack(lanes, f"%{tag}.r{at + (kind + 1) * region}", j, node)

    def _unpack(self, lanes: Lanes, vector: str, j: int, node: int) -> None:
        """Name a node's value, which is lane j of a vector, or the whole vector in a batch."""
        if lanes.width > self.lanes.width:
            self._put(f"%v{node} = extractelement {lanes.double} {vector}, i64 {j}")
            vector = f"%v{node}"
        self.names[node] = vector
        self._hand_on(node)

    def _buffer(self, tag: str, at: int) -> str:
        self._put(f"%{tag}.p{at} = getelementptr double, ptr %{tag}, i64 {at}")
        return f"%{tag}.p{at}"

    def _emit(self, index: int) -> None:
        node = self.graph.nodes[index]
        lanes, d = self.lanes, self.lanes.double
        name = f"%v{index}"
        args = [self._value(a) for a in node.args]
        op = node.op
        put = self._put
        if op in _ARITHMETIC:
            put(f"{name} = {_ARITHMETIC[op]} {d} {args[0]}, {args[1]}")
        elif op == "neg":
            put(f"{name} = fneg {d} {args[0]}")
        elif op == "sq":
            put(f"{name} = fmul {d} {args[0]}, {args[0]}")
        elif op == "twice":
            put(f"{name} = fadd {d} {args[0]}, {args[0]}")
        elif op == "inv":
            put(f"{name} = fdiv {d} {lanes.number(1.0)}, {args[0]}")
        elif op in ("fma", "fms", "fnma"):
            self._fused(name, op, args)
        elif op in _INTRINSIC:
            listed = ", ".join(f"{d} {a}" for a in args)
            put(f"{name} = call {d} @llvm.{_INTRINSIC[op]}.{lanes.suffix}({listed})")
        elif op in _COMPARE:
            put(f"{name}.b = fcmp {_COMPARE[op]} {d} {args[0]}, {args[1]}")
            put(f"{name} = uitofp {lanes.bit} {name}.b to {d}")
        elif op in ("fmin", "fmax"):
            self._extreme(name, "olt" if op == "fmin" else "ogt", args)
        elif op in ("not", "and", "or", "if_else_zero", "sign"):
            self._logical(name, op, args)
        elif op in _LIBRARY:
            self._library_call(name, op, args)
        else:
            raise CompileError(f"the operation '{op}' cannot be compiled; write the expression without it")
        self.names[index] = name

    def _fused(self, name: str, op: str, args: list[str]) -> None:
        """a b + c, a b - c or c - a b, rounded once."""
        d, negated = self.lanes.double, {"fms": 2, "fnma": 0}.get(op)
        if negated is not None:
            self._put(f"{name}.n = fneg {d} {args[negated]}")
            args[negated] = f"{name}.n"
        self._put(f"{name} = call {d} @llvm.fma.{self.lanes.suffix}({d} {args[0]}, {d} {args[1]}, {d} {args[2]})")

    def _extreme(self, name: str, before: str, args: list[str]) -> None:
        """The minimum or maximum of two values; NaN if either is NaN, unlike C's fmin."""
        a, b, d, bit = args[0], args[1], self.lanes.double, self.lanes.bit
        self._put(f"{name}.b = fcmp {before} {d} {a}, {b}")
        self._put(f"{name}.m = select {bit} {name}.b, {d} {a}, {d} {b}")
        self._put(f"{name}.n = fcmp uno {d} {a}, {a}")
        self._put(f"{name} = select {bit} {name}.n, {d} {a}, {d} {name}.m")

    def _logical(self, name: str, op: str, args: list[str]) -> None:
        lanes, d, b = self.lanes, self.lanes.double, self.lanes.bit
        zero, one = lanes.number(0.0), lanes.number(1.0)
        put = self.lines.append
        if op == "sign":
            put(f"  {name}.one = call {d} @llvm.copysign.{lanes.suffix}({d} {one}, {d} {args[0]})")
            put(f"  {name}.z = fcmp ueq {d} {args[0]}, {zero}")  # zero, or NaN, which stays
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
        symbol = "pow" if op == "constpow" else op
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
    """The operations of a graph; `load` and `store` are formats over {k}, {i}, {name} that may use `pointers`."""
    graph = contracted(graph) if fused else graph
    plan = schedule(graph)
    bodies = []
    library: set[str] = set()
    for k in range(len(plan.parts)):
        body = Body(graph, plan, lanes, fused, load, store, packed)
        body.write(k)
        library |= body.library
        bodies.append(body)
    before = declarations(library, lanes)
    if "sin" in library:
        before.append(EXACT_SINCOS)
    if len(bodies) == 1:
        return Code(bodies[0].lines, bodies[0].allocas, bodies[0].label, before)
    listed = ", ".join(f"ptr noalias %{p}" for p in [*pointers, "passed"])
    inlining = "alwaysinline" if plan.joined else "noinline"
    for k, body in enumerate(bodies):
        head = f"define internal void @part{k}({listed}) {inlining} alignstack(64) {{"
        before += [head, "body:", *body.allocas, *body.lines, "  ret void", "}"]
    given = listed.replace(" noalias", "")
    calls = [f"  call void @part{k}({given})" for k in range(len(bodies))]
    return Code(calls, [f"  %passed = alloca [{plan.memory} x {lanes.double}], align 64"], "body", before)
