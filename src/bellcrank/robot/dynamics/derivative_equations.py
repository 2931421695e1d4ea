"""Derivatives of a robot's dynamics as casadi expressions, before they are compiled.

Derivatives by position are in the tangent space: column k is the derivative along δ_k of the position q ⊕ δ, which the
velocity δ, held for one second, reaches from q: dq/dδ = E(q) at δ = 0 (`configuration_rate`). For joints of one degree
of freedom this is the plain derivative by q; for a free base δ is a displacement and a rotation vector in the base's
own axes. Matrices leave the functions row by row.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bellcrank.codegen.expression_graph import graph_of
from bellcrank.robot.dynamics.equations import Equations

if TYPE_CHECKING:
    import casadi

LARGEST_PLAIN = 12  # degrees of freedom up to which plain differentiation may take fewer operations


@dataclass(frozen=True)
class DerivativeEquations:
    """Derivatives of these equations."""

    equations: Equations

    def inverse_dynamics(self) -> casadi.Function:
        """(q, v, a) -> ∂tau/∂q, ∂tau/∂v, M (nv × nv each, row by row, sparse), with friction."""
        import casadi

        q, v, a = self._symbols("a")
        by_q, by_v, mass = self._newton_euler()(q, v, a)
        by_v += casadi.jacobian(self.equations.friction(v), v)
        return casadi.Function("inverse_dynamics_derivatives", [q, v, a], [_rows(x) for x in (by_q, by_v, mass)])

    def forward_dynamics(self) -> casadi.Function:
        """(q, v, tau) -> ∂a/∂q, ∂a/∂v, M⁻¹ (nv × nv each, row by row), with friction.

        M a + h(q, v) = tau differentiated at fixed tau: M ∂a/∂x = −∂tau/∂x, the latter at the acceleration a that tau
        causes. Source: Carpentier & Mansard, Analytical Derivatives of Rigid Body Dynamics Algorithms, RSS 2018.
        """
        import casadi

        q, v, tau = self._symbols("tau")
        derivatives = self._newton_euler()
        rest = casadi.SX(v.size1(), 1)
        solver = Factorisation.of(derivatives(q, v, rest)[2])
        friction = self.equations.friction(v)
        bias = self.equations.algorithm("inverse_dynamics")(q, v, rest, casadi.SX(0, 1)) + friction
        by_q, by_v, _ = derivatives(q, v, solver.solve(tau - bias))
        by_v += casadi.jacobian(friction, v)
        inverse = solver.inverse()
        found = [solver.solve(by_q, -1.0), solver.solve(by_v, -1.0), inverse]
        return casadi.Function("forward_dynamics_derivatives", [q, v, tau], [_rows(x) for x in found])

    def _newton_euler(self) -> casadi.Function:
        """(q, v, a) -> ∂tau/∂q, ∂tau/∂v, M without friction: of two ways that of the fewest operations."""
        if self.equations.velocities > LARGEST_PLAIN:
            return self._recursive()
        return min((self._recursive(), self._plain()), key=_operations)

    def _recursive(self) -> casadi.Function:
        import casadi

        traced = self.equations.algorithm("inverse_dynamics_derivatives")
        q, v, a = self._symbols("a")
        return casadi.Function("recursive", [q, v, a], list(traced.call([q, v, a, casadi.SX(0, 1)])))

    def _plain(self) -> casadi.Function:
        """By differentiating the expressions of the recursive Newton-Euler algorithm; M by composite bodies."""
        import casadi

        q, v, a = self._symbols("a")
        none = casadi.SX(0, 1)
        tau = self.equations.algorithm("inverse_dynamics")(q, v, a, none)
        rate = casadi.jacobian(self.equations.algorithm("configuration_rate")(q, v), v)
        mass = self.equations.algorithm("mass_matrix")(q, none)
        nv = v.size1()
        by_q = casadi.jacobian(tau, q) @ rate
        return casadi.Function(
            "plain", [q, v, a], [by_q, casadi.jacobian(tau, v), casadi.sparsify(casadi.reshape(mass, nv, nv))]
        )

    def _symbols(self, third: str) -> tuple[casadi.SX, casadi.SX, casadi.SX]:
        import casadi

        nv = self.equations.velocities
        return casadi.SX.sym("q", self.equations.positions), casadi.SX.sym("v", nv), casadi.SX.sym(third, nv)


def _rows(matrix: casadi.SX) -> casadi.SX:
    import casadi

    return casadi.vec(matrix.T)


def _operations(function: casadi.Function) -> int:
    return graph_of(function.serialize().encode("latin-1")).operations


# ---- Linear equations with a sparse symmetric positive matrix of expressions, such as the mass matrix of a tree.
#
# A = Lᵀ D L with a unit lower triangle L, from the last row to the first. For the mass matrix of a tree, L has
# entries only where A has: those of a joint's row are at the joints that carry it. Right-hand sides may be sparse
# too. Source: the LTDL factorisation, Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 6.5.


@dataclass(frozen=True)
class Factorisation:
    """The entries of L below its diagonal, row by row and by column, and 1 / D."""

    lower: list[dict[int, casadi.SX]]
    reciprocal: list[casadi.SX]

    @classmethod
    def of(cls, matrix: casadi.SX) -> Factorisation:
        """The factors of a symmetric matrix, of which the lower triangle is read."""
        import casadi

        rows = casadi.vertsplit(casadi.tril(matrix))
        lower: list[dict[int, casadi.SX]] = [{} for _ in rows]
        reciprocal: list[casadi.SX] = [casadi.SX(0)] * len(rows)
        for k in range(len(rows) - 1, -1, -1):
            reciprocal[k] = 1.0 / casadi.densify(rows[k][k])  # infinite where there is no inertia
            left = rows[k][:k]
            for i in left.sparsity().get_triplet()[1]:
                lower[k][i] = left[i] * reciprocal[k]
                rows[i] = rows[i] - lower[k][i] * rows[k] * _up_to(i, len(rows))
        return cls(lower, reciprocal)

    def solve(self, right: casadi.SX, sign: float = 1.0) -> casadi.SX:
        """A⁻¹ B, or −A⁻¹ B for a sign of −1; sparse where it is zero."""
        import casadi

        rows = casadi.vertsplit(right)
        for k in range(len(rows) - 1, -1, -1):
            for i, factor in self.lower[k].items():
                rows[i] = rows[i] - factor * rows[k]
        for k, factors in enumerate(self.lower):
            rows[k] = rows[k] * (sign * self.reciprocal[k])
            for i, factor in factors.items():
                rows[k] = rows[k] - factor * rows[i]
        return casadi.vertcat(*rows)

    def inverse(self) -> casadi.SX:
        """A⁻¹, from L A⁻¹ = D⁻¹ L⁻ᵀ, whose right-hand side is an upper triangle with the diagonal D⁻¹."""
        import casadi

        size = len(self.lower)
        found = casadi.SX(size, size)
        for k, factors in enumerate(self.lower):
            row = casadi.SX(1, k)
            for i, factor in factors.items():
                row = row - factor * found[i, :k]
            found[k, :k] = row
            found[:k, k] = row.T
            found[k, k] = self.reciprocal[k] - sum(factor * row[i] for i, factor in factors.items())
        return found


def _up_to(last: int, width: int) -> casadi.DM:
    """A sparse row of ones in the columns from 0 to `last`."""
    import casadi

    return casadi.DM(casadi.Sparsity.triplet(1, width, [0] * (last + 1), list(range(last + 1))))
