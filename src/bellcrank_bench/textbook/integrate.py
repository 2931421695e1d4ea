"""What the analytic equations share: their integration by SciPy, and the linear system with multipliers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def integrate(derivative: Callable[[Array], Array], start: Array, times: Array) -> Array:
    """States (n, k) at times (n,), s, from a start (k,) at time 0, by SciPy's DOP853 at rtol = 1e-13, atol = 1e-14."""
    from scipy.integrate import solve_ivp

    span = (0.0, float(times[-1]))
    found: Any = solve_ivp(lambda _, x: derivative(x), span, start, "DOP853", times, rtol=1e-13, atol=1e-14)
    return np.asarray(found.y.T)


def solve_with_multipliers(mass: Array, jacobian: Array, force: Array, right: Array) -> tuple[Array, Array]:
    """Accelerations (..., n) and multipliers (..., m) of M q̈ = f + Jᵀ λ, J q̈ = right."""
    n, m = mass.shape[-1], jacobian.shape[-2]
    matrix = np.zeros((*mass.shape[:-2], n + m, n + m))
    matrix[..., :n, :n], matrix[..., :n, n:], matrix[..., n:, :n] = mass, -np.swapaxes(jacobian, -1, -2), jacobian
    x = np.linalg.solve(matrix, np.concatenate([force, right], -1)[..., None])[..., 0]
    return x[..., :n], x[..., n:]
