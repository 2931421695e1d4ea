"""The limits of a motion along a path, jerk included, as functions of the squared path speed z(r) and its derivatives.

With ṙ = √z, r̈ = z'/2 and d³r/dt³ = √z z''/2, a joint's jerk along q(r) is

    d³q/dt³ = √z (q''' z + 3/2 q'' z' + 1/2 q' z''),

so that |jerk| ≤ J is ±(q''' z + 3/2 q'' z' + 1/2 q' z'') / J - 1/√z ≤ 0: linear less a convex function. Limits of
torques and accelerations are those of path_limits.py with y = √z and u = z'/2. (F. Debrouwere et al., IEEE Trans.
Robotics 29, 2013: time-optimal path following with convex-concave constraints.)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bellcrank._planner import LimitArrays, linearised
from bellcrank.arrays import Array, Indices
from bellcrank.planning.joint_path import JointPath
from bellcrank.planning.limits.path_limits import PathLimits

# ---- The squared path speed z = ṙ² over a path parameter r, cubic in each cell and continuous with its slope.
#
# The unknowns are z and z' at the ends of cells (cubic Hermite interpolation). The second derivative, on which the
# jerk depends, is linear in each cell and may jump between cells.


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


@dataclass(frozen=True, eq=False)
class Violation:
    """Constraints g ≤ 0 at p places.

    Attributes:
        value: g (p, m).
        slope: Its derivatives (p, m, 3) by z, z' and z''.
        by_limit: -∂g/∂ ln L (p, m), of the limit L.
        share: The share (p, m) by which the limited quantity exceeds its limit.
    """

    value: Array
    slope: Array
    by_limit: Array
    share: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class JerkLimits:
    """The limits at p places.

    Attributes:
        arrays: Limits of torques and accelerations.
        fastest: The largest path speeds (p,) that limits of speeds allow.
        jerk: Derivatives of the limited joints' positions over their jerk (p, j, 3): q''', 3/2 q'', 1/2 q', each
            divided by the largest jerk.
        kept: Those entries of `linearised` that may be reached.
        squares: Number of the last of them that are squares of norms.
    """

    arrays: LimitArrays
    fastest: Array
    jerk: Array
    kept: Indices
    squares: int

    @property
    def first_jerk(self) -> int:
        """The number of the first constraint of a jerk."""
        return len(self.kept) + 1

    @classmethod
    def of(cls, path: JointPath, limits: PathLimits, places: Array, middles: Array) -> JerkLimits:
        """The limits at places (p,) of a path. Coulomb friction is that of the joints' directions in the middles (p,)
        of their cells: where a joint turns, it has its full size on either side.
        """
        first, second, third = (path.spline(places, order) for order in (1, 2, 3))
        most = limits.largest_jerk
        columns = np.flatnonzero(np.isfinite(most))
        jerk = np.stack([third, 1.5 * second, 0.5 * first], axis=-1)[:, columns] / most[columns, None]
        tops = [value for _, value in limits.speed_limits(path.spline(places, 0), first)]
        kept = np.array([entry for entry, _ in limits.linearised], dtype=np.intp)
        return cls(
            arrays=limits.at(path, places, middles),
            fastest=np.min(tops, axis=0, initial=1e12) if tops else np.full(len(places), 1e12),
            jerk=jerk,
            kept=kept,
            squares=limits.norm_count,
        )

    def violation(self, z: Array) -> Violation:
        """The constraints at z, z' and z'' (3, p): two for each row, one of speed, two for each limited jerk."""
        root = np.sqrt(z[0])
        found = linearised(self.arrays, root, np.ascontiguousarray(0.5 * z[1]))
        places = len(root)
        share, by_u, by_y, limited = (one.reshape(places, one.size // places)[:, self.kept] for one in found)
        second = np.stack([0.5 * by_y / root[:, None], 0.5 * by_u, np.zeros_like(share)], axis=-1)
        speed = (z[0] / self.fastest**2)[:, None]
        fast = np.zeros((len(root), 1, 3))
        fast[:, 0, 0] = self.fastest**-2.0
        moved = np.einsum("pjk,kp->pj", self.jerk, z)
        slow = np.broadcast_to((1.0 / root)[:, None], moved.shape)
        away = np.zeros_like(self.jerk)
        away[..., 0] = 0.5 * (z[0] ** -1.5)[:, None]
        scaled = moved * root[:, None]
        exceeded = share.copy()
        if self.squares:
            exceeded[:, -self.squares :] = np.sqrt(1.0 + share[:, -self.squares :]) - 1.0
        return Violation(
            np.concatenate([share, speed - 1.0, moved - slow, -moved - slow], axis=1),
            np.concatenate([second, fast, self.jerk + away, away - self.jerk], axis=1),
            np.concatenate([limited, 2.0 * speed, moved, -moved], axis=1),
            np.concatenate([exceeded, np.sqrt(speed) - 1.0, scaled - 1.0, -scaled - 1.0], axis=1),
        )
