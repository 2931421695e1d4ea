"""Sparse matrices of expressions: what is compiled of them is the entries that are not always zero."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import casadi

Array = NDArray[np.float64]


class Places(NamedTuple):
    """Where the entries of a sparse matrix lie: its rows and columns, and the row and the column of each entry."""

    height: int
    width: int
    rows: Sequence[int]
    columns: Sequence[int]

    @staticmethod
    def of(matrix: casadi.SX) -> Places:
        """Those of an expression, column after column."""
        return Places(*matrix.shape, *matrix.sparsity().get_triplet())

    def matrix(self, entries: Array) -> Array:
        """The matrix (…, height, width) with these entries (…, n)."""
        whole = np.zeros((*entries.shape[:-1], self.height, self.width))
        whole[..., self.rows, self.columns] = entries
        return whole


def entries(matrix: casadi.SX) -> casadi.SX:
    """The entries of a sparse matrix that are not always zero (n), in the order of their Places."""
    column: casadi.SX = matrix.nz[:]
    return column
