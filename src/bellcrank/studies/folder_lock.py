"""A lock on a folder, so that two processes do not write one study at once."""

from __future__ import annotations

import errno
import fcntl
import os
from pathlib import Path
from typing import Self

from bellcrank.errors import InputError

NAME = ".bellcrank-study-lock"
_WOULD_WAIT = (errno.EAGAIN, errno.EACCES)


class FolderLock:
    """Holds a folder while its block runs. The system releases the lock of a process that is killed.

    The lock is on a file in the folder (flock), which other machines that mount the folder respect too.
    """

    def __init__(self, folder: Path) -> None:
        self.path, self._file = folder / NAME, -1

    def __enter__(self) -> Self:
        """Raises InputError where another process holds the folder, or it cannot be written."""
        while self._file < 0:
            try:
                self.path.parent.mkdir(parents=True, exist_ok=True)
                file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)
            except OSError as error:
                raise InputError(
                    f"cannot write in {self.path.parent}: {error.strerror}; choose another folder"
                ) from None
            try:
                self._take(file)
            except BaseException:
                os.close(file)
                raise
            if self._is_ours(file):
                self._file = file
            else:  # its owner has just removed it
                os.close(file)
        return self

    def __exit__(self, *_: object) -> None:
        self.path.unlink(missing_ok=True)  # before it is released
        os.close(self._file)
        self._file = -1

    def _take(self, file: int) -> None:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in _WOULD_WAIT:
                raise InputError(
                    f"cannot lock {self.path}: {error.strerror}; choose a folder on another disk"
                ) from None
            holder = os.pread(file, 80, 0).decode("utf-8", "replace").strip() or "its number is not known"
            raise InputError(
                f"{self.path.parent}: another study is writing there ({holder}); wait for it, or choose another folder"
            ) from None
        os.ftruncate(file, 0)
        os.pwrite(file, f"process {os.getpid()} on {os.uname().nodename}\n"[:80].encode(), 0)

    def _is_ours(self, file: int) -> bool:
        try:
            here = self.path.stat(follow_symlinks=False)
        except OSError:
            return False
        mine = os.fstat(file)
        return (here.st_dev, here.st_ino) == (mine.st_dev, mine.st_ino)
