"""Atomic writes: a file is written beside its target and then renamed over it.

If the target is a symbolic link, the file that it points to is replaced; permissions are kept. A folder, a device or a
pipe is refused. If the process is killed, the old file remains. After a power cut a file may be missing unless it was
written with `lasting`.
"""

from __future__ import annotations

import contextlib
import os
import re
import stat
from collections.abc import Iterable, Iterator, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from bellcrank.errors import InputError
from bellcrank.files.temporaries import new_file
from bellcrank.messages import ERRORS

_WILD = re.compile(r"([\[*?])")  # wildcards of fnmatch


@contextlib.contextmanager
def writing(path: str | Path, lasting: bool = False) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`; it replaces `path` when the block ends without an exception.

    With `lasting`, the data is flushed to the disk. Raises InputError where `path` cannot be written.
    """
    target = file_meant(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = new_file(target.parent, target.suffix)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}; choose a folder that you can write to") from error
    try:
        yield temporary
        _take_permissions(target, temporary)
        if lasting:
            _sync(temporary)
        os.replace(temporary, target)
        if lasting:
            _sync(target.parent)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write `text` (UTF-8) to `path` atomically."""
    with writing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", errors=ERRORS)


def file_meant(path: str | Path) -> Path:
    """The file that a write to `path` replaces: `path` itself, or the target of a symbolic link.

    Raises InputError for a folder, a device, a pipe, a circular link, and an invalid name.
    """
    target = Path(path)
    try:
        if target.is_symlink():
            target = Path(os.path.realpath(target))
            if target.is_symlink():
                raise InputError(f"cannot write {path}: the symbolic link is circular")
        mode = target.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return target
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}; choose a folder that you can write to") from error
    except ValueError:  # a NUL, or letters that the locale has none for
        raise InputError(f"cannot write {path}: the name is not valid on this system; choose another") from None
    if not stat.S_ISREG(mode):
        raise InputError(f"cannot write {path}: it is a {_kind(mode)}; expected a file")
    return target


def check_file(option: str, path: Path) -> None:
    """Check, before long work, that the file given by `option` can be written. Raises InputError."""
    if path.is_dir():
        raise InputError(f"{option} {path}: is a folder; expected a file such as {path / 'replay.html'}")
    try:
        target = file_meant(path)
    except InputError as error:
        raise InputError(f"{option}: {error}") from None
    _check_place(f"{option} {path}", target.parent)


def check_folder(option: str, folder: Path, names: Iterable[str] = ()) -> None:
    """Check, before long work, that the folder given by `option`, and files of these names (shell patterns) in it, can
    be written. Raises InputError, also for links that lead out of the folder.
    """
    _check_place(f"{option} {folder}", folder)
    names = list(names)
    _refuse_links_elsewhere(option, folder, names)
    for name in names:
        try:
            target = file_meant(folder / name)
        except InputError as error:
            raise InputError(f"{option}: {error}") from None
        if target.parent != folder:
            _check_place(f"{option} {folder}: {name}", target.parent)


def default_place(name: str) -> Path:
    """The default output of a command: a folder of this name in the current folder, or a file (and NAME_…).

    Raises InputError where it is a link that leads out of the current folder: the user did not choose what the link
    would overwrite.
    """
    if "\0" in name:  # which writing refuses
        return Path(name)
    path = Path(_WILD.sub(r"[\1]", name))
    _refuse_links_elsewhere("--out", Path(), [str(path), f"{path.stem}_*{path.suffix}" if path.suffix else str(path)])
    return Path(name)


def _refuse_links_elsewhere(option: str, folder: Path, names: Sequence[str]) -> None:
    """Refuse links that match these patterns and lead out of the folder. Raises InputError."""
    try:
        entries = [entry for entry in folder.iterdir() if entry.is_symlink()]
    except (OSError, ValueError):  # it does not exist yet, or its name is not valid
        return
    own = os.path.realpath(folder)
    for link in entries:
        if any(fnmatchcase(link.name, name) for name in names):
            target = os.path.realpath(link)
            if not Path(target).is_relative_to(own):
                raise InputError(
                    f"{link}: is a link to {target}, which would be overwritten; remove the link, or choose the "
                    f"output by {option}"
                )


def _check_place(what: str, folder: Path) -> None:
    place = next(place for place in (folder, *folder.parents) if os.path.lexists(place))
    if not place.is_dir():
        raise InputError(f"{what}: {place} is a file; expected a folder")
    if not os.access(place, os.W_OK | os.X_OK):
        raise InputError(f"{what}: no permission to write in {place}; choose another folder")


def _take_permissions(target: Path, temporary: Path) -> None:
    """Give a file the permissions of the file that it replaces, and its owner where that is allowed."""
    try:
        facts = target.stat()
    except OSError:
        return
    mine = temporary.stat()
    if (facts.st_uid, facts.st_gid) != (mine.st_uid, mine.st_gid):
        with contextlib.suppress(OSError):
            os.chown(temporary, facts.st_uid, facts.st_gid)
    temporary.chmod(stat.S_IMODE(facts.st_mode) & 0o777)


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _kind(mode: int) -> str:
    names = {stat.S_IFDIR: "folder", stat.S_IFIFO: "pipe", stat.S_IFSOCK: "socket"}
    return names.get(stat.S_IFMT(mode), "device")
