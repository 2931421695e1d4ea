"""The exceptions of bellcrank: one base, whose message is one line that is safe to print."""

from __future__ import annotations

from typing import Any

from bellcrank.text import one_line, printable


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
