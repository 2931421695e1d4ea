"""Directional derivatives as two functions: one of the point, and one of the direction, linear in it.

A function f(x, …, dx, …) that is linear in its directions dx consists of operations that depend on the point alone and
of those that carry a direction. Separated, the first are evaluated once at a point, for one sample, and hand the
numbers that the others need over as a vector (the tape); the second, almost all of them fused products and sums, are
evaluated for many directions in SIMD lanes, where a number of the tape is the same in all lanes. Source: A. Griewank,
A. Walther, Evaluating Derivatives (2008), ch. 3: vector forward mode.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank._codegen import operation_names
from bellcrank.codegen import cache as disk
from bellcrank.codegen.compile import Compiled, _serialized, sources
from bellcrank.codegen.expression_graph import Graph, graph_of
from bellcrank.codegen.locks import making

if TYPE_CHECKING:
    import casadi

_CODE = {name: k for k, name in enumerate(operation_names())}
_CONSTANT, _INPUT, _INVERSE, _PRODUCT, _QUOTIENT = (_CODE[name] for name in ("const", "input", "inv", "mul", "div"))


@dataclass(frozen=True)
class Directional:
    """The two functions of a directional derivative.

    Attributes:
        point: (inputs of the point) -> outputs at the point, and last the tape; for one sample.
        along: (tape, directions) -> the outputs along a direction; the kind "directions" of kernels.py.
    """

    point: Compiled
    along: Compiled


def directional(name: str, key: Sequence[str], build: Callable[[], casadi.Function], directions: int) -> Directional:
    """The derivative that `build` returns: its last inputs are `directions` vectors, its last output linear in them.

    The outputs before the last one must not depend on the directions. `key` must contain everything that `build`
    depends on. Where the machine code is cached, `build` is not called.
    """
    made: list[tuple[Graph, Graph]] = []

    def halves() -> tuple[Graph, Graph]:
        with making:
            if not made:
                made.append(separated(graph_of(_serialized(build())), directions))
            return made[0]

    recipe = disk.digest(name, *key, sources())
    return Directional(
        Compiled(f"{name} at a point", "recipe-" + disk.digest(recipe, "point"), lambda: halves()[0]),
        Compiled(f"{name} along", "recipe-" + disk.digest(recipe, "along"), lambda: halves()[1]),
    )


def separated(graph: Graph, directions: int) -> tuple[Graph, Graph]:
    """The graph of the point and that of the directions, which are the last inputs of `graph`."""
    first = len(graph.input_sizes) - directions
    point, along = _Half(), _Half()
    carries: list[bool] = []  # whether a node depends on a direction
    tape: dict[int, int] = {}  # the place of a node of `point` on the tape
    taped_nodes: dict[int, int] = {}  # and the input of `along` that reads it
    at_point: dict[int, int] = {}  # where a node of `graph` is in `point`
    on_way: dict[int, int] = {}  # and in `along`

    def read(node: int) -> int:
        """The node of `along` that has the value of a node of `graph`."""
        if node not in on_way:
            value = graph.value[node].item()
            if graph.op[node] == _CONSTANT:
                on_way[node] = along.add(_CONSTANT, (-1, -1, -1), value)
            else:
                on_way[node] = taped(at_point[node])
        return on_way[node]

    def of_point(node: int) -> int:
        """The node of `point` that has the value of a node of `graph`; constants are written where they are needed."""
        if node not in at_point:
            at_point[node] = point.add(_CONSTANT, (-1, -1, -1), graph.value[node].item())
        return at_point[node]

    def taped(node: int) -> int:
        """The input of `along` that has the value of a node of `point`."""
        if node not in taped_nodes:
            place = tape.setdefault(node, len(tape))
            taped_nodes[node] = along.add(_INPUT, (0, place, -1), 0.0)
        return taped_nodes[node]

    for node, (op, operands) in enumerate(zip(graph.op.tolist(), graph.operands.tolist(), strict=True)):
        if op == _INPUT:
            carries.append(operands[0] >= first)
            if carries[-1]:
                on_way[node] = along.add(op, (operands[0] - first + 1, operands[1], -1), 0.0)
            else:
                at_point[node] = point.add(op, tuple(operands), 0.0)
            continue
        used = [] if op == _CONSTANT else [a for a in operands if a >= 0]
        carries.append(any(carries[a] for a in used))
        if not carries[-1]:
            if op != _CONSTANT:
                mine = [of_point(a) for a in used] + [-1] * (3 - len(used))
                at_point[node] = point.add(op, tuple(mine), graph.value[node].item())
        elif op == _QUOTIENT and not carries[used[1]] and graph.op[used[1]] != _CONSTANT:
            inverse = point.inverse(at_point[used[1]])  # one division at the point, products along directions
            on_way[node] = along.add(_PRODUCT, (on_way[used[0]], taped(inverse), -1), 0.0)
        else:
            mine = [on_way[a] if carries[a] else read(a) for a in used] + [-1] * (3 - len(used))
            on_way[node] = along.add(op, tuple(mine), graph.value[node].item())
    *before, last = graph.outputs
    outputs = [
        (size, entries, np.array([of_point(n) for n in nodes], dtype=np.int32)) for size, entries, nodes in before
    ]
    linear = (last[0], last[1], np.array([on_way[n] if carries[n] else read(n) for n in last[2]], dtype=np.int32))
    places = np.arange(len(tape), dtype=np.int32)
    handed = (len(tape), places, np.array(list(tape), dtype=np.int32))
    return (
        point.graph((*outputs, handed), graph.input_sizes[:first]),
        along.graph((linear,), (len(tape), *graph.input_sizes[first:])),
    )


class _Half:
    """A graph that is being written."""

    def __init__(self) -> None:
        self.op: list[int] = []
        self.operands: list[tuple[int, ...]] = []
        self.value: list[float] = []
        self._inverses: dict[int, int] = {}

    def add(self, op: int, operands: tuple[int, ...], value: float) -> int:
        self.op.append(op)
        self.operands.append(operands)
        self.value.append(value)
        return len(self.op) - 1

    def inverse(self, node: int) -> int:
        if node not in self._inverses:
            self._inverses[node] = self.add(_INVERSE, (node, -1, -1), 0.0)
        return self._inverses[node]

    def graph(self, outputs: tuple[tuple[int, np.ndarray, np.ndarray], ...], inputs: tuple[int, ...]) -> Graph:
        return Graph(
            np.array(self.op, dtype=np.uint8),
            np.array(self.operands, dtype=np.int32).reshape(-1, 3),
            np.array(self.value),
            outputs,
            inputs,
        )
