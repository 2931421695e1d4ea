"""Where sampled positions or velocities stop being smooth, and their derivatives on either side.

A jump of acceleration is a corner in the velocity and a jump of the second derivative in the position. A spline across
it rings; splines on both sides of it do not. A jump shows in divided differences: those of the samples around it are
many times larger than those just beside it, while smooth samples have neighbouring differences of one size (A. Harten
et al., Uniformly high order accurate essentially non-oscillatory schemes, J. Comput. Phys. 71, 1987).
"""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from itertools import pairwise
from math import factorial

import numpy as np

from bellcrank.motion.coordinates import Array
from bellcrank.motion.waypoints import derivative, second_derivatives

RISE = 6.0  # times the differences beside it: differences around a jump are larger than this
TYPICAL = 8.0  # times the median: what rounding changes nowhere by more
LEAST = 1e-4  # of the largest acceleration: smaller jumps are left to the spline


def positions_differentiated(time: Array, position: Array, rounding: float) -> tuple[Array, Array]:
    """Velocity and acceleration (n,) at the samples of a position (n,), which is known to ± `rounding`."""
    velocity, acceleration = np.zeros_like(position), np.zeros_like(position)
    for piece in smooth_pieces(time, position, 2, rounding):
        velocity[piece], acceleration[piece] = second_derivatives(time[piece], position[piece])
    return velocity, acceleration


def velocity_differentiated(time: Array, velocity: Array, rounding: float) -> Array:
    """Acceleration (n,) at the samples of a velocity (n,), which is known to ± `rounding`."""
    acceleration = np.zeros_like(velocity)
    for piece in smooth_pieces(time, velocity, 1, rounding):
        acceleration[piece] = derivative(time[piece], velocity[piece, None])[:, 0]
    return acceleration


def smooth_pieces(time: Array, values: Array, order: int, rounding: float) -> list[slice]:
    """Ranges of samples (n,) between jumps of the derivative of this order (1 or 2); no jump lies inside a range.

    Each has at least order + 1 samples, so that it determines that derivative. Where jumps are closer, the largest are
    kept.
    """
    n, width = len(time), order + 2
    if n < width + 2:
        return [slice(0, n)]
    difference = np.abs(_scaled_differences(time, values, width, order))
    least = np.abs(_scaled_differences(time, values, order, order)).max(initial=0.0) * LEAST
    # Rounding by ± q changes a difference over equal steps h by at most 2^width q; numbers that are exact though they
    # have few decimals show much less than that in most places.
    span = (time[width:] - time[:-width]) / width
    floor = least + np.minimum(2.0**width * rounding / span**order, TYPICAL * np.median(difference))
    score = np.zeros(n - 1)
    for k in range(n - 1):
        inside = slice(max(0, k - width + 1), min(len(difference), k + 1))
        if inside.stop <= inside.start:
            continue
        beside = [j for j in (k - width, k + 1) if 0 <= j < len(difference)]
        quiet = max((difference[j] for j in beside), default=np.inf)
        score[k] = difference[inside].max() / max(quiet, floor[inside].max())
    return _ranges(score, n, order + 1)


def _ranges(score: Array, n: int, shortest: int) -> list[slice]:
    edges = [0, n]  # first samples of the ranges
    for k in np.argsort(-score, kind="stable").tolist():
        if score[k] <= RISE:
            break
        if min(abs(k + 1 - edge) for edge in edges) >= shortest:
            edges.append(k + 1)
    return [slice(a, b) for a, b in pairwise(sorted(edges))]


def _scaled_differences(time: Array, values: Array, width: int, order: int) -> Array:
    """Divided differences over width + 1 samples, as changes of the derivative of this order over one step."""
    table = values
    for level in range(1, width + 1):
        table = np.diff(table) / (time[level:] - time[:-level])
    span = (time[width:] - time[:-width]) / width
    return np.asarray(table * factorial(width) * span ** (width - order))


def rounding_of(columns: Sequence[Array]) -> float:
    """Half a unit of the last decimal that numbers in a file have: ± this much is unknown of them; 0.0 where they have
    12 significant digits or more. The largest numbers of all columns count, so that zeros say nothing.
    """
    numbers = np.concatenate([np.unique(np.abs(column))[-32:] for column in columns])
    largest = float(numbers.max(initial=0.0))
    if largest == 0.0:
        return 0.0
    decimals = max(-int(Decimal(repr(number)).normalize().as_tuple().exponent) for number in numbers.tolist())
    unit = 10.0**-decimals
    return 0.0 if unit < 1e-12 * largest else 0.5 * unit
