"""Checks of JSON values: functions that accept a value, or say which entry has what in place of what."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from typing import Any, NoReturn

from bellcrank.files.npz_archive import brief

Check = Callable[[Any, str], Any]  # takes a value and its name; returns the value, or raises ValueError
LARGEST_COUNT = 2**62
LONGEST_PATH = 4096  # characters


def text(value: Any, name: str) -> str:
    """A text that can be written as UTF-8."""
    if not isinstance(value, str):
        _refuse(name, "a text", value)
    if any("\ud800" <= c <= "\udfff" for c in value):
        _refuse(name, "a text in UTF-8", value)
    return value


def path(value: Any, name: str) -> str:
    """A text that can be a path."""
    found = text(value, name)
    return found if "\0" not in found and len(found) <= LONGEST_PATH else _refuse(name, "a path", value)


def flag(value: Any, name: str) -> bool:
    """true or false."""
    return value if isinstance(value, bool) else _refuse(name, "true or false", value)


def count(value: Any, name: str) -> int:
    """A whole number, 0 or more."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= LARGEST_COUNT:
        _refuse(name, "a whole number of 0 or more", value)
    return value


def amount(value: Any, name: str) -> float:
    """A finite number, 0 or more."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        _refuse(name, "a number", value)
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    return number if 0.0 <= number < math.inf else _refuse(name, "a finite number of 0 or more", value)


def positive(value: Any, name: str) -> float:
    """A finite number of more than 0."""
    return amount(value, name) or _refuse(name, "more than 0", value)


def one_of(known: Collection[str]) -> Check:
    """One of these texts."""
    return lambda value, name: value if value in list(known) else _refuse(name, f"one of {', '.join(known)}", value)


def maybe(check: Check) -> Check:
    """null, or what the check accepts."""
    return lambda value, name: None if value is None else check(value, name)


def each(check: Check) -> Check:
    """A list of what the check accepts."""

    def checked(value: Any, name: str) -> list[Any]:
        if not isinstance(value, list):
            _refuse(name, "a list", value)
        return [check(entry, f"{name}[{k}]") for k, entry in enumerate(value)]

    return checked


def named(check: Check) -> Check:
    """A mapping of any names to what the check accepts."""

    def checked(value: Any, name: str) -> dict[str, Any]:
        if not isinstance(value, dict):
            _refuse(name, "a mapping", value)
        return {text(key, name): check(entry, f"{name}.{brief(key, '')}") for key, entry in value.items()}

    return checked


def keys(known: Mapping[str, Check]) -> Check:
    """A mapping of exactly these keys to what their checks accept."""

    def checked(value: Any, name: str) -> dict[str, Any]:
        if not isinstance(value, dict):
            _refuse(name or "its text", "a mapping", value)
        found = {}
        for key, entry in value.items():
            path = f"{name}.{brief(key, '')}" if name else brief(key, "")
            if key not in known:
                raise ValueError(f"'{path}' is not known; expected {', '.join(known)}")
            found[key] = known[key](entry, path)
        for key in known:
            if key not in found:
                raise ValueError(f"the key '{f'{name}.{key}' if name else key}' is missing")
        return found

    return checked


def anything(value: Any, name: str) -> Any:
    """Information for people, which is not read."""
    return value


def _refuse(name: str, expected: str, value: object) -> NoReturn:
    raise ValueError(f"'{name}': expected {expected}, found {brief(value)}")
