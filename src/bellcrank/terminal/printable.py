"""Text for a terminal: names from files may hold escape codes, which would move the cursor, change colours or worse."""

from __future__ import annotations

import contextlib
import re
import sys
from collections.abc import Iterable, Iterator
from typing import Any, TextIO, cast

from bellcrank.text import printable

_STEPS = re.compile("\\A\n*(?:\x1b\\[A)+")  # with which tqdm goes back up from the lines of other bars


class _Printable:
    """A text stream that shows control characters instead of sending them; where `bars` are drawn, they keep theirs."""

    def __init__(self, stream: TextIO, bars: bool) -> None:
        self._stream, self._bars = stream, bars

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        start = "\r" if self._bars and text.startswith("\r") else ""  # tqdm draws a bar from the beginning of its line
        steps = self._bars and _STEPS.fullmatch(text)
        self._stream.write(text if steps else start + printable(text[len(start) :]))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)


@contextlib.contextmanager
def printable_streams() -> Iterator[None]:
    """While the block runs, what is printed to standard output and error is printable."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = cast(TextIO, _Printable(before[0], False)), cast(TextIO, _Printable(before[1], True))
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before
