"""Criteria of short-time operation: a maker's curve, and how long the torque is above the continuous one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.continuous_torque import continuous_torque
from bellcrank.actuators.product_arrays import Curves
from bellcrank.actuators.short_time_limits import peak_curve_use
from bellcrank.arrays import Array, Indices, Mask
from bellcrank.numerics import floats
from bellcrank.sizing.selection.axis_loads import DrivenAxis
from bellcrank.sizing.selection.criteria import SHAFT, Criterion, alternatives, exceeds
from bellcrank.sizing.selection.load_reductions import ReducedCycle
from bellcrank.sizing.selection.motor_criteria import ContinuousTorqueCriterion
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.shaft_loads import (
    BLOCK,
    largest_shaft_torque,
    largest_signed,
    least_coefficients,
    most_shaft_torque,
    shaft_coefficients,
    speed_coefficients,
)


class PeakCurve(Criterion):
    """Every sample under the curve of short-time operation that the maker prints; a note where there is none."""

    name = "peak curve"
    of_ratings = True
    formula = "every (ω, T) inside the printed curve, measured along the ray from the origin"
    source = "the motor's data sheet"
    needs = alternatives(SHAFT, (("motor.peak_curve",),))

    def judged(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
        """Pairs whose motor has such a curve."""
        return np.asarray(pairs.products.motor_arrays.peak_curve.known[pairs.motor])

    def cycle_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Largest use of the curve: over the extreme points where the region is convex, else over all samples."""
        use = np.full(len(pairs), np.nan)
        printed = self.judged(pairs, cycle.axis, conditions)
        if not printed.any():
            return use
        sides = convex_sides(pairs.products.peak_curves(conditions))
        convex = np.nonzero(printed & sides.convex[pairs.motor])[0]
        if len(pairs) == 1:
            use = _convex_use(pairs, cycle, sides) if len(convex) else _use_of_samples(pairs, cycle, conditions)
        elif len(convex):
            use[convex] = _convex_use(pairs.take(convex), cycle, sides)
        others = np.nonzero(printed & ~sides.convex[pairs.motor] & (len(pairs) > 1))[0]
        step = max(1, BLOCK // len(cycle.torque))
        for start in range(0, len(others), step):
            rows = others[start : start + step]
            use[rows] = _use_of_samples(pairs.take(rows), cycle, conditions)
        unknown = np.nonzero(printed & np.isnan(use))[0]
        for start in range(0, len(unknown), step):
            rows = unknown[start : start + step]
            least = self._least_use(pairs.take(rows), cycle, conditions)
            use[rows] = np.where(exceeds(least), least, np.nan)
        return use

    def _least_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Largest use (m,) at the torques of `least_coefficients`: a point above the curve stays so at a larger one."""
        torque = least_coefficients(pairs, cycle, electrical=False) @ cycle.aligned.features.T
        speed = pairs.of_gear("ratio")[:, None] * cycle.aligned.speed
        return np.asarray(np.max(peak_curve_use(pairs.motors[:, None], conditions, torque, speed), axis=1))

    def cycle_below(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions, level: Array) -> Mask:
        """By the largest torque and the largest speed at once, where the region is convex."""
        sides = convex_sides(pairs.products.peak_curves(conditions))
        speed = (pairs.of_gear("ratio") * cycle.max_speed)[:, None] * np.maximum(sides.speed[pairs.motor], 0.0)
        bound = sides.torque[pairs.motor] * most_shaft_torque(pairs, cycle)[:, None] + speed
        return np.asarray(sides.convex[pairs.motor] & (bound <= level[:, None]).all(axis=1))

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """Largest use of the curve."""
        if not self.judged(pair, cycle.axis, conditions)[0]:
            return "no curve of short-time operation is printed"
        use = float(self.cycle_use(pair, cycle, conditions)[0])
        if math.isnan(use):
            return self.missing(pair)
        unknown = math.isnan(float(shaft_coefficients(pair, cycle).sum()))
        curve = "torque-speed curve" if pair.rows(0)[0].by_ratings else "printed curve"
        return f"{'at least ' if unknown else ''}{use:.1%} of the {curve} in '{cycle.name}'"


class ShortTimeSides(NamedTuple):
    """The sides a |T| + b |ω| ≤ 1 of the regions under curves of torque over speed.

    Attributes:
        torque: a (n, p), 1/(N m); 0 where a curve has fewer sides.
        speed: b (n, p), s/rad.
        convex: Whether (n,) the sides are the region, for |ω| as the speed.
    """

    torque: Array
    speed: Array
    convex: Mask


def convex_sides(curves: Curves) -> ShortTimeSides:
    """The sides of n curves: the line through each two points, and the last speed.

    The line through (ω0, T0) and (ω1, T1) is T (ω1 - ω0) + ω (T0 - T1) = T0 ω1 - T1 ω0. A region is convex where the
    slopes fall from segment to segment.
    """
    x, y = curves.x, curves.y
    rise, run = np.diff(y, axis=1), np.diff(x, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        constant = y[:, :-1] * x[:, 1:] - y[:, 1:] * x[:, :-1]
        used = x[:, 1:] > 0.0
        slopes = rise / run
        falling = ~(np.diff(slopes, axis=1) > 0.0)
        convex = curves.known & (curves.last_x > 0.0) & falling.all(axis=1) & (~used | (constant > 0.0)).all(axis=1)
        torque = np.where(used, run / constant, 0.0)
        speed = np.where(used, -rise / constant, 0.0)
        last = 1.0 / curves.last_x
    zero = np.zeros((len(x), 1))
    return ShortTimeSides(np.hstack([torque, zero]), np.hstack([speed, last[:, None]]), convex)


def _use_of_samples(pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
    """Largest use (m,) of any curves over all samples."""
    torque = shaft_coefficients(pairs, cycle) @ cycle.features.T
    speed = pairs.of_gear("ratio")[:, None] * cycle.speed
    return floats(np.max(peak_curve_use(pairs.motors[:, None], conditions, torque, speed), axis=1))


def _convex_use(pairs: Pairs, cycle: ReducedCycle, sides: ShortTimeSides) -> Array:
    """Largest use (m,) of convex regions over the extreme points, which have speeds of 0 or more."""
    shaft = shaft_coefficients(pairs, cycle)
    per_torque, per_speed = sides.torque[pairs.motor], sides.speed[pairs.motor]
    use = np.zeros(len(pairs))
    for side in range(per_torque.shape[1]):
        speed = speed_coefficients(pairs, per_speed[:, side])
        use = np.maximum(use, largest_signed(per_torque[:, side : side + 1] * shaft, speed, cycle))
    return use


# ---- Criterion of the time that a motor bears more than its continuous torque without a break.


class PeakDuration(Criterion):
    """The longest time without a break above the continuous torque, under the time that peak torque may last.

    A sample stands for its integration weight. Where the continuous torque is unknown at some speeds, samples there
    count as above it to show a pass, and as below it to show a failure.
    """

    name = "peak duration"
    formula = "longest time with |T| > T_S1(|ω|) ≤ t_peak; nothing is asked for where |T| never exceeds T_S1"
    source = "the motor's data sheet (time of the peak torque)"
    needs = alternatives(ContinuousTorqueCriterion.needs, (("motor.peak_time",),))

    def cycle_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Longest time over the permitted one."""
        least, most = _continuous_range(pairs, cycle, conditions)
        peak = largest_shaft_torque(pairs, cycle, least)
        use = np.where(peak <= least, 0.0, np.nan)
        unknown = np.isnan(peak) | (np.isnan(pairs.of_motor("peak_time")) & ~(peak <= most))
        above = np.nonzero(~(peak <= least) & ~unknown)[0]
        step = max(1, BLOCK // len(cycle.torque))
        for start in range(0, len(above), step):
            rows = above[start : start + step]
            constant = least[rows] == most[rows]
            for some, level in ((rows[constant], least), (rows[~constant], None)):
                if len(some):
                    use[some] = _use(pairs.take(some), cycle, conditions, None if level is None else level[some])
        return use

    def reduced_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """0 where the largest torque is not above the least continuous torque."""
        least, _ = _continuous_range(pairs, cycle, conditions)
        return np.where(largest_shaft_torque(pairs, cycle, least) <= least, 0.0, np.nan)

    def cycle_below(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions, level: Array) -> Mask:
        """By blocks of samples: one counts where its largest torques and acceleration exceed the least S1 torque."""
        least, _ = _continuous_range(pairs, cycle, conditions)
        most = most_shaft_torque(pairs, cycle)
        shown = most <= least
        permitted = level * pairs.of_motor("peak_time")
        maxima, weight, interval = cycle.blocks
        rest = np.nonzero((most > least) & (permitted > 0.0))[0]
        step = max(1, BLOCK // len(weight))
        for start in range(0, len(rest), step):
            rows = rest[start : start + step]
            bounds = shaft_coefficients(pairs.take(rows), cycle) @ maxima.T
            longest = longest_run(~(bounds <= least[rows, None]), weight, interval, cycle.sequence)
            shown[rows] = longest <= permitted[rows]
        return np.asarray(shown)

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """Longest time, and the permitted one."""
        use = float(self.cycle_use(pair, cycle, conditions)[0])
        peak_time = float(pair.of_motor("peak_time")[0])
        if use == 0.0:
            return f"the torque never exceeds the continuous torque for a time in '{cycle.name}'"
        if math.isnan(use):
            return self.missing(pair)
        if math.isinf(use):
            return f"the torque exceeds the continuous torque all the time in '{cycle.name}'"
        return f"{use * peak_time:.3g} s above the continuous torque of {peak_time:.3g} s permitted, in '{cycle.name}'"


def _continuous_range(pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
    """The least and largest continuous torque (2, m) over the speeds of the cycle; NaN where not known throughout.

    Thermal limits fall with the speed and nominal torques are constant, so their ends suffice; a printed curve also has
    its points in between.
    """
    key = ("continuous range", cycle, conditions)
    return pairs.once(key, lambda: _continuous_range_of(pairs, cycle, conditions)).T


def _continuous_range_of(pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
    fastest = pairs.of_gear("ratio") * cycle.max_speed
    ends = [continuous_torque(pairs.motors, speed, conditions).torque for speed in (np.zeros(len(pairs)), fastest)]
    least, most = np.minimum(*ends), np.maximum(*ends)
    curves = pairs.motors.continuous_curve
    printed = np.nonzero(curves.known)[0]
    if len(printed):
        part = pairs.take(printed)
        for points in part.motors.continuous_curve.x.T:
            inside = np.where(points <= fastest[printed], points, 0.0)
            torque = continuous_torque(part.motors, inside, conditions).torque
            least[printed], most[printed] = np.minimum(least[printed], torque), np.maximum(most[printed], torque)
    return np.stack([least, most], axis=-1)


def _use(pairs: Pairs, cycle: ReducedCycle, conditions: Conditions, level: Array | None) -> Array:
    """Longest time over the permitted one by all samples, above a level (m,) or the continuous torque at each speed."""
    torque = np.abs(shaft_coefficients(pairs, cycle) @ cycle.features.T)
    if level is not None:
        above = torque > level[:, None]
        longest = _longest(above, cycle)
        return np.where(above.any(axis=1), _share(longest, pairs), 0.0)
    speed = pairs.of_gear("ratio")[:, None] * np.abs(cycle.speed)
    continuous = _continuous_torque_at(pairs, torque, speed, cycle, conditions)
    sure = torque > continuous
    maybe = sure | (np.isnan(continuous) & (torque > 0.0))
    most = np.where(maybe.any(axis=1), _share(_longest(maybe, cycle), pairs), 0.0)
    least = np.where(sure.any(axis=1), _share(_longest(sure, cycle), pairs), 0.0)
    return np.where((most <= 1.0) | (least == most), most, np.where(exceeds(least), least, np.nan))


def _continuous_torque_at(
    pairs: Pairs, torque: Array, speed: Array, cycle: ReducedCycle, conditions: Conditions
) -> Array:
    """Continuous torque (m, n) at speeds; only a bound of it where that decides whether the torque is above."""
    least, most = (bound[:, None] for bound in _continuous_range(pairs, cycle, conditions))
    continuous = np.where(torque <= least, least, np.broadcast_to(most, torque.shape))
    pair, sample = np.nonzero(~((torque <= least) | (torque > most)))
    motors = pairs.products.motor_arrays[pairs.motor[pair]]
    continuous[pair, sample] = continuous_torque(motors, speed[pair, sample], conditions).torque
    return continuous


def _share(longest: Array, pairs: Pairs) -> Array:
    """Times (m,) over the permitted ones; infinite where the time is, whatever is permitted."""
    return np.where(np.isinf(longest), np.inf, longest / pairs.of_motor("peak_time"))


class _Runs(NamedTuple):
    """Times (m,) above a level: before the first sample below it, after the last one, the longest; whole time."""

    first: Array
    last: Array
    longest: Array
    total: float
    whole: Mask

    def then(self, other: _Runs) -> _Runs:
        """The runs of two stretches, one after the other."""
        return _Runs(
            np.where(self.whole, self.total + other.first, self.first),
            np.where(other.whole, other.total + self.last, other.last),
            np.maximum(np.maximum(self.longest, other.longest), self.last + other.first),
            self.total + other.total,
            self.whole & other.whole,
        )

    def repeated(self, passes: int) -> _Runs:
        """The runs of several passes of the same stretch."""
        if passes == 1:
            return self
        total = self.total * passes
        return _Runs(
            np.where(self.whole, total, self.first),
            np.where(self.whole, total, self.last),
            np.where(self.whole, total, np.maximum(self.longest, self.last + self.first)),
            total,
            self.whole,
        )


def _longest(above: Mask, cycle: ReducedCycle) -> Array:
    return longest_run(above, cycle.pass_weight, cycle.interval, cycle.sequence)


def longest_run(above: Mask, weight: Array, interval: Indices, sequence: Sequence[tuple[int, int, int]]) -> Array:
    """The longest time (m,) without a break in a cycle that repeats; infinite where it has no end.

    Args:
        above: Whether (m, n) each of n samples, or blocks of samples, is above.
        weight: Weight (n,) of each in one pass, s.
        interval: Number (n,) of the interval of each.
        sequence: (first interval, interval after the last, passes) of each part in the order of the cycle.

    Returns:
        Times, s, of weights.
    """
    runs: _Runs | None = None
    for first, end, passes in sequence:
        samples = slice(*np.searchsorted(interval, [first, end]))
        part = _runs(above[:, samples], weight[samples]).repeated(passes)
        runs = part if runs is None else runs.then(part)
    if runs is None:
        return np.zeros(len(above))
    return np.where(runs.whole, np.inf, np.maximum(runs.longest, runs.last + runs.first))


def _runs(above: Mask, weight: Array) -> _Runs:
    """The runs of samples (m, n) of these weights (n,)."""
    end = np.cumsum(weight)
    run = end - np.maximum.accumulate(np.where(above, 0.0, end), axis=1)  # since the last sample below
    whole = np.asarray(above.all(axis=1))
    first = np.where(whole, end[-1], (end - weight)[np.argmin(above, axis=1)])
    return _Runs(first, run[:, -1], run.max(axis=1), float(end[-1]), whole)
