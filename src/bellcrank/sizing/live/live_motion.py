"""A motion as quintic polynomials between states, from which a page has its states at any time.

The polynomials are of the coordinates q, so that a joint with several degrees of freedom has those of its unit vectors;
`velocities` gives velocity and acceleration again, of unit vectors that interpolation changes in length.

With the independent joints i of a motion and the dependent joints d, a page solves φ(q, p) = 0 by Newton's method from
the posture of the sizing, while the parameters go from their values there to new ones: it calls `step` until the
residual vanishes, and refuses values on whose way the posture leaves its branch (assets/live_loops.js). Velocities and
accelerations are v_d = −J_d⁻¹ J_i v_i and a_d = −J_d⁻¹ (γ + J_i a_i), as in dynamics/postures/loop_kinematics.py.
Angles are in rad, lengths in units of the characteristic length.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank.arrays import Array
from bellcrank.dynamics.constraints.constraint_derivatives import SymbolicRows, differentiate_constraints
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.elements.symbols import Symbols
from bellcrank.motion.coordinates import continuous, rates
from bellcrank.motion.motion import Motion
from bellcrank.motion.sampled.quintic_splines import quintic_polynomial
from bellcrank.robot.model.joints import unit_vectors
from bellcrank.sizing.loads.motion_grid import FINEST, grid_along

if TYPE_CHECKING:
    from collections.abc import Sequence

    import casadi

    from bellcrank.robot.robot import Robot


ACCURATE = 2e-10  # of the largest position, speed, acceleration of all joints: joints that accelerate less see more
ROUNDED = 1e-14  # of the largest position: between two rows close together its rounding shows in the accelerations
AT_ROWS = 0.1  # of that rounding: errors at the rows themselves that it hides
EQUAL = 1e-12  # of the same: two states of one time that differ by less are one
DIGITS = (52, 46, 40)  # binary digits below the largest q, q̇ and q̈ that are kept: the others would not compress
LONG = 0.1  # of the longest part of a grid: a quintic may end between two parts that last as long
POINTS = 5  # of a part of a grid: its ends and three points between them


class MotionPieces(NamedTuple):
    """A motion of n coordinates and nv degrees of freedom as m quintics, cut into pieces in which none reverses.

    Attributes:
        time: When each quintic begins (m,), s.
        length: How long it lasts (m,), s.
        states: q, q̇ and q̈ (m, 2, 3 n) at its begin and end.
        cuts: The number of the quintic of each piece and the shares of it (k, 3) at which the piece begins and ends.
        sides: The signs of the speeds (k, nv) in each piece, 0 where a joint rests (one_sided.py).
        rests: States (r, 3 n) before and after the motion, at rest, where it begins and ends at rest.
        error: The largest error of the quintics, relative to the largest position, speed and acceleration.
    """

    time: Array
    length: Array
    states: Array
    cuts: Array
    sides: Array
    rests: Array
    error: float


def motion_pieces(motion: Motion, robot: Robot) -> MotionPieces:
    """The pieces of a motion, with as few quintics as are accurate.

    A quintic reaches over reversals between two rows, and over short parts beside them: between two states that are
    close together, rounding would show in the accelerations.
    """
    grid = grid_along(motion)
    q = grid.position * continuous(robot.joints, grid.position)
    table = np.hstack([q, *rates(robot.joints, q, grid.velocity, grid.acceleration)])
    count = np.bincount(grid.part)
    first = int(count[0] > POINTS and grid.time[0] == grid.time[1])
    kept = slice(first, first + POINTS * len(count))
    time, states = grid.time[kept].reshape(-1, POINTS), table[kept].reshape(len(count), POINTS, -1)
    scales = np.concatenate([np.full(part.shape[1], _largest(part)) for part in np.split(table, 3, axis=1)])
    step = np.diff(motion.time)[np.clip(np.searchsorted(motion.time, time[:, 2]) - 1, 0, len(motion.time) - 2)]
    rounding = ROUNDED * scales[0] / step[:, None] ** np.repeat([0, 1, 2], len(scales) // 3) / scales
    unsure = np.where(np.isin(time, motion.time)[:, :, None], AT_ROWS, 1.0) * rounding[:, None]
    apart = (np.abs(states[1:, 0] - states[:-1, -1]) > EQUAL * scales).any(axis=1)
    turns = (np.diff(np.sign(grid.sides.velocity), axis=0) != 0.0).any(axis=1)
    long = time[:, -1] - time[:, 0] > LONG * motion.duration / FINEST
    may_end = apart | (~turns & long[1:] & long[:-1]) | np.isin(time[1:, 0], motion.time)
    found = []
    bounds = [-1, *np.flatnonzero(apart).tolist(), len(count) - 1]
    for begin, end in pairwise(bounds):
        waiting = [(begin + 1, end)]
        while waiting:
            low, high = waiting.pop()
            parts = slice(low, high + 1)
            error = _error(time[parts], states[parts], scales, unsure[parts])
            inside = low + np.flatnonzero(may_end[low:high])
            if error <= ACCURATE or not len(inside):
                found.append((low, high, error))
            else:
                middle = int(inside[np.abs(inside - (low + high) // 2).argmin()])
                waiting += [(middle + 1, high), (low, middle)]
    cuts = []
    for number, (low, high, _) in enumerate(found):
        ends = [low - 1, *(low + np.flatnonzero(turns[low:high])).tolist(), high]
        shares = [(time[end, -1] - time[low, 0]) / (time[high, -1] - time[low, 0]) for end in ends[1:-1]]
        cuts += [(number, *each) for each in zip([0.0, *shares], [*shares, 1.0], strict=True)]
    lows, highs = [each[0] for each in found], [each[1] for each in found]
    pieces = np.array(cuts)
    place = pieces[:, 0].astype(int)
    starts, lengths = time[lows, 0], time[highs, -1] - time[lows, 0]
    middle = starts[place] + 0.5 * (pieces[:, 1] + pieces[:, 2]) * lengths[place]
    part = np.minimum(np.searchsorted(grid.sides.end, middle), len(grid.sides.end) - 1)
    unit = 2.0 ** (np.ceil(np.log2(scales)) - np.repeat(DIGITS, len(scales) // 3))
    return MotionPieces(
        starts,
        lengths,
        np.round(np.stack([states[lows, 0], states[highs, -1]], axis=1) / unit) * unit,
        pieces,
        np.sign(grid.sides.velocity[part]),
        np.concatenate([table[:first], table[kept.stop :]]),
        max(each[2] for each in found),
    )


def velocities(robot: Robot, states: list[casadi.SX]) -> list[casadi.SX]:
    """q with unit vectors of length 1, v and a, as expressions of those of a polynomial: p, ṗ and p̈ (nq)."""
    if robot.nq == robot.nv:
        return states
    import casadi

    s = Symbols(robot)
    p, p_rate, p_change = (casadi.SX.sym(name, robot.nq) for name in ("p", "rate", "change"))
    unit = casadi.SX(p)
    for part in unit_vectors(robot.joints):
        unit[part] /= casadi.norm_2(p[part])
    # E has orthogonal columns: those of lengths and angles have length 1, those of quaternions 1/2.
    moves = casadi.Function("moves", [s.q], [casadi.jacobian(s.algorithm("configuration_rate")(s.q, s.v), s.v)])
    size = np.square(np.array(moves(robot.neutral))).sum(axis=0)
    v = moves(unit).T @ casadi.jtimes(unit, p, p_rate) / casadi.DM(size)
    a = casadi.jtimes(v, casadi.vertcat(p, p_rate), casadi.vertcat(p_rate, p_change))
    return list(casadi.Function("velocities", [p, p_rate, p_change], list(map(casadi.densify, (unit, v, a))))(*states))


def _largest(values: Array) -> float:
    return max(float(np.abs(values).max(initial=0.0)), 1e-300)


def _error(time: Array, states: Array, scales: Array, unsure: Array) -> float:
    """The largest error, relative to `scales`, of one quintic through parts, at the points of these, less the rounding
    of their states there (`unsure`).
    """
    length = time[-1, -1] - time[0, 0]
    s = ((time - time[0, 0]) / length).reshape(-1, 1)
    (q0, v0, a0), (q1, v1, a1) = (np.split(end, 3) for end in (states[0, 0], states[-1, -1]))
    ends = (v0 * length, a0 * length**2), (v1 * length, a1 * length**2)
    p, pd, pdd = quintic_polynomial(s, q0, q1 - q0, *ends)
    off = np.hstack([p, pd / length, pdd / length**2]) - states.reshape(len(s), -1)
    return float((np.abs(off) / scales - unsure.reshape(len(s), -1)).max(initial=0.0))


@dataclass(eq=False)
class LiveLoops:
    """The loops of a linkage whose joints all have one degree of freedom.

    Attributes:
        linkage: The linkage.
        symbols: The symbols of its equations.
        lead: The independent joints of the motions, as indices in v.
        rest: The others.
        residual: φ as expressions of `symbols`, of the rows that are kept.
        jacobian: J, the same.
    """

    linkage: Linkage
    symbols: Symbols
    lead: tuple[int, ...]
    rest: tuple[int, ...] = field(init=False)
    residual: casadi.SX = field(init=False)
    jacobian: casadi.SX = field(init=False)

    def __post_init__(self) -> None:
        s, scene = self.symbols, self.linkage.kinematics.scene
        self.rest = tuple(v for v in range(self.linkage.robot.nv) if v not in self.lead)
        c = differentiate_constraints(scene.constraints, SymbolicRows.unscaled(rows_of(scene).kept), s)
        self.residual, self.jacobian, self._drift = c.position_residual, c.jacobian, c.drift
        # Rows that are left out are 0 at the values of the sizing; at other ones they have to stay so.
        self._every = differentiate_constraints(scene.constraints, None, s).position_residual

    def states(
        self, states: Sequence[casadi.SX], closed: casadi.SX, values: casadi.SX
    ) -> tuple[casadi.SX, casadi.SX, casadi.SX]:
        """Position, velocity and acceleration of all joints, those of the independent ones given, and the positions
        `closed` of the others, at values of the parameters.
        """
        import casadi

        s, lead, rest = self.symbols, list(self.lead), list(self.rest)
        q, v, a = (casadi.SX(each) for each in states)
        q[rest] = closed
        terms = casadi.Function("terms", [s.q, s.v, s.p], [casadi.densify(self.jacobian), self._drift])
        jacobian, _ = terms(q, casadi.SX.zeros(v.shape), values)
        v[rest] = -casadi.solve(jacobian[:, rest], jacobian[:, lead] @ v[lead])
        _, drift = terms(q, v, values)
        a[rest] = -casadi.solve(jacobian[:, rest], drift + jacobian[:, lead] @ a[lead])
        return q, v, a

    def step(self, q: casadi.SX, closed: casadi.SX, values: casadi.SX) -> list[casadi.SX]:
        """A step of Newton's method from the positions `closed`, where the others are those of `q`.

        Returns:
            The next positions; the largest residual, the largest step, det J_d, and |det J_d| / ‖J_d‖ⁿ; the positions
            that `q` has.
        """
        import casadi

        s, rest, linkage = self.symbols, list(self.rest), self.linkage
        rows, units = rows_of(linkage.kinematics.scene), linkage.kinematics.units
        at = casadi.SX(q)
        at[rest] = closed
        scaled = self.residual / casadi.DM(rows.unit)
        jacobian = casadi.densify(self.jacobian[:, rest] / casadi.DM(rows.unit)) * casadi.DM(
            np.tile(units[rest], (len(rows.unit), 1))
        )
        function = casadi.Function("close", [s.q, s.p], [scaled, jacobian, self._every / rows.length])
        residual, slope, every = function(at, values)
        step = -casadi.solve(slope, residual)
        size = casadi.mmax(casadi.fabs(casadi.vertcat(residual, every)))
        determinant = casadi.det(slope)
        share = casadi.fabs(determinant) / casadi.sumsqr(slope) ** (0.5 * len(rest))
        about = casadi.vertcat(size, casadi.mmax(casadi.fabs(step)), determinant, share)
        return [closed + casadi.DM(units[rest]) * step, about, q[rest]]


def leading_joints(linkage: Linkage, motions: Sequence[Motion]) -> tuple[int, ...] | None:
    """The indices in v of the joints from which the others follow in all motions; None where they differ, or a motion
    does not follow from joints.
    """
    found = {linkage.leading(motion.name) for motion in motions}
    lead = found.pop() if len(found) == 1 else None
    return None if lead is None else tuple(linkage.robot.joint(name).v for name in lead)
