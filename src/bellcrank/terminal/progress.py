"""Progress bars: on a terminal only, and after a second."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from bellcrank.errors import InputError


def bars() -> Any:
    """The class of progress bars. Raises InputError where a variable TQDM_… of the environment is not what it takes."""
    try:
        from tqdm import tqdm
    except (TypeError, ValueError) as error:
        raise InputError(f"a variable TQDM_… of the environment: {error}; unset it") from None
    return tqdm


@contextmanager
def counting(title: str, unit: str) -> Iterator[Callable[[int, int], None]]:
    """A bar over things that are counted; yields what to call with the number done and that of all."""
    with bars()(desc=title, unit=unit, delay=1.0, disable=None) as bar:

        def progress(done: int, of: int) -> None:
            bar.total = of
            bar.update(done - bar.n)

        yield progress


@contextmanager
def share_bar(what: str) -> Iterator[Callable[[float], None]]:
    """A bar that shows itself after a second, on a terminal only; yields what to call with the share that is done."""
    layout = "{l_bar}{bar}| [{elapsed}]"
    with bars()(total=1.0, desc=what, delay=1.0, disable=None, bar_format=layout, position=0, leave=False) as bar:

        def progress(share: float) -> None:
            bar.update(max(min(share, 1.0) - bar.n, 0.0))

        yield progress
