"""What a reduced load cycle asks of the shafts of many motors: largest values of linear forms, root mean squares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bellcrank.sizing.selection.load_reductions import SPEED, ReducedCycle
from bellcrank.sizing.selection.pairs import Pairs

Array = NDArray[np.float64]
BLOCK = 2**16  # values at once: they stay in the processor's cache


def shaft_coefficients(pairs: Pairs, cycle: ReducedCycle) -> Array:
    """Factors (m, 5) of the cycle's features whose sum is the torque at each pair's shaft, N m."""
    return coefficients(pairs, cycle, electrical=False)


def electrical_coefficients(pairs: Pairs, cycle: ReducedCycle) -> Array:
    """Factors (m, 5) of the torque of the current T_e: the shaft torque, and friction and iron losses."""
    return coefficients(pairs, cycle, electrical=True)


def coefficients(pairs: Pairs, cycle: ReducedCycle, *, electrical: bool) -> Array:
    """Factors (m, 5) of the cycle's features; see `PowerTrains.electrical_coefficients`."""
    factors = pairs.coefficients
    if not electrical or cycle.includes_gear:
        factors = factors.copy()
    if not electrical:
        factors[:, 3:] = 0.0
    if cycle.includes_gear:
        factors[:, :2] = 1.0 / pairs.of_gear("ratio")[:, None]
    return factors


def speed_coefficients(pairs: Pairs, per_speed: Array | float = 1.0) -> Array:
    """Factors (m, 5) of the cycle's features whose sum is each shaft's speed N q̇ times something (m,)."""
    factors = np.zeros((len(pairs), 5))
    factors[:, SPEED] = pairs.of_gear("ratio") * per_speed
    return factors


def largest(factors: Array, cycle: ReducedCycle, *, signed: bool = False) -> Array:
    """The largest |c · x| (m,) over all samples x of the cycle, of factors c (m, 5); NaN where a factor is NaN.

    With `signed` it is the largest c · x over the samples turned to speeds of 0 or more.
    """
    points = np.ascontiguousarray(cycle.extremes.T)
    found = np.empty(len(factors))
    step = max(1, BLOCK // points.shape[1])
    for start in range(0, len(factors), step):
        values = factors[start : start + step] @ points
        if not signed:
            np.abs(values, out=values)
        values.max(axis=1, out=found[start : start + step])
    return found


def root_mean_square(factors: Array, cycle: ReducedCycle) -> Array:
    """The root (m,) of the mean over time of (c · x)², of factors c (m, 5)."""
    return np.sqrt(np.maximum(mean_square(factors, cycle), 0.0))


def mean_square(factors: Array, cycle: ReducedCycle) -> Array:
    """The mean (m,) over time of (c · x)², of factors c (m, 5)."""
    return np.asarray(np.einsum("mi,mi->m", factors @ cycle.second_moments, factors))


def mean_times_speed(factors: Array, cycle: ReducedCycle) -> Array:
    """The mean (m,) over time of (c · x) q̇, of factors c (m, 5)."""
    return np.asarray(factors @ cycle.second_moments[:, SPEED])
