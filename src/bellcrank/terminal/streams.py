"""Standard output and error of the command line, whose failure does not stop a command.

If the reader of a pipe has ended (`| head`), or a stream is closed (`>&-`), output is dropped and files are still
written. If a stream cannot be written (/dev/full), an error is reported at the end.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


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
