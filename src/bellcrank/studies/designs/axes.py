"""The axes of a sweep: a parameter, or another number of the scene by dotted path, with its values or distribution."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.cached_values import Portable
from bellcrank.config.fields import parse_number
from bellcrank.config.units import split_number, whole_number
from bellcrank.config.yaml_file import read_value
from bellcrank.errors import InputError
from bellcrank.messages import format_value
from bellcrank.scene.scene import Scene
from bellcrank.studies.designs.distributions import Distribution, is_distribution, read_distribution

MOST_VALUES = arguments.MOST_ITEMS  # of an axis
LARGEST_WHOLE = 10**308
EXPECTED = (
    "expected PATH=FIRST:LAST:COUNT, PATH=VALUE,VALUE,… or PATH=DISTRIBUTION, such as crank_length=1.21:1.24:31 or "
    "crank_length='normal(1.241 m, 1 mm)'"
)


@dataclass(frozen=True, eq=False, kw_only=True)
class StudyAxis(Portable):
    """One axis of a sweep: its values, or their distribution.

    Attributes:
        path: A parameter, or a dotted path in the scene.
        unit: The unit of numbers: the SI unit of a parameter, else the unit that the values are written in.
        numbers: (n,) its values; values that are not numbers, such as names of solvers, count from 0; none where there
            is a distribution.
        choices: The values that are not numbers; empty where they are.
        distribution: The distribution of the values; None where they are given.
        suffix: The unit that the scene needs behind a number; empty where a plain number will do.
        whole: Whether the numbers were given as whole ones, which some keys require.
    """

    path: str
    unit: str = ""
    numbers: Array
    choices: tuple[Any, ...] = ()
    distribution: Distribution | None = None
    suffix: str = ""
    whole: bool = False

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def label(self) -> str:
        """The path with its unit, for the title of a column."""
        return f"{self.path} [{self.unit or '1'}]"

    @property
    def numeric(self) -> bool:
        """Whether the values are numbers."""
        return not self.choices

    @property
    def values(self) -> list[Any]:
        """The values in the form that the scene accepts."""
        return [self.value(number) for number in self.numbers.tolist()]

    def value(self, number: float) -> Any:
        """The value for which a number stands, in the form that the scene accepts."""
        if self.choices:
            return self.choices[int(number)]
        if self.suffix:
            return f"{float(number)!r} {self.suffix}"
        return int(number) if self.whole else float(number)

    def shown(self, number: float) -> Any:
        """A number in the axis' unit, or the value itself where it is not a number."""
        return self.choices[int(number)] if self.choices else float(number)


@dataclass(frozen=True, eq=False)
class Numbers:
    """Numbers (n,) in a unit, as values of an axis."""

    numbers: Array
    unit: str = ""


def parse_axis(text: str) -> tuple[str, Any]:
    """Path and values of "path=first:last:count" (equally spaced, both ends in), "path=value,value,…" or
    "path=distribution", for `read_axis`. Raises InputError.
    """
    path, equals, given = text.partition("=")
    where = f"--vary {format_value(text)}"
    if not equals or not path.strip() or not given.strip():
        raise InputError(f"{where}: {EXPECTED}")
    return path.strip(), parse_values(given, where)


def parse_values(given: str, where: str) -> Any:
    """The values that a text describes, as in `parse_axis`; `where` begins messages. Raises InputError."""
    if is_distribution(given):
        return given.strip()
    if ":" in given:
        return _range(where, given.split(":"))
    parts = given.split(",")
    if len(parts) > MOST_VALUES:
        raise InputError(f"expected at most {MOST_VALUES} values, found {len(parts)}", where)
    try:
        values = tuple(read_value(part, format_value(part)) for part in parts)
    except InputError as error:
        raise InputError(error.reason, where) from None
    if any(value is None or isinstance(value, (list, dict)) for value in values):
        raise InputError(EXPECTED, where)
    return values


def read_axis(scene: Scene, path: str, values: Any, unit: str | None = None, place: str = "sweep over") -> StudyAxis:
    """The axis of a path, in the unit of the parameter that it names.

    Args:
        scene: The scene that has the path.
        path: A parameter, or a dotted path.
        values: A distribution, as a text or a `Distribution`; a range "FIRST:LAST:COUNT"; or the values.
        unit: The SI unit of a path that is no parameter, where it is known.
        place: What the path is an axis of, with which messages begin.

    Raises:
        InputError: There are no values, or they do not fit the parameter.
    """
    parameter = scene.parameters.get(path.removeprefix("parameters."))
    unit = unit if parameter is None else parameter.unit
    where = f"{place} {format_value(path)}"
    if isinstance(values, str) and is_distribution(values):
        try:
            values = read_distribution(values, unit)
        except InputError as error:
            raise InputError(str(error), where) from None
    if isinstance(values, Distribution):
        suffix = values.unit if unit is None else ""
        return StudyAxis(path=path, unit=values.unit, numbers=np.zeros(0), distribution=values, suffix=suffix)
    if isinstance(values, str) and len(parts := values.split(":")) == 3 and _split(parts[0]) and whole_number(parts[2]):
        values = _range(where, parts)
    if isinstance(values, Numbers):
        return _axis_of_numbers(where, path, values, unit)
    if isinstance(values, np.ndarray) and values.ndim == 1 and values.dtype.kind in "f" and len(values) <= MOST_VALUES:
        values = Numbers(values.astype(np.float64))
        return _axis_of_numbers(where, path, values, unit)
    return _axis_of_values(where, path, values, unit)


def _axis_of_numbers(where: str, path: str, given: Numbers, unit: str | None) -> StudyAxis:
    numbers = given.numbers
    if not len(numbers):
        raise InputError("expected at least one value, found none", where)
    if unit is None:
        return StudyAxis(path=path, unit=given.unit, numbers=_frozen(numbers), suffix=given.unit)
    try:
        factor = parse_number(f"1 {given.unit}", unit)
        parse_number(float(numbers[np.argmax(~np.isfinite(numbers))]), unit)  # says what is wrong with one that is not
    except ValueError as error:
        raise InputError(str(error), where) from None
    return StudyAxis(path=path, unit=unit, numbers=_frozen(numbers * factor))


def _axis_of_values(where: str, path: str, values: Any, unit: str | None) -> StudyAxis:
    if isinstance(values, (str, int, float)):
        values = [values]
    try:
        listed = tuple(_plain(value) for value in arguments.several("vary", values, object, "values"))
    except InputError as error:
        raise InputError(error.reason, where) from None
    if not listed:
        raise InputError("expected at least one value, found none", where)
    if unit is not None:
        try:
            return StudyAxis(path=path, unit=unit, numbers=_frozen([parse_number(value, unit) for value in listed]))
        except ValueError as error:
            raise InputError(str(error), where) from None
    parts = [part for value in listed if (part := _split(value)) is not None]
    units = {written for _, written in parts}
    if len(parts) < len(listed) or len(units) > 1:
        return StudyAxis(path=path, numbers=_frozen(np.arange(len(listed))), choices=listed)
    whole = all(isinstance(value, int) for value in listed)
    own = units.pop()
    return StudyAxis(path=path, unit=own, numbers=_frozen([number for number, _ in parts]), suffix=own, whole=whole)


def _frozen(numbers: Iterable[float] | Array) -> Array:
    kept = np.array(numbers, dtype=np.float64)
    kept.flags.writeable = False
    return kept


def _plain(value: Any) -> Any:
    """A value of an axis as a plain Python type; InputError for a type that no key of a scene accepts."""
    if isinstance(value, np.generic) or (isinstance(value, np.ndarray) and value.ndim == 0):
        value = value.item()
    if not isinstance(value, (str, bool, int, float, list, tuple, dict)):
        arguments.refuse("vary", "numbers, texts, or another value that the key accepts", value)
    if isinstance(value, int) and abs(value) > LARGEST_WHOLE:
        arguments.refuse("vary", "numbers that a double can hold", value)
    return value


def _range(where: str, parts: list[str]) -> Numbers:
    ends = [_split(part) for part in parts[:2]]
    count = whole_number(parts[2]) if len(parts) == 3 else None
    if None in ends or count is None:
        raise InputError(EXPECTED, where)
    if not 1 <= count <= MOST_VALUES:
        raise InputError(f"expected a count from 1 to {MOST_VALUES}, found {format_value(parts[2].strip())}", where)
    (first, before), (last, after) = (end for end in ends if end is not None)
    if before and after and before != after:
        raise InputError(f"the ends are in '{before}' and in '{after}'; write one unit", where)
    if count == 1 and first != last:
        raise InputError("count must be at least 2", where)
    if not math.isfinite(last - first):
        raise InputError("expected finite ends with a finite difference", where)
    return Numbers(np.linspace(first, last, count), after or before)


def _split(value: Any) -> tuple[float, str] | None:
    """The number and the unit of a value; None where it is not a number."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        try:
            return float(value), ""
        except OverflowError:
            return math.copysign(math.inf, value), ""
    return split_number(value) if isinstance(value, str) else None
