"""The axes of a sweep: a parameter, or another number of the scene by dotted path, with its values."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bellcrank import arguments
from bellcrank.cached_values import cached_property
from bellcrank.config.fields import parse_number
from bellcrank.config.numbers import split_number, whole_number
from bellcrank.config.yaml_file import read_value
from bellcrank.errors import InputError
from bellcrank.messages import format_value
from bellcrank.scene.scene import Scene

MOST_VALUES = arguments.MOST_ITEMS  # of an axis
LARGEST_WHOLE = 10**308
EXPECTED = "expected PATH=FIRST:LAST:COUNT or PATH=VALUE,VALUE,…, such as crank_length=1.21:1.24:31"


@dataclass(frozen=True)
class Axis:
    """One axis of a sweep's grid.

    Attributes:
        path: A parameter, or a dotted path in the scene.
        values: Its values in the form that the scene accepts.
        numbers: The same as numbers in `unit`; values that are not numbers, such as names of solvers, count from 0.
        unit: The unit of `numbers`.
    """

    path: str
    values: tuple[Any, ...]
    numbers: tuple[float, ...]
    unit: str

    @property
    def label(self) -> str:
        """The path with its unit, for the title of a column."""
        return f"{self.path} [{self.unit or '1'}]"

    @cached_property
    def numeric(self) -> bool:
        """Whether the values are numbers."""
        return all(_split(value) is not None for value in self.values)


def parse_axis(text: str) -> tuple[str, tuple[Any, ...]]:
    """Path and values of "path=first:last:count" (equally spaced, both ends in) or "path=value,value,…"; InputError."""
    path, equals, given = text.partition("=")
    if not equals or not path.strip() or not given.strip():
        raise InputError(f"--vary {format_value(text)}: {EXPECTED}")
    if ":" in given:
        return path.strip(), _range(text, given.split(":"))
    parts = given.split(",")
    if len(parts) > MOST_VALUES:
        raise InputError(f"--vary {format_value(text)}: expected at most {MOST_VALUES} values, found {len(parts)}")
    values = tuple(read_value(part, f"--vary {format_value(text)}: {format_value(part)}") for part in parts)
    if any(value is None or isinstance(value, (list, dict)) for value in values):
        raise InputError(f"--vary {format_value(text)}: {EXPECTED}")
    return path.strip(), values


def read_axis(scene: Scene, path: str, values: Iterable[Any]) -> Axis:
    """The axis of a path, in the unit of the parameter that it names; InputError where there are no values."""
    if isinstance(values, (str, int, float)):
        values = [values]
    listed = tuple(_plain(path, value) for value in arguments.several(f'vary["{path:.80}"]', values, object, "values"))
    if not listed:
        raise InputError(f"sweep over '{path}': expected at least one value, found none")
    parameter = scene.parameters.get(path.removeprefix("parameters."))
    if parameter is not None:
        try:
            return Axis(path, listed, tuple(parse_number(v, parameter.unit) for v in listed), parameter.unit)
        except ValueError as error:
            raise InputError(f"sweep over '{path}': {error}") from None
    parts = [_split(value) for value in listed]
    units = {part[1] for part in parts if part is not None}
    if None in parts or len(units) > 1:
        return Axis(path, listed, tuple(map(float, range(len(listed)))), "")
    return Axis(path, listed, tuple(part[0] for part in parts if part is not None), units.pop())


def _plain(path: str, value: Any) -> Any:
    """A value of an axis as a plain Python type; InputError for a type that no key of a scene accepts."""
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        value = value.item()
    if not isinstance(value, (str, bool, int, float, list, tuple, dict)):
        arguments.refuse(f'vary["{path:.80}"]', "numbers, texts, or another value that the key accepts", value)
    if isinstance(value, int) and abs(value) > LARGEST_WHOLE:
        arguments.refuse(f'vary["{path:.80}"]', "numbers that a double can hold", value)
    return value


def _range(text: str, parts: list[str]) -> tuple[Any, ...]:
    ends = [_split(part) for part in parts[:2]]
    count = whole_number(parts[2]) if len(parts) == 3 else None
    if None in ends or count is None:
        raise InputError(f"--vary {format_value(text)}: {EXPECTED}")
    if not 1 <= count <= MOST_VALUES:
        raise InputError(
            f"--vary {format_value(text)}: expected a count from 1 to {MOST_VALUES}, found "
            f"{format_value(parts[2].strip())}"
        )
    (first, before), (last, after) = (end for end in ends if end is not None)
    if before and after and before != after:
        raise InputError(f"--vary {format_value(text)}: the ends are in '{before}' and in '{after}'; write one unit")
    unit = after or before
    if count == 1 and first != last:
        raise InputError(f"--vary {format_value(text)}: one value cannot be at both ends; give a count of 2 or more")
    if not math.isfinite(last - first):
        raise InputError(f"--vary {format_value(text)}: expected finite ends with a finite difference")
    numbers = np.linspace(first, last, count).tolist()
    return tuple(f"{number!r} {unit}" for number in numbers) if unit else tuple(numbers)


def _split(value: Any) -> tuple[float, str] | None:
    """The number and the unit of a value; None where it is not a number."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        try:
            return float(value), ""
        except OverflowError:
            return math.copysign(math.inf, value), ""
    return split_number(value) if isinstance(value, str) else None
