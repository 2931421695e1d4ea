"""The constrained equations of motion, solved as expressions by a sparse factorisation, and for numbers.

With the Jacobian J and drift γ of the constraints (constraint_derivatives.py),

    M v̇ = f + Jᵀ λ,    J v̇ = −γ − 2 α (φ̇, ψ) − β² (φ, 0),

α and β being Baumgarte's gains (0 without them). This is the Karush-Kuhn-Tucker (KKT) system

    [ M   Jᵀ ] [  a ]   [ f ]
    [ J  −μI ] [ −λ ] = [ b ]

M is positive definite and J has the constraints as rows. L D Lᵀ without pivoting exists in every order that eliminates
a constraint after the coordinates it depends on: then each leading block is [M_VV, J_CVᵀ; J_CV, −μI] with J_CV of full
rank. Of those orders, one of minimum degree keeps the factor sparse, so that the number of operations of a chain of
loops is proportional to its length.

Sources: J. Baumgarte, Comput. Methods Appl. Mech. Eng. 1 (1972); A. Ghosal, NPTEL 2022, lecture 18; Golub & Van Loan,
Matrix Computations, 4th ed., 4.1 and 4.4; minimum degree by Tinney & Walker, Proc. IEEE 55 (1967).

For numbers, where M need not be regular, only Zᵀ M Z, and without gains and μ,

    [ M   Jᵀ ] [  a ]   [ f ]
    [ J   0  ] [ −λ ] = [ b ]

With the singular value decomposition J = U Σ Vᵀ of rank r, V = (Y, Z): a = J⁺ b + Z z, where Zᵀ M Z z = Zᵀ (f − M J⁺
b), and λ = (Jᵀ)⁺ (M a − f), the smallest of all λ that fit. This is the null-space method: Nocedal & Wright, Numerical
Optimization, 2nd ed., 16.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from typing import TYPE_CHECKING, Self

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.errors import InputError
from bellcrank.numerics import checked, svd

if TYPE_CHECKING:
    import casadi

    from bellcrank.dynamics.constraints.constraint_derivatives import ConstraintDerivatives


Pattern = Mask
REFINEMENTS = 3  # passes of the proximal solve after the first; the error that they leave in a regular row is μ⁴
PROJECTING = 1  # the same for projections, whose corrections are small
REGULARISATION = 1e-9  # μ, as a share of a row's J M⁻¹ Jᵀ
LEAST = 1e-14  # the same at rest where the row vanishes
NEAR_SINGULAR = 1e-4  # a pivot below this share of its usual value calls for the proximal solve
SINGULAR = 1e-8  # of the largest singular value of J: a smaller one counts as 0, as in mobility.py
MASSLESS = 1e-13  # of the largest eigenvalue of the reduced mass matrix


class Factor:
    """L D Lᵀ of the KKT system as expressions; `mu` (m) regularises the rows of J, zero for none."""

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
        """Accelerations a (n) and multipliers λ (m) for the right-hand sides f (n) and b (m)."""
        import casadi

        both = casadi.vertcat(force, right)
        x = casadi.ldl_solve(both[self.order], self.pivots, self._lower, list(range(self.n + self.m)))
        x = x[np.argsort(self.order).tolist()]
        return x[: self.n], -x[self.n :]

    def slack(self, least: casadi.SX) -> casadi.SX:
        """The smallest excess, at most 1, of a row's pivot over its bound in `least` (m); valid while positive."""
        import casadi

        slack = casadi.SX(1.0)
        for place, k in enumerate(self.order):
            if k >= self.n:
                slack = casadi.fmin(slack, -self.pivots[place] - least[k - self.n])
        return slack


@dataclass(frozen=True)
class KktSolution:
    """One solution of the KKT system: v̇ (nv), λ (rows), and the projection onto the constraints by the same factor.

    The projection is a displacement (nv) of the position and a change (nv) of the velocity; see `projection`.
    """

    acceleration: casadi.SX
    multipliers: casadi.SX
    displacement: casadi.SX
    velocity_change: casadi.SX


@dataclass(frozen=True)
class ConstrainedSolution:
    """The accelerations and multipliers of constrained equations of motion, solved in two ways.

    The proximal solution holds also where rows depend on each other, or nearly, and has the minimum-norm multipliers in
    the metric of the rows' own scale. The plain solution costs less and holds while `guard` is positive.
    `event_multipliers` are those of a single pass of the proximal solve: relative error 1e-9, for events and outputs
    that are evaluated at every step.
    """

    derivatives: ConstraintDerivatives
    mass: casadi.SX
    proximal: KktSolution
    plain: KktSolution
    guard: casadi.SX
    event_multipliers: casadi.SX
    plain_factor: Factor
    proximal_factor: Factor


def solve_constrained(
    mass: casadi.SX, derivatives: ConstraintDerivatives, force: casadi.SX, gains: casadi.SX, share: casadi.SX
) -> ConstrainedSolution:
    """Solve the constrained equations of motion.

    `force` is f (nv). `gains` is (α, β), or empty without Baumgarte's terms. `share` is μ as a share of a row's usual
    J M⁻¹ Jᵀ; it is a parameter of the equations, so that two runs show its effect.

    Where M is singular, M + Jᵀ W J replaces it and f + Jᵀ W J v̇ replaces f, with W the inverse of the usual J M⁻¹ Jᵀ.
    This changes neither v̇ nor λ.
    """
    import casadi

    jacobian, usual = derivatives.jacobian, derivatives.rows.scale
    alpha, beta = casadi.vertsplit(gains) if gains.numel() else (0.0, 0.0)
    right = derivatives.required_acceleration(alpha, beta)
    if derivatives.rows.singular:
        weighted = jacobian.T @ casadi.diag(1.0 / usual)
        mass, force = casadi.sparsify(mass + weighted @ jacobian), force + weighted @ right
    plain = Factor(mass, jacobian, casadi.SX(jacobian.size1(), 1))
    regular = Factor(mass, jacobian, regularisation(mass, derivatives, share))
    return ConstrainedSolution(
        derivatives=derivatives,
        mass=mass,
        proximal=KktSolution(
            *proximal(regular, force, right, REFINEMENTS), *projection(regular, derivatives, PROJECTING)
        ),
        plain=KktSolution(*plain.solve(force, right), *projection(plain, derivatives, 0)),
        guard=plain.slack(NEAR_SINGULAR * usual),
        event_multipliers=regular.solve(force, right)[1],
        plain_factor=plain,
        proximal_factor=regular,
    )


def proximal(factor: Factor, force: casadi.SX, right: casadi.SX, refinements: int) -> tuple[casadi.SX, casadi.SX]:
    """a (n) and λ (m) of the system without μ, by repeated solves with the factor that has it.

    Each pass solves for the remainder of b − J a, which is the method of multipliers: for redundant rows λ converges to
    the minimum-norm solution in the metric of μ, and a to the unique one. Source: Carpentier, Budhiraja & Mansard,
    Proximal and sparse resolution of constrained dynamic equations, RSS 2021.
    """
    import casadi

    a, multiplier = factor.solve(force, right)
    for _ in range(refinements):
        correction, more = factor.solve(casadi.SX(factor.n, 1), right - factor.jacobian @ a)
        a, multiplier = a + correction, multiplier + more
    return a, multiplier


def projection(factor: Factor, derivatives: ConstraintDerivatives, refinements: int) -> tuple[casadi.SX, casadi.SX]:
    """A displacement (nv) and a change of v (nv) that take φ, φ̇ and ψ to 0 to first order, both with one factor.

    Each is the smallest that does so in the metric of M; the displacement also satisfies the non-holonomic rows, so
    that a wheel rolls where it is moved. This is Newton's method on (φ, φ̇, ψ) as a function of q and v: as the
    derivative by q is included, the remainder is of second order in both. Source: Hairer & Wanner, Solving ODEs II,
    VII.2.
    """
    import casadi

    no_force = casadi.SX(factor.n, 1)
    step = proximal(factor, no_force, -derivatives.padded_position_residual, refinements)[0]
    change = casadi.substitute(derivatives.velocity_change, derivatives.step, step)
    return step, proximal(factor, no_force, -derivatives.velocity_residual - change, refinements)[0]


def regularisation(mass: casadi.SX, derivatives: ConstraintDerivatives, share: casadi.SX) -> casadi.SX:
    """μ (rows): a share of each row's usual J M⁻¹ Jᵀ; less where the row of J is small, unless the mechanism moves.

    At distance x from a posture in which J loses rank (a linkage that lies flat loses whole rows) the equations at rest
    are as accurate as elsewhere, but a motion at speed w amplifies rounding by w/x². There, a share of the usual value
    bounds the amplification, and inertia carries the motion through. w² is about the usual value times twice the
    kinetic energy; one characteristic length per second, or 1 rad/s, counts as moving.
    """
    import casadi

    rows = derivatives.rows
    now = (derivatives.jacobian * derivatives.jacobian) @ (rows.columns * rows.columns) / rows.square
    speed = rows.scale * casadi.dot(derivatives.v, mass @ derivatives.v) / (rows.unit * rows.unit)
    return rows.scale * (share * (now + speed / (1.0 + speed)) + LEAST)


def elimination_order(mass: Pattern, jacobian: Pattern) -> list[int]:
    """Coordinates 0 … n−1 and constraints n … n+m−1 by minimum degree, each constraint after its coordinates."""
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
    ready = [
        (len(near[k]), k) for k in range(n + m) if not waits[k]
    ]  # may hold outdated degrees beside the current ones
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


@dataclass(frozen=True, eq=False, kw_only=True)
class KktSolver:
    """The factors of one system.

    Attributes:
        mass: M (nv, nv).
        free: Z (nv, nv − r): the velocities that the constraints allow.
        inverse: The pseudo-inverse J⁺ (nv, m), small singular values cut off.
        dual_inverse: (Jᵀ)⁺ (m, nv), minimum-norm in the metric of the rows' usual size.
        rank: r.
    """

    mass: Array
    free: Array
    inverse: Array
    dual_inverse: Array
    rank: int

    @classmethod
    def of(cls, mass: Array, jacobian: Array, size: Array, unit: Array) -> Self:
        """Factorise. `size` (m) is the usual size of each row, `unit` (nv) the unit of each velocity.

        Raises InputError where a motion that the constraints allow moves no mass.
        """
        scaled = jacobian / size[:, None] * unit
        left, values, right = svd(scaled, "the derivative of the constraints is")
        rank = int(np.count_nonzero(values > SINGULAR * values.max(initial=0.0)))
        kept = (right[:rank].T / values[:rank]) @ left[:, :rank].T  # of the scaled J
        free = unit[:, None] * right[rank:].T
        reduced = free.T @ checked(mass, "the mass matrix is") @ free
        least = np.linalg.eigvalsh(reduced)
        if least.size and least[0] <= MASSLESS * least[-1]:
            raise InputError("the mass matrix is singular: a motion that the constraints allow has no inertia")
        return cls(
            mass=mass,
            free=free,
            inverse=unit[:, None] * kept / size,
            dual_inverse=(unit[:, None] * kept / size).T,
            rank=rank,
        )

    def solve(self, force: Array, right: Array) -> tuple[Array, Array]:
        """Accelerations a (nv, …) and multipliers λ (m, …) for f (nv, …) and b (m, …)."""
        start = self.inverse @ right
        if self.free.shape[1]:
            reduced = self.free.T @ self.mass @ self.free
            start = start + self.free @ np.linalg.solve(reduced, self.free.T @ (force - self.mass @ start))
        return start, self.dual_inverse @ (self.mass @ start - force)
