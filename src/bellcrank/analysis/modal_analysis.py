"""Eigenvalues and modes of linear equations with symmetries.

The symmetries' own directions G (n, k) are an invariant subspace of A, A G = G Λ. Eigenvalues are computed block by
block, those of Λ and those of A on the quotient, since together they have defective zeros (position and velocity of
a cart), of which an eigenvalue routine returns the square root of its rounding. Source: Golub & Van Loan, Matrix
Computations, 4th ed., 7.1 and 7.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.linalg import eig, matrix_balance, qr

from bellcrank.analysis.mode import Mode, normalised, sort_key
from bellcrank.arrays import Array, Complex

# times machine precision, the norm of A and an eigenvalue's condition number: a real or imaginary part below this is 0
ROUNDING = 100.0
DEPENDENT = 1e-9  # of the largest singular value: symmetries that do the same at the operating point
NEUTRAL = 1e-6  # of the largest eigenvalue: an eigenvalue nearer than this to one of Λ has no eigenvector of its own


@dataclass(frozen=True, eq=False)
class Quotient:
    """Linear equations without the directions of their symmetries.

    Attributes:
        kept: The states that remain.
        dropped: The states (k of them) that the symmetries move.
        projection: (n − k, n): remaining states of all states, the same along the symmetries.
        directions: G (n, k), the identity on the dropped states.
    """

    kept: list[int]
    dropped: list[int]
    projection: Array
    directions: Array

    @classmethod
    def of(cls, directions: Array, positions: int, units: Array) -> Self:
        """From directions G (n, k); positions, the first of the states, are dropped before velocities."""
        left, values, _ = np.linalg.svd(directions, full_matrices=False)
        directions = left[
            :, values > DEPENDENT * values.max(initial=1.0)
        ]  # at a fixed point of a symmetry there are fewer
        n, k = directions.shape
        weights = np.where(np.arange(n) < positions, 1.0, 1e-3) / units
        _, _, order = qr((directions * weights[:, None]).T, mode="economic", pivoting=True)
        dropped = sorted(int(place) for place in order[:k])
        kept = [place for place in range(n) if place not in dropped]
        solved = directions @ np.linalg.inv(directions[dropped]) if k else directions
        projection = np.zeros((len(kept), n))
        projection[range(len(kept)), kept] = 1.0
        projection[:, dropped] = -solved[kept]
        return cls(kept, dropped, projection, solved)

    def field(self, matrix: Array) -> Array:
        """A on the quotient (n − k, n − k)."""
        return self.projection @ matrix[:, self.kept]

    def along(self, matrix: Array) -> Array:
        """Λ (k, k)."""
        return (matrix @ self.directions)[self.dropped]


def modes_of(matrix: Array, quotient: Quotient, embedding: Array, *, reduced: bool) -> tuple[Mode, ...]:
    """The modes of A = `matrix` (n, n), those along symmetries last; without these if `reduced`.

    Their shapes are over the remaining states if `reduced`, else over all. `embedding` (nv, n) gives the
    displacement of all degrees of freedom.
    """
    field, along = quotient.field(matrix), quotient.along(matrix)
    values, vectors, error = eigen(field)
    group, basis, group_error = eigen(along)
    found = []
    largest = max(np.abs(values).max(initial=0.0), np.abs(group).max(initial=0.0))
    for value, vector, own in zip(values, vectors.T, error, strict=True):
        whole = _lifted(matrix, quotient, complex(value), vector, group, NEUTRAL * largest)
        found.append((_rounded(complex(value), own), whole, False))
    if not reduced:
        for value, vector, own in zip(group, basis.T, group_error, strict=True):
            found.append((_rounded(complex(value), own), quotient.directions @ vector, True))
    found = [entry for entry in found if entry[0].imag >= 0.0]
    return tuple(
        Mode(
            eigenvalue=value,
            shape=normalised(np.asarray(whole[quotient.kept] if reduced else whole, dtype=np.complex128)),
            displacement=normalised(np.asarray(embedding @ whole, dtype=np.complex128)),
            symmetry=symmetry,
        )
        for value, whole, symmetry in sorted(found, key=lambda entry: (entry[2], sort_key(entry[0])))
    )


def _lifted(matrix: Array, quotient: Quotient, value: complex, vector: Complex, group: Complex, near: float) -> Complex:
    """The eigenvector (n,) over all states of one of the quotient; without the symmetries' part where λ is one of Λ."""
    n, k = quotient.directions.shape
    whole = np.zeros(n, dtype=np.complex128)
    whole[quotient.kept] = vector
    if k and np.abs(group - value).min() > near:
        # (λ − Λ) s = what the remaining states do along the symmetries
        push = (matrix @ whole)[quotient.dropped]
        whole = whole + quotient.directions @ np.linalg.solve(value * np.eye(k) - quotient.along(matrix), push)
    return whole


def eigen(matrix: Array, change: float | None = None) -> tuple[Complex, Complex, Array]:
    """Eigenvalues, eigenvectors and the error of each eigenvalue.

    The error is that of a perturbation of A, by `change` or by its own rounding, times its condition number 1/|yᴴ x|.
    """
    if not len(matrix):
        return np.zeros(0, dtype=np.complex128), np.zeros((0, 0), dtype=np.complex128), np.zeros(0)
    balanced, scaling = matrix_balance(matrix, permute=False)
    values, left, right = eig(balanced, left=True, right=True)
    overlap = np.abs(np.einsum("ij,ij->j", left.conj(), right))
    rounding = ROUNDING * np.finfo(float).eps * float(np.linalg.norm(balanced, 2))
    least = np.sqrt(np.finfo(float).eps if change is None else max(change, np.finfo(float).eps))
    return values, scaling @ right, (rounding if change is None else change) / np.maximum(overlap, least)


def _rounded(value: complex, error: float) -> complex:
    real = value.real if abs(value.real) > error else 0.0
    imaginary = value.imag if abs(value.imag) > error else 0.0
    return complex(real, imaginary)
