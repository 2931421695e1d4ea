"""Parts of error messages: unknown names, and values."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable, Mapping

LONGEST_NAME = 200  # characters of an unknown name that a message repeats
MOST_NAMES = 30  # expected names that a message lists: all keys of a scene


def unknown_name(kind: str, name: str, known: Iterable[str]) -> str:
    """A clause for an unknown name: the nearest known one, and what is expected."""
    names = list(known)
    if len(name) > LONGEST_NAME or not name.isprintable():
        name = ascii(name[:LONGEST_NAME])[1:-1] + ("…" if len(name) > LONGEST_NAME else "")
    near = difflib.get_close_matches(name, names, n=1)
    hint = f"; did you mean '{near[0]}'?" if near else ""
    listed = ", ".join(names[:MOST_NAMES]) + (f", … ({len(names)} in all)" if len(names) > MOST_NAMES else "")
    expected = f"expected: {listed}" if listed else "there is none"
    return f"unknown {kind} '{name}'{hint} ({expected})"


def format_value(value: object) -> str:
    """A value for an error message: short, on one line."""
    if value is None:
        return "nothing"
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, (list, tuple)):
        return f"a list of {len(value)}"
    text = " ".join(str(value).split())
    text = text if len(text) <= 60 else text[:57] + "…"
    return f"'{text}'" if isinstance(value, str) else reprlib.repr(value) if len(text) > 57 else text
