"""The division of large graphs into functions, and the order in which their operations are written.

LLVM's time grows faster than the length of straight-line code: 13,000 operations take 0.8 s and 37,000 4 s in one
function, 1.7 s in functions of 400. Therefore long code is divided. But values passed between functions cost time at
every call, 15 % for 13,000 operations of a humanoid in eight lanes. Therefore the optimiser joins the functions again
(`joined`), unless the code is very long, or so many values are live at once that they are in memory anyway: forty loops
of four bars, 9,000 operations, then take half the time to compile, and a tenth less to run.

Code of a chain's bodies or of a row of linkages repeats itself: there, loops take the place of straight code, with the
same results to the last bit (src/cpp/codegen/rolled_plan.hpp). Their length, and so the time to compile, hardly grows
with the number of bodies; a chain of 100 spatial joints then also runs a sixth faster.

Sines are computed together in waves as early as possible, the rest in an order in which few values are live
(src/cpp/codegen/schedule.hpp, instruction_order.hpp).
"""

from __future__ import annotations

from dataclasses import dataclass

from bellcrank._codegen import schedule as divided
from bellcrank.codegen.expression_graph import LONG, Graph

PART = 400  # operations per function of a divided graph
WHOLE = 16_000  # the most operations that the optimiser joins
WAITING = 750  # the most live values in functions that it joins
ROLLED = 3_000  # operations from which on repetitions are written as loops


@dataclass(frozen=True)
class Limits:
    """How a graph is divided: the constants above, that of long code, and whether it is called for some rows only."""

    whole: int
    part: int
    waiting: int
    rolled: int
    lengthy: int
    seldom: bool


def limits_of(graph: Graph) -> Limits:
    """The limits for a graph."""
    return Limits(WHOLE, PART, WAITING, ROLLED, LONG, graph.seldom)


@dataclass(frozen=True)
class Schedule:
    """The steps of each function, and the memory slots in which values are passed to later functions.

    A step is a node, or -1 - w for wave w: angles whose sines and cosines are computed together. `slots` has the nodes
    that are passed; nodes share a slot if the last function that reads one comes before the function that writes the
    next. `joined`: optimised code is one function.
    """

    parts: tuple[tuple[int, ...], ...]
    waves: tuple[tuple[int, ...], ...]
    slots: dict[int, int]
    memory: int
    joined: bool


def schedule(graph: Graph) -> Schedule:
    """The straight-line code of a graph as it is divided and ordered."""
    parts, waves, slots, memory, joined = divided(graph, limits_of(graph))
    return Schedule(
        tuple(tuple(part) for part in parts),
        tuple(tuple(wave) for wave in waves),
        {node: slot for node, slot in enumerate(slots) if slot >= 0},
        memory,
        joined,
    )
