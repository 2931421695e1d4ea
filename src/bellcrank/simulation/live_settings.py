"""The numbers that the reader of a page can change."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A number that the reader can change.

    Attributes:
        group: Under which heading it stands.
        name: Its name there.
        unit: Its unit; empty for a factor.
        value: The value of the sizing or run.
        range: The ends of its slider.
        least: The least value that is accepted, or is not, if `above`.
        above: Whether the least value itself is refused.
        path: The path of the override that changes it; empty where there is none.
        entry: Its place in the list that the path names, or its key in the mapping; empty for a number of its own.
    """

    group: str
    name: str
    unit: str
    value: float
    range: tuple[float, float]
    least: float = 0.0
    above: bool = False
    path: str = ""
    entry: str = ""


def slider_end(value: float) -> float:
    """The least of 1, 2 and 5 times a power of ten that is not below a value."""
    power = 10.0 ** math.floor(math.log10(value)) if value > 0.0 else 1.0
    return next(power * step for step in (1.0, 2.0, 5.0, 10.0) if power * step >= value)
