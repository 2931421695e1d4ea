"""Parts of error messages, and names of files, in any locale and safe to print.

In a locale other than UTF-8 (LC_ALL=C), Python represents undecodable bytes of file names as lone surrogates (PEP 383),
which it does not encode to UTF-8, and it does not encode letters of other alphabets to file names. Here such bytes are
written unchanged where they are valid UTF-8.
"""

from __future__ import annotations

import codecs
import difflib
import os
import re
import reprlib
import sys
from collections.abc import Iterable, Mapping

ERRORS = "bellcrank"  # the error handler for such texts
MOST_LETTERS = 1200  # of a message
_UNUSUAL = re.compile(r"[^\w.-]+")  # in names of files
# controls but for newline and tab; what turns the direction of writing; what breaks lines besides a newline
_CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")
LONGEST_NAME = 200  # characters of an unknown name that a message repeats
MOST_NAMES = 30  # expected names that a message lists: all keys of a scene


def utf8(text: str) -> bytes:
    """The text in UTF-8. Bytes of file names are kept; those that are not valid UTF-8 become question marks."""
    return text.encode("utf-8", ERRORS)


def readable(text: str) -> str:
    """The text without lone surrogates."""
    return text if text.isascii() else utf8(text).decode("utf-8")


def file_name_here(name: str) -> str:
    """A name read from a UTF-8 file, as this system encodes file names; unchanged in a UTF-8 locale."""
    if name.isascii() or sys.getfilesystemencoding().lower() in ("utf-8", "utf8"):
        return name
    return os.fsdecode(utf8(name))


def file_name(text: str, default: str = "motion") -> str:
    """A name as part of a file name: letters, digits, . _ and - only, at most 80; `default` where nothing is left."""
    return file_name_here(_UNUSUAL.sub("_", text).strip("_.")[:80]) or default


def one_line(text: str) -> str:
    """A message on one line, without control characters. The middle of a very long message is left out.

    Lone surrogates are kept, because they are bytes of file names.
    """
    text = " ".join(text.splitlines())
    plain = (c if c.isprintable() or "\ud800" <= c <= "\udfff" else ascii(c)[1:-1] for c in text)
    text = "".join(plain)
    return text if len(text) <= MOST_LETTERS else f"{text[: MOST_LETTERS - 403]}… …{text[-400:]}"


def printable(text: str) -> str:
    r"""The text with control characters and marks of direction as \x1b or \u202e; newlines and tabs stay."""
    return _CONTROLS.sub(lambda found: ascii(found[0])[1:-1], text)


def _encoded(error: UnicodeError) -> tuple[str | bytes, int]:
    """Bytes of file names as they are; other letters escaped where the encoding lacks them, lone surrogates as ?."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    start, end = error.start, error.end
    held = ["\udc80" <= letter <= "\udcff" for letter in error.object[start:end]]
    alike = next((k for k, one in enumerate(held) if one != held[0]), len(held))  # the rest comes again
    part = error.object[start : start + alike]
    if held[0]:
        raw = bytes(ord(letter) & 0xFF for letter in part)
        try:
            raw.decode("utf-8")
        except UnicodeDecodeError:
            return "?" * alike, start + alike
        return raw, start + alike
    escaped = "".join("?" if "\ud800" <= letter <= "\udfff" else ascii(letter)[1:-1] for letter in part)
    return escaped, start + alike


codecs.register_error(ERRORS, _encoded)


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
