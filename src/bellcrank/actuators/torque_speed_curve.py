"""A torque-speed curve that holds in all four quadrants: points (speed, torque) from speed 0 on."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments
from bellcrank.errors import InputError

Array = NDArray[np.float64]
Points = tuple[tuple[float, float], ...]


def falling_curve(curve: object, where: str) -> Points:
    """The points of a curve as numbers: speeds that start at 0 and rise, torques that do not. Raises InputError."""
    expected = "at least two (speed rad/s, torque N m) points"
    if isinstance(curve, np.ndarray) and curve.ndim == 2:
        curve = curve.tolist()
    if not isinstance(curve, (list, tuple)) or len(curve) < 2:
        arguments.refuse("curve", expected, curve, where)
    pairs = [arguments.vector("curve", pair, 2, most=arguments.LARGEST, where=where) for pair in curve]
    points = tuple((float(speed), float(torque)) for speed, torque in pairs)
    speeds, torques = zip(*points, strict=True)
    if speeds[0] != 0.0 or not all(b > a for a, b in pairwise(speeds)):
        raise InputError(f"{where}'s curve: expected speeds that start at 0 and rise, found {list(speeds)}")
    if torques[0] <= 0.0 or torques[-1] < 0.0 or not all(b <= a for a, b in pairwise(torques)):
        raise InputError(
            f"{where}'s curve: expected torques of 0 or more that do not rise with the speed, found {list(torques)}"
        )
    return points


def four_quadrants(points: Points) -> Array:
    """Corners (k, 2) of speed rad/s and torque N m of the region below a curve, in all four quadrants."""
    speed, torque = np.array([*points, (points[-1][0], 0.0)]).T
    return np.column_stack(
        [
            np.concatenate([speed, speed[::-1], -speed, -speed[::-1]]),
            np.concatenate([torque, -torque[::-1], -torque, torque[::-1]]),
        ]
    )


def torque_below(points: Points, speed: Array) -> Array:
    """The torque (n,) N m that a curve allows at speeds (n,) rad/s of either sign; 0 beyond its last speed."""
    speeds, torques = np.array(points).T
    return np.asarray(np.interp(np.abs(speed), speeds, torques, right=0.0))


def share_of_curve(points: Points, torque: Array, speed: Array) -> Array:
    """The share (n,) of a curve that torques (n,) N m at speeds (n,) rad/s use, along the ray from the origin.

    A point is inside exactly when its share is at most 1, because the region under a curve that does not rise is
    star-shaped about the origin. NaN where an argument is NaN.
    """
    speeds, torques = np.array(points).T
    return share_of_curves(speeds, torques, torque, speed)


def share_of_curves(speeds: Array, torques: Array, torque: Array, speed: Array) -> Array:
    """As `share_of_curve`, of curves whose points have speeds (m, …) and torques (m, …) that broadcast with the load.

    Points of one speed count once.
    """
    torque, speed = np.abs(torque), np.abs(speed)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        reach = np.where(speed > 0.0, speeds[-1] / speed, np.inf)  # factor to the last speed
        for k in range(len(speeds) - 1):
            slope = (torques[k + 1] - torques[k]) / (speeds[k + 1] - speeds[k])
            intercept = torques[k] - slope * speeds[k]
            factor = intercept / (torque - slope * speed)
            at = factor * speed
            # The first crossing counts. Round-off must not miss a corner, hence the slack.
            slack = 1e-12 * speeds[-1]
            crosses = (torque > 0.0) & np.isfinite(factor) & (at >= speeds[k] - slack) & (at <= speeds[k + 1] + slack)
            reach = np.where(crosses, np.minimum(reach, factor), reach)
        use = np.where(np.isinf(reach), 0.0, 1.0 / reach)
    return np.where(np.isnan(torque) | np.isnan(speed), np.nan, use)
