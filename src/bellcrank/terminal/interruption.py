"""Signals that stop the command line: Ctrl-C (SIGINT), SIGTERM and SIGHUP, handled alike.

Only the command line handles them (`handled`); programs that import bellcrank are not affected. A signal raises
Interrupted, a KeyboardInterrupt, at once, except in a `held` block: there it is raised at the next call of the block's
check, so that results can be saved.
"""

from __future__ import annotations

import signal
import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # signals are handled before more is imported
    from collections.abc import Callable, Iterator
    from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_TOGETHER = 1.0  # s; signals within this time are one request: timeout(1) sends two at once
_RETRY = 0.01  # s


class Interrupted(KeyboardInterrupt):
    """A signal asked the program to stop."""


class _Request:
    def __init__(self) -> None:
        self.number: int | None = None  # of the signal that asked first
        self.time = 0.0
        self.pending = self.held = self.whole = self.handled = False


_request = _Request()


@contextmanager
def handled() -> Iterator[None]:
    """In the block the signals raise Interrupted, except those that the process ignores (nohup). After the block they
    are ignored, because the program only has to exit.
    """
    vars(_request).update(vars(_Request()))
    _request.handled = True
    before = sys.unraisablehook
    mine = [number for number in SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
    for number in (*mine, signal.SIGALRM):
        signal.signal(number, _handle)

    def unraisable(found: Any) -> None:
        if isinstance(found.exc_value, Interrupted):  # Python drops errors in __del__: raise it again
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
        _request.handled = False


def in_command() -> bool:
    """Whether this process is the command line, and not a program that imports bellcrank."""
    return _request.handled


def exit_status() -> int | None:
    """128 + the number of the signal that stopped the program; None where there was no signal."""
    return None if _request.number is None else 128 + _request.number


def signal_name() -> str:
    """The name of that signal in brackets; empty for Ctrl-C and where there was no signal."""
    if _request.number in (None, signal.SIGINT):
        return ""
    assert _request.number is not None
    return f" ({signal.Signals(_request.number).name})"


@contextmanager
def held() -> Iterator[Callable[[], None]]:
    """Yield a check that raises Interrupted after a signal. From its first call to the end of the block a signal raises
    nothing else, unless a second signal arrives more than a second after the first.
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
    """In the block a signal raises nothing, unless a second one arrives more than a second after the first. It raises
    Interrupted at the end of the block, unless the block is inside a `held` block.
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
    """In the block a simulation that a signal interrupts raises Interrupted instead of returning a status."""
    _request.whole = True
    try:
        yield
    finally:
        _request.whole = False


def cut_short() -> None:
    """Raise Interrupted in a `whole_runs` block; called after a signal has interrupted a simulation."""
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
