"""Quintic Hermite interpolation: a polynomial of degree 5 a step that matches value, slope and curvature at
both ends.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bellcrank.motion.coordinates import Array


def quintic(
    knots: Array, value: Array, first: Array, second: Array, at: Array, step: Any = None
) -> tuple[Array, Array, Array]:
    """Value, first and second derivative (m, k) at points (m,) from those (n, k) at increasing knots (n,).

    `step` (m,) says which interval each point is taken to lie in; left out, it is looked up. The error of the
    second derivative is of order step⁴ (E. Hairer, S. Nørsett, G. Wanner, Solving Ordinary Differential
    Equations I, II.6).
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
    return np.asarray(p), np.asarray(pd / h), np.asarray(pdd / (h * h))


def cubic(knots: Array, value: Array, first: Array, at: Array, step: Any) -> Array:
    """Value (m, k) at points (m,) of the cubics that match value and slope (n, k) at increasing knots (n,); `step` (m,)
    says which interval each point lies in. The error is of order step⁴ (source as above).
    """
    h = (knots[step + 1] - knots[step])[:, None]
    s = (at - knots[step])[:, None] / h
    begin, end = value[step], value[step + 1]
    bend = (1.0 - s) * (h * first[step] - (end - begin)) - s * (h * first[step + 1] - (end - begin))
    return np.asarray(begin + s * (end - begin) + s * (1.0 - s) * bend)
