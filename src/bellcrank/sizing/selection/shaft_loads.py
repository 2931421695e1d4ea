"""What a reduced load cycle asks of the shafts of many motors: largest values of linear forms, root mean squares."""

from __future__ import annotations

import numpy as np

from bellcrank.arrays import Array
from bellcrank.numerics import floats
from bellcrank.sizing.selection.load_reductions import ACCELERATION, DIRECTION, DRIVING, SPEED, ReducedCycle
from bellcrank.sizing.selection.pairs import Pairs

BLOCK = 2**16  # values at once: they stay in the processor's cache
FEW = 1000  # pairs: for so few of them all samples cost less (1 ms) than finding the extreme points (10 ms)


def shaft_coefficients(pairs: Pairs, cycle: ReducedCycle) -> Array:
    """Factors (m, 5) of the cycle's features whose sum is the torque at each pair's shaft, N m."""
    return coefficients(pairs, cycle, electrical=False)


def electrical_coefficients(pairs: Pairs, cycle: ReducedCycle) -> Array:
    """Factors (m, 5) of the torque of the current T_e: the shaft torque, and friction and iron losses."""
    return coefficients(pairs, cycle, electrical=True)


def coefficients(pairs: Pairs, cycle: ReducedCycle, *, electrical: bool) -> Array:
    """Factors (m, 5) of the cycle's features, times its safety factor; see `PowerTrains.electrical_coefficients`."""
    factors = pairs.coefficients
    if not electrical or cycle.includes_gear or cycle.safety_factor != 1.0:
        factors = cycle.safety_factor * factors
    if not electrical:
        factors[:, 3:] = 0.0
    if cycle.includes_gear:
        factors[:, :2] = cycle.safety_factor / pairs.of_gear("ratio")[:, None]
    return factors


def least_coefficients(pairs: Pairs, cycle: ReducedCycle, *, electrical: bool) -> Array:
    """Factors (m, 5) of the features of `ReducedCycle.aligned` whose sum is a lower bound of each pair's torque, times
    the cycle's safety factor.

    Where the motor drives and the load's torque τ has the sign of q̈, the parts of the torque,

        T_e = τ/(N η) + (J_rotor + J_gear) N q̈ + T_c sign q̇ + c_v N q̇,

    all have the sign of τ. So |T_e| is the sum of their sizes, each of which is at least its value with η = 1, no
    inertia and no friction: |T_e| >= |T| >= |τ|/N, because η <= 1 and inertias and friction are not negative. Every
    figure that is not stated is replaced so; those that are stated count in full. A curve of efficiency counts as 1.
    Elsewhere the torque counts as 0. (Derived here. Only an unknown ratio leaves the bound unknown.)
    """
    ratio = pairs.of_gear("ratio")
    curved = pairs.products.gear_arrays.efficiency_curve.known[pairs.gear]
    efficiency = np.where(curved, 1.0, np.nan_to_num(pairs.of_gear("efficiency"), nan=1.0))
    inertia = np.nan_to_num(pairs.of_motor("rotor_inertia")) + np.nan_to_num(pairs.of_gear("inertia"))
    factors = np.zeros((len(pairs), 5))
    factors[:, DRIVING] = 1.0 / (ratio * efficiency)
    factors[:, ACCELERATION] = inertia * ratio
    if electrical:
        factors[:, DIRECTION] = np.nan_to_num(pairs.of_motor("coulomb_torque"))
        factors[:, SPEED] = np.nan_to_num(pairs.of_motor("viscous_coefficient")) * ratio
    return cycle.safety_factor * factors


def speed_coefficients(pairs: Pairs, per_speed: Array | float = 1.0) -> Array:
    """Factors (m, 5) of the cycle's features whose sum is each shaft's speed N q̇ times something (m,)."""
    return floats(np.eye(5)[SPEED] * (pairs.of_gear("ratio") * per_speed)[:, None])


def largest(factors: Array, cycle: ReducedCycle, over: Array | float | None = None) -> Array:
    """The largest |c · x| (m,) over all samples x of the cycle, of factors c (m, 5) >= 0; NaN where one is NaN.

    Where `not_above` shows that it is not over a level (m,), if one is given, its bound may stand in for it.
    """
    if len(factors) == 1 or (over is None and len(factors) <= FEW):
        return _largest(np.abs, factors, cycle.forward)
    found = not_above(factors, cycle)
    rows = np.nonzero(~np.isnan(found) if over is None else found > over)[0]
    if len(rows) <= FEW:
        found[rows] = _largest(np.abs, factors[rows], cycle.forward)
        return found
    factors = factors[rows]
    most = _largest(None, factors, cycle.extremes(1, 1))
    found[rows] = np.maximum(most, _largest(None, -factors, cycle.extremes(-1, -1)))
    return found


def not_above(factors: Array, cycle: ReducedCycle) -> Array:
    """What `largest` does not exceed (m,), at little cost: all features have their largest size at once."""
    return np.asarray(np.max([factors @ corner for corner in cycle.corners], axis=0))


def largest_shaft_torque(pairs: Pairs, cycle: ReducedCycle, over: Array | None = None) -> Array:
    """The largest |T| (m,) at each pair's shaft, N m; a bound of it may stand in where it is not over a level (m,)."""
    if over is not None and len(pairs) > 1:
        return largest(shaft_coefficients(pairs, cycle), cycle, over)
    return pairs.once(("largest shaft torque", cycle), lambda: largest(shaft_coefficients(pairs, cycle), cycle))


def most_shaft_torque(pairs: Pairs, cycle: ReducedCycle) -> Array:
    """What the largest |T| is not above (m,), N m; see `not_above`."""
    return pairs.once(("most shaft torque", cycle), lambda: not_above(shaft_coefficients(pairs, cycle), cycle))


def rms_shaft_torque(pairs: Pairs, cycle: ReducedCycle) -> Array:
    """The root mean square (m,) of T at each pair's shaft, N m."""
    return pairs.once(("RMS shaft torque", cycle), lambda: root_mean_square(shaft_coefficients(pairs, cycle), cycle))


def largest_signed(torque: Array, speed: Array, cycle: ReducedCycle) -> Array:
    """The largest ±(t · x) + s · x (m,) over the samples x turned to speeds of 0 or more; t (m, 5) >= 0.

    The factors s (m, 5) are those of the speed alone, of either sign.
    """
    if len(torque) <= FEW:
        return np.maximum(*(_largest(None, sign * torque + speed, cycle.forward) for sign in (1.0, -1.0)))
    found = np.full(len(torque), -np.inf)
    for rising in (False, True):
        rows = np.nonzero((speed[:, SPEED] < 0.0) == rising)[0]
        for sign in (1, -1) if len(rows) else ():
            points = cycle.extremes(sign, -1 if rising else 1)
            found[rows] = np.maximum(found[rows], _largest(None, sign * torque[rows] + speed[rows], points))
    return found


def _largest(function: np.ufunc | None, factors: Array, points: Array) -> Array:
    """The largest value (m,) of products of factors (m, 5) and points (h, 5), or of a function of them."""
    if len(points) == 1:
        (values,) = (factors @ points.T).T
        return values if function is None else floats(function(values))
    transposed = np.ascontiguousarray(points.T)
    found = np.empty(len(factors))
    step = max(1, BLOCK // len(points))
    for start in range(0, len(factors), step):
        values = factors[start : start + step] @ transposed
        if function is not None:
            function(values, out=values)
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
