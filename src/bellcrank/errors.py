"""One exception base for everything bellcrank refuses, and the helper that suggests a near name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Any

from bellcrank.files.locale_text import one_line
from bellcrank.terminal.printable import printable

LONGEST_NAME = 200  # characters of an unknown name that a message repeats


class BellcrankError(Exception):
    """Base of all errors of bellcrank: the text names what is wrong, where, and what to do; it is one line, safe to
    print, and without the middle of a very long one.
    """

    def __str__(self) -> str:
        return printable(one_line(super().__str__()))


class InputError(BellcrankError):
    """A file, a key or an argument is not what was expected."""


class NotSavedError(InputError):
    """A run that is done cannot be saved; `run` is that run."""

    def __init__(self, text: str, run: Any) -> None:
        super().__init__(text)
        self.run = run


class UnreachableError(BellcrankError):
    """A path leaves what the robot can reach, or passes a posture where it cannot be followed."""


class CompileError(BellcrankError):
    """An expression graph could not be turned into machine code."""


def among(kind: str, name: str, known: Iterable[str]) -> str:
    """One phrase for an unknown name: what there is, and the nearest of it."""
    names = list(known)
    if len(name) > LONGEST_NAME or not name.isprintable():
        name = ascii(name[:LONGEST_NAME])[1:-1] + ("…" if len(name) > LONGEST_NAME else "")
    near = difflib.get_close_matches(name, names, n=1)
    hint = f"; did you mean '{near[0]}'?" if near else ""
    shown = ", ".join(names[:20]) + (f", … ({len(names)} in all)" if len(names) > 20 else "")
    return f"there is no {kind} '{name}'{hint} (there are: {shown or 'none'})"
