"""Splines of degree 5: through given points, and between samples whose value, velocity and acceleration are known.

The spline through points is solved in C++ (src/cpp/motion/spline.cpp): importing scipy.interpolate takes 0.3 s.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bellcrank._step import spline_coefficients, spline_values
from bellcrank.arrays import Array, Mask
from bellcrank.errors import InputError
from bellcrank.motion.coordinates import continuous, from_rates, rates
from bellcrank.robot.model.joints import JointLike

FEWEST = 6  # points of a spline whose ends are not-a-knot
AMPLIFIED = (
    6.0  # max 60 s (1 − s) (1 − 2 s): times rounding / step² it is what rounding changes in the second derivative
)
VISIBLE = 1e-4  # of the second derivative
Ends = tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class QuinticSpline:
    """A spline by its knots (n + 6,) and coefficients (n, m)."""

    knots: Array
    coefficients: Array

    @classmethod
    def through(cls, times: Array, points: Array, rest: bool) -> QuinticSpline:
        """The spline through points (k, m) at times (k,), which rise.

        With `rest` its first and second derivative are 0 at both ends. Without, the ends are not-a-knot, for which
        `FEWEST` points are needed (C. de Boor, A Practical Guide to Splines, 1978, ch. XIII).

        Raises:
            InputError: The times are too close for numbers.
        """
        inner = times[1:-1] if rest else times[3:-3]
        knots = np.concatenate([np.repeat(times[:1], 6), inner, np.repeat(times[-1:], 6)])
        try:
            found = spline_coefficients(knots, np.ascontiguousarray(times), np.ascontiguousarray(points, dtype=float))
        except ValueError:
            raise too_close(times) from None
        if not np.isfinite(found).all():
            raise too_close(times)
        return cls(knots, found)

    def __call__(self, times: Array, order: int = 0) -> Array:
        """Values (k, m) of a derivative at times (k,); beyond the ends the curve goes on as it is there."""
        return spline_values(self.knots, self.coefficients, np.ascontiguousarray(times, dtype=float), order)


def too_close(times: Array) -> InputError:
    """The error of points through which no curve can be computed."""
    least = float(np.min(np.diff(times)))
    return InputError(
        f"no smooth curve passes through {len(times)} points whose times lie as close as {least:.3g} s; "
        "leave some of them out"
    )


def quintic(
    knots: Array, value: Array, first: Array, second: Array, at: Array, step: Any = None
) -> tuple[Array, Array, Array]:
    """Value, first and second derivative (m, k) at points (m,) from those (n, k) at increasing knots (n,).

    `step` (m,) says which interval each point is taken to lie in; left out, it is looked up. The error of the
    second derivative is of order step⁴ (E. Hairer, S. Nørsett, G. Wanner, Solving Ordinary Differential
    Equations I, II.6). Where the knots are so close that rounding of the values would show in the second derivative,
    it and the first are interpolated linearly.
    """
    if step is None:
        step = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
    k = step
    h = (knots[k + 1] - knots[k])[:, None]
    s = (at - knots[k])[:, None] / h
    v0, a0 = h * first[k], h * h * second[k]
    v1, a1 = h * first[k + 1], h * h * second[k + 1]
    p, pd, pdd = quintic_polynomial(s, value[k], value[k + 1] - value[k], (v0, a0), (v1, a1))
    short = _too_short(knots[k], h, (value[k], value[k + 1]), (first[k], first[k + 1]), (second[k], second[k + 1]))
    slope, bend = (f[k] + s * (f[k + 1] - f[k]) for f in (first, second))
    square = np.where(short, 1.0, h * h)
    return np.asarray(p), np.where(short, slope, pd / h), np.where(short, bend, pdd / square)


def quintic_polynomial(s: Any, value: Any, d: Any, begin: Any, end: Any) -> tuple[Any, Any, Any]:
    """The quintic that rises by d from `value` over 0 <= s <= 1, and its derivatives by s, of numbers, arrays or
    expressions; `begin` and `end` are its first and second derivatives there.
    """
    _, v0, half, c3, c4, c5 = quintic_powers(value, d, begin, end)
    a0 = 2.0 * half
    p = value + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))))
    pd = v0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    pdd = a0 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))
    return p, pd, pdd


def quintic_powers(value: Any, d: Any, begin: Any, end: Any) -> tuple[Any, ...]:
    """The coefficients of 1, s, … s⁵ of `quintic_polynomial`."""
    (v0, a0), (v1, a1) = begin, end
    c3 = 10.0 * d - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15.0 * d + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    c5 = 6.0 * d - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1
    return value, v0, 0.5 * a0, c3, c4, c5


def _too_short(knot: Array, h: Array, value: Ends, first: Ends, second: Ends) -> Mask:
    """Whether rounding of values and knots would change the second derivative within steps h (m, 1) by more than
    VISIBLE of what it is there. Values are sums of numbers of the size of 1 (rad, m), or larger.
    """
    size, speed, known = (np.maximum(np.abs(ends[0]), np.abs(ends[1])) for ends in (value, first, second))
    rounding = AMPLIFIED * np.finfo(float).eps * (1.0 + size + (np.abs(knot)[:, None] + h) * speed)
    missing = np.abs(value[1] - value[0] - 0.5 * h * (first[0] + first[1]))
    return np.asarray((rounding > VISIBLE * np.maximum(h * h * known, missing)) | (h * h < np.finfo(float).tiny))


def smooth_between(joints: Sequence[JointLike], time: Array, q: Array, v: Array, a: Array) -> Callable[[Array], Any]:
    """Positions and velocities at times between rows, by quintics that match position, velocity and acceleration at
    either row; rotations are of unit length.
    """
    smooth, a = q * continuous(joints, q), np.where(np.isfinite(a), a, 0.0)
    slope, curvature = rates(joints, smooth, v, a)

    def at(times: Array) -> tuple[Array, Array]:
        step = np.clip(np.searchsorted(time, times, side="right") - 1, 0, len(time) - 2)
        q, velocity, _ = from_rates(joints, *quintic(time, smooth, slope, curvature, times, step))
        return q, velocity

    return at
