"""The compiled functions of an expression graph, as LLVM IR: `evaluate` of three kinds.

    scalar, lanes:  i32 evaluate(const double *const *inputs, double *const *outputs)
    batch:          i32 evaluate(const double *const *inputs, double *const *outputs, const int64_t *strides,
                                 int64_t samples)

"scalar" is for one sample. "lanes" is for as many samples as there are SIMD lanes, stored as structure of arrays: entry
i of lane l is at [i * width + l] of an array that begins at a multiple of 64 bytes. The result of a lane depends on the
inputs in that lane alone, to the last bit.

"directions" are "lanes" whose first input is one vector for all lanes: its entry i is at [i].

In a "batch", sample i of input k begins at inputs[k] + i strides[k] (a stride of 0 repeats one sample); outputs are
contiguous rows. There are at least as many samples as SIMD lanes, with one sample a lane; the last block of samples
overlaps the one before it. Each block is transposed
into a buffer with one vector an entry, so that the body reads and writes whole vectors.
"""

from __future__ import annotations

from bellcrank.codegen.expression_graph import Graph
from bellcrank.codegen.llvm_ir import METADATA, Lanes, operations


def _transpose(lanes: Lanes, tag: str, rows: list[str]) -> tuple[list[str], list[str]]:
    """Eklundh's transposition of a width x width block: log2(width) rounds of two-row shuffles."""
    width, d = lanes.width, lanes.double
    lines: list[str] = []
    rows = list(rows)
    step = 1
    while step < width:
        for i in range(width):
            if i & step:
                continue
            low = [lane if not lane & step else width + lane - step for lane in range(width)]
            high = [lane + step if not lane & step else width + lane for lane in range(width)]
            pair = (rows[i], rows[i + step])
            for half, (row, mask) in enumerate(((i, low), (i + step, high))):
                name = f"%{tag}.{step}.{row}"
                picks = ", ".join(f"i32 {m}" for m in mask)
                lines.append(f"  {name} = shufflevector {d} {pair[0]}, {d} {pair[1]}, <{width} x i32> <{picks}>")
                rows[i + half * step] = name
        step *= 2
    return lines, rows


def _lane_mask(lanes: Lanes, count: int) -> str:
    bits = ", ".join(f"i1 {'true' if c < count else 'false'}" for c in range(lanes.width))
    return f"<{lanes.width} x i1> <{bits}>"


def _addresses(lanes: Lanes, name: str, stride: str) -> list[str]:
    """Where each lane's sample begins in an array of samples."""
    lines = []
    for lane in range(lanes.width):
        lines += [
            f"  %{name}.i{lane} = add i64 %at, {lane}",
            f"  %{name}.o{lane} = mul i64 %{name}.i{lane}, {stride}",
            f"  %{name}.p{lane} = getelementptr double, ptr %{name}, i64 %{name}.o{lane}",
        ]
    return lines


def _gather(lanes: Lanes, k: int, size: int, used: set[int]) -> list[str]:
    """One block of samples of input k, transposed into the vectors %in{k}.s{entry}."""
    d, width = lanes.double, lanes.width
    lines = _addresses(lanes, f"in{k}", f"%stride{k}")
    for first in range(0, size, width):
        count = min(width, size - first)
        if used.isdisjoint(range(first, first + count)):
            continue
        rows = []
        for lane in range(width):
            name = f"%in{k}.c{first}.{lane}"
            lines.append(f"  {name}.p = getelementptr double, ptr %in{k}.p{lane}, i64 {first}")
            if count == width:
                lines.append(f"  {name} = load {d}, ptr {name}.p, align 8, !noalias !1")
            else:
                lines.append(
                    f"  {name} = call {d} @llvm.masked.load.{lanes.suffix}.p0(ptr align 8 {name}.p, "
                    f"{_lane_mask(lanes, count)}, {d} zeroinitializer)"
                )
            rows.append(name)
        shuffles, columns = _transpose(lanes, f"in{k}.c{first}", rows)
        lines += shuffles
        for c in range(count):
            lines += [
                f"  %in{k}.s{first + c} = getelementptr {d}, ptr %soa.in{k}, i64 {first + c}",
                f"  store {d} {columns[c]}, ptr %in{k}.s{first + c}, align 64",
            ]
    return lines


def _scatter(lanes: Lanes, k: int, size: int) -> list[str]:
    """The vectors %out{k}.s{entry} of one block, transposed into rows of output k."""
    d, width = lanes.double, lanes.width
    lines = _addresses(lanes, f"out{k}", str(size))
    for first in range(0, size, width):
        count = min(width, size - first)
        columns = ["poison"] * width
        for c in range(count):
            columns[c] = f"%out{k}.v{first + c}"
            lines.append(f"  {columns[c]} = load {d}, ptr %out{k}.s{first + c}, align 64")
        shuffles, rows = _transpose(lanes, f"out{k}.c{first}", columns)
        lines += shuffles
        for lane in range(width):
            name = f"%out{k}.r{first}.{lane}"
            lines.append(f"  {name} = getelementptr double, ptr %out{k}.p{lane}, i64 {first}")
            if count == width:
                lines.append(f"  store {d} {rows[lane]}, ptr {name}, align 8, !alias.scope !1")
            else:
                lines.append(
                    f"  call void @llvm.masked.store.{lanes.suffix}.p0({d} {rows[lane]}, ptr align 8 {name}, "
                    f"{_lane_mask(lanes, count)})"
                )
    return lines


def batch_ir(graph: Graph, width: int, fused: bool) -> str:
    """LLVM IR that evaluates the graph for a batch, `width` samples at a time."""
    lanes = Lanes(width)
    d, mask = lanes.double, f"<{width} x i1>"
    entry: list[str] = []
    loads: list[str] = []
    stores: list[str] = []
    pointers: list[str] = []
    for k, size in enumerate(graph.input_sizes):
        used = graph.used_entries(k)
        if used:
            entry += [
                f"  %in.at{k} = getelementptr ptr, ptr %in, i64 {k}",
                f"  %in{k} = load ptr, ptr %in.at{k}",
                f"  %stride.at{k} = getelementptr i64, ptr %strides, i64 {k}",
                f"  %stride{k} = load i64, ptr %stride.at{k}",
                f"  %soa.in{k} = alloca [{size} x {d}], align 64",
            ]
            pointers.append(f"soa.in{k}")
            loads += _gather(lanes, k, size, used)
    for k, (size, *_) in enumerate(graph.outputs):
        if size:
            entry += [
                f"  %out.at{k} = getelementptr ptr, ptr %out, i64 {k}",
                f"  %out{k} = load ptr, ptr %out.at{k}",
                f"  %soa.out{k} = alloca [{size} x {d}], align 64",
            ]
            entry += [f"  %out{k}.s{i} = getelementptr {d}, ptr %soa.out{k}, i64 {i}" for i in range(size)]
            pointers.append(f"soa.out{k}")
            stores += _scatter(lanes, k, size)
    code = operations(
        graph, lanes, fused,
        "{name}.p = getelementptr " + d + ", ptr %soa.in{k}, i64 {i}\n  {name} = load " + d + ", ptr {name}.p",
        "{at} = getelementptr " + d + ", ptr %soa.out{k}, i64 {i}\n"
        "  store " + d + " {name}, ptr {at}",
        pointers,
    )  # fmt: skip
    head = [
        "define i32 @evaluate(ptr noalias %in, ptr noalias %out, ptr noalias %strides, i64 %n) {",
        "entry:",
        *code.allocas,
        *entry,
        f"  %last = sub i64 %n, {width}",
        "  br label %loop",
        "loop:",
        f"  %wanted = phi i64 [ 0, %entry ], [ %following, %{code.label} ]",
        "  %past = icmp sgt i64 %wanted, %last",
        "  %at = select i1 %past, i64 %last, i64 %wanted",
        "  br label %body",
        "body:",
        *loads,
    ]
    tail = [
        *stores,
        f"  %following = add i64 %wanted, {width}",
        "  %more = icmp slt i64 %following, %n",
        "  br i1 %more, label %loop, label %end",
        "end:",
        "  ret i32 0",
        "}",
    ]
    declared = [
        f"declare {d} @llvm.masked.load.{lanes.suffix}.p0(ptr, {mask}, {d})",
        f"declare void @llvm.masked.store.{lanes.suffix}.p0({d}, ptr, {mask})",
    ]
    return "\n".join(code.before + declared + head + code.lines + tail) + METADATA


def scalar_ir(graph: Graph, width: int, fused: bool) -> str:
    """LLVM IR that evaluates the graph for one sample.

    Angles share vectors of up to `width` lanes, at most 4: 512-bit operations would take a port from the scalar ones.
    """
    return _direct_ir(graph, Lanes(1), fused, min(width, 4))


def lanes_ir(graph: Graph, width: int, fused: bool) -> str:
    """LLVM IR that evaluates the graph for `width` samples, stored as structure of arrays."""
    return _direct_ir(graph, Lanes(width), fused, 1)


def _direct_ir(graph: Graph, lanes: Lanes, fused: bool, packed: int, load: str = "") -> str:
    """LLVM IR whose loads and stores are those of the caller's arrays; `packed`, `load`: those of `operations`."""
    d = lanes.double
    pointers, entry = [], []
    for kind, count in (("in", len(graph.input_sizes)), ("out", len(graph.outputs))):
        for k in range(count):
            pointers.append(f"{kind}{k}")
            entry += [
                f"  %{kind}.at{k} = getelementptr ptr, ptr %{kind}, i64 {k}",
                f"  %{kind}{k} = load ptr, ptr %{kind}.at{k}",
            ]
    code = operations(
        graph, lanes, fused,
        load or "{name}.p = getelementptr " + d + ", ptr %in{k}, i64 {i}\n"
        "  {name} = load " + d + ", ptr {name}.p, !noalias !1",
        "{at} = getelementptr " + d + ", ptr %out{k}, i64 {i}\n"
        "  store " + d + " {name}, ptr {at}, !alias.scope !1",
        pointers, packed,
    )  # fmt: skip
    text = ["define i32 @evaluate(ptr noalias %in, ptr noalias %out) {", "entry:", *code.allocas, *entry]
    text += ["  br label %body", "body:", *code.lines, "  ret i32 0", "}"]
    return "\n".join(code.before + text) + METADATA


def directions_ir(graph: Graph, width: int, fused: bool) -> str:
    """LLVM IR like `lanes_ir`, but with the entries of the first input the same in all lanes."""
    lanes = Lanes(width)
    d, numbered = lanes.double, range(len(graph.input_sizes))
    loads = [
        f"define internal {d} @load0(ptr %from, i64 %i) alwaysinline {{",
        "  %at = getelementptr double, ptr %from, i64 %i",
        "  %one = load double, ptr %at, !noalias !1",
        f"  %first = insertelement {d} poison, double %one, i64 0",
        f"  %all = shufflevector {d} %first, {d} poison, <{width} x i32> zeroinitializer",
        f"  ret {d} %all",
        "}",
    ]
    for k in numbered[1:]:
        loads += [
            f"define internal {d} @load{k}(ptr %from, i64 %i) alwaysinline {{",
            f"  %at = getelementptr {d}, ptr %from, i64 %i",
            f"  %all = load {d}, ptr %at, !noalias !1",
            f"  ret {d} %all",
            "}",
        ]
    load = f"{{name}} = call {d} @load{{k}}(ptr %in{{k}}, i64 {{i}})"
    return "\n".join([*loads, _direct_ir(graph, lanes, fused, 1, load)])


KINDS = {"scalar": scalar_ir, "lanes": lanes_ir, "batch": batch_ir, "directions": directions_ir}
