"""The order in which a graph's operations are written, and the division of large graphs into functions.

LLVM's time grows faster than the length of straight-line code: 13,000 operations take 0.8 s and 37,000 4 s in one
function, 1.7 s in functions of 400. Therefore long code is divided. But values passed between functions cost time at
every call, 15 % for 13,000 operations of a humanoid in eight lanes. Therefore the optimiser joins the functions again
(`joined`), unless the code is very long, or so many values are live at once that they are in memory anyway: forty loops
of four bars, 9,000 operations, then take half the time to compile, and a tenth less to run.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterable
from dataclasses import dataclass

from bellcrank.codegen.expression_graph import Graph
from bellcrank.codegen.instruction_order import local_order

PART = 400  # operations per function of a divided graph
WHOLE = 16_000  # the most operations that the optimiser joins
WAITING = 750  # the most live values in functions that it joins


@dataclass(frozen=True)
class Wave:
    """Angles whose sines and cosines are computed together."""

    angles: tuple[int, ...]


Step = int | Wave  # an operation, as the index of its node, or a wave


@dataclass(frozen=True)
class Schedule:
    """The steps of each function, and the memory slots in which values are passed to later functions.

    `slots` has the nodes that are passed; nodes share a slot if the last function that reads one comes before the
    function that writes the next. `sines[angle]` has the nodes of its sine and cosine, -1 for none;
    `places[node]` has the outputs (which, entry) that a node is. `joined`: optimised code is one function.
    """

    parts: tuple[tuple[Step, ...], ...]
    slots: dict[int, int]
    memory: int
    sines: dict[int, tuple[int, int]]
    places: dict[int, list[tuple[int, int]]]
    joined: bool


def schedule(graph: Graph) -> Schedule:
    """The order of a graph's operations: sines in waves as early as possible, the rest so that few values are live."""
    sines = _sines(graph)
    steps = _steps(graph, sines)
    count = -(-len(steps) // PART) if graph.is_long or len(steps) > WHOLE else 1
    cuts = [len(steps) * k // count for k in range(count + 1)]
    parts = tuple(tuple(steps[a:b]) for a, b in itertools.pairwise(cuts))
    slots, memory = _slots(graph, parts, sines)
    joined = not graph.soon_compiled and len(steps) <= WHOLE and memory <= WAITING
    places: dict[int, list[tuple[int, int]]] = {}
    for k, (_, entries) in enumerate(graph.outputs):
        for i, node in entries.items():
            places.setdefault(node, []).append((k, i))
    return Schedule(parts, slots, memory, sines, places, joined)


def _sines(graph: Graph) -> dict[int, tuple[int, int]]:
    found: dict[int, list[int]] = {}
    for index, node in enumerate(graph.nodes):
        if node.op in ("sin", "cos"):
            found.setdefault(node.args[0], [-1, -1])[node.op == "cos"] = index
    return {angle: (s, c) for angle, (s, c) in found.items()}


def _steps(graph: Graph, sines: dict[int, tuple[int, int]]) -> list[Step]:
    nodes = graph.nodes
    done = bytearray(len(nodes))
    steps: list[Step] = []
    for wave in _waves(graph):
        steps += _ancestors(graph, wave, done)
        steps.append(Wave(tuple(wave)))
        for angle in wave:
            for index in sines[angle]:
                if index >= 0:
                    done[index] = True
    rest = _ancestors(graph, [n for _, entries in graph.outputs for n in entries.values()], done)
    return steps + local_order(graph, rest)


def _waves(graph: Graph) -> list[list[int]]:
    """The angles whose sine or cosine is taken, grouped by how many sines deep they lie."""
    depth = [0] * len(graph.nodes)
    waves: list[dict[int, None]] = []
    for index, node in enumerate(graph.nodes):
        below = max([depth[a] for a in node.args], default=0)
        if node.op in ("sin", "cos"):
            if len(waves) <= below:
                waves.append({})
            waves[below][node.args[0]] = None
            below += 1
        depth[index] = below
    return [list(wave) for wave in waves]


def _ancestors(graph: Graph, roots: Iterable[int], done: bytearray) -> list[int]:
    """The operations that the roots need and that are not done yet, in the graph's order; marks them as done."""
    found = []
    stack = list(roots)
    while stack:
        index = stack.pop()
        if not done[index]:
            done[index] = True
            node = graph.nodes[index]
            if node.args:
                found.append(index)
                stack += node.args
    return sorted(found)


def reads(graph: Graph, step: Step) -> tuple[int, ...]:
    """The nodes that a step reads."""
    return step.angles if isinstance(step, Wave) else graph.nodes[step].args


def _slots(
    graph: Graph, parts: tuple[tuple[Step, ...], ...], sines: dict[int, tuple[int, int]]
) -> tuple[dict[int, int], int]:
    made: dict[int, int] = {}  # node -> the part that computes it
    last: dict[int, int] = {}  # node -> the last later part that reads it
    for k, part in enumerate(parts):
        for step in part:
            for a in reads(graph, step):
                if made.get(a, k) < k:
                    last[a] = k
            for index in [i for a in step.angles for i in sines[a]] if isinstance(step, Wave) else [step]:
                made[index] = k
    ending: list[list[int]] = [[] for _ in parts]
    for index, k in last.items():
        ending[k].append(index)
    begins: list[list[int]] = [[] for _ in parts]
    for index in last:
        begins[made[index]].append(index)
    slots: dict[int, int] = {}
    free: list[int] = []
    memory = 0
    for k in range(len(parts)):
        for index in sorted(begins[k]):
            if not free:
                free.append(memory)
                memory += 1
            slots[index] = heapq.heappop(free)
        for index in ending[k]:  # free from the next part on
            heapq.heappush(free, slots[index])
    return slots, memory
