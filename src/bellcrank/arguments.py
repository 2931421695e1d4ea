"""Checks of the arguments of public functions.

Each function returns the value in its plain type, or raises an InputError that names the argument, what was expected
and what was found. Numbers are real numbers of Python and numpy, including 0-d arrays; not bools, texts, complex
numbers or other objects. Arrays are everything that numpy converts to a real array, without masked entries.
"""

from __future__ import annotations

import functools
import inspect
import math
import numbers
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from decimal import Decimal
from pathlib import Path
from typing import Any, NoReturn, ParamSpec, TypeVar

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.messages import format_value, unknown_name
from bellcrank.numerics import LARGEST as LARGEST  # of masses, inertias, forces and lengths

Progress = Callable[[float, float | None], object]  # (what is done, of how much; None where that is unknown)
PROGRESS = "a function of how much is done, and of how much"
T = TypeVar("T")
P = ParamSpec("P")
_KEYWORD = re.compile(r"unexpected keyword argument '(\w+)'")
LONGEST_PATH = 4096  # bytes; limits of file systems
LONGEST_NAME = 255
LONGEST_RANGE = 10**7  # numbers of a range, which takes no memory itself
MOST_ITEMS = 10**6  # of a list of names or objects, so that an endless generator is refused


def named(function: Callable[P, T]) -> Callable[P, T]:
    """A public function whose unknown arguments are an InputError, with the nearest known one."""

    @functools.wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return function(*args, **kwargs)
        except TypeError as error:
            at_call = error.__traceback__ is not None and error.__traceback__.tb_next is None  # not in the function
            found = _KEYWORD.search(str(error)) if at_call else None
            if found is None:
                raise
            known = inspect.signature(function).parameters
            raise InputError(f"{function.__name__}: {unknown_name('argument', found[1], known)}") from None

    return checked


def is_masked_array(value: object) -> bool:
    """Whether it is a masked array; numpy.ma, which takes long to import, is imported where there is one."""
    return "numpy.ma" in sys.modules and np.ma.isMaskedArray(value)


def is_masked(value: object) -> bool:
    """Whether it is a masked array with a masked entry."""
    return is_masked_array(value) and bool(np.ma.is_masked(value))


def refuse(name: str, expected: str, value: object, where: str = "", remedy: str = "") -> NoReturn:
    """Raise the InputError of an argument; `where` is the object that it belongs to, `remedy` what to do."""
    ending = f"; {remedy}" if remedy else ""
    raise InputError(f"expected {expected}, found {found(value)}{ending}", where, name)


def found(value: object) -> str:
    """A value for a message: short, on one line, without calling methods of foreign classes."""
    kind = type(value)
    if isinstance(value, str):
        seen = format_value(value[:200])
        return seen if seen.isprintable() else ascii(seen[1:-1])
    if value is None or kind in (bool, float):
        return repr(value)
    if isinstance(value, (list, tuple, dict)) and not value:
        return f"an empty {'mapping' if isinstance(value, dict) else 'list'}"
    if kind in (dict, list, tuple):
        return format_value(value)
    if isinstance(value, int) and kind is int:
        return str(value) if abs(value) < 10**20 else f"a whole number beyond {'-' if value < 0 else ''}1e20"
    if isinstance(value, np.ndarray):
        held = "" if value.dtype == np.float64 else f" ({value.dtype})"
        return f"{'a masked' if is_masked_array(value) else 'an'} array of shape {value.shape}{held}"
    if isinstance(value, np.generic):
        return f"{format_value(value.item())} ({kind.__name__})"
    article = "an" if kind.__name__[:1].lower() in "aeiou" else "a"
    return f"{article} {kind.__name__}"


# ---- numbers


def number(
    name: str,
    value: object,
    unit: str = "",
    *,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
    where: str = "",
    remedy: str = "",
) -> float:
    """A finite number greater than `above`, at least `least` and at most `most`."""
    if type(value) is float:
        x = value
    else:
        try:
            x = float(value) if is_number(value) else math.nan  # type: ignore[arg-type]
        except (TypeError, ValueError, OverflowError):
            x = math.nan
    if (
        not math.isfinite(x)
        or (above is not None and x <= above)
        or (least is not None and x < least)
        or (most is not None and x > most)
    ):
        refuse(name, _wanted("a finite number", unit, above, least, most), value, where, remedy)
    return x


def is_number(value: object) -> bool:
    """Whether a value is a real number by type, or a 0-d array of one; a bool is not."""
    if isinstance(value, np.ndarray):
        return value.ndim == 0 and value.dtype.kind in "fiu" and not is_masked(value)
    return isinstance(value, (numbers.Real, Decimal)) and not isinstance(value, (bool, np.bool_))


def _wanted(what: str, unit: str, above: float | None, least: float | None, most: float | None) -> str:
    bounds = [
        f"{words} {limit if isinstance(limit, int) else f'{limit:.12g}'}"
        for words, limit in (("more than", above), ("at least", least), ("at most", most))
        if limit is not None
    ]
    limits = " of " + " and ".join(bounds) if bounds else ""
    return f"{what}{limits}{f' ({unit})' if unit else ''}"


def whole(
    name: str, value: object, *, least: int | None = None, most: int | None = None, where: str = "", remedy: str = ""
) -> int:
    """An integer by type, at least `least` and at most `most`."""
    if isinstance(value, np.ndarray) and value.ndim == 0 and value.dtype.kind in "iu":
        value = value.item()
    right = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    x = int(value) if right else 0  # type: ignore[call-overload]
    if not right or (least is not None and x < least) or (most is not None and x > most):
        refuse(name, _wanted("a whole number", "", None, least, most), value, where, remedy)
    return x


def array(
    name: str, value: object, shape: tuple[int | None, ...], unit: str = "", *, finite: bool = True, where: str = ""
) -> Array:
    """A real array of a shape (None: any length) with finite entries; an array of doubles is not copied."""
    x = as_array(name, value, _shape(shape), where)
    right = x.ndim == len(shape) and all(w is None or n == w for n, w in zip(x.shape, shape, strict=False))
    if not right:
        refuse(name, _shape(shape) + (f" ({unit})" if unit else ""), x if x.ndim else value, where)
    if finite and not np.isfinite(x).all():
        place = np.argwhere(~np.isfinite(x))[0].tolist()
        at = f" at entry {', '.join(map(str, place))}" if place else ""
        expected = f"{_shape(shape).replace('numbers', 'finite numbers')}{f' ({unit})' if unit else ''}"
        if len(shape) > 1:
            expected += " of finite numbers"
        raise InputError(f"expected {expected}, found {x[tuple(place)]}{at}", where, name)
    return x


def as_array(name: str, value: object, expected: str = "an array of numbers", where: str = "") -> Array:
    """A real array of doubles of any shape; an array of doubles is returned unchanged."""
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    try:
        if isinstance(value, (str, bytes, Mapping, set, frozenset)) or is_masked(value):
            refuse(name, expected, value, where)
        if isinstance(value, range) and len(value) > LONGEST_RANGE:
            refuse(name, expected, value, where, f"it has {len(value)} numbers, of at most {LONGEST_RANGE}")
        given = np.asarray(value)
        if given.dtype.kind == "O" and isinstance(value, (list, tuple)):  # fractions, decimals, long integers
            given = np.array([number(f"{name}[{k}]", x) for k, x in enumerate(value)], dtype=np.float64)
        if isinstance(value, (list, tuple)) and any(isinstance(x, (bool, np.bool_)) for x in value):
            refuse(name, expected, value, where, "True and False are not numbers")
    except (TypeError, ValueError, OverflowError, RecursionError):
        refuse(name, expected, value, where)
    if given.dtype.kind not in "fiu":
        if given.ndim and not given.size:  # an empty list of lists
            return np.zeros(given.shape)
        refuse(name, expected, given if given.ndim else value, where)
    return given.astype(np.float64, copy=False)


def _shape(shape: tuple[int | None, ...]) -> str:
    if len(shape) == 1:
        return f"{shape[0]} numbers" if shape[0] is not None else "a list of numbers"
    return f"an array of shape ({', '.join('n' if w is None else str(w) for w in shape)})"


def vector(
    name: str, value: object, size: int | None, unit: str = "", *, most: float | None = None, where: str = ""
) -> Array:
    """`size` finite numbers (None: any count), of a magnitude of at most `most`."""
    x = array(name, value, (size,), unit, where=where)
    if most is not None:
        for entry in x[np.abs(x) > most][:1].tolist():
            refuse(name, f"{_shape((size,))} of a magnitude of at most {most:g}", entry, where)
    return x


def alike(size: int | None = None, /, **values: object) -> tuple[Array, ...]:
    """Arrays by the names of their arguments, whose shapes broadcast; NaN is allowed."""
    arrays = {name: as_array(name, value) for name, value in values.items()}
    first = next(iter(arrays))
    for name, x in arrays.items():
        try:
            np.broadcast_shapes(arrays[first].shape, x.shape)
        except ValueError:
            refuse(name, f"an array as long as '{first}', of shape {arrays[first].shape}", x)
    return tuple(arrays.values())


def increasing(name: str, value: object, unit: str = "", *, count: int = 1, where: str = "") -> Array:
    """At least `count` finite numbers, each more than the one before."""
    x = array(name, value, (None,), unit, where=where)
    expected = f"at least {count} increasing numbers{f' ({unit})' if unit else ''}"
    if len(x) < count:
        refuse(name, expected, x, where)
    back = np.flatnonzero(~(np.diff(x) > 0.0))
    if len(back):
        k = int(back[0])
        raise InputError(f"expected {expected}, found {x[k + 1]:g} after {x[k]:g} (entry {k + 1})", where, name)
    return x


# ---- other kinds


def flag(name: str, value: object, *, where: str = "") -> bool:
    """True or False."""
    if not isinstance(value, (bool, np.bool_)):
        refuse(name, "True or False", value, where)
    return bool(value)


def text(name: str, value: object, what: str = "a text", *, empty: bool = False, where: str = "") -> str:
    """A text, not an empty one unless `empty`; `what` says of what."""
    if not isinstance(value, str) or not (empty or value.strip()):
        refuse(name, what, value, where)
    return value


def one_of(name: str, value: object, options: Iterable[str], *, where: str = "") -> str:
    """One of some texts."""
    listed = list(options)
    if not isinstance(value, str):
        refuse(name, f"one of {', '.join(map(repr, listed))}", value, where)
    if value not in listed:
        raise InputError(unknown_name("choice", value, listed), where, name)
    return value


def instance(name: str, value: object, kinds: type[T] | tuple[type[T], ...], what: str, *, remedy: str = "") -> T:
    """A value of one of some types; `what` says which."""
    if not isinstance(value, kinds):
        refuse(name, what, value, remedy=remedy)
    return value


def subject(name: str, value: Any, what: str) -> Any:
    """The path or the name of a file, returned unchanged; `what` says what the file describes."""
    if not isinstance(value, (str, os.PathLike)):
        refuse(name, f"{what}, or the path or name of one", value)
    return value


def robot(value: Any, name: str = "robot") -> Any:
    """A robot, or an object with the joints and ranges of one."""
    if not (hasattr(value, "joints") and hasattr(value, "lower")):
        refuse(name, "a robot", value, remedy="use bc.load_robot(PATH or NAME)")
    return value


def several(
    name: str, value: object, kind: type[T], what: str, *, alone: bool = False, where: str = ""
) -> tuple[T, ...]:
    """The entries of a list or another iterable, each of a type; `what` names them ("names of joints").

    With `alone` one by itself stands for a list of it.
    """
    if alone and isinstance(value, kind):
        return (value,)
    no_list = isinstance(value, np.ndarray) and value.ndim == 0  # numpy refuses to iterate over it
    if isinstance(value, (str, bytes, Mapping)) or not isinstance(value, Iterable) or no_list:
        refuse(name, f"a list of {what}", value, where)
    listed: list[T] = []
    for entry in value:
        if not isinstance(entry, kind):
            refuse(name, f"a list of {what}", entry, where, f"it is entry {len(listed) + 1}")
        if len(listed) == MOST_ITEMS:
            refuse(name, f"at most {MOST_ITEMS} {what}", value, where)
        listed.append(entry)
    return tuple(listed)


def mapping(name: str, value: object, what: str, *, where: str = "") -> dict[str, Any]:
    """A mapping with texts as keys, as a dict; `what` describes it ("a mapping of joint names to numbers")."""
    if not isinstance(value, Mapping):
        refuse(name, what, value, where)
    for key in value:
        if not isinstance(key, str):
            refuse(name, f"{what} with texts as keys", key, where)
    return dict(value)


def names_to_numbers(
    name: str,
    value: object,
    what: str,
    unit: str = "",
    *,
    least: float | None = None,
    most: float | None = None,
    where: str = "",
) -> dict[str, float]:
    """A mapping of names to finite numbers, each at least `least` and at most `most`."""
    given = mapping(name, value, f"a mapping of {what} to numbers{f' ({unit})' if unit else ''}", where=where)
    return {
        key: number(f'{name}["{key:.80}"]', x, unit, least=least, most=most, where=where) for key, x in given.items()
    }


def path(name: str, value: object, what: str = "a path") -> Path:
    """The path of a file or folder, which may not exist."""
    given = os.fspath(value) if isinstance(value, os.PathLike) else value
    if not isinstance(given, str) or not given.strip() or "\0" in given:
        refuse(name, what, value)
    try:
        raw = os.fsencode(given)
    except UnicodeEncodeError:
        refuse(
            name,
            what,
            value,
            remedy="the locale cannot encode this name (set LC_ALL to a UTF-8 locale)",
        )
    if len(raw) > LONGEST_PATH or max(map(len, raw.split(b"/"))) > LONGEST_NAME:
        refuse(name, f"{what} with names of at most {LONGEST_NAME} bytes, {LONGEST_PATH} in all", value)
    return Path(given)


def picture(value: object) -> Path | None:
    """The path of a picture that a result draws, or None, before it is drawn."""
    return None if value is None else path("path", value, "the path of a picture")


def function(name: str, value: object, what: str = "a function") -> Callable[..., Any]:
    """Something that can be called."""
    if not callable(value):
        refuse(name, what, value)
    return value
