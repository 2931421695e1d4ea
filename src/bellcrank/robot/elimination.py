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

Row = dict[int, "casadi.SX"]  # the entries of a sparse row, by column


@dataclass(frozen=True)
class Factorisation:
    """L without its diagonal, row by row, and 1 / D."""

    lower: list[Row]
    reciprocal: list[casadi.SX]

    @classmethod
    def of(cls, matrix: casadi.SX) -> Factorisation:
        """The factors of a symmetric matrix, of which the lower triangle is read."""
        import casadi

        left = _rows_of(matrix, lower=True)
        lower: list[Row] = [{} for _ in left]
        reciprocal: list[casadi.SX] = []
        for k in range(len(left) - 1, -1, -1):
            row = left[k]
            reciprocal.append(1.0 / row.pop(k, casadi.SX(0.0)))  # infinite where there is no inertia
            lower[k] = {j: entry * reciprocal[-1] for j, entry in row.items()}
            for i, scaled in lower[k].items():
                for j, entry in row.items():
                    if j <= i:
                        _subtract(left[i], j, scaled * entry)
        return cls(lower, reciprocal[::-1])

    def solve(self, right: casadi.SX) -> casadi.SX:
        """A⁻¹ B, sparse where it is zero."""
        rows = _rows_of(right)
        for k in range(len(rows) - 1, -1, -1):
            for i, factor in self.lower[k].items():
                for column, entry in rows[k].items():
                    _subtract(rows[i], column, factor * entry)
        for k, row in enumerate(rows):
            rows[k] = {column: entry * self.reciprocal[k] for column, entry in row.items()}
            for i, factor in self.lower[k].items():
                for column, entry in rows[i].items():
                    _subtract(rows[k], column, factor * entry)
        return _matrix(rows, right.size2())

    def inverse(self) -> casadi.SX:
        """A⁻¹, from L A⁻¹ = D⁻¹ L⁻ᵀ, whose right-hand side is an upper triangle with the diagonal D⁻¹."""
        rows: list[Row] = [{} for _ in self.lower]
        for k, factors in enumerate(self.lower):
            for j in range(k):
                for i, factor in factors.items():
                    if j in rows[i]:
                        _subtract(rows[k], j, factor * rows[i][j])
                if j in rows[k]:
                    rows[j][k] = rows[k][j]
            rows[k][k] = self.reciprocal[k]
            for i, factor in factors.items():
                if i in rows[k]:
                    _subtract(rows[k], k, factor * rows[k][i])
        return _matrix(rows, len(rows))


def _subtract(row: Row, column: int, term: casadi.SX) -> None:
    row[column] = row[column] - term if column in row else -term


def _rows_of(matrix: casadi.SX, lower: bool = False) -> list[Row]:
    import casadi

    rows: list[Row] = [{} for _ in range(matrix.size1())]
    if not matrix.nnz():
        return rows
    places = zip(*matrix.sparsity().get_triplet(), casadi.vertsplit(matrix.nz[:]), strict=True)
    for row, column, entry in places:
        if column <= row or not lower:
            rows[row][column] = entry
    return rows


def _matrix(rows: list[Row], width: int) -> casadi.SX:
    import casadi

    places = [(i, j) for i, row in enumerate(rows) for j in sorted(row)]
    pattern = casadi.Sparsity.triplet(len(rows), width, [i for i, _ in places], [j for _, j in places])
    by_column = sorted(places, key=lambda place: (place[1], place[0]))
    return casadi.SX(pattern, casadi.vertcat(*[rows[i][j] for i, j in by_column]))
