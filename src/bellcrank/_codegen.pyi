"""Expression graphs from casadi's instructions, and their code in LLVM IR (src/cpp/codegen)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen.expression_graph import Graph
from bellcrank.codegen.llvm_ir import Limits

CASADI_VERSION: str
"""The version of casadi whose headers and library the tracer `_trace` was built with."""
ASSIGN: int
STORE: int

def operation_names() -> list[str]:
    """By an operation's number, its name in casadi."""

_Arrays = tuple[
    NDArray[np.uint8],
    NDArray[np.int32],
    NDArray[np.float64],
    tuple[tuple[int, NDArray[np.int32], NDArray[np.int32]], ...],
]

def build(
    op: NDArray[np.int32],
    result: NDArray[np.int32],
    first: NDArray[np.int32],
    second: NDArray[np.int32],
    constant: NDArray[np.float64],
    outputs: Sequence[tuple[int, NDArray[np.int64]]],
) -> _Arrays:
    """The graph of a function's instructions: operations, operands, values and outputs."""

def contract(graph: Graph) -> _Arrays:
    """The same of the graph with products contracted into sums."""

def write(
    graph: Graph,
    limits: Limits,
    width: int,
    fused: bool,
    packed: int,
    load: str,
    store: str,
    pointers: list[str],
    sine_codes: dict[int, tuple[str, str, str, str]],
) -> tuple[str, list[str], str, str, set[str]]:
    """Lines of `evaluate`, its allocas, the basic block that ends them, functions before it, C functions they call."""

def schedule(graph: Graph, limits: Limits) -> tuple[list[list[int]], list[list[int]], list[int], int, bool]:
    """The steps of each function, the angles of each wave, the slots by node (-1 for none), their number; joined."""
