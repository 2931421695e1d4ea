"""The linear system of constrained dynamics, factorised as straight-line expressions.

    [ M   Jᵀ ] [  a ]   [ f ]
    [ J  −μI ] [ −λ ] = [ b ]

M is positive definite and J has the constraints as rows. L D Lᵀ without pivoting exists in every order that eliminates
a constraint after the coordinates it touches: then each leading block is [M_VV, J_CVᵀ; J_CV, −μI] with J_CV of full
rank. Among those orders one of least degree keeps the factor sparse, so that a chain of loops costs a number of
operations proportional to its length. Sources: Golub & Van Loan, Matrix Computations, 4th ed., 4.1 and 4.4; minimum
degree by Tinney & Walker, Proc. IEEE 55 (1967).
"""

from __future__ import annotations

from heapq import heapify, heappop, heappush
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import casadi

Pattern = NDArray[np.bool_]


class Factor:
    """L D Lᵀ of the system above, as expressions; `mu` (m) regularises the rows of J, zero for none."""

    def __init__(self, mass: casadi.SX, jacobian: casadi.SX, mu: casadi.SX) -> None:
        import casadi

        self.n, self.m = mass.size1(), jacobian.size1()
        self.mass, self.jacobian = mass, jacobian
        matrix = casadi.vertcat(
            casadi.horzcat(mass, jacobian.T), casadi.horzcat(jacobian, casadi.sparsify(casadi.diag(-mu)))
        )
        self.order = elimination_order(_pattern(mass), _pattern(jacobian))
        self.pivots, self._lower, _ = casadi.ldl(matrix[self.order, self.order], False)

    def solve(self, force: casadi.SX, right: casadi.SX) -> tuple[casadi.SX, casadi.SX]:
        """a (n) and λ (m) for the right-hand sides f (n) and b (m)."""
        import casadi

        both = casadi.vertcat(force, right)
        x = casadi.ldl_solve(both[self.order], self.pivots, self._lower, list(range(self.n + self.m)))
        x = x[np.argsort(self.order).tolist()]
        return x[: self.n], -x[self.n :]

    def slack(self, least: casadi.SX) -> casadi.SX:
        """The smallest excess, up to 1, of a row's pivot over its `least` (m); the factor is good while positive."""
        import casadi

        slack = casadi.SX(1.0)
        for place, k in enumerate(self.order):
            if k >= self.n:
                slack = casadi.fmin(slack, -self.pivots[place] - least[k - self.n])
        return slack


def proximal(factor: Factor, force: casadi.SX, right: casadi.SX, refinements: int) -> tuple[casadi.SX, casadi.SX]:
    """a and λ of the system without μ, by solves with the factor that has it.

    Each pass solves for what is left of b − J a, which is the method of multipliers: for redundant rows λ converges to
    its least-norm solution in the metric of μ, and a to the one there is. Source: Carpentier, Budhiraja & Mansard,
    Proximal and sparse resolution of constrained dynamic equations, RSS 2021.
    """
    import casadi

    a, multiplier = factor.solve(force, right)
    for _ in range(refinements):
        correction, more = factor.solve(casadi.SX(factor.n, 1), right - factor.jacobian @ a)
        a, multiplier = a + correction, multiplier + more
    return a, multiplier


def elimination_order(mass: Pattern, jacobian: Pattern) -> list[int]:
    """Coordinates 0 … n−1 and constraints n … n+m−1 by least degree, each constraint after its coordinates."""
    n, m = mass.shape[0], jacobian.shape[0]
    near: list[set[int]] = [set() for _ in range(n + m)]
    waits: list[set[int]] = [set() for _ in range(n + m)]
    for i, j in zip(*np.nonzero(mass), strict=True):
        if i != j:
            near[i].add(int(j))
    for i, j in zip(*np.nonzero(jacobian), strict=True):
        near[n + i].add(int(j))
        near[j].add(n + int(i))
        waits[n + i].add(int(j))
    ready = [(len(near[k]), k) for k in range(n + m) if not waits[k]]  # may hold outdated sizes beside the right ones
    heapify(ready)
    done = np.zeros(n + m, dtype=bool)
    order: list[int] = []
    while ready:
        size, k = heappop(ready)
        if done[k] or size != len(near[k]):
            continue
        done[k] = True
        order.append(k)
        for a in near[k]:
            near[a].discard(k)
            near[a] |= near[k] - {a}
            waits[a].discard(k)
            if not waits[a]:
                heappush(ready, (len(near[a]), a))
    return order


def _pattern(matrix: casadi.SX) -> Pattern:
    rows, columns = matrix.sparsity().get_triplet()
    pattern = np.zeros(matrix.shape, dtype=bool)
    pattern[rows, columns] = True
    return pattern
