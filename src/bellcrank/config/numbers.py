"""Numbers in texts, of files and of command lines: ASCII digits only, without underscores.

`float` and `int` take whatever Unicode calls a digit, and underscores ("١٢", "1_000"); a name or a typing error must
not pass for a number.
"""

from __future__ import annotations

import re

_NUMBER = re.compile(r"\A\s*([-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)")
_COMMA = re.compile(r"\A\s*([-+]?[0-9]+),([0-9]+)(?![0-9,.])")
_WHOLE = re.compile(r"\A\s*([-+]?)([0-9]+)\s*\Z")
MOST_DIGITS = 100  # of a whole number; a longer one is beyond every limit, as is 10**MOST_DIGITS


def split_number(text: str) -> tuple[float, str] | None:
    """The number that a text begins with (infinite where doubles end) and what follows; None where there is none."""
    match = _NUMBER.match(text)
    return (float(match[1]), text[match.end() :].strip()) if match else None


def decimal_comma(text: str) -> str:
    """What to write where a text begins with a number with a comma, such as "0,5 m"; else "".

    Before three digits the comma may separate thousands: both readings are named.
    """
    found = _COMMA.match(text)
    if found is None:
        return ""
    pointed, joined = (_COMMA.sub(rf"\1{sign}\2", text).strip() for sign in (".", ""))
    return f"{pointed}, or {joined}" if len(found[2]) == 3 else pointed


def decimal_number(text: str) -> float:
    """The number that a text is, as `float` reads it; ValueError where it is none."""
    text = text.strip()
    if not text.isascii() or "_" in text:
        raise ValueError(f"not a number: {text[:40]!r}")
    return float(text)


def whole_number(text: str) -> int | None:
    """The whole number that a text is; None where it is none. One of very many digits counts as 10**MOST_DIGITS."""
    match = _WHOLE.match(text)
    if match is None:
        return None
    digits = match[2].lstrip("0") or "0"
    size = int(digits) if len(digits) <= MOST_DIGITS else 10**MOST_DIGITS
    return -size if match[1] == "-" else size
