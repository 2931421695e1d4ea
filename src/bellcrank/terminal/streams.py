"""Standard output and error of the command line: a failing stream does not stop a command, and control characters in
names are printed visibly.

If the reader of a pipe has ended (`| head`), or a stream is closed (`>&-`), output is dropped and files are still
written. If a stream cannot be written (/dev/full), an error is reported at the end.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO, cast

from bellcrank.messages import printable


class _Output(io.FileIO):
    """A file descriptor that drops output after its first error; `failure` is that error, except a broken pipe."""

    failure: OSError | None = None

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except BrokenPipeError:
            self._drop()
        except OSError as error:
            self.failure = error
            self._drop()
        return len(memoryview(data).cast("B"))

    def _drop(self) -> None:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, self.fileno())
        os.close(null)


@contextmanager
def standard_streams() -> Iterator[_Output]:
    """Replace standard output and error in the block; yields standard output."""
    for number in (0, 1, 2):  # a file opened later must not get the number of standard output
        try:
            os.fstat(number)
        except OSError:
            null = os.open(os.devnull, os.O_RDWR)
            if null != number:
                os.dup2(null, number)
                os.close(null)
    before = sys.stdout, sys.stderr
    raw = _Output(1, "w", closefd=False)
    sys.stdout = _text(raw, before[0], "backslashreplace")
    sys.stderr = _text(_Output(2, "w", closefd=False), before[1], "backslashreplace")
    try:
        yield raw
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        sys.stdout, sys.stderr = before


def _text(raw: _Output, like: Any, errors: str) -> io.TextIOWrapper:
    """A text stream on a descriptor, buffered like another stream (None where that was closed)."""
    at_once = bool(getattr(like, "write_through", False))
    by_line = at_once or bool(getattr(like, "line_buffering", False))
    buffer: Any = raw if at_once else io.BufferedWriter(raw)
    if like is not None:
        like.flush()
    coding = getattr(like, "encoding", None) or "utf-8"
    return io.TextIOWrapper(buffer, coding, errors, line_buffering=by_line, write_through=at_once)


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
