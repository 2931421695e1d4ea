"""Checked reading of YAML mappings: each value is read by key, kind and unit, and unread keys are refused."""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from bellcrank.config.units import decimal_comma, split_number, units_for
from bellcrank.config.yaml_file import read_yaml
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess
from bellcrank.messages import file_name_here, format_value, unknown_name

_REQUIRED: Final = object()
MOST_WHOLE = 10**9


def parse_number(value: object, unit: str) -> float:
    """The SI value of a number, or of a text such as "30 deg"; ValueError says what was expected instead."""
    known = units_for(unit)
    if isinstance(value, (bool, np.bool_)):
        raise ValueError(f"expected {_wanted(unit)}, found {str(value).lower()}")
    if isinstance(value, (int, float, np.integer, np.floating)):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
    elif isinstance(value, str) and (split := split_number(value)):
        figure, written = split
        if pointed := decimal_comma(value):
            raise ValueError(f"expected {_wanted(unit)}, found {format_value(value)}; write {pointed}")
        if written and written not in known:
            others = ", ".join(f"'{name}'" for name in known if name)
            raise ValueError(
                f"expected {_wanted(unit)}{f' (units known here: {others})' if others else ''}, "
                f"found {format_value(value)}"
            )
        number = figure * (known[written] if written else 1.0)
    else:
        raise ValueError(f"expected {_wanted(unit)}, found {format_value(value)}")
    if not math.isfinite(number):
        raise ValueError(f"expected {_wanted(unit)} that is finite, found {format_value(value)}")
    return number


def _wanted(unit: str) -> str:
    return {
        "": "a number",
        "rad": 'an angle in rad (or "30 deg")',
        "m": "a length in m",
        "rad or m": 'an angle in rad (or "30 deg") or a length in m',
    }.get(unit, f"a number in {unit}")


def _yaml_hint(value: object) -> str:
    """What to write instead of an override that is YAML in a text, such as "{guess: 1 deg}"; "" for others."""
    kind = {"{": "a dict, such as {'guess': '30 deg'}", "[": "a list, such as [0, 0, 1]"}
    begin = value.strip()[:1] if isinstance(value, str) else ""
    return (
        f"; a text is not read as YAML: in Python, give {kind[begin]}, without quotes around it"
        if begin in kind
        else ""
    )


class Fields:
    """One mapping of a file, read key by key; `done()` refuses keys that were not read.

    `access` says which files the mapping may name; the default is the files near the file `where`.
    """

    def __init__(
        self, data: Mapping[str, Any], where: str = "", path: str = "", access: FileAccess | None = None
    ) -> None:
        if not isinstance(data, Mapping):
            raise InputError(f"{_place(where, path)}: expected a mapping of keys to values, found {format_value(data)}")
        self._data = data
        self.where = where
        self.path = path
        self.access = FileAccess.of(where) if access is None else access
        self._asked: dict[str, None] = {}
        self._named: dict[str, None] = {}  # those that `known` names

    @classmethod
    def from_file(cls, path: str | Path, access: FileAccess | None = None) -> Fields:
        """The top mapping of a YAML file; InputError as `read_yaml`."""
        return cls(read_yaml(path), str(path), access=access)

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    def __contains__(self, key: str) -> bool:
        return key in self._data

    def keys(self) -> list[str]:
        """The keys that are there, in the order of the file."""
        return [str(key) for key in self._data]

    def error(self, key: str, message: str) -> InputError:
        """An InputError that names the file, the key and, where known, the line or the override that set the key."""
        path = f"{self.path}.{key}" if self.path and key else self.path or key
        lines: dict[str, int] = getattr(self._data, "lines", {})
        line = f" (line {lines[key]})" if key in lines else ""
        overrides: dict[str, str] = getattr(self._data, "overrides", {})
        text = f"{_place(self.where, path)}{line}: {message}"
        if key in overrides:
            hint = _yaml_hint(self._data[key]) if key in self._data else ""
            text = f"override '{overrides[key]}': {_place(self.where, path)}: {message}{hint}"
        return InputError(" ".join(text.splitlines()))

    def overridden(self, key: str) -> bool:
        """Whether an override set the key."""
        return key in getattr(self._data, "overrides", {})

    def raw(self, key: str, default: Any = _REQUIRED) -> Any:
        """The value as it is in the file. Raises InputError where it is missing and no default is given."""
        self._asked[key] = None
        if key in self._data:
            return self._data[key]
        if default is _REQUIRED:
            keys = self.keys()
            there = ", ".join(keys[:20]) + (f", … ({len(keys)} in all)" if len(keys) > 20 else "") or "nothing"
            near = difflib.get_close_matches(key, [name for name in self.keys() if name not in self._asked], n=1)
            hint = f"; did you mean '{key}' by '{near[0]}'?" if near else ""
            others = ", ".join(name for name in self._named if name not in self and name != key)
            there += f"; also known here: {others}" if others else ""
            raise self.error(near[0] if near else "", f"the key '{key}' is missing{hint} (present: {there})")
        return default

    def known(self, *keys: str) -> None:
        """Name further keys that are allowed here, so that `done` accepts them and messages suggest them."""
        self._asked.update(dict.fromkeys(keys))
        self._named.update(dict.fromkeys(keys))

    def number(
        self,
        key: str,
        unit: str = "",
        default: float | object = _REQUIRED,
        *,
        positive: bool = False,
        nonnegative: bool = False,
        maximum: float = math.inf,
    ) -> float:
        """A finite number in the SI unit named, or a text with a unit ("30 deg"); InputError otherwise."""
        value = self.raw(key, default)
        return self._number(key, value, unit, positive, nonnegative, maximum)

    def optional_number(
        self,
        key: str,
        unit: str = "",
        *,
        positive: bool = False,
        nonnegative: bool = False,
        maximum: float = math.inf,
    ) -> float | None:
        """As `number`, or None where the key is missing."""
        value = self.raw(key, None)
        if value is None and key not in self._data:
            return None
        return self._number(key, value, unit, positive, nonnegative, maximum)

    def _number(self, key: str, value: object, unit: str, positive: bool, nonnegative: bool, maximum: float) -> float:
        try:
            number = parse_number(value, unit)
        except ValueError as error:
            raise self.error(key, str(error)) from None
        suffix = f" {unit}" if unit else ""
        if positive and number <= 0.0:
            raise self.error(key, f"expected more than 0{suffix}, found {format_value(value)}")
        if nonnegative and number < 0.0:
            raise self.error(key, f"expected 0{suffix} or more, found {format_value(value)}")
        if number > maximum:
            percent = f"; did you mean {value} %?" if not unit and maximum == 1.0 and 1.0 < number <= 100.0 else ""
            raise self.error(key, f"expected at most {maximum:g}{suffix}, found {format_value(value)}{percent}")
        return number

    def parsed(self, key: str, value: object, unit: str = "") -> float:
        """The SI value of one entry of what stands under a key; InputError naming the key otherwise."""
        return self._number(key, value, unit, False, False, math.inf)

    def integer(self, key: str, default: int | object = _REQUIRED, *, minimum: int = 0) -> int:
        """A whole number of at least `minimum`. Raises InputError otherwise."""
        value = self.raw(key, default)
        if isinstance(value, bool) or not isinstance(value, int):
            raise self.error(key, f"expected a whole number, found {format_value(value)}")
        if not minimum <= value <= MOST_WHOLE:
            bounds = f"of {minimum} or more" if value < minimum else f"of at most {MOST_WHOLE}"
            raise self.error(key, f"expected a whole number {bounds}, found {format_value(value)}")
        return value

    def vector(
        self,
        key: str,
        length: int,
        unit: str = "",
        default: Sequence[float] | object = _REQUIRED,
    ) -> tuple[float, ...]:
        """A list of `length` numbers in the unit named. Raises InputError otherwise."""
        return self._numbers(key, self.raw(key, default), length, unit)

    def rows(self, key: str, width: int, unit: str = "") -> tuple[tuple[float, ...], ...]:
        """A list of lists of `width` numbers each. Raises InputError otherwise."""
        value = self.raw(key)
        if not isinstance(value, (list, tuple)) or not value:
            raise self.error(key, f"expected a list of lists of {width} numbers, found {format_value(value)}")
        return tuple(self._numbers(key, row, width, unit) for row in value)

    def numbers(self, key: str, unit: str = "") -> tuple[float, ...]:
        """A list of any number of numbers in the unit named. Raises InputError otherwise."""
        value = self.raw(key)
        if not isinstance(value, (list, tuple)):
            raise self.error(key, f"expected a list of numbers, found {format_value(value)}")
        return self._numbers(key, value, len(value), unit)

    def _numbers(self, key: str, value: object, length: int, unit: str) -> tuple[float, ...]:
        if not isinstance(value, (list, tuple)) or len(value) != length:
            raise self.error(
                key,
                f"expected a list of {length} numbers{f' in {unit}' if unit else ''}, found {format_value(value)}",
            )
        return tuple(self._number(key, entry, unit, False, False, math.inf) for entry in value)

    def text(self, key: str, default: str | object = _REQUIRED) -> str:
        """A text that is not empty. Raises InputError otherwise."""
        value = self.raw(key, default)
        if not isinstance(value, str) or not value.strip():
            raise self.error(key, f"expected a text, found {format_value(value)}")
        return value

    def unit(self, key: str = "unit") -> str:
        """A unit as a text; "1" where it is missing or written as the number 1. Raises InputError otherwise."""
        value = self.raw(key, "1")
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            if value != 1:
                raise self.error(
                    key, f"expected a unit such as 'm/s', or 1 for a plain number, found {format_value(value)}"
                )
            return "1"
        return self.text(key, "1")

    def file(self, key: str) -> Path:
        """The path of the file that a key names, relative to the folder of the file that is read.

        Raises InputError where the value is not a text, and where the file may not be named (files/access.py). An
        override, which the user writes, may name any file.
        """
        name = self.text(key)
        if self.overridden(key):
            return self.access.folder / file_name_here(name)
        try:
            return self.access.path(name)
        except InputError as error:
            raise self.error(key, str(error)) from None

    def flag(self, key: str, default: bool) -> bool:
        """true or false. Raises InputError otherwise."""
        value = self.raw(key, default)
        if not isinstance(value, bool):
            raise self.error(key, f"expected true or false, found {format_value(value)}")
        return value

    def choice(self, key: str, options: Sequence[str], default: str | object = _REQUIRED) -> str:
        """One of the texts named; InputError, with the nearest of them, otherwise."""
        value = self.raw(key, default)
        if not isinstance(value, str):
            raise self.error(key, f"expected one of {', '.join(options)}, found {format_value(value)}")
        if value not in options:
            raise self.error(key, unknown_name(key, value, options))
        return value

    def mapping(self, key: str, default: Mapping[str, Any] | object = _REQUIRED) -> Fields:
        """The mapping under a key, as Fields of its own; InputError where it is something else."""
        value = self.raw(key, default)
        if not isinstance(value, Mapping):
            raise self.error(key, f"expected a mapping of keys to values, found {format_value(value)}")
        return Fields(value, self.where, f"{self.path}.{key}" if self.path else key, self.access)

    def mappings(self, key: str) -> list[Fields]:
        """The list of mappings under a key, empty where the key is missing. Raises InputError otherwise."""
        value = self.raw(key, ())
        if not isinstance(value, (list, tuple)):
            raise self.error(key, f"expected a list of mappings, found {format_value(value)}")
        path = f"{self.path}.{key}" if self.path else key
        for index, entry in enumerate(value):
            if not isinstance(entry, Mapping):
                raise self.error(key, f"expected a list of mappings, found {format_value(entry)} as entry {index + 1}")
        return [Fields(entry, self.where, f"{path}[{index + 1}]", self.access) for index, entry in enumerate(value)]

    def done(self) -> None:
        """Refuse keys that were not read. Raises InputError, which suggests the nearest known key."""
        self.only(self._asked)

    def only(self, keys: Collection[str]) -> None:
        """Refuse keys other than these, before their values are read. Raises InputError as `done`."""
        for key in self:
            if key not in keys:
                raise self.error(key, unknown_name("key", key, keys))


def _place(where: str, path: str) -> str:
    return ": ".join(part for part in (where, path) if part) or "input"
