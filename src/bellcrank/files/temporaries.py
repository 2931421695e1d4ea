"""Temporary files and folders, whose names contain the process that made them.

A name contains the machine, the process number and its start time. When a process creates a temporary file in a folder,
it first removes those that dead processes of the same user left there. Files of another machine (in a shared folder)
are removed when they are older than a day, because their process cannot be checked.
"""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import shutil
import stat
import tempfile
import time
import zlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

OLD = 86_400.0  # s
_MARK = re.compile(r"(?P<host>[0-9a-f]{8})-(?P<pid>\d{1,10})-(?P<start>\d{1,20})")
_NAME = re.compile(r"\.?bellcrank-(?P<kind>[a-z]+)-(?P<mark>[0-9a-f]{8}-\d+-\d+)-[0-9a-f]{8}(?:\.\w{1,15})?\Z")
_SUFFIX = re.compile(r"\.\w{1,15}")
_LASTING = ("show",)  # pages that a browser may read after the process has ended
_cleaned: set[str] = set()


def own_mark() -> str:
    """The text that identifies this process in names of files."""
    pid = os.getpid()
    return f"{_host()}-{pid}-{_started(pid) or 0}"


def is_running(mark: str) -> bool | None:
    """Whether the process of a mark is running; None for a process of another machine, or an invalid mark."""
    found = _MARK.fullmatch(mark)
    if found is None or found["host"] != _host():
        return None
    started = _started(int(found["pid"]))
    return started is not None and started == int(found["start"])


def new_file(folder: Path, suffix: str) -> Path:
    """Create an empty temporary file in a folder, with default permissions. Raises OSError."""
    remove_left(folder)
    ending = suffix if _SUFFIX.fullmatch(suffix) else ""
    path = folder / f".{_new_name('file')}{ending}"
    os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
    return path


def new_folder(kind: str, within: Path | None = None) -> Path:
    """Create a temporary folder that only this user can read, in the system's temporary folder or `within` another.

    `kind` is one word in lower case. Raises OSError.
    """
    where = Path(tempfile.gettempdir()) if within is None else within
    remove_left(where)
    path = where / f"{'' if within is None else '.'}{_new_name(kind)}"
    path.mkdir(0o700 if within is None else 0o777)
    return path


@contextlib.contextmanager
def temporary_folder(kind: str) -> Iterator[Path]:
    """A temporary folder that is removed at the end of the block. Raises OSError."""
    path = new_folder(kind)
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


def remove_left(folder: Path) -> None:
    """Remove what dead processes of this user left in a folder; done once per process and folder."""
    key = os.path.realpath(folder)
    if key in _cleaned:
        return
    _cleaned.add(key)
    with contextlib.suppress(OSError), os.scandir(key) as entries:
        for entry in entries:
            found = _NAME.match(entry.name)
            if found is not None:
                _remove(entry, found["kind"], found["mark"])


def _remove(entry: os.DirEntry[str], kind: str, mark: str) -> None:
    with contextlib.suppress(OSError):
        facts = entry.stat(follow_symlinks=False)
        running = None if kind in _LASTING else is_running(mark)
        if facts.st_uid != os.geteuid() or running or (running is None and time.time() - facts.st_mtime < OLD):
            return
        if stat.S_ISDIR(facts.st_mode):
            shutil.rmtree(entry.path, ignore_errors=True)
        elif stat.S_ISREG(facts.st_mode):
            Path(entry.path).unlink()


def _new_name(kind: str) -> str:
    return f"bellcrank-{kind}-{own_mark()}-{secrets.token_hex(4)}"


@cache
def _host() -> str:
    """The machine or container in which process numbers are unique: 8 hexadecimal digits."""
    space = ""
    with contextlib.suppress(OSError):
        space = str(Path("/proc/self/ns/pid").readlink())
    return f"{zlib.crc32(f'{os.uname().nodename} {space}'.encode()):08x}"


def _started(pid: int) -> int | None:
    """The start time of a process in clock ticks; 0 where it is unknown, None where there is no such process."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
        return int(text.rpartition(")")[2].split()[19])
    except FileNotFoundError:
        if Path("/proc/self/stat").exists():
            return None
    except (OSError, ValueError, IndexError):
        pass
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return None
    except OSError:
        pass
    return 0
