"""The secret with which entries of the cache are signed.

It is 32 random bytes in XDG_STATE_HOME/bellcrank/cache-secret, else ~/.local/state/bellcrank/cache-secret, which only
the user may read (mode 0600). It is not in the cache, so that a copied cache cannot bring its own.
"""

from __future__ import annotations

import contextlib
import os
import stat
from functools import cache
from pathlib import Path

from bellcrank.codegen.cache_folder import users_folder

_SIZE = 32


def secret() -> bytes | None:
    """The user's secret, created when first needed; None where it cannot be written."""
    base = users_folder("XDG_STATE_HOME", ".local/state")
    return None if base is None else _kept(base / "bellcrank" / "cache-secret")


@cache
def _kept(path: Path) -> bytes | None:
    try:
        return _read(path) or _made(path)
    except OSError:
        return None


def _read(path: Path) -> bytes | None:
    """The content of the file; None where it is missing or invalid. Raises OSError for a file of another user."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError:
        return None
    with os.fdopen(handle, "rb") as file:
        facts = os.fstat(handle)
        if facts.st_uid != os.geteuid() or not stat.S_ISREG(facts.st_mode):
            raise PermissionError(path)
        found = file.read(_SIZE + 1)
    return found if len(found) == _SIZE and not stat.S_IMODE(facts.st_mode) & 0o077 else None


def _made(path: Path) -> bytes | None:
    """Write a new secret atomically. If two processes do so at once, both use the one that remains."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    temporary = path.with_name(f"{path.name}-{os.urandom(8).hex()}")
    handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(os.urandom(_SIZE))
        os.replace(temporary, path)
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
    return _read(path)
