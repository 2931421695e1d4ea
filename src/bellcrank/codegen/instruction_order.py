"""Orders of a graph's operations in which few values are live, so that fewer are spilled to memory.

Finding the best order is hard (register allocation with free order). Therefore some cheap orders are compared by how
many operands were last used long ago.
"""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heappop, heappush

from bellcrank.codegen.expression_graph import Graph

_REGISTERS, _NEAR = 32, 512  # values that fit in the registers, and in the first-level cache
_FAR_COST = 3  # cost of a value outside the first-level cache, in reloads from it (fitted to measured times)


def local_order(graph: Graph, operations: Sequence[int]) -> list[int]:
    """The operations (node indices, operands first) in an order in which values are used soon."""
    place = {index: i for i, index in enumerate(operations)}  # from here on operations go by their place
    reads = [[place[a] for a in dict.fromkeys(graph.nodes[index].args) if a in place] for index in operations]
    outputs = [place[n] for _, entries in graph.outputs for n in entries.values() if n in place]
    orders = [list(range(len(reads))), _depth_first(reads, outputs)]
    costs = [_cost(reads, order) for order in orders]
    if graph.soon_compiled:
        return [operations[i] for i in orders[costs.index(min(costs))]]
    base = orders[costs.index(min(costs))]
    orders += [_greedy(reads, base, newest_first=False), _greedy(reads, base, newest_first=True)]
    costs += [_cost(reads, order) for order in orders[2:]]
    return [operations[i] for i in orders[costs.index(min(costs))]]


def _cost(reads: list[list[int]], order: list[int]) -> int:
    """Reloads: operands last touched more operations ago than there are registers, or than the cache holds."""
    touched = [0] * len(reads)
    cost = 0
    for now, i in enumerate(order):
        for a in reads[i]:
            ago = now - touched[a]
            if ago > _REGISTERS:
                cost += _FAR_COST + 1 if ago > _NEAR else 1
            touched[a] = now
        touched[i] = now
    return cost


def _depth_first(reads: list[list[int]], outputs: list[int]) -> list[int]:
    """Each output's operations in turn, the last output's first; of an operation's operands the deepest first.

    The last outputs are a tree's leaves, which a recursion towards the root meets first.
    """
    depth = [0] * len(reads)
    for i, operands in enumerate(reads):
        if operands:
            depth[i] = 1 + max([depth[a] for a in operands])
    done = bytearray(len(reads))
    order = []
    stack = list(outputs)
    while stack:
        i = stack[-1]
        waiting = [] if done[i] else [a for a in reads[i] if not done[a]]
        if waiting:
            stack += sorted(waiting, key=depth.__getitem__)
            continue
        stack.pop()
        if not done[i]:
            done[i] = True
            order.append(i)
    return order


def _greedy(reads: list[list[int]], base: list[int], newest_first: bool) -> list[int]:
    """List scheduling: of the operations that are ready the one after which the fewest values wait.

    Ties go to the operation that became ready last, or to the first in the order `base`.
    """
    count = len(reads)
    readers: list[list[int]] = [[] for _ in reads]
    for i in base:
        for a in reads[i]:
            readers[a].append(i)
    missing = [len(operands) for operands in reads]  # operands yet to be computed
    waiting = [len(r) for r in readers]  # operations yet to read a value
    ties = [0] * count
    for position, i in enumerate(base):
        ties[i] = position
    valid = [0] * count  # an operation's present key in the heap, 0 for none
    ready: list[int] = []  # (values added, tie, operation), as one number
    turn = 9 * count
    unit = 10 * count

    def offer(i: int) -> None:
        nonlocal turn
        added = 3 if readers[i] else 2
        for a in reads[i]:
            if waiting[a] == 1:
                added -= 1
        turn -= 1
        key = (added * unit + (turn if newest_first else ties[i])) * count + i
        valid[i] = key
        heappush(ready, key)

    for i in base:
        if not missing[i]:
            offer(i)
    order = []
    while ready:
        key = heappop(ready)
        i = key % count
        if valid[i] != key:
            continue
        valid[i] = 0
        order.append(i)
        for a in reads[i]:
            waiting[a] -= 1
            if waiting[a] == 1:
                for other in readers[a]:
                    if valid[other]:
                        offer(other)
        for other in readers[i]:
            missing[other] -= 1
            if not missing[other]:
                offer(other)
    return order
