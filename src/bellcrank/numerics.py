"""Linear algebra for matrices whose entries may be huge, tiny or not finite.

LAPACK fails or does not terminate where squares of entries overflow (least squares of 1e160). Matrices whose largest
entry is outside 1e-100 to 1e100 are scaled by a power of two, which is exact; entries that are not finite are refused.
Otherwise the results are numpy's, to the bit.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError

LARGEST, SMALLEST = 1e100, 1e-100  # squares of entries between them, and their sums, are finite


def checked(array: Array, what: str) -> Array:
    """The array; InputError, "`what` is not finite", with the first such entry, where one is NaN or infinite."""
    if not np.isfinite(array).all():
        raise InputError(f"{what} not finite (it has {array.ravel()[~np.isfinite(array).ravel()][0]}): "
                         "values are too large, too small, or undefined")  # fmt: skip
    return array


def floats(value: Any) -> Array:
    """Numbers as an array of floats; arrays of expressions, which answer NumPy's functions, stay what they are."""
    return value if hasattr(value, "__array_function__") else np.asarray(value, dtype=np.float64)


def least_squares(matrix: Array, right: Array, what: str, rcond: float | None = None) -> Array:
    """The least x (n,) or (n, k) with the least |matrix x − right|; matrix (m, n). InputError where not finite."""
    checked(matrix, what), checked(right, what)
    size, much = _scale(matrix), _scale(right)
    if size == 1.0 == much:
        return np.asarray(np.linalg.lstsq(matrix, right, rcond=rcond)[0], dtype=np.float64)
    found = np.linalg.lstsq(matrix / size, right / much, rcond=rcond)[0]
    with np.errstate(over="ignore"):  # a solution that overflows is infinite, and refused
        return checked(np.asarray(found * (much / size), dtype=np.float64), what)


def singular_values(matrix: Array, what: str) -> Array:
    """Singular values (…, k), largest first, of matrices (…, m, n). InputError where one is not finite."""
    size = _scale(checked(matrix, what))
    return np.asarray(np.linalg.svd(matrix / size if size != 1.0 else matrix, compute_uv=False) * size)


def svd(matrix: Array, what: str, full: bool = True) -> tuple[Array, Array, Array]:
    """U, singular values and Vᵀ of matrices (…, m, n), as numpy's. InputError where one is not finite."""
    size = _scale(checked(matrix, what))
    u, values, vt = np.linalg.svd(matrix / size if size != 1.0 else matrix, full_matrices=full)
    return u, values * size, vt


def pseudo_inverse(matrix: Array, what: str, rcond: float | None = None) -> Array:
    """The pseudo-inverse (…, n, m) of matrices (…, m, n). InputError where one is not finite."""
    size = _scale(checked(matrix, what))
    options: dict[str, Any] = {} if rcond is None else {"rcond": rcond}
    return np.asarray(np.linalg.pinv(matrix / size if size != 1.0 else matrix, **options) / size, dtype=np.float64)


def eigenvectors(matrix: Array, what: str) -> tuple[Array, Array]:
    """Eigenvalues (…, n), rising, and eigenvectors (…, n, n) of symmetric ones. InputError where one is not finite."""
    size = _scale(checked(matrix, what))
    values, vectors = np.linalg.eigh(matrix / size if size != 1.0 else matrix)
    return values * size, vectors


def products(matrices: Array, vectors: Array) -> Array:
    """The products (n, a) of matrices (n, a, b) with vectors (n, b)."""
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])


def length(vector: Any) -> float:
    """The Euclidean norm of a vector, without the overflow of squares."""
    return math.hypot(*np.asarray(vector, dtype=np.float64).ravel().tolist())


def unit(vector: Any, what: str) -> Array:
    """The vector (n,) at length 1. InputError where it is not finite, or zero."""
    given = checked(np.asarray(vector, dtype=np.float64), what)
    size = _scale(given) if given.size else 1.0
    long = length(given / size)
    if not long > 0.0:
        raise InputError(f"{what} zero and has no direction")
    return np.asarray(given / size / long)


def _scale(array: Array) -> float:
    """A power of two near the largest entry where this is beyond 1e±100, else 1."""
    largest = float(np.abs(array).max(initial=0.0))
    if largest == 0.0 or SMALLEST <= largest <= LARGEST:
        return 1.0
    return math.ldexp(1.0, max(math.frexp(largest)[1], -1000) - 1)
