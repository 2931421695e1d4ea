"""What a motor can do, as curves in its torque-speed plane at speeds that are not negative.

All limits are the same for the opposite torque and speed together, so the half plane of positive speeds shows all of
them: positive torques drive, negative ones brake.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.continuous_torque import continuous_torque
from bellcrank.actuators.electrical import friction_torque
from bellcrank.actuators.motor import Motor
from bellcrank.actuators.product_arrays import MotorArrays
from bellcrank.actuators.short_time_limits import SpeedTorqueLimit, peak_curves, short_time_limits
from bellcrank.arrays import Array

POINTS = 121  # of a curve before points on straight lines are left out
STRAIGHT = 1e-4  # of a curve's range: deviation of a point that is left out


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorCurves:
    """Curves of one motor under some conditions; None where nothing is known of a curve.

    Attributes:
        continuous: S1 torque: points (k, 2) of speed rad/s and torque N m.
        short_time: The region of short-time operation: (k, 3) of speed, smallest and largest torque; infinite where no
            bound is known.
        voltage: The voltage limit: points (2, 2).
        unknown: What bounds the region of short-time operation and is not stated, such as "peak torque".
    """

    continuous: Array | None
    short_time: Array | None
    voltage: Array | None
    unknown: tuple[str, ...]


def motor_curves(motor: Motor, conditions: Conditions) -> MotorCurves:
    """The curves of a motor; values that the conditions assume fill what it does not state.

    Args:
        motor: The motor.
        conditions: Supply, surroundings and assumed values.

    Returns:
        The curves.

    Example:
        >>> from bellcrank.actuators.conditions import Conditions
        >>> from bellcrank.actuators.motor import Motor
        >>> motor = Motor(id="m", maker="", model="", nominal_torque=1.5, nominal_speed=300.0, peak_torque=4.0)
        >>> curves = motor_curves(motor, Conditions())
        >>> curves.continuous.tolist(), curves.voltage, curves.unknown
        ([[0.0, 1.5], [300.0, 1.5]], None, ('voltage limit', 'maximum speed'))
    """
    motors = MotorArrays.of([conditions.completed(motor)])
    limits = short_time_limits(motors, conditions)
    known = [limit for limit in limits if np.isfinite(limit.torque[0]) and np.isfinite(limit.speed[0])]
    voltage = next((limit for limit in known if limit.name == "voltage limit"), None)
    names = {limit.name for limit in known}
    torque_bound = names & {"peak torque", "peak current"} or motors.peak_curve.known[0]
    unknown = [] if torque_bound else ["peak torque"]
    unknown += [name for name in ("voltage limit", "maximum speed") if name not in names]
    return MotorCurves(
        continuous=_continuous(motors, conditions, _end(motors, known)),
        short_time=_short_time(motors, conditions, known),
        voltage=None if voltage is None else _voltage_line(motors, voltage),
        unknown=tuple(unknown),
    )


def _end(motors: MotorArrays, known: list[SpeedTorqueLimit]) -> float:
    """The speed up to which curves are drawn, rad/s: the largest that any limit or figure names."""
    stated = [
        motors.max_speed[0],
        motors.nominal_speed[0],
        motors.continuous_curve.last_x[0],
        motors.peak_curve.last_x[0],
    ]
    stated += [1.0 / limit.speed[0] for limit in known if limit.speed[0] > 0.0]
    finite = [float(speed) for speed in stated if np.isfinite(speed)]
    if np.isfinite(motors.max_speed[0]):
        return float(motors.max_speed[0])
    return max(finite, default=0.0)


def _continuous(motors: MotorArrays, conditions: Conditions, end: float) -> Array | None:
    """The S1 curve up to where it is known, or falls to zero."""
    stated = [motors.nominal_speed[0], *motors.continuous_curve.x[0]]
    speed = _speeds(end, [value for value in stated if np.isfinite(value)])
    torque = continuous_torque(motors, speed, conditions).torque
    known = np.isfinite(torque)
    if not known.any():
        return None
    zero = np.flatnonzero(torque == 0.0)
    known[zero[1:]] = False
    return straightened(np.column_stack([speed, torque])[known])


def _short_time(motors: MotorArrays, conditions: Conditions, known: list[SpeedTorqueLimit]) -> Array | None:
    """The largest and smallest torque of short-time operation over speed, within all limits that are known."""
    peak = peak_curves(motors, conditions)
    if not known and not peak.known[0]:
        return None
    ends = [1.0 / limit.speed[0] for limit in known if limit.name == "maximum speed"]
    ends += [float(peak.last_x[0])] if np.isfinite(peak.last_x[0]) else []
    ends += [2.0 / limit.speed[0] for limit in known if limit.name == "voltage limit"]  # where it brakes only
    if not ends:
        speed = np.array([0.0, np.inf])
        bound = min((1.0 / limit.torque[0] for limit in known if limit.torque[0] > 0.0), default=np.inf)
        return np.column_stack([speed, [-bound, -bound], [bound, bound]])
    speed = _speeds(min(ends), [value for value in peak.x[0] if np.isfinite(value)])
    friction = friction_torque(motors, speed)
    low, high = np.full(len(speed), -np.inf), np.full(len(speed), np.inf)
    for limit in known:
        a, b = limit.torque[0], limit.speed[0]
        if a > 0.0:
            own = friction if limit.basis == "electrical" else 0.0
            low = np.fmax(low, (-1.0 - b * speed) / a - own)
            high = np.fmin(high, (1.0 - b * speed) / a - own)
    if peak.known[0]:
        printed = peak.at(speed, beyond=0.0)
        low, high = np.fmax(low, -printed), np.fmin(high, printed)
    inside = high >= low
    return straightened(np.column_stack([speed, low, high])[inside])


def _voltage_line(motors: MotorArrays, limit: SpeedTorqueLimit) -> Array:
    """The line a T + b ω = 1 from standstill to the opposite torque."""
    speed = np.array([0.0, 2.0 / limit.speed[0]])
    torque = (1.0 - limit.speed[0] * speed) / limit.torque[0]
    if limit.basis == "electrical":
        torque = torque - np.nan_to_num(friction_torque(motors, np.maximum(speed, 1e-9)))
    return np.column_stack([speed, torque])


def _speeds(end: float, more: list[float]) -> Array:
    """Speeds from 0 to an end, with those of `more` in between."""
    return np.union1d(
        np.linspace(0.0, end, POINTS if end > 0.0 else 1), [value for value in more if 0.0 <= value <= end]
    )


def straightened(points: Array) -> Array:
    """Points (k, m) of a curve without those on straight lines between others (within STRAIGHT of each column's range).

    Source: D. Douglas, T. Peucker, The Canadian Cartographer 10, 1973, with vertical distances.
    """
    finite = np.where(np.isfinite(points), points, 0.0)
    scale = np.maximum(np.ptp(finite, axis=0), 1e-300)
    keep, stack = {0, len(points) - 1}, [(0, len(points) - 1)]
    while stack:
        first, last = stack.pop()
        if last - first < 2:
            continue
        inner = np.arange(first + 1, last)
        part = ((finite[inner, 0] - finite[first, 0]) / max(finite[last, 0] - finite[first, 0], 1e-300))[:, None]
        chord = finite[first] + part * (finite[last] - finite[first])
        off = np.max(np.abs(finite[inner] - chord) / scale, axis=1)
        worst = int(np.argmax(off))
        if off[worst] > STRAIGHT:
            middle = int(inner[worst])
            keep.add(middle)
            stack += [(first, middle), (middle, last)]
    return points[sorted(keep)]
