"""Progress bars, which are shown on a terminal only, and after one second."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from bellcrank.arguments import Progress
from bellcrank.errors import InputError


def bars() -> Any:
    """The class of progress bars. Raises InputError for an invalid environment variable TQDM_….

    They have no monitor: a thread that outlives them, and beside which `plot_style` draws in no second process.
    """
    try:
        from tqdm import tqdm
    except (TypeError, ValueError) as error:
        raise InputError(f"environment variable TQDM_…: {error}; unset it") from None

    class Bar(tqdm):  # type: ignore[type-arg]
        monitor_interval = 0

        def __init__(self, *of: Any, **options: Any) -> None:
            super().__init__(*of, **{"delay": 1.0, "disable": None, "miniters": 0, **options})  # of 0 needs no monitor

    return Bar


@contextmanager
def counting(title: str, unit: str) -> Iterator[Progress]:
    """A progress bar that counts; yields a function of the number done and the total, None where that is unknown."""
    with bars()(desc=title, unit=unit) as bar:

        def progress(done: float, of: float | None) -> None:
            bar.total = done if of is None else of
            bar.update(done - bar.n)

        yield progress


@contextmanager
def share_bar(what: str) -> Iterator[Callable[[float], None]]:
    """A progress bar without a count; yields a function of the share done, 0 to 1."""
    layout = "{l_bar}{bar}| [{elapsed}]"
    with bars()(total=1.0, desc=what, bar_format=layout, position=0, leave=False) as bar:

        def progress(share: float) -> None:
            bar.update(max(min(share, 1.0) - bar.n, 0.0))

        yield progress
