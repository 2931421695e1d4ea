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
from bellcrank.robot.elimination import Factorisation
from bellcrank.robot.equations import Equations

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
