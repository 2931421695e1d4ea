"""Signals that ask the command line to stop: Ctrl-C (SIGINT), SIGTERM and SIGHUP, all alike.

Only the command line handles them (`handled`); for programs that import bellcrank nothing changes. A signal raises
Interrupted, a KeyboardInterrupt, where it finds the program, except in a `held` block: there it waits for the next call
of its check, so that what was computed can be kept.
"""

from __future__ import annotations

import signal
import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # little is imported before signals are handled
    from collections.abc import Callable, Iterator
    from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_TOGETHER = 1.0  # s in which further signals are the same request: timeout(1) sends two at once
_RETRY = 0.01  # s


class Interrupted(KeyboardInterrupt):
    """A signal asked the program to stop."""


class _Request:
    def __init__(self) -> None:
        self.number: int | None = None  # of the signal that asked first
        self.time = 0.0
        self.pending = self.held = self.whole = False


_request = _Request()


@contextmanager
def handled() -> Iterator[None]:
    """Let the signals raise Interrupted while the block lasts; those that are ignored, as by nohup, stay so. After it
    they are ignored: what is left to do is to exit.
    """
    vars(_request).update(vars(_Request()))
    before = sys.unraisablehook
    mine = [number for number in SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
    for number in (*mine, signal.SIGALRM):
        signal.signal(number, _handle)

    def unraisable(found: Any) -> None:
        if isinstance(found.exc_value, Interrupted):  # lost where Python drops errors, as in __del__: once more
            _request.time = 0.0
            signal.setitimer(signal.ITIMER_REAL, _RETRY)
        else:
            before(found)

    sys.unraisablehook = unraisable
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number in (*mine, signal.SIGALRM):
            signal.signal(number, signal.SIG_IGN)
        sys.unraisablehook = before


def exit_status() -> int | None:
    """128 + the number of the signal that asked the program to stop; None where none did."""
    return None if _request.number is None else 128 + _request.number


def signal_name() -> str:
    """The name of that signal, in brackets, but for Ctrl-C; empty otherwise."""
    if _request.number in (None, signal.SIGINT):
        return ""
    assert _request.number is not None
    return f" ({signal.Signals(_request.number).name})"


@contextmanager
def held() -> Iterator[Callable[[], None]]:
    """Yield a check that raises Interrupted where a signal asked to stop. From its first call to the end of the block
    nothing else raises, unless a second signal comes later than a moment after the first.
    """

    def check() -> None:
        _request.held = True
        if _request.pending:
            _request.pending = False
            raise Interrupted

    try:
        yield check
    finally:
        _request.held = False
        _request.pending = False


@contextmanager
def unbroken() -> Iterator[None]:
    """In the block no signal raises, unless a second one comes later than a moment after the first; at its end it does,
    where no `held` block is around it.
    """
    before, _request.held = _request.held, True
    try:
        yield
    finally:
        _request.held = before
    if _request.pending and not before:
        _request.pending = False
        raise Interrupted


@contextmanager
def whole_runs() -> Iterator[None]:
    """In the block a simulation that a signal cuts short raises Interrupted: nobody looks at its status."""
    _request.whole = True
    try:
        yield
    finally:
        _request.whole = False


def cut_short() -> None:
    """Called where a signal has cut a simulation short: raises Interrupted in a `whole_runs` block."""
    if _request.whole:
        raise Interrupted


def _handle(number: int, frame: FrameType | None) -> None:
    now = time.monotonic()
    asked = _request.number is not None
    if asked and now - _request.time < _TOGETHER:
        return
    if not asked and number != signal.SIGALRM:
        _request.number = number
    _request.time = now
    if _request.held and not asked:
        _request.pending = True
        return
    raise Interrupted
