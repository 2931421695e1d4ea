"""Expression graphs in single-assignment form: the input of the compiler."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

from bellcrank.codegen.tracer import extension

LONG = 2_000  # operations; shorter code compiles in a tenth of a second


@cache
def _names() -> dict[int, str]:
    names: dict[int, str] = extension().operations()
    return names


class Node(NamedTuple):
    """One operation: its name, the nodes it reads, and for constants and inputs its value or place."""

    op: str
    args: tuple[int, ...] = ()
    value: float = 0.0
    place: tuple[int, int] = (0, 0)  # inputs: (which input, which entry)


@dataclass(frozen=True)
class Graph:
    """Nodes, of which each reads only earlier ones; outputs[k] = (size, {entry: node}).

    `seldom`: the function is called for some rows only, not at each step, so that a short compile time matters more.
    """

    nodes: tuple[Node, ...]
    input_sizes: tuple[int, ...]
    outputs: tuple[tuple[int, dict[int, int]], ...]
    seldom: bool = False

    @property
    def soon_compiled(self) -> bool:
        """Whether a short compile time matters more than fast code."""
        return self.seldom and self.is_long

    @property
    def is_long(self) -> bool:
        """Whether optimising the code takes long."""
        return self.operations > LONG

    @property
    def operations(self) -> int:
        """The number of operations; inputs and constants are not counted."""
        return sum(node.op not in ("input", "const") for node in self.nodes)

    @property
    def flops(self) -> int:
        """The number of operations without sines and cosines."""
        return sum(node.op not in ("input", "const", "sin", "cos") for node in self.nodes)


class _Builder:
    """Collects nodes; equal operations, also with swapped operands of a sum or product, become one node."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._known: dict[object, int] = {}

    def add(self, op: str, args: tuple[int, ...]) -> int:
        """An operation."""
        if op in ("add", "mul") and args[0] > args[1]:
            args = (args[1], args[0])
        index = self._known.get((op, args))
        return self._new((op, args), Node(op, args)) if index is None else index

    def leaf(self, node: Node) -> int:
        """A constant or an input."""
        key = node.value.hex() if node.op == "const" else node.place
        index = self._known.get(key)
        return self._new(key, node) if index is None else index

    def _new(self, key: object, node: Node) -> int:
        index = self._known[key] = len(self.nodes)
        self.nodes.append(node)
        return index


def graph_of(serialized: bytes) -> Graph:
    """Read a serialised casadi SX function; repeated constants, inputs and operations become one node.

    Several divisions by the same number become one reciprocal and products, which may differ from the quotients
    by one unit in the last place (and overflow where the divisor is subnormal); a single division stays one.
    """
    codes, results, firsts, seconds, values, input_sizes, outs = extension().instructions(serialized)
    names = _names()
    builder = _Builder()
    register: dict[int, int] = {}
    stored: list[dict[int, int]] = [{} for _ in outs]
    columns = zip(codes.tolist(), results.tolist(), firsts.tolist(), seconds.tolist(), values.tolist(), strict=True)
    for code, result, first, second, value in columns:
        op = names.get(code) or f"casadi operation {code}"
        if op == "output":
            stored[result][int(outs[result][1][int(value)])] = register[first]
        elif op == "assign":
            register[result] = register[first]
        elif op == "const":
            register[result] = builder.leaf(Node(op, value=value))
        elif op == "input":
            register[result] = builder.leaf(Node(op, place=(first, second)))
        elif op in _UNARY or second < 0:
            register[result] = builder.add(op, (register[first],))
        else:
            register[result] = builder.add(op, (register[first], register[second]))
    sizes = tuple(int(n) for n in input_sizes)
    outputs = tuple((int(size), entries) for (size, _), entries in zip(outs, stored, strict=True))
    return _with_shared_reciprocals(Graph(tuple(builder.nodes), sizes, outputs))


def _with_shared_reciprocals(graph: Graph) -> Graph:
    divisors = Counter(node.args[1] for node in graph.nodes if node.op == "div")
    divisors += Counter(node.args[0] for node in graph.nodes if node.op == "inv")
    builder = _Builder()
    new: list[int] = []  # index by old index
    for node in graph.nodes:
        if not node.args:
            new.append(builder.leaf(node))
        elif len(node.args) == 1:
            new.append(builder.add(node.op, (new[node.args[0]],)))
        elif node.op == "div" and divisors[node.args[1]] > 1:
            inverse = builder.add("inv", (new[node.args[1]],))
            new.append(builder.add("mul", (new[node.args[0]], inverse)))
        else:
            new.append(builder.add(node.op, (new[node.args[0]], new[node.args[1]])))
    outputs = tuple((size, {i: new[n] for i, n in entries.items()}) for size, entries in graph.outputs)
    return Graph(tuple(builder.nodes), graph.input_sizes, outputs)


_UNARY = frozenset(
    "neg exp log sqrt sq twice sin cos tan asin acos atan sinh cosh tanh log1p expm1 not floor ceil fabs sign "
    "inv".split()
)
