"""A bar on the terminal for what may take longer than a second."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def share_bar(what: str) -> Iterator[Callable[[float], None]]:
    """A bar that shows itself after a second, on a terminal only; yields what to call with the share that is done."""
    from bellcrank.terminal.progress import bars

    layout = "{l_bar}{bar}| [{elapsed}]"
    with bars()(total=1.0, desc=what, delay=1.0, disable=None, bar_format=layout, position=0, leave=False) as bar:

        def progress(share: float) -> None:
            bar.update(max(min(share, 1.0) - bar.n, 0.0))

        yield progress
