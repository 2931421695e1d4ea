"""What is known of compiled equations of motion without tracing them: sizes, names and sparsity."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank.arrays import Array
from bellcrank.codegen import cache as disk
from bellcrank.dynamics.constraints.constraint_derivatives import row_names

if TYPE_CHECKING:
    import casadi

    from bellcrank.dynamics.equations.assembly import Assembly
    from bellcrank.scene.scene import Scene

Sizes = tuple[int, int, int, int]
_STORED = {
    "has_work": bool,
    "multiplier_names": [(str, str)],
    "operations": int,
    "sparsity": {str: (int, int, [int], [int])},
    "sizes": (int, int, int, int),
}


class SparsityPattern(NamedTuple):
    """The size of a sparse matrix, and the row and the column of each entry that is not always zero."""

    height: int
    width: int
    rows: Sequence[int]
    columns: Sequence[int]

    @classmethod
    def of(cls, matrix: casadi.SX) -> SparsityPattern:
        """The pattern of an expression, column after column."""
        return cls(*matrix.shape, *matrix.sparsity().get_triplet())

    def matrix(self, entries: Array) -> Array:
        """The matrix (…, height, width) with these entries (…, n)."""
        whole = np.zeros((*entries.shape[:-1], self.height, self.width))
        whole[..., self.rows, self.columns] = entries
        return whole


def entries(matrix: casadi.SX) -> casadi.SX:
    """The entries of a sparse matrix that are not always zero (n), in the order of its SparsityPattern."""
    column: casadi.SX = matrix.nz[:]
    return column


@dataclass(frozen=True, kw_only=True)
class SystemLayout:
    """Sizes, names and sparsity of a scene's equations of motion.

    Attributes:
        has_work: Whether the state ends with the work W.
        multiplier_names: (constraint, label) of each multiplier.
        operations: The number of operations of the right-hand side.
        sparsity: The patterns of the constraints' "jacobian" and of the "mass" matrix.
        sizes: The sizes of t, x, u and p.
    """

    has_work: bool
    multiplier_names: tuple[tuple[str, str], ...]
    operations: int
    sparsity: dict[str, SparsityPattern]
    sizes: Sizes

    @classmethod
    def of(cls, scene: Scene, assembly: Assembly, operations: int, sizes: Sizes) -> SystemLayout:
        """The layout of assembled equations."""
        solution, names, sparsity = assembly.solution, [], {}
        if solution is not None:
            every = row_names(scene.constraints, assembly.symbols)
            names = [every[k] for k in solution.derivatives.rows.kept]
            matrices = {"jacobian": solution.derivatives.jacobian, "mass": solution.mass}
            sparsity = {name: SparsityPattern.of(matrix) for name, matrix in matrices.items()}
        return cls(
            has_work=assembly.has_work,
            multiplier_names=tuple(names),
            operations=operations,
            sparsity=sparsity,
            sizes=sizes,
        )

    @classmethod
    def load(cls, name: str) -> SystemLayout | None:
        """The layout stored on disk under a name; None where there is none."""
        stored = disk.load_data(name, _STORED)
        if stored is None:
            return None
        return cls(
            has_work=stored["has_work"],
            multiplier_names=tuple((constraint, label) for constraint, label in stored["multiplier_names"]),
            operations=stored["operations"],
            sparsity={matrix: SparsityPattern(*pattern) for matrix, pattern in stored["sparsity"].items()},
            sizes=tuple(stored["sizes"]),
        )

    def store(self, name: str) -> None:
        """Keep the layout on disk under a name."""
        disk.store(name, json.dumps(asdict(self)).encode())
