"""Streams that print control characters visibly: names from files may contain escape codes for the terminal."""

from __future__ import annotations

import contextlib
import re
import sys
from collections.abc import Iterable, Iterator
from typing import Any, TextIO, cast

from bellcrank.text import printable

_STEPS = re.compile("\\A\n*(?:\x1b\\[A)+")  # tqdm moves up to the line of another bar


class _Printable:
    """A text stream that prints control characters visibly, except those of progress bars with `bars`."""

    def __init__(self, stream: TextIO, bars: bool) -> None:
        self._stream, self._bars = stream, bars

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        start = "\r" if self._bars and text.startswith("\r") else ""  # tqdm redraws a bar from the start of its line
        steps = self._bars and _STEPS.fullmatch(text)
        self._stream.write(text if steps else start + printable(text[len(start) :]))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)


@contextlib.contextmanager
def printable_streams() -> Iterator[None]:
    """In the block, standard output and error print control characters visibly."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = cast(TextIO, _Printable(before[0], False)), cast(TextIO, _Printable(before[1], True))
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before
