"""Checks of a catalogue row: numbers in their ranges, curves, and texts from a list."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

from bellcrank import arguments

Points = tuple[tuple[float, float], ...]
COLDEST = -273.15  # °C


@dataclass(frozen=True)
class Range:
    """The numbers that a field takes: more than `above`, or at least `least`; at most `most`."""

    above: float | None = 0.0
    least: float | None = None
    most: float = arguments.LARGEST


POSITIVE = Range()
NOT_NEGATIVE = Range(above=None, least=0.0)
SHARE = Range(most=1.0)
TEMPERATURE = Range(above=COLDEST)


def check_numbers(row: Any, where: str, ranges: Mapping[str, Range]) -> None:
    """Turn every numeric field of a frozen row into a float in its range. Raises InputError; None stays None."""
    for field in fields(row):
        value = getattr(row, field.name)
        if value is None or str(field.type) not in ("float", "float | None"):
            continue
        range_ = ranges.get(field.name, POSITIVE)
        number = arguments.number(
            field.name, value, above=range_.above, least=range_.least, most=range_.most, where=where
        )
        object.__setattr__(row, field.name, number)


def check_texts(row: Any, where: str, choices: Mapping[str, Iterable[str]]) -> None:
    """Check that the texts of a row are texts, and those named in `choices` one of the listed. Raises InputError."""
    for field in fields(row):
        value = getattr(row, field.name)
        if field.name in choices:
            if value is not None or "None" not in str(field.type):
                arguments.one_of(field.name, value, choices[field.name], where=where)
        elif str(field.type) in ("str", "str | None") and value is not None:
            arguments.text(field.name, value, empty=True, where=where)


def curve_points(name: str, value: object, where: str) -> Points | None:
    """The points of a curve over rising abscissas of 0 or more. Raises InputError."""
    if value is None:
        return None
    expected = "at least two points (two numbers each)"
    if not isinstance(value, (list, tuple)) or len(value) < 2:
        arguments.refuse(name, expected, value, where)
    points = [tuple(arguments.vector(name, point, 2, most=arguments.LARGEST, where=where).tolist()) for point in value]
    x, y = zip(*points, strict=True)
    if x[0] < 0.0 or any(b <= a for a, b in pairwise(x)):
        arguments.refuse(name, "first numbers of 0 or more that rise from point to point", list(x), where)
    if min(y) < 0.0:
        arguments.refuse(name, "second numbers of 0 or more", min(y), where)
    return tuple((float(a), float(b)) for a, b in points)


def torque_speed_curve(name: str, value: object, where: str) -> Points | None:
    """The points (speed, torque) of a torque-speed curve, from standstill on. Raises InputError.

    The torque over the speed must not rise, so that the region below the curve is star-shaped about the origin: a point
    is inside exactly when every smaller load on its ray is.
    """
    points = curve_points(name, value, where)
    if points is None:
        return None
    if points[0][0] != 0.0 or points[0][1] <= 0.0:
        arguments.refuse(name, "a first point at speed 0 with a torque of more than 0", list(points[0]), where)
    for (speed, torque), (next_speed, next_torque) in pairwise(points):
        if next_torque * speed > torque * next_speed:
            arguments.refuse(
                name,
                "torques that do not rise faster than in proportion to the speed",
                [next_speed, next_torque],
                where,
            )
    return points
