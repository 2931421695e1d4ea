"""Tables of a sweep that goes on, sweep.partial.csv and .json, which sweep.csv and sweep.json replace at the end."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.studies.sweep_result import Sweep

_SUFFIXES = (".csv", ".json")


class PartialTables:
    """Writes the tables of a sweep into a folder. What an earlier sweep left unfinished there is renamed to
    sweep.partial.1.csv and so on: `earlier` are the new paths. Raises InputError where it cannot be.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.paths = [folder / f"sweep.partial{suffix}" for suffix in _SUFFIXES]
        self.earlier = [_set_aside(path) for path in self.paths if os.path.lexists(path)]

    def write(self, sweep: Sweep) -> None:
        """Write the designs that are done; not, where the disk takes none: the next time, or at the end."""
        with contextlib.suppress(InputError):
            sweep.to_csv(self.paths[0])
            sweep.to_json(self.paths[1])

    def finish(self, sweep: Sweep) -> list[Path]:
        """Write the tables of the sweep as it is at its end; their paths. Raises InputError, with what is kept."""
        files: list[Path] = []
        try:
            files.append(sweep.to_csv(self.folder / "sweep.csv"))
            files.append(sweep.to_json(self.folder / "sweep.json"))
        except InputError as error:
            kept = [path.name for path in self.paths if path.exists()]
            left = f"the designs that were done before are kept in {' and '.join(kept)}" if kept else "nothing is kept"
            if files:
                left = f"all designs are in {files[0].name}"
            raise InputError(f"{error}; {left}") from None
        for path in self.paths:
            path.unlink(missing_ok=True)
        return files


def _set_aside(path: Path) -> Path:
    number = 1
    while os.path.lexists(aside := path.with_suffix(f".{number}{path.suffix}")):
        number += 1
    try:
        return path.rename(aside)
    except OSError as error:
        raise InputError(f"cannot rename {path}: {error.strerror}; choose another folder") from None
