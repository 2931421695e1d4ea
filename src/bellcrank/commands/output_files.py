"""Files that a command writes one after the other: those written are listed even where one cannot be written."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from bellcrank.errors import InputError


def output_path(text: str) -> Path:
    """The path that an option names for output. An empty one, as of a variable that is not set, is refused.

    Raises ArgumentTypeError, which argparse reports with the option's name.
    """
    if not text.strip():
        raise argparse.ArgumentTypeError(f"expected a path, found {text!r}; leave the option out for the default")
    return Path(text)


@contextmanager
def list_on_failure(files: list[Path], folder: Path) -> Iterator[None]:
    """Where the block ends early, by an error or a signal, list the files written until then."""
    try:
        yield
    except BaseException:
        if files:
            print(written(files, folder))
        raise


def write_each(files: list[Path], jobs: Iterable[tuple[Path, Callable[[Path], object]]]) -> None:
    """Write all files that can be written, and add them to a list. Raises the InputError of the first that cannot."""
    failures = []
    for path, write in jobs:
        try:
            write(path)
            files.append(path)
        except InputError as error:
            failures.append(error)
    if failures:
        raise failures[0]


def written(files: Iterable[Path], folder: Path) -> str:
    """The sentence about the files that a command wrote: those in its folder by name, others by their path."""
    files = list(files)
    inside = ", ".join(path.name for path in files if path.parent == folder)
    return f"wrote {inside or 'nothing'} in {folder}{''.join(f', {path}' for path in files if path.parent != folder)}"
