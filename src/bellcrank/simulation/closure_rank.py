"""How well closures hold in a posture: singular values of J M⁻¹ᐟ², their rank, and which multipliers are unique."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.dynamics.system import System

Array = NDArray[np.float64]
LOST = 1e-8  # of the largest singular value: rows below it depend on others


@dataclass(frozen=True, eq=False)
class ClosureRank:
    """Singular values (rows,), largest first, of J M⁻¹ᐟ² with rows of length 1, so that units do not matter; the rank;
    and `unique` (rows,): which multipliers no combination of the others can take over.
    """

    singular_values: Array
    rank: int
    unique: NDArray[np.bool_]


def rank_of(system: System, t: Array, x: Array, u: Array, p: Array) -> ClosureRank:
    """The rank of a system's closures at a time (1) s, state, signals and parameters.

    Raises InputError where the mass matrix is not that of bodies, or a number is not finite.
    """
    with np.errstate(all="ignore"):
        jacobian, mass = system.closure_metric(t, x, u, p)
        try:
            weighted = np.linalg.solve(np.linalg.cholesky(mass), jacobian.T).T
        except np.linalg.LinAlgError:
            weighted = np.full_like(jacobian, np.nan)
        length = np.linalg.norm(weighted, axis=1, keepdims=True)
    if not np.isfinite(length).all():
        raise InputError(
            f"the closures have no rank at {float(t[0]):.6g} s: the mass matrix or their Jacobian is not finite there, "
            "or a mass or inertia is not that of a body"
        )
    weighted = weighted / np.where(length > 0.0, length, 1.0)
    left, values, _ = np.linalg.svd(weighted)
    rank = int(np.sum(values > LOST * values.max(initial=0.0)))
    idle = left[:, rank:]  # combinations of multipliers that move nothing
    return ClosureRank(values, rank, np.linalg.norm(idle, axis=1) < 1e-6)
