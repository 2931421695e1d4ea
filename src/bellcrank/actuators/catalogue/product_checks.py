"""Checks of a product: numbers in their ranges, curves, texts from a list, and figures that follow from each other."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, Generic, TypeVar

from bellcrank import arguments

Points = tuple[tuple[float, float], ...]
COLDEST = -273.15  # °C
P = TypeVar("P")


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


@dataclass(frozen=True, kw_only=True)
class Check(Generic[P]):
    """Two figures of a product, the ratio of which lies between two bounds.

    Attributes:
        name: Of the check.
        formula: What is compared, such as "U / R = stall current".
        source: Of the formula.
        figures: The two figures of a product, left and right of the formula, in SI units; None where the product does
            not state what they need.
        unit: Of the figures.
        least: Least ratio left over right.
        most: Largest ratio left over right.
        reason: Why the ratio may differ from 1, or where the bounds come from.
        advice: What to look at where the ratio is outside.
    """

    name: str
    formula: str
    source: str
    figures: Callable[[P], tuple[float | None, float | None]]
    unit: str = ""
    least: float = 0.0
    most: float = math.inf
    reason: str
    advice: str

    def ratio(self, product: P) -> float | None:
        """Left over right figure; None where the product does not state what they need."""
        left, right = self.figures(product)
        if left is None or right is None or not math.isfinite(left) or not math.isfinite(right) or right <= 0.0:
            return None
        return left / right

    def contradiction(self, product: P) -> str | None:
        """What does not agree, in one sentence; None where it agrees, or cannot be checked."""
        ratio = self.ratio(product)
        if ratio is None or self.least <= ratio <= self.most:
            return None
        left, right = self.figures(product)
        bounds = f"from {self.least:g} to {self.most:g}" if self.least > 0.0 else f"at most {self.most:g}"
        if self.most == math.inf:
            bounds = f"at least {self.least:g}"
        found = f"{_shown(left, self.unit)} against {_shown(right, self.unit)}, a ratio of {ratio:.3g}"
        return (
            f"{self.formula}: {_shown(left, self.unit) if right == 1.0 else found} (expected {bounds}); {self.advice}"
        )


def order(left: str, right: str, unit: str = "", most: float = 1.0) -> Check[Any]:
    """The check that one field is at most another one; `most` more than 1 allows for rounding."""
    words = [name.replace("no_load", "no-load").replace("_", " ") for name in (left, right)]
    return Check(
        name=f"{words[0]} and {words[1]}",
        formula=f"{words[0]} <= {words[1]}",
        source="definition",
        figures=lambda product: (getattr(product, left), getattr(product, right)),
        unit=unit,
        most=most,
        reason="by definition" if most == 1.0 else "printed figures are rounded",
        advice="were they exchanged, or is one of them of another variant of the product?",
    )


def plausible(
    name: str, formula: str, value: Callable[[Any], float | None], bounds: tuple[float, float], advice: str
) -> Check[Any]:
    """The check that a number lies in the range of what is built; it finds wrong units and decimal points."""
    return Check(
        name=name,
        formula=formula,
        source="range of products that are built",
        figures=lambda product: (value(product), 1.0),
        least=bounds[0],
        most=bounds[1],
        reason="the bounds are wide: what is outside is far from what is built",
        advice=advice,
    )


def product_of(*values: float | None) -> float | None:
    """The product of numbers; None where one is unknown."""
    known = [value for value in values if value is not None]
    return math.prod(known) if len(known) == len(values) else None


def quotient(above: float | None, below: float | None) -> float | None:
    """A quotient; None where a number is unknown, or the divisor is 0."""
    return None if above is None or not below else above / below


def _shown(value: float | None, unit: str) -> str:
    if value is None:
        return "unknown"
    if unit == "rad/s":
        value, unit = value * 30.0 / math.pi, "rpm"
    return f"{value:.4g} {unit}".rstrip()
