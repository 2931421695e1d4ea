"""A motion as quintic polynomials between states, from which a page has its states at any time."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank.motion.hermite import quintic_polynomial
from bellcrank.motion.motion import Motion
from bellcrank.sizing.motion_grid import grid_along

Array = NDArray[np.float64]
ACCURATE = 1e-9  # of the largest position, speed, acceleration: about the rounding of rows 3 ms apart
EQUAL = 1e-12  # of the same: two states of one time that differ by less are one
POINTS = 5  # of a part of a grid: its ends and three points between them


class MotionPieces(NamedTuple):
    """A motion of n joints of one degree of freedom as m quintics, cut into pieces in which no joint reverses.

    Attributes:
        time: When each quintic begins (m,), s.
        length: How long it lasts (m,), s.
        states: Positions, velocities and accelerations (m, 2, 3 n) at its begin and end.
        cuts: The number of the quintic of each piece and the shares of it (k, 3) at which the piece begins and ends.
        sides: The signs of the joints' speeds (k, n) in each piece, 0 where a joint rests (one_sided.py).
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


def motion_pieces(motion: Motion) -> MotionPieces:
    """The pieces of a motion, with as few quintics as are accurate.

    A quintic reaches over reversals between two rows: from a state at a reversal close to a row, rounding would show in
    the accelerations.
    """
    grid = grid_along(motion)
    table = np.hstack([grid.position, grid.velocity, grid.acceleration])
    count = np.bincount(grid.part)
    first = int(count[0] > POINTS and grid.time[0] == grid.time[1])
    kept = slice(first, first + POINTS * len(count))
    time, states = grid.time[kept].reshape(-1, POINTS), table[kept].reshape(len(count), POINTS, -1)
    scales = np.concatenate([np.full(motion.nv, _largest(part)) for part in np.split(table, 3, axis=1)])
    apart = (np.abs(states[1:, 0] - states[:-1, -1]) > EQUAL * scales).any(axis=1)
    turns = (np.diff(np.sign(grid.sides.velocity), axis=0) != 0.0).any(axis=1)
    may_end = apart | ~turns | np.isin(time[1:, 0], motion.time)
    found = []
    bounds = [-1, *np.flatnonzero(apart).tolist(), len(count) - 1]
    for begin, end in pairwise(bounds):
        waiting = [(begin + 1, end)]
        while waiting:
            low, high = waiting.pop()
            error = _error(time[low : high + 1], states[low : high + 1], scales)
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
    return MotionPieces(
        starts,
        lengths,
        np.stack([states[lows, 0], states[highs, -1]], axis=1),
        pieces,
        np.sign(grid.sides.velocity[part]),
        np.concatenate([table[:first], table[kept.stop :]]),
        max(each[2] for each in found),
    )


def _largest(values: Array) -> float:
    return max(float(np.abs(values).max(initial=0.0)), 1e-300)


def _error(time: Array, states: Array, scales: Array) -> float:
    """The largest error, relative to `scales`, of one quintic through parts, at the points of these."""
    length = time[-1, -1] - time[0, 0]
    s = ((time - time[0, 0]) / length).reshape(-1, 1)
    (q0, v0, a0), (q1, v1, a1) = (np.split(end, 3) for end in (states[0, 0], states[-1, -1]))
    ends = (v0 * length, a0 * length**2), (v1 * length, a1 * length**2)
    p, pd, pdd = quintic_polynomial(s, q0, q1 - q0, *ends)
    off = np.hstack([p, pd / length, pdd / length**2]) - states.reshape(len(s), -1)
    return float((np.abs(off) / scales).max(initial=0.0))
