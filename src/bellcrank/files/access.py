"""Reads files with limits, and decides which files another file may name.

A file that the user names, on the command line or as a Python argument, is read wherever it is. A file that another
file names must be, after symbolic links are resolved, in the folder of that other file or below it. If it is named by a
relative path, it may also be beside that folder: below the parent folder, without hidden names, unless the parent is a
shared folder (a home, Downloads, Documents, Desktop, a temporary folder, the root of the file system). Every file may
name bundled data and example-robot-data. All other files are refused without being opened; --trust DIR,
BELLCRANK_TRUST and the argument `trust` allow them. A saved run may name only files in its own folder or below.
"""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import BinaryIO

from bellcrank import arguments
from bellcrank.errors import InputError
from bellcrank.files import bundled_data
from bellcrank.messages import file_name_here

MOST_TEXT = 64 * 2**20  # bytes of a URDF, or of another text that is read whole
MOST_YAML = 16 * 2**20  # bytes: a million entries
MOST_TABLE = 256 * 2**20  # bytes of a CSV file
MOST_RUN = 16 * 2**30  # bytes of a saved run, which is not read whole
TRUST = "BELLCRANK_TRUST"
ALLOW = f"allow its folder with --trust DIR, in Python with the argument trust of load_scene, or with {TRUST}"
Trust = str | Path | Iterable[str | Path]
_GATHERED = ("Downloads", "Documents", "Desktop")  # in a home: files from many sources
_SYSTEM = (
    "home",
    "Users",
    "Volumes",
    "etc",
    "usr",
    "var",
    "opt",
    "srv",
    "mnt",
    "media",
    "run",
    "dev",
    "proc",
    "sys",
    "root",
)


def open_regular(path: str | Path, most: int) -> BinaryIO:
    """Open a regular file of at most `most` bytes for reading; pipes, devices and sockets are refused.

    Raises InputError where the file is missing, is not a regular file, is too large or cannot be read.
    """
    try:
        _refuse_special(path, Path(path).stat(), most)
        number = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file; check the path") from None
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from None
    file = os.fdopen(number, "rb")
    try:
        _refuse_special(path, os.fstat(number), most)  # the file may have been replaced since
    except InputError:
        file.close()
        raise
    return file


def read_bytes(path: str | Path, most: int = MOST_TEXT) -> bytes:
    """Read a regular file of at most `most` bytes. Raises InputError as `open_regular`."""
    with open_regular(path, most) as file:
        try:
            size = os.fstat(file.fileno()).st_size
            data = file.read(size + 1) or b""
            if len(data) > size:  # a growing file, or one in /proc, whose size is 0
                data += file.read(most + 1 - len(data)) or b""
        except OSError as error:
            raise _unreadable(path, error) from None
    if len(data) > most:
        raise _too_large(path, most)
    return data


def read_text(path: str | Path, most: int = MOST_TEXT) -> str:
    """Read a text file in UTF-8; a byte-order mark is dropped and line ends become "\\n". Raises InputError."""
    data = read_bytes(path, most)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not valid UTF-8 at byte {error.start}; save the file as UTF-8") from None
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def _refuse_special(path: str | Path, facts: os.stat_result, most: int) -> None:
    if stat.S_ISDIR(facts.st_mode):
        raise InputError(f"{path}: is a folder; name a file in it")
    if not stat.S_ISREG(facts.st_mode):
        raise InputError(f"{path}: is a pipe, a device or a socket; expected a regular file")
    if facts.st_size > most:
        raise _too_large(path, most)


def _unreadable(path: str | Path, error: OSError | ValueError) -> InputError:
    reason = getattr(error, "strerror", None) or error
    return InputError(f"{path}: cannot be read: {reason}; check the path and its permissions")


def _too_large(path: str | Path, most: int) -> InputError:
    return InputError(f"{path}: is too large; the limit for such files is {most / 2**20:.0f} MiB")


@dataclass(frozen=True)
class FileAccess:
    """Which files a file may name, by the rule of this module.

    Relative names start in `folder`. `area` is the folder of the file that the user named. With `held`, only files in
    `area` or below are allowed. `trusted` are further folders or files, with links resolved.
    """

    folder: Path
    area: Path
    trusted: tuple[Path, ...] = ()
    held: bool = False

    @classmethod
    def of(cls, file: str | Path, trust: Trust = ()) -> FileAccess:
        """The access of a file that the user named. Raises InputError where `trust` is not a folder."""
        folder = Path(file).parent
        return cls(folder, folder, trusted_folders(trust))

    @classmethod
    def below(cls, folder: str | Path, trust: Trust = ()) -> FileAccess:
        """The access to the files in a folder and below only. Raises InputError where `trust` is not a folder."""
        return cls(Path(folder), Path(folder), trusted_folders(trust), held=True)

    def by(self, file: Path) -> FileAccess:
        """The access of a file that was itself named under this access."""
        return replace(self, folder=file.parent)

    def path(self, name: str) -> Path:
        """The path of a file that another file names. Raises InputError where it is not allowed."""
        given = Path(name).expanduser() if name.startswith("~/") else Path(file_name_here(name))
        path = self.folder / given
        if not self.allows(path, absolute=bool(given.anchor)):
            shown = "".join(c if c.isprintable() else " " for c in name)
            shown = shown if len(shown) <= 80 else f"{shown[:77]}…"
            if self.held:
                raise InputError(f"'{shown}' is not allowed: expected a file in {self.folder}")
            beside = "" if self._roots[1] is None else " or beside it"
            raise InputError(
                f"'{shown}' is not allowed: expected a relative path to a file in {self.folder}{beside}; {ALLOW}"
            )
        return _resolved(path) or path if ".." in path.parts else path

    def allows(self, path: Path, absolute: bool = False) -> bool:
        """Whether a file may be named. One that is named by an `absolute` path must be in the folder itself or below,
        bundled data, or trusted.
        """
        found = _resolved(path)
        if found is None:
            return False
        if self._is_near(found, beside=not absolute):
            return True
        if any(found.is_relative_to(folder) for folder in self.trusted):
            return True
        return any(found.is_relative_to(folder) for folder in _data_folders(tuple(sys.path)))

    def _is_near(self, path: Path, beside: bool) -> bool:
        own, above = self._roots
        if own is not None and path.is_relative_to(own):
            inside = path.relative_to(own).parts
            if own == Path(own.anchor):
                return len(inside) == 1
            return not (_is_shared(own) and _hidden(inside))
        if not beside or above is None:
            return False
        return path.is_relative_to(above) and not _hidden(path.relative_to(above).parts)

    @cached_property
    def _roots(self) -> tuple[Path | None, Path | None]:
        """The folder itself, and its parent where files beside the folder are allowed."""
        own = _resolved(self.area)
        alone = self.held or own is None or _is_shared(own) or _is_shared(own.parent)
        return own, None if alone or own is None else own.parent


def trusted_folders(trust: Trust = ()) -> tuple[Path, ...]:
    """The folders of the argument `trust` and of BELLCRANK_TRUST. Raises InputError where one is not a folder."""
    found = []
    given = [trust] if isinstance(trust, (str, Path)) else trust
    for each in arguments.several("trust", given, object, "folders"):
        path = arguments.path("trust", each, "a folder whose files may be read").expanduser()
        if not path.is_dir():
            raise InputError(f"argument 'trust': {path}: there is no such folder; name one whose files may be read")
        found.append(path.resolve())
    for text in os.environ.get(TRUST, "").split(os.pathsep):
        if text.strip() and (resolved := _resolved(Path(text).expanduser())) is not None:
            found.append(resolved)
    return tuple(dict.fromkeys(found))


def for_files_only(trust: Trust, name: str, loader: str) -> None:
    """Raise InputError where `trust` is given although the argument `name` is loaded already, by `loader`."""
    if arguments.several("trust", [trust] if isinstance(trust, (str, Path)) else trust, object, "folders"):
        raise InputError(
            f"argument 'trust': applies only to paths, and '{name}' is loaded already; give it to {loader}"
        )


def _resolved(path: Path) -> Path | None:
    """The path with links resolved; None where that is impossible."""
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError):  # a loop of links, or a NUL in the name
        return None


def _hidden(parts: Iterable[str]) -> bool:
    return any(part.startswith(".") for part in parts)


def _is_shared(folder: Path) -> bool:
    """Whether a folder holds unrelated files: a home, a root, a temporary folder."""
    root = Path(folder.anchor)
    system = [root, *(root / name for name in _SYSTEM)]
    home = _resolved(Path(os.path.expanduser("~")))
    if folder in system or folder == home or folder.parent in (root / "home", root / "Users"):
        return True
    if folder.name in _GATHERED and (folder.parent == home or folder.parent.parent in (root / "home", root / "Users")):
        return True
    try:
        return bool(folder.stat().st_mode & stat.S_ISVTX)  # such as /tmp
    except OSError:
        return True


@lru_cache(maxsize=4)
def _data_folders(import_path: tuple[str, ...]) -> list[Path]:
    """The folders of bundled data and example-robot-data."""
    folders = [*(bundled_data.folder(name) for name in bundled_data.FOLDERS), *bundled_data.example_folders()]
    return [found for folder in folders if (found := _resolved(folder)) is not None]
