"""The limits of torque over speed at a motor's shaft as polylines, for driving and for braking."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.actuator import Actuator

Array = NDArray[np.float64]
Polyline = tuple[tuple[float, float], ...]
SAMPLES = 401
STRAIGHT = 1e-9  # of the largest torque: a corner bends more than this


def torque_speed_polylines(actuator: Actuator) -> tuple[Polyline, Polyline] | None:
    """(speed rad/s, torque N m) of the largest torque that drives the shaft, and of the largest that brakes it, without
    the safety factor; None where no limit of the torque over the speed is known.

    For an actuator of a catalogue the limits are straight lines between corners, which are found by intersecting the
    lines beside them.
    """
    if actuator.by_ratings:
        points = actuator.curve_points
        return None if points is None else (points, points)
    outline = actuator.outline
    if outline is None:
        return None
    top = float(np.max(outline[:, 0]))
    region = actuator.short_time_region
    return (
        _polyline(lambda speed: np.asarray(region.highest_torque(speed)), top),
        _polyline(lambda speed: np.asarray(region.highest_torque(-speed)), top),
    )


def _polyline(torque: Callable[[Array], Array], top: float) -> Polyline:
    """The corners of a function of the speed that consists of straight lines, from standstill to the largest speed."""
    speed = np.linspace(0.0, top, SAMPLES)
    speed[0] = 1e-9 * top  # friction opposes the motion, so standstill itself differs
    value = np.maximum(torque(speed), 0.0)
    known = np.isfinite(value)
    speed, value = speed[known], value[known]
    slope = np.diff(value) / np.diff(speed)
    bent = np.abs(np.diff(slope)) * (speed[2:] - speed[1:-1]) > STRAIGHT * float(value.max())
    corners = [(0.0, float(value[0]))]
    k = 0
    while k < len(bent):
        if not bent[k]:
            k += 1
            continue
        if k + 1 < len(bent) and bent[k + 1] and (k + 2 >= len(bent) or not bent[k + 2]):
            corners.append(_meeting(speed, value, slope, k))  # a corner within the piece between two samples
            k += 2
        else:
            corners.append((float(speed[k + 1]), float(value[k + 1])))
            k += 1
    return (*corners, (float(speed[-1]), float(value[-1])))


def _meeting(speed: Array, value: Array, slope: Array, k: int) -> tuple[float, float]:
    """Where the lines before and after piece k + 1 meet."""
    a, b = slope[k], slope[k + 2] if k + 2 < len(slope) else slope[k + 1]
    if a == b:
        return float(speed[k + 1]), float(value[k + 1])
    x = (value[k + 2] - b * speed[k + 2] - value[k] + a * speed[k]) / (a - b)
    x = float(np.clip(x, speed[k + 1], speed[k + 2]))
    return x, float(value[k] + a * (x - speed[k]))
