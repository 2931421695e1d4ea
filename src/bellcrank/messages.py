"""What error messages have in common: how an unknown name is told, and how a value is shown."""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable, Mapping

LONGEST_NAME = 200  # characters of an unknown name that a message repeats


def unknown_name(kind: str, name: str, known: Iterable[str]) -> str:
    """One phrase for an unknown name: what there is, and the nearest of it."""
    names = list(known)
    if len(name) > LONGEST_NAME or not name.isprintable():
        name = ascii(name[:LONGEST_NAME])[1:-1] + ("…" if len(name) > LONGEST_NAME else "")
    near = difflib.get_close_matches(name, names, n=1)
    hint = f"; did you mean '{near[0]}'?" if near else ""
    listed = ", ".join(names[:20]) + (f", … ({len(names)} in all)" if len(names) > 20 else "")
    return f"there is no {kind} '{name}'{hint} (there are: {listed or 'none'})"


def format_value(value: object) -> str:
    """A value as an error message shows it: short, on one line."""
    if value is None:
        return "nothing"
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, (list, tuple)):
        return f"a list of {len(value)}"
    text = " ".join(str(value).split())
    text = text if len(text) <= 60 else text[:57] + "…"
    return f"'{text}'" if isinstance(value, str) else reprlib.repr(value) if len(text) > 57 else text
