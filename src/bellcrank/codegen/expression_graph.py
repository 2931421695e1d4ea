"""Expression graphs in single-assignment form: the input of the compiler."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank._codegen import ASSIGN, STORE, build, contract, operation_names
from bellcrank.arrays import Array
from bellcrank.codegen.tracer import extension
from bellcrank.errors import CompileError

LONG = 2_000  # operations; shorter code compiles in a tenth of a second
_NAMES = operation_names()
_SINES = [_NAMES.index(name) for name in ("sin", "cos")]
_UNKNOWN = -3  # an operation of casadi's that has no machine code
_LEAVES = [_NAMES.index(name) for name in ("const", "input")]


class Node(NamedTuple):
    """One operation: its name, the nodes it reads, and for constants and inputs its value or place."""

    op: str
    args: tuple[int, ...] = ()
    value: float = 0.0
    place: tuple[int, int] = (0, 0)  # inputs: (which input, which entry)


@dataclass(frozen=True, eq=False)
class Graph:
    """Nodes, of which each reads only earlier ones.

    Attributes:
        op: The operations (n) as indices of `_codegen.operation_names()`.
        operands: The nodes (n, 3) that each reads, -1 for none; for an input (which input, which entry).
        value: The values (n) of constants.
        outputs: For each output its size, and which entries are the values of which nodes; the others are zero.
        input_sizes: The sizes of the inputs.
        seldom: The function is called for some rows only, not at each step: a short compile time matters more.
    """

    op: NDArray[np.uint8]
    operands: NDArray[np.int32]
    value: Array
    outputs: tuple[tuple[int, NDArray[np.int32], NDArray[np.int32]], ...]
    input_sizes: tuple[int, ...]
    seldom: bool = False

    @property
    def is_long(self) -> bool:
        """Whether optimising the code takes long."""
        return self.operations > LONG

    @property
    def operations(self) -> int:
        """The number of operations; inputs and constants are not counted."""
        return int(np.count_nonzero(~np.isin(self.op, _LEAVES)))

    @property
    def flops(self) -> int:
        """The number of operations without sines and cosines."""
        return int(np.count_nonzero(~np.isin(self.op, _LEAVES + _SINES)))

    @property
    def nodes(self) -> tuple[Node, ...]:
        """The nodes one by one."""
        columns = zip(self.op.tolist(), self.operands.tolist(), self.value.tolist(), strict=True)
        return tuple(_node(_NAMES[op], operands, value) for op, operands, value in columns)

    def used_entries(self, which: int) -> set[int]:
        """The entries of an input that are read."""
        of_this = (self.op == _NAMES.index("input")) & (self.operands[:, 0] == which)
        return set(self.operands[of_this, 1].tolist())


def _node(op: str, operands: list[int], value: float) -> Node:
    if op == "const":
        return Node(op, value=value)
    if op == "input":
        return Node(op, place=(operands[0], operands[1]))
    return Node(op, tuple(a for a in operands if a >= 0))


@cache
def _codes() -> NDArray[np.int32]:
    """By casadi's code of an operation: ours, UNKNOWN for none."""
    names: dict[int, str] = extension().operations()
    codes = np.full(max(names) + 1, _UNKNOWN, dtype=np.int32)
    ours = {name: k for k, name in enumerate(_NAMES)} | {"assign": ASSIGN, "output": STORE}
    for code, name in names.items():
        codes[code] = ours.get(name, _UNKNOWN)
    return codes


def graph_of(serialized: bytes, seldom: bool = False) -> Graph:
    """Read a serialised casadi SX function; repeated constants, inputs and operations become one node.

    Several divisions by the same number become one reciprocal and products, which may differ from the quotients
    by one unit in the last place (and overflow where the divisor is subnormal); a single division stays one. Raises
    CompileError for an operation that has no machine code.
    """
    found, results, firsts, seconds, values, input_sizes, outs = extension().instructions(serialized)
    codes = _codes()
    known = np.where(found < len(codes), codes[np.minimum(found, len(codes) - 1)], _UNKNOWN)
    if np.any(known == _UNKNOWN):
        code = int(found[known == _UNKNOWN][0])
        raise CompileError(f"casadi's operation {code} cannot be compiled; write the expression without it")
    op, operands, value, outputs = build(known.astype(np.int32), results, firsts, seconds, values, outs)
    return Graph(op, operands, value, outputs, tuple(int(n) for n in input_sizes), seldom)


def contracted(graph: Graph) -> Graph:
    """The graph with each product that only one sum or difference reads contracted into it, as its code has it.

    Products and sums are contracted to fused multiply-adds "fma" a b + c, "fms" a b - c, and "fnma" c - a b once for a
    graph, so that its code gives the same results to the last bit at each of the optimiser's levels, however it is
    divided into functions, for one sample and for many.
    """
    op, operands, value, outputs = contract(graph)
    return replace(graph, op=op, operands=operands, value=value, outputs=outputs)
