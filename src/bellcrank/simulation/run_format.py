"""The container of a saved run: an .npz file with a JSON text, `about`, and float64 arrays."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.errors import InputError
from bellcrank.files.access import MOST_RUN, open_regular
from bellcrank.files.atomic_write import writing
from bellcrank.simulation.run_archive import DAMAGE, NoRun, brief, read_archive
from bellcrank.terminal import interruption
from bellcrank.text import utf8
from bellcrank.version import version

Array = NDArray[np.float64]
RUN = "bellcrank run"
CHECKPOINTS = "bellcrank run in blocks"  # about.npz of a folder of checkpoints
CHECKPOINT = "bellcrank run block"  # the other files of that folder
VERSION = 1
LONGEST_REASON = 300  # characters


def run_path(path: str | Path) -> Path:
    """The path of a run's file, with its suffix."""
    target = Path(path)
    return target if target.suffix == ".npz" else target.with_name(target.name + ".npz")


def write_archive(target: Path, about: dict[str, Any], arrays: dict[str, Array], lasting: bool = False) -> None:
    """Write a JSON text and arrays to an .npz file, atomically. `lasting`: it survives a power cut. Raises InputError."""
    text = np.frombuffer(utf8(json.dumps(about, ensure_ascii=False)), dtype=np.uint8)
    contents: dict[str, Any] = {"about": text, **arrays}
    with interruption.unbroken(), writing(target, lasting) as temporary, temporary.open("wb") as file:
        np.savez(file, **contents)


def archive_of(file: Path, form: str, unpacked: int | None = None) -> tuple[dict[str, Any], dict[str, Array]]:
    """Read the JSON text and the float64 arrays of an .npz file of the format `form`.

    `unpacked` as in `read_archive`. Raises InputError for any other file.
    """
    try:
        with open_regular(file, MOST_RUN) as stream:
            about, arrays = read_archive(stream, unpacked)
    except NoRun:
        about, arrays = {}, {}
    except DAMAGE as error:
        raise damaged(file, error) from None
    if about.get("format") != form:
        raise InputError(f"{file}: not a run: expected an .npz file that Trajectory.save wrote")
    if about.get("version") != VERSION:
        raise InputError(
            f"{file}: the run has format version {brief(about.get('version'), '')}, this bellcrank {version()} reads "
            f"{VERSION}; load it with the bellcrank that wrote it, or a later one"
        )
    return about, arrays


def damaged(file: Path, error: BaseException) -> InputError:
    """The error of a file that is not what it says, with the reason."""
    why = reason(error)
    return InputError(f"{file}: not a run, or damaged{f' ({why})' if why else ''}; save or copy it again")


def reason(error: BaseException) -> str:
    """The text of an error in one line of at most LONGEST_REASON characters."""
    text = " ".join(str(error).split())
    return text if len(text) <= LONGEST_REASON else f"{text[:LONGEST_REASON]}…"
