"""Differentiation of sampled positions or velocities, separately on either side of jumps of the acceleration.

A spline across a jump oscillates; splines on both sides of it do not. A jump shows in divided differences: those across
it are many times larger than those beside it, while neighbouring differences of smooth samples are of similar size
(A. Harten et al., Uniformly high order accurate essentially non-oscillatory schemes, J. Comput. Phys. 71, 1987).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from bellcrank.arrays import Array
from bellcrank.motion.generators.waypoints import derivative, second_derivatives
from bellcrank.motion.sampled.file_precision import differences, typical_noise

RISE = 6.0  # times the differences beside it: differences around a jump are larger than this
DIGITS = 2.0**-52  # of the largest number: what numbers of double precision round to
AGREES = 0.05  # of a jump times h²: what a jump found in positions may miss
GOOD = 0.01  # and what leaves no doubt of where it is
NEAR = 12  # samples on either side of a jump that say where it is
LEAST = 1e-4  # of the largest acceleration: smaller jumps are left to the spline


def positions_differentiated(time: Array, position: Array, rounding: float) -> tuple[Array, Array, list[int]]:
    """Velocity and acceleration (n,) at the samples of a position (n,), which is known to ± `rounding`, and the samples
    after which the acceleration jumps.
    """
    velocity, acceleration = np.zeros_like(position), np.zeros_like(position)
    pieces = _pieces_that_agree(time, position, 2, rounding)
    for piece in pieces:
        velocity[piece], acceleration[piece] = second_derivatives(time[piece], position[piece])
    return velocity, acceleration, [piece.stop - 1 for piece in pieces[:-1]]


def velocity_differentiated(time: Array, velocity: Array, rounding: float) -> Array:
    """Acceleration (n,) at the samples of a velocity (n,), which is known to ± `rounding`."""
    acceleration = np.zeros_like(velocity)
    for piece in _pieces_that_agree(time, velocity, 1, rounding):
        acceleration[piece] = derivative(time[piece], velocity[piece, None])[:, 0]
    return acceleration


def _pieces_that_agree(time: Array, values: Array, order: int, rounding: float) -> list[slice]:
    """The smooth pieces, joined where no jump between them agrees with speeds and positions: samples that are too far
    apart look like jumps, and are taken to be smooth.
    """
    edges = [0, *(piece.stop for piece in smooth_pieces(time, values, order, rounding))]
    for place in range(len(edges) - 2, 0, -1):
        edge = _best_edge(time, values, order, edges[place - 1], edges[place], edges[place + 1])
        edges[place : place + 1] = [] if edge is None else [edge]
    return [slice(a, b) for a, b in pairwise(edges)]


def _best_edge(time: Array, values: Array, order: int, first: int, edge: int, last: int) -> int | None:
    """The first sample after a jump: this one, or a neighbour where rounding hides on which side a sample lies.

    It is the one for which a jump between both sides' accelerations agrees best with speeds and positions there; None
    where none agrees.
    """
    best, least = None, 2.0 * AGREES
    for k in (edge, edge - 1, edge + 1):
        if least < GOOD:
            break
        if k - first < order + 1 or last - k < order + 1:
            continue
        sides = (slice(max(first, k - NEAR), k), slice(k, min(last, k + NEAR)))
        if order == 2:
            (v0, a0), (v1, a1) = (second_derivatives(time[side], values[side]) for side in sides)
        else:
            v0, v1 = (values[side] for side in sides)
            a0, a1 = (derivative(time[side], values[side, None])[:, 0] for side in sides)
        h, jump = time[k] - time[k - 1], a0[-1] - a1[0]
        if jump == 0.0:
            continue
        until = (v1[0] - v0[-1] - a1[0] * h) / jump  # of the step, when the acceleration jumps
        miss = max(-until, until - h, 0.0) / h
        if order == 2:
            place = values[k - 1] + h * v0[-1] + 0.5 * a1[0] * h * h + jump * until * (h - 0.5 * until)
            miss += abs(values[k] - place) / (abs(jump) * h * h)
        if miss < 0.5 * least:  # neighbours only where they are clearly better
            best, least = k, miss
    return best


def smooth_pieces(time: Array, values: Array, order: int, rounding: float) -> list[slice]:
    """Ranges of samples (n,) between jumps of the derivative of this order (1 or 2); no jump lies inside a range.

    Each has at least order + 1 samples, so that it determines that derivative. Where jumps are closer, the largest are
    kept.
    """
    if len(time) < order + 4:
        return [slice(0, len(time))]
    # Rounding by ± q changes a difference over equal steps h by at most 2^width q.
    width = order + 2
    most = 2.0**width * rounding / (float(time[-1] - time[0]) / (len(time) - 1)) ** order
    noise = typical_noise(differences(time, values, width, order), most) / most if most > 0.0 else 0.0
    least = LEAST * np.abs(differences(time, values, order, order)).max(initial=0.0)
    found, open_ranges = [], [slice(0, len(time))]
    while open_ranges:
        piece = open_ranges.pop()
        split = _split(
            time[piece], values[piece], order, least, noise * rounding + DIGITS * float(np.abs(values).max())
        )
        if split is None:
            found.append(piece)
        else:
            open_ranges += [slice(piece.start, piece.start + split), slice(piece.start + split, piece.stop)]
    return sorted(found, key=lambda piece: piece.start)


def _split(time: Array, values: Array, order: int, least: float, rounding: float) -> int | None:
    """Number of samples before the most distinct jump; None where there is none."""
    n, width = len(time), order + 2
    if n < width + 2:
        return None
    difference = np.abs(differences(time, values, width, order))
    span = (time[width:] - time[:-width]) / width
    floor = least + 2.0**width * rounding / span**order
    inside, around = _sliding(difference, width), _sliding(floor, width)  # of all differences across each step
    padded = np.pad(difference, width + 3)
    place = np.arange(n - 1) + 3  # of the difference that ends with a step's first sample
    left, right = padded[place], padded[place + width + 1]
    # At an end there is one side, where a difference may be 0 by chance: look further.
    further = np.maximum.reduce(
        [padded[place - j] for j in (1, 2, 3)] + [padded[place + width + 1 + j] for j in (1, 2)]
    )
    one_sided = (np.arange(n - 1) < width) | (np.arange(n - 1) + width >= n - 1)
    quiet = np.maximum(np.maximum(left, right), np.where(one_sided, further, 0.0))
    score = inside / np.maximum(np.maximum(quiet, around), 1e-300)
    score[:order] = score[n - 1 - order :] = 0.0
    k = int(np.argmax(score))
    if k + width >= n - 1:  # at the end several steps have the same differences across them, and the last has the jump
        k = int(np.flatnonzero(score > 0.5 * score[k])[-1])
    return k + 1 if score[k] > RISE else None


def _sliding(difference: Array, width: int) -> Array:
    """Largest of the differences (m,) across each of the m + width − 1 steps."""
    padded = np.pad(difference, width - 1)
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, width).max(axis=1))
