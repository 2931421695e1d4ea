"""`Check`: two figures of a product that follow from each other, and how far they may be apart."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

P = TypeVar("P")


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
