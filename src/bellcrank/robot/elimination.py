"""Linear equations with a sparse symmetric positive matrix of expressions, such as the mass matrix of a tree.

A = Lᵀ D L with a unit lower triangle L, from the last row to the first. For the mass matrix of a tree, L has entries
only where A has: those of a joint's row are at the joints that carry it. Right-hand sides may be sparse too.
Source: the LTDL factorisation, Featherstone, Rigid Body Dynamics Algorithms (2008), ch. 6.5.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import casadi


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
