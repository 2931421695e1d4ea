"""Distributions of a parameter, written as in "normal(1.24 m, 1 mm)", and the numbers at given probabilities.

Sampled values are quantiles of points of the unit cube (samples.py): the inverse of the distribution function at each
coordinate, see Devroye, Non-Uniform Random Variate Generation (1986), sec. II.2. The truncated normal distribution is
evaluated in the lower tail, by symmetry, where the distribution function has the smaller rounding errors.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from bellcrank.arrays import Array
from bellcrank.config.fields import parse_number
from bellcrank.config.units import UNITS, split_number
from bellcrank.errors import InputError
from bellcrank.messages import format_value, unknown_name

_CALL = re.compile(r"\A\s*([A-Za-z_]\w*)\s*\(([^()]*)\)\s*\Z")


@dataclass(frozen=True)
class Family:
    """Distributions that differ in their numbers: the names of these, what they must satisfy, and the quantiles."""

    names: tuple[str, ...]
    wanted: str
    admits: Callable[..., bool]
    quantiles: Callable[..., Array]


def _normal(u: Array, mean: float, sd: float) -> Array:
    from scipy.special import ndtri

    return np.asarray(mean + sd * ndtri(u))


def _truncated(u: Array, mean: float, sd: float, low: float, high: float) -> Array:
    from scipy.special import ndtr, ndtri

    a, b = (low - mean) / sd, (high - mean) / sd
    if a + b > 0.0:  # reflected
        return 2.0 * mean - _truncated(1.0 - u, mean, sd, 2.0 * mean - high, 2.0 * mean - low)
    first, last = ndtr(a), ndtr(b)
    return np.asarray(np.clip(mean + sd * ndtri(first + u * (last - first)), low, high))


def _truncation_is_likely(mean: float, sd: float, low: float, high: float) -> bool:
    """Whether the interval has a probability that doubles can hold."""
    from scipy.special import ndtr

    if not (sd > 0.0 and low < high):
        return False
    a, b = (low - mean) / sd, (high - mean) / sd
    return bool(ndtr(min(b, -a)) > 1e-290) and bool(ndtr(b) > ndtr(a) or ndtr(-a) > ndtr(-b))


def _triangular(u: Array, low: float, mode: float, high: float) -> Array:
    width, rise = high - low, mode - low
    below = low + np.sqrt(u * width * rise)
    return np.clip(np.where(u * width < rise, below, high - np.sqrt((1.0 - u) * width * (high - mode))), low, high)


def _log_uniform(u: Array, low: float, high: float) -> Array:
    return np.clip(np.exp(math.log(low) + u * (math.log(high) - math.log(low))), low, high)


FAMILIES: Mapping[str, Family] = MappingProxyType(
    {
        "normal": Family(("mean", "sd"), "sd > 0", lambda mean, sd: sd > 0.0, _normal),
        "uniform": Family(
            ("low", "high"), "low < high", lambda low, high: low < high,
            lambda u, low, high: np.clip(low + u * (high - low), low, high),
        ),
        "truncnormal": Family(
            ("mean", "sd", "low", "high"), "sd > 0 and low < high, within 36 sd of the mean", _truncation_is_likely,
            _truncated,
        ),
        "triangular": Family(
            ("low", "mode", "high"), "low <= mode <= high and low < high",
            lambda low, mode, high: low <= mode <= high and low < high, _triangular,
        ),
        "loguniform": Family(("low", "high"), "0 < low < high", lambda low, high: 0.0 < low < high, _log_uniform),
    }
)  # fmt: skip
EXPECTED = ", ".join(f"{name}({', '.join(family.names)})" for name, family in FAMILIES.items())


@dataclass(frozen=True)
class Distribution:
    """A distribution of one parameter.

    Attributes:
        family: One of `FAMILIES`.
        numbers: Its numbers, in `unit`.
        unit: The unit of the numbers, and of what is drawn.
    """

    family: str
    numbers: tuple[float, ...]
    unit: str = ""

    def __post_init__(self) -> None:
        if self.family not in FAMILIES:
            raise InputError(unknown_name("distribution", self.family, FAMILIES))
        family = FAMILIES[self.family]
        usage = f"{self.family}({', '.join(family.names)})"
        if len(self.numbers) != len(family.names):
            raise InputError(f"expected {usage}, found {len(self.numbers)} numbers")
        if not all(map(math.isfinite, self.numbers)) or not math.isfinite(max(self.numbers) - min(self.numbers)):
            raise InputError(f"expected {usage} with finite numbers and differences")
        if not family.admits(*self.numbers):
            raise InputError(f"expected {usage} with {family.wanted}, found {self}")

    def __str__(self) -> str:
        numbers = ", ".join(f"{number:.12g}" for number in self.numbers)
        return f"{self.family}({numbers}){f' {self.unit}' if self.unit else ''}"

    def quantiles(self, probabilities: Array) -> Array:
        """The values (n,), in `unit`, below which the probability is as given, more than 0 and less than 1 (n,)."""
        return FAMILIES[self.family].quantiles(probabilities, *self.numbers)


def is_distribution(text: str) -> bool:
    """Whether a text is written as a distribution is: NAME(…)."""
    return _CALL.match(text) is not None


def read_distribution(text: str, unit: str | None) -> Distribution:
    """The distribution that a text such as "normal(1.24 m, 1 mm)" describes.

    Args:
        text: NAME(NUMBER, …). A unit stands behind every number that is not 0, or behind none.
        unit: The SI unit of the parameter; None where only the text can tell: then the unit of its first number.

    Raises:
        InputError: The text is none, or its numbers do not fit the distribution.
    """
    match = _CALL.match(text)
    shown = format_value(text.strip())
    if match is None:
        raise InputError(f"expected a distribution, one of {EXPECTED}; found {shown}")
    name = match[1]
    if name not in FAMILIES:
        raise InputError(unknown_name("distribution", name, FAMILIES))
    parts = [part.strip() for part in match[2].split(",")]
    split = [split_number(part) for part in parts]
    if any(pair is None for pair in split):
        raise InputError(f"expected {name}({', '.join(FAMILIES[name].names)}) with numbers, found {shown}")
    pairs = [pair for pair in split if pair is not None]
    written = [its_unit for number, its_unit in pairs if number != 0.0 or its_unit]
    if len({bool(its_unit) for its_unit in written}) > 1:
        raise InputError(f"{shown}: some of the numbers have a unit and others none; write it behind all, or none")
    try:
        if unit is not None:
            return Distribution(name, tuple(parse_number(part, unit) for part in parts), unit)
        own = written[0] if written else ""
        return Distribution(name, tuple(_in_unit(number, its_unit, own) for number, its_unit in pairs), own)
    except ValueError as error:
        raise InputError(f"{shown}: {error}") from None


def _in_unit(number: float, written: str, unit: str) -> float:
    """A number in another unit of the same kind; ValueError where there is none such."""
    if written in ("", unit):
        return number
    for asked, known in UNITS.items():
        if " or " not in asked and written in known and unit in known:
            return number * known[written] / known[unit]
    raise ValueError(f"the units '{unit}' and '{written}' are not of one kind")
