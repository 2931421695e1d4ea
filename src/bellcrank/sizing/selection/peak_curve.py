"""Criterion of the curve of short-time operation that a maker prints."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.product_arrays import Curves
from bellcrank.actuators.short_time_limits import peak_curve_use
from bellcrank.numerics import floats
from bellcrank.sizing.selection.axis_loads import Axis
from bellcrank.sizing.selection.criteria import SHAFT, Array, Bools, Criterion, alternatives, exceeds
from bellcrank.sizing.selection.load_reductions import ReducedCycle
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.shaft_loads import (
    BLOCK,
    largest_shaft_torque,
    largest_signed,
    least_coefficients,
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

    def judged(self, pairs: Pairs, axis: Axis, conditions: Conditions) -> Bools:
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

    def cycle_below(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions, level: Array) -> Bools:
        """By the largest torque and the largest speed at once, where the region is convex."""
        sides = convex_sides(pairs.products.peak_curves(conditions))
        speed = (pairs.of_gear("ratio") * cycle.max_speed)[:, None] * np.maximum(sides.speed[pairs.motor], 0.0)
        bound = sides.torque[pairs.motor] * largest_shaft_torque(pairs, cycle)[:, None] + speed
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


class Sides(NamedTuple):
    """The sides a |T| + b |ω| ≤ 1 of the regions under curves of torque over speed.

    Attributes:
        torque: a (n, p), 1/(N m); 0 where a curve has fewer sides.
        speed: b (n, p), s/rad.
        convex: Whether (n,) the sides are the region, for |ω| as the speed.
    """

    torque: Array
    speed: Array
    convex: Bools


def convex_sides(curves: Curves) -> Sides:
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
    return Sides(np.hstack([torque, zero]), np.hstack([speed, last[:, None]]), convex)


def _use_of_samples(pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
    """Largest use (m,) of any curves over all samples."""
    torque = shaft_coefficients(pairs, cycle) @ cycle.features.T
    speed = pairs.of_gear("ratio")[:, None] * cycle.speed
    return floats(np.max(peak_curve_use(pairs.motors[:, None], conditions, torque, speed), axis=1))


def _convex_use(pairs: Pairs, cycle: ReducedCycle, sides: Sides) -> Array:
    """Largest use (m,) of convex regions over the extreme points, which have speeds of 0 or more."""
    shaft = shaft_coefficients(pairs, cycle)
    per_torque, per_speed = sides.torque[pairs.motor], sides.speed[pairs.motor]
    use = np.zeros(len(pairs))
    for side in range(per_torque.shape[1]):
        speed = speed_coefficients(pairs, per_speed[:, side])
        use = np.maximum(use, largest_signed(per_torque[:, side : side + 1] * shaft, speed, cycle))
    return use
