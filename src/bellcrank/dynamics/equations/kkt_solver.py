"""The constrained equations of motion solved for numbers with any number of right-hand sides, rows of J of any rank.

    [ M   Jᵀ ] [  a ]   [ f ]
    [ J   0  ] [ −λ ] = [ b ]

With the singular value decomposition J = U Σ Vᵀ of rank r, V = (Y, Z): a = J⁺ b + Z z, where Zᵀ M Z z = Zᵀ (f − M J⁺
b), and λ = (Jᵀ)⁺ (M a − f), the smallest of all λ that fit. This is the null-space method: Nocedal & Wright, Numerical
Optimization, 2nd ed., 16.2. M need not be regular, only Zᵀ M Z.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.numerics import checked, svd

SINGULAR = 1e-8  # of the largest singular value of J: a smaller one counts as 0, as in mobility.py
MASSLESS = 1e-13  # of the largest eigenvalue of the reduced mass matrix


@dataclass(frozen=True, eq=False, kw_only=True)
class KktSolver:
    """The factors of one system.

    Attributes:
        mass: M (nv, nv).
        free: Z (nv, nv − r): the velocities that the constraints allow.
        inverse: The pseudo-inverse J⁺ (nv, m), small singular values cut off.
        dual_inverse: (Jᵀ)⁺ (m, nv), minimum-norm in the metric of the rows' usual size.
        rank: r.
    """

    mass: Array
    free: Array
    inverse: Array
    dual_inverse: Array
    rank: int

    @classmethod
    def of(cls, mass: Array, jacobian: Array, size: Array, unit: Array) -> Self:
        """Factorise. `size` (m) is the usual size of each row, `unit` (nv) the unit of each velocity.

        Raises InputError where a motion that the constraints allow moves no mass.
        """
        scaled = jacobian / size[:, None] * unit
        left, values, right = svd(scaled, "the derivative of the constraints is")
        rank = int(np.count_nonzero(values > SINGULAR * values.max(initial=0.0)))
        kept = (right[:rank].T / values[:rank]) @ left[:, :rank].T  # of the scaled J
        free = unit[:, None] * right[rank:].T
        reduced = free.T @ checked(mass, "the mass matrix is") @ free
        least = np.linalg.eigvalsh(reduced)
        if least.size and least[0] <= MASSLESS * least[-1]:
            raise InputError("the mass matrix is singular: a motion that the constraints allow has no inertia")
        return cls(
            mass=mass,
            free=free,
            inverse=unit[:, None] * kept / size,
            dual_inverse=(unit[:, None] * kept / size).T,
            rank=rank,
        )

    def solve(self, force: Array, right: Array) -> tuple[Array, Array]:
        """Accelerations a (nv, …) and multipliers λ (m, …) for f (nv, …) and b (m, …)."""
        start = self.inverse @ right
        if self.free.shape[1]:
            reduced = self.free.T @ self.mass @ self.free
            start = start + self.free @ np.linalg.solve(reduced, self.free.T @ (force - self.mass @ start))
        return start, self.dual_inverse @ (self.mass @ start - force)
