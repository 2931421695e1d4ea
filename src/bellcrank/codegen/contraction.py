"""Products and sums contracted to fused multiply-adds, decided once for a graph.

The optimiser could contract them as well, but does so differently at each of its levels and wherever code is divided
into functions. Decided here, the code of a graph gives the same results to the last bit at every level, however it is
divided, for one sample and for many.
"""

from __future__ import annotations

from dataclasses import replace

from bellcrank.codegen.expression_graph import Graph, Node

# By the operation of the sum and the operand that is the product a b: a b + c, a b - c, c - a b.
_CONTRACTED = {("add", 0): "fma", ("add", 1): "fma", ("sub", 0): "fms", ("sub", 1): "fnma"}


def contracted(graph: Graph) -> Graph:
    """The graph with each product that only one sum or difference reads contracted into it.

    Of two such products the later one is contracted, because the sum waits for it.
    """
    nodes = graph.nodes
    uses = [0] * len(nodes)
    for node in nodes:
        for a in node.args:
            uses[a] += 1
    for _, entries in graph.outputs:
        for n in entries.values():
            uses[n] += 1
    product_of: dict[int, int] = {}  # which operand of a sum is contracted
    absorbed = bytearray(len(nodes))
    for index, node in enumerate(nodes):
        if node.op in ("add", "sub"):
            single = [k for k, a in enumerate(node.args) if uses[a] == 1 and nodes[a].op in ("mul", "sq")]
            if single:
                product_of[index] = max(single, key=node.args.__getitem__)
                absorbed[node.args[product_of[index]]] = True
    new = [0] * len(nodes)
    kept: list[Node] = []
    for index, node in enumerate(nodes):
        if absorbed[index]:
            continue
        new[index] = len(kept)
        k = product_of.get(index)
        if k is not None:
            product, other = nodes[node.args[k]], node.args[1 - k]
            factors = product.args * (2 if product.op == "sq" else 1)
            node = Node(_CONTRACTED[node.op, k], (*(new[a] for a in factors), new[other]))
        elif node.args:
            node = node._replace(args=tuple(new[a] for a in node.args))
        kept.append(node)
    outputs = tuple((size, {i: new[n] for i, n in entries.items()}) for size, entries in graph.outputs)
    return replace(graph, nodes=tuple(kept), outputs=outputs)
