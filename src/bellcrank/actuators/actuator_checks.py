"""Checks of an actuator's ratings: numbers in their ranges, peak over rated values, and a curve that falls."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from bellcrank import arguments
from bellcrank.actuators.catalogue.product_checks import Points
from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.actuators.actuator import Actuator

_NUMBERS = (  # name, least, more than, most, whether it may be unknown
    ("ratio", None, 0.0, arguments.LARGEST, False),
    ("rated_torque", None, 0.0, arguments.LARGEST, True),
    ("peak_torque", None, 0.0, arguments.LARGEST, True),
    ("rated_speed", None, 0.0, arguments.LARGEST, True),
    ("max_speed", None, 0.0, arguments.LARGEST, True),
    ("efficiency", None, 0.0, 1.0, True),
    ("rotor_inertia", 0.0, None, arguments.LARGEST, True),
    ("gear_inertia", 0.0, None, arguments.LARGEST, True),
    ("safety_factor", 1.0, None, arguments.LARGEST, False),
    ("motor_efficiency", None, 0.0, 1.0, True),
)


def check_ratings(actuator: Actuator) -> None:
    """Turn the ratings into floats in their ranges; None stays None where it may be unknown. Raises InputError."""
    for name, least, above, most, may_be_unknown in _NUMBERS:
        value = getattr(actuator, name)
        if value is None and may_be_unknown:
            continue
        number = arguments.number(name, value, least=least, above=above, most=most, where="an actuator")
        object.__setattr__(actuator, name, number)
    _require(
        actuator.known_inertia <= arguments.LARGEST,
        "ratio",
        f"one with which the reflected inertia is at most {arguments.LARGEST:g} kg m²",
        actuator.ratio,
    )
    if actuator.peak_torque is not None and actuator.rated_torque is not None:
        _require(
            actuator.peak_torque >= actuator.rated_torque,
            "peak_torque",
            f"at least the rated torque, {actuator.rated_torque:g} N m",
            actuator.peak_torque,
        )
    if actuator.max_speed is not None and actuator.rated_speed is not None:
        _require(
            actuator.max_speed >= actuator.rated_speed,
            "max_speed",
            f"at least the rated speed, {actuator.rated_speed:g} rad/s",
            actuator.max_speed,
        )
    if actuator.curve is not None:
        object.__setattr__(actuator, "curve", falling_curve(actuator.curve))


def _require(condition: bool, name: str, expected: str, found: object) -> None:
    if not condition:
        raise InputError(f"an actuator's {name}: expected {expected}, found {found}")


def falling_curve(curve: object) -> Points:
    """The points of a curve as numbers: speeds that start at 0 and rise, torques that do not. Raises InputError."""
    where, expected = "an actuator", "at least two (speed rad/s, torque N m) points"
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
