"""The rank of constraints in a configuration: singular values of J M⁻¹ᐟ², and which multipliers are unique."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.errors import InputError
from bellcrank.numerics import checked, eigenvectors, svd

if TYPE_CHECKING:
    from bellcrank.dynamics.equations.compiled_equations import System

MASSLESS = 1e-6  # of a coordinate's own inertia: the least that a motion counts with
LOST = 1e-8  # of the largest singular value: smaller ones count as 0


@dataclass(frozen=True, eq=False)
class ConstraintRank:
    """The rank of the constraints in one configuration.

    Attributes:
        singular_values: Singular values (rows,), largest first, of J M⁻¹ᐟ² with rows of length 1, so that units do not
            matter.
        rank: The number of independent rows.
        unique: Which multipliers (rows,) are determined by the motion.
    """

    singular_values: Array
    rank: int
    unique: Mask

    @classmethod
    def of_none(cls) -> ConstraintRank:
        """That of a scene without constraints."""
        return cls(np.zeros(0), 0, np.zeros(0, dtype=np.bool_))


def rank_of(system: System, t: Array, x: Array, u: Array, p: Array) -> ConstraintRank:
    """The rank of a system's constraints at a time (1) s, state, signals and parameters.

    Raises InputError where a number is not finite or an inertia negative.
    """
    with np.errstate(all="ignore"):
        jacobian, mass = system.constraint_metric(t, x, u, p)
        checked(mass, "the mass matrix at this row of the run is")
        try:
            weighted = np.linalg.solve(np.linalg.cholesky(mass), jacobian.T).T
        except np.linalg.LinAlgError:  # massless links: the rank of J is the same in any metric
            weighted = jacobian @ _whitening(mass)
        length = np.linalg.norm(weighted, axis=1, keepdims=True)
    weighted = weighted / np.where(length > 0.0, length, 1.0)
    left, values, _ = svd(weighted, "the constraint Jacobian at this row of the run is")
    rank = int(np.sum(values > LOST * values.max(initial=0.0)))
    idle = left[:, rank:]  # combinations of multipliers without effect
    return ConstraintRank(values, rank, np.linalg.norm(idle, axis=1) < 1e-6)


def _whitening(mass: Array) -> Array:
    """W with Wᵀ M W = 1 (nv, nv), of M with MASSLESS of a coordinate's own inertia where it has less.

    Raises InputError where an inertia is negative by more than that.
    """
    own = mass.diagonal()
    size = np.sqrt(np.where(own > MASSLESS * own.max(initial=0.0), own, own.max(initial=0.0) or 1.0))
    values, vectors = eigenvectors(mass / np.outer(size, size), "the mass matrix at this row of the run is")
    if values.min(initial=0.0) < -MASSLESS:
        raise InputError(
            "the rank of the constraints cannot be computed, because the mass matrix is not positive: check masses "
            "and inertias"
        )
    return np.asarray(vectors / np.sqrt(np.maximum(values, MASSLESS)) / size[:, None])
