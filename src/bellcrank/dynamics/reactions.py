"""What constraints do, as expressions for outputs and events: their multipliers, and how near to singular they are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from bellcrank.dynamics.kkt import Factor
from bellcrank.elements.constraint import Constraint

if TYPE_CHECKING:
    import casadi

    from bellcrank.dynamics.constraint_derivatives import Solution
    from bellcrank.elements.symbols import Symbols

PASSES: Final = 6  # of the power iterations
FLOOR: Final = 1e-12  # regularisation of the inverse iteration, as a share of a row's usual J M⁻¹ Jᵀ


class Reactions:
    """The multipliers of a scene's constraints, N or N m, by the constraint's name."""

    def __init__(
        self, constraints: Sequence[Constraint], solution: Solution, multipliers: casadi.SX, s: Symbols
    ) -> None:
        self._solution, self._multipliers = solution, multipliers
        self._rows = constraint_rows(constraints, s)

    def of(self, name: str) -> casadi.SX:
        """The multipliers of one constraint in the order of its labels; 0 for rows that were dropped."""
        import casadi

        place = {row: k for k, row in enumerate(self._solution.closed.kept)}
        return casadi.vertcat(*[self._multipliers[place[r]] if r in place else casadi.SX(0) for r in self._rows[name]])

    @property
    def closeness(self) -> casadi.SX:
        """σ_min/σ_max of J M⁻¹ᐟ², the closures' Jacobian in the metric of the mass matrix, lengths counted in the
        mechanism's own; 1 for a single row.

        S = J M⁻¹ Jᵀ has the squares as eigenvalues. Power iterations with S and with (S + εD)⁻¹, D its diagonal by M's,
        give them as Rayleigh quotients: near a singular position the inverse one converges at once; where the two
        smallest are alike the value is a bound from above, and ε ends it at about 1e-6. Source: Golub & Van Loan,
        Matrix Computations, 4th ed., 8.2.
        """
        import casadi

        c, mass = self._solution.closed, self._solution.mass
        m, unit = c.jacobian.size1(), c.rows.unit
        jacobian = casadi.sparsify(casadi.diag(1.0 / unit)) @ c.jacobian
        inverse = Factor(mass, jacobian, FLOOR * c.rows.scale / (unit * unit))
        inertia = Factor(mass, casadi.SX(0, mass.size1()), casadi.SX(0, 1))

        def times(x: casadi.SX) -> casadi.SX:
            return jacobian @ inertia.solve(jacobian.T @ x, casadi.SX(0, 1))[0]

        still = casadi.SX(mass.size1(), 1)
        start = casadi.SX(
            np.cos(1.0 + 2.0 * np.arange(m) ** 2)
        )  # no singular direction of a mechanism is at right angles
        least = largest = start
        for _ in range(PASSES if m > 1 else 0):
            least, largest = inverse.solve(still, least)[1], times(largest)
            least, largest = least / casadi.norm_2(least), largest / casadi.norm_2(largest)

        def quotient(x: casadi.SX) -> casadi.SX:
            return casadi.dot(x, times(x)) / casadi.dot(x, x)

        return casadi.sqrt(casadi.fmax(quotient(least), 0.0) / quotient(largest))


def constraint_rows(constraints: Sequence[Constraint], s: Symbols) -> dict[str, list[int]]:
    """Which rows of all φ, and then of all ψ, are a constraint's, in the order of its labels."""
    sizes = [[part.size1() for part in constraint.residual(s)] for constraint in constraints]
    first, second = 0, sum(h for h, _ in sizes)
    rows = {}
    for constraint, (h, k) in zip(constraints, sizes, strict=True):
        rows[constraint.name] = [*range(first, first + h), *range(second, second + k)]
        first, second = first + h, second + k
    return rows
