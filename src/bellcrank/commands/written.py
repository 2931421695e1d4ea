"""Files that a command writes one after the other: what is there is told even where one of them cannot be written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from bellcrank.errors import InputError


@contextmanager
def telling(files: list[Path], folder: Path) -> Iterator[None]:
    """Where the block ends early, by an error or a signal, say which files were written until then."""
    try:
        yield
    except BaseException:
        if files:
            print(f"wrote {', '.join(path.name for path in files)} in {folder}")
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
