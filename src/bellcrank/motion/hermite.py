"""Quintic Hermite interpolation: on each step the polynomial of degree 5 that matches value, first and second
derivative at both ends; and the states of a robot between rows by it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from bellcrank.motion.coordinates import Array, continuous, from_rates, rates
from bellcrank.robot.joints import JointLike


def quintic(
    knots: Array, value: Array, first: Array, second: Array, at: Array, step: Any = None
) -> tuple[Array, Array, Array]:
    """Value, first and second derivative (m, k) at points (m,) from those (n, k) at increasing knots (n,).

    `step` (m,) says which interval each point is taken to lie in; left out, it is looked up. The error of the
    second derivative is of order step⁴ (E. Hairer, S. Nørsett, G. Wanner, Solving Ordinary Differential
    Equations I, II.6); in intervals below 1.5e-154 it is interpolated linearly.
    """
    if step is None:
        step = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
    k = step
    h = (knots[k + 1] - knots[k])[:, None]
    s = (at - knots[k])[:, None] / h
    v0, a0 = h * first[k], h * h * second[k]
    v1, a1 = h * first[k + 1], h * h * second[k + 1]
    d = value[k + 1] - value[k]
    c3 = 10.0 * d - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15.0 * d + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    c5 = 6.0 * d - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1
    p = value[k] + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))))
    pd = v0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    pdd = a0 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))
    short = h * h < np.finfo(float).tiny  # squares of such steps underflow: between their ends, it is a line
    line = second[k] + s * (second[k + 1] - second[k])
    return np.asarray(p), np.asarray(pd / h), np.where(short, line, pdd / np.where(short, 1.0, h * h))


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
