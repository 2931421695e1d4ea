"""An expression graph as plain arrays, in single-assignment form: what the compiler reads."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from bellcrank.trace import extension


@cache
def _names() -> dict[int, str]:
    names: dict[int, str] = extension().operations()
    return names


@dataclass(frozen=True)
class Node:
    """One operation: its name, the nodes it reads, and for constants and inputs its value or place."""

    op: str
    args: tuple[int, ...] = ()
    value: float = 0.0
    place: tuple[int, int] = (0, 0)  # inputs: (which input, which entry)


@dataclass(frozen=True)
class Graph:
    """Nodes in an order in which each reads only earlier ones; outputs[k] = (size, {entry: node})."""

    nodes: tuple[Node, ...]
    input_sizes: tuple[int, ...]
    outputs: tuple[tuple[int, dict[int, int]], ...]

    @property
    def operations(self) -> int:
        """How many arithmetic operations there are: inputs and constants are not counted."""
        return sum(node.op not in ("input", "const") for node in self.nodes)

    @property
    def flops(self) -> int:
        """The arithmetic operations without sines and cosines."""
        return sum(node.op not in ("input", "const", "sin", "cos") for node in self.nodes)


def graph_of(serialized: bytes) -> Graph:
    """Read a serialised casadi SX function; repeated constants and inputs become one node."""
    codes, results, firsts, seconds, values, input_sizes, outs = extension().instructions(serialized)
    names = _names()
    unary = _UNARY
    nodes: list[Node] = []
    register: dict[int, int] = {}
    known: dict[tuple[object, ...], int] = {}
    stored: list[dict[int, int]] = [{} for _ in outs]
    columns = zip(codes.tolist(), results.tolist(), firsts.tolist(), seconds.tolist(), values.tolist(), strict=True)
    for code, result, first, second, value in columns:
        op = names.get(code, f"casadi operation {code}")
        if op == "output":
            stored[result][int(outs[result][1][int(value)])] = register[first]
            continue
        if op == "assign":
            register[result] = register[first]
            continue
        if op == "const":
            key: tuple[object, ...] = ("const", value.hex())
            node = Node("const", value=value)
        elif op == "input":
            key = ("input", first, second)
            node = Node("input", place=(first, second))
        else:
            args = (register[first],) if op in unary or second < 0 else (register[first], register[second])
            key = (op, *args)
            node = Node(op, args)
        if key not in known:
            known[key] = len(nodes)
            nodes.append(node)
        register[result] = known[key]
    return Graph(
        tuple(nodes),
        tuple(int(n) for n in input_sizes),
        tuple((int(size), entries) for (size, _), entries in zip(outs, stored, strict=True)),
    )


_UNARY = frozenset(
    "neg exp log sqrt sq twice sin cos tan asin acos atan sinh cosh tanh log1p expm1 not floor ceil fabs sign "
    "inv".split()
)
