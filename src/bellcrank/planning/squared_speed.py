"""The squared path speed z = ṙ² over a path parameter r, cubic in each cell and continuous with its slope.

The unknowns are z and z' at the ends of cells (cubic Hermite interpolation). The second derivative, on which the jerk
depends, is linear in each cell and may jump between cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of a cell, at which limits are kept
PLACES = len(SHARES)
SIMPSON = (1.0 / 12.0, 4.0 / 12.0, 2.0 / 12.0, 4.0 / 12.0, 1.0 / 12.0)
INSIDE = 1e-9  # of a cell, by which its ends are moved inside: derivatives of the path may jump between cells
GAUSS, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(8)
LOCAL = 4  # unknowns of a cell


@dataclass(frozen=True, eq=False)
class SquaredSpeedSpline:
    """The functions over cells that end at r (n,), for 2 n unknowns: z and z' at each end in turn.

    Attributes:
        r: Ends of the cells (n,), rising.
    """

    r: Array

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.r) - 1

    def basis(self, shares: Array | tuple[float, ...]) -> Array:
        """The four functions of each cell and their first two derivatives (cells, shares, 3, 4): the third index is the
        order of the derivative, the last one the function; those of cell k belong to the unknowns from 2 k on.
        """
        t = np.asarray(shares)
        one, zero = np.ones_like(t), np.zeros_like(t)
        cubic = np.array([[1.0, 0.0, -3.0, 2.0], [0.0, 1.0, -2.0, 1.0], [0.0, 0.0, 3.0, -2.0], [0.0, 0.0, -1.0, 1.0]])
        powers = np.array([[one, t, t**2, t**3], [zero, one, 2.0 * t, 3.0 * t**2], [zero, zero, 2.0 * one, 6.0 * t]])
        unit = np.einsum("fk,oks->sof", cubic, powers)
        width = np.diff(self.r)
        scale = np.stack([width**0, width**-1.0, width**-2.0], axis=-1)
        factor = np.stack([width**0, width, width**0, width], axis=-1)
        return np.asarray(unit[None] * scale[:, None, :, None] * factor[:, None, None, :])

    def local(self, unknowns: Array) -> Array:
        """The four unknowns of each cell (cells, 4)."""
        return np.stack([unknowns[k : k + 2 * self.cells : 2] for k in range(LOCAL)], axis=-1)

    @cached_property
    def points(self) -> Array:
        """The places (cells, PLACES) at which limits are kept."""
        width = np.diff(self.r)[:, None]
        places = self.r[:-1, None] + np.clip(SHARES, INSIDE, 1.0 - INSIDE) * width
        places[0, 0], places[-1, -1] = self.r[0], self.r[-1]
        return places

    def middles(self, times: int) -> Array:
        """The middle of each cell, as often as it has places (cells * times,)."""
        return np.repeat((self.r[1:] + self.r[:-1]) / 2.0, times)

    @property
    def weights(self) -> Array:
        """Simpson's weights (cells, PLACES) at `points`."""
        return np.asarray(np.diff(self.r)[:, None] * np.array(SIMPSON))

    def values(self, unknowns: Array, shares: Array | tuple[float, ...]) -> Array:
        """z and its two derivatives at shares of each cell (3, cells, shares)."""
        return np.asarray(np.einsum("csok,ck->ocs", self.basis(shares), self.local(unknowns)))

    def durations(self, unknowns: Array, share: float = 1.0) -> Array:
        """The times (cells,) of the first share of each cell: ∫ dr / √z."""
        z = self.values(unknowns, share * (GAUSS + 1.0) / 2.0)[0]
        with np.errstate(invalid="ignore"):
            return np.asarray(share * np.diff(self.r) / 2.0 * (z**-0.5 @ GAUSS_WEIGHTS), dtype=np.float64)
