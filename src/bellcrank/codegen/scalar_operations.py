"""The operations of a graph for one sample.

i32 evaluate(const double *const *inputs, double *const *outputs)
"""

from __future__ import annotations

from bellcrank.codegen.expression_graph import Graph
from bellcrank.codegen.llvm_ir import METADATA, operations
from bellcrank.codegen.vector_math import Lanes


def scalar_ir(graph: Graph, width: int, fused: bool) -> str:
    """LLVM IR that evaluates the graph for one sample.

    Angles share vectors of up to `width` lanes, at most 4: 512-bit operations would take a port from the scalar ones.
    """
    lanes = Lanes(1)
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
        "{name}.p = getelementptr double, ptr %in{k}, i64 {i}\n  {name} = load double, ptr {name}.p, !noalias !1",
        "%out{k}.{i}.p = getelementptr double, ptr %out{k}, i64 {i}\n"
        "  store double {name}, ptr %out{k}.{i}.p, !alias.scope !1",
        pointers, min(width, 4),
    )  # fmt: skip
    text = ["define i32 @evaluate(ptr noalias %in, ptr noalias %out) {", "entry:", *code.allocas, *entry]
    text += ["  br label %body", "body:", *code.lines, "  ret i32 0", "}"]
    return "\n".join(code.before + text) + METADATA
