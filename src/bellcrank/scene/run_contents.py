"""The contents of a saved run: the JSON text and the arrays of its .npz file, or of a folder of checkpoints.

The text contains the scene, the URDF and the files that the scene names, so that a run can be loaded without the
original files. Only sizes and names are checked here; simulation/files/load_run.py checks everything else.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from bellcrank.arrays import Array
from bellcrank.elements.element import found_signal
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import MOST_RUN, open_regular
from bellcrank.files.npz_archive import DAMAGE, UNPACKED, NoAboutError, brief, read_archive
from bellcrank.files.temporaries import new_folder
from bellcrank.messages import file_name_here, utf8
from bellcrank.version import version

RUN: Final = "bellcrank run"
CHECKPOINTS: Final = "bellcrank run in blocks"  # about.npz of a folder of checkpoints
CHECKPOINT: Final = "bellcrank run block"  # the other files of that folder
VERSION: Final = 1
LONGEST_REASON: Final = 300  # characters
_ARRAYS = re.compile(
    r"time|state|parameters|steps|multipliers|event_(time|position|velocity|auxiliary)|latch_velocity|end_(time|state)|"
    r"held_(time|values)|"
    r"signal_(0|[1-9][0-9]{0,3})_(breaks|coefficients)"
)
_NUMBERED = re.compile(r"\d{4,}\.npz")
_ROWS = ("time", "state", "event_time", "event_position", "event_velocity")


def run_contents(file: Path) -> tuple[dict[str, Any], dict[str, Array]]:
    """Read the JSON text and the float64 arrays of a run's file or folder of checkpoints. Raises InputError."""
    return joined_checkpoints(file) if file.is_dir() else archive_of(file, RUN)


def archive_of(file: Path, form: str, unpacked: int | None = None) -> tuple[dict[str, Any], dict[str, Array]]:
    """Read the JSON text and the float64 arrays of an .npz file of the format `form`.

    `unpacked` is passed to `read_archive`. Raises InputError for any other file.
    """
    try:
        with open_regular(file, MOST_RUN) as stream:
            about, arrays = read_archive(stream, _ARRAYS, unpacked)
    except NoAboutError:
        about, arrays = {}, {}
    except DAMAGE as error:
        raise damaged(file, error) from None
    if about.get("format") != form:
        raise InputError(f"{file}: not a run; expected an .npz file written by Trajectory.save")
    if about.get("version") != VERSION:
        raise InputError(
            f"{file}: the run has format version {brief(about.get('version'), '')}, but bellcrank {version()} reads "
            f"version {VERSION}; load it with the bellcrank that wrote it, or a later one"
        )
    return about, arrays


def damaged(file: Path, error: BaseException) -> InputError:
    """The error for a damaged file, with the reason."""
    why = reason(error)
    return InputError(f"{file}: not a run, or damaged{f' ({why})' if why else ''}; save or copy it again")


def reason(error: BaseException) -> str:
    """The text of an error in one line of at most LONGEST_REASON characters."""
    text = " ".join(str(error).split())
    return text if len(text) <= LONGEST_REASON else f"{text[:LONGEST_REASON]}…"


@contextlib.contextmanager
def refusing(file: Path) -> Iterator[None]:
    """Convert the errors that a file's contents cause to an InputError that names the file."""
    try:
        yield
    except BellcrankError as error:
        raise InputError(f"{file}: the scene in it cannot be rebuilt: {reason(error)}") from None
    except DAMAGE as error:
        raise damaged(file, error) from None


# ---- checkpoints


def holds_checkpoints(folder: Path) -> bool:
    """Whether this is a folder of checkpoints."""
    return (folder / "about.npz").is_file()


def checkpoint_file(folder: Path, name: str) -> Path:
    """The path of a file in a folder of checkpoints.

    Raises InputError for a symbolic link, which could lead out of the folder or repeat one file many times.
    """
    path = folder / name
    if path.is_symlink():
        raise InputError(f"{path}: expected a regular file, found a symbolic link; copy the folder again")
    return path


def joined_checkpoints(folder: Path) -> tuple[dict[str, Any], dict[str, Array]]:
    """Read a folder of checkpoints. Returns the same contents as those of a run's file. Raises InputError."""
    if not holds_checkpoints(folder):
        raise InputError(f"{folder}: expected a saved run (.npz) or a folder of checkpoints, found another folder")
    about, arrays = archive_of(checkpoint_file(folder, "about.npz"), CHECKPOINTS)
    names = sorted((path.name for path in folder.iterdir() if _NUMBERED.fullmatch(path.name)), key=_number)
    for k, name in enumerate(names, 1):
        if _number(name) != k:
            raise InputError(
                f"{folder}: the checkpoint {k:04d}.npz is missing; to load the run up to there, move the later ones to "
                "another folder"
            )
    if not names:
        raise InputError(f"{folder}: no checkpoints found")
    spare = UNPACKED // len(names)  # the limit of one file applies to their sum
    parts = [archive_of(checkpoint_file(folder, name), CHECKPOINT, spare) for name in names]
    try:
        for name in (*_ROWS, *(("event_auxiliary",) if "event_auxiliary" in parts[0][1] else ())):
            arrays[name] = np.concatenate([rows[name] for _, rows in parts])
        last, rows = parts[-1]
        arrays["steps"] = rows["steps"]  # each checkpoint holds all steps so far
        if not len(arrays["time"]) or arrays["time"][-1] < rows["end_time"][0]:
            arrays["time"] = np.append(arrays["time"], rows["end_time"])
            arrays["state"] = np.vstack([arrays["state"], rows["end_state"]])
        events = [event for facts, _ in parts for event in facts["events"]]
        about.pop("process", None)
        _add_held(about, arrays, about.pop("held", []), [rows for _, rows in parts])
        about |= {"format": RUN, "status": last["status"], "statistics": last["statistics"], "events": events}
    except (KeyError, TypeError, ValueError, IndexError) as error:
        why = " ".join(str(error).split())[:150]
        raise InputError(f"{folder}: the checkpoints do not fit together ({why}); copy the folder again") from None
    return about, arrays


def _add_held(
    about: dict[str, Any], arrays: dict[str, Array], widths: list[int], parts: list[dict[str, Array]]
) -> None:
    """Add the signals that the run found, of these widths, which the checkpoints hold in parts."""
    if not widths:
        return
    time = np.concatenate([rows["held_time"] for rows in parts])
    values = np.concatenate([rows["held_values"] for rows in parts])
    last = np.append(np.diff(time) > 0.0, True)  # of several at one time
    for part in np.split(values[last], np.cumsum(widths)[:-1], axis=1):
        signal, k = found_signal(time[last], np.ascontiguousarray(part)), len(about["signals"])
        about["signals"].append({"derivatives": signal.derivatives, "kinked": signal.kinked})
        arrays |= {f"signal_{k}_breaks": signal.breaks, f"signal_{k}_coefficients": signal.coefficients}


def _number(name: str) -> int:
    return int(name.partition(".")[0])


# ---- the scene's files


def unpacked_scene(about: Mapping[str, Any]) -> Path:
    """Unpack a run's scene and the files that it names into a temporary folder. Returns the scene's path.

    Raises InputError if they cannot be written, and ValueError for names that lead out of the folder.
    """
    return _unpacked(json.dumps(about["files"], sort_keys=True)) / _file_name(about["scene"])


@cache
def _unpacked(files: str) -> Path:
    """Write files (JSON {name: text}) to a folder that is kept until the process ends. Raises InputError."""
    texts: dict[str, str] = {_file_name(name): text for name, text in json.loads(files).items()}
    try:
        folder = new_folder("run")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        for name, text in texts.items():
            (folder / name).write_bytes(utf8(text))
    except OSError as error:
        raise InputError(f"cannot be unpacked into {tempfile.gettempdir()}: {error.strerror or error}") from None
    return folder


def _file_name(name: str) -> str:
    """Convert a file's name for this system. Raises ValueError for one that leads out of its folder."""
    if Path(name).name != name or name in ("", ".."):
        raise ValueError(f"it names the file {brief(name)}")
    return file_name_here(name)
