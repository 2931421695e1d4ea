"""The limits of a motion along a path, jerk included, as functions of the squared path speed z(r) and its derivatives.

With ṙ = √z, r̈ = z'/2 and d³r/dt³ = √z z''/2, a joint's jerk along q(r) is

    d³q/dt³ = √z (q''' z + 3/2 q'' z' + 1/2 q' z''),

so that |jerk| ≤ J is ±(q''' z + 3/2 q'' z' + 1/2 q' z'') / J - 1/√z ≤ 0: linear less a convex function. Limits of
torques and accelerations are those of path_limits.py with y = √z and u = z'/2. (F. Debrouwere et al., IEEE Trans.
Robotics 29, 2013: time-optimal path following with convex-concave constraints.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bellcrank._planner import LimitArrays, linearised
from bellcrank.planning.joint_path import JointPath
from bellcrank.planning.path_limits import PathLimits

Array = NDArray[np.float64]


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
    kept: NDArray[np.intp]
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
