"""What need not be made twice: traced recipes and machine code, in a folder of the user's own.

Compiled code on disk is executable code, so the folder must belong to the user and be closed to
others (mode 0700), and every entry carries a checksum. Nothing here ever fails a run: an entry that
is missing, truncated, altered or foreign is made anew, and a folder that cannot be used is not used.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import tempfile
from functools import cache
from pathlib import Path

_MAGIC = b"bellcrank-cache-1\n"
_LIMIT = 512 * 2**20  # bytes kept; the least recently used entries go first


def digest(*parts: str | bytes) -> str:
    """The SHA-256, in hexadecimal, of parts that cannot run into each other."""
    h = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        h.update(len(data).to_bytes(8, "little"))
        h.update(data)
    return h.hexdigest()


def folder() -> Path | None:
    """The cache folder: BELLCRANK_CACHE, else XDG_CACHE_HOME/bellcrank, else ~/.cache/bellcrank.

    None where it cannot be made, belongs to somebody else, or BELLCRANK_CACHE is "off".
    """
    chosen = os.environ.get("BELLCRANK_CACHE", "")
    if chosen.lower() == "off":
        return None
    base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return _usable(chosen or os.path.join(base, "bellcrank"))


@cache
def _usable(path: str) -> Path | None:
    where = Path(path)
    try:
        where.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = where.stat()
        if status.st_uid != os.getuid():
            return None
        if stat.S_IMODE(status.st_mode) != 0o700:
            where.chmod(0o700)
        return where if os.access(where, os.W_OK | os.X_OK) else None
    except OSError:
        return None


def load(key: str) -> bytes | None:
    """The payload stored under `key`, or None."""
    where = folder()
    if where is None:
        return None
    path = where / key
    try:
        data = path.read_bytes()
    except OSError:
        return None
    head = len(_MAGIC) + 32
    payload = data[head:]
    if data[: len(_MAGIC)] != _MAGIC or data[len(_MAGIC) : head] != hashlib.sha256(payload).digest():
        return None
    with contextlib.suppress(OSError):
        os.utime(path)  # marks it as used, for pruning
    return payload


def store(key: str, payload: bytes) -> None:
    """Keep `payload` under `key`, atomically; silently not, where the folder cannot be written."""
    where = folder()
    if where is None:
        return
    try:
        handle, name = tempfile.mkstemp(dir=where)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(_MAGIC + hashlib.sha256(payload).digest() + payload)
            os.replace(name, where / key)
        finally:
            Path(name).unlink(missing_ok=True)
        _prune(where)
    except OSError:
        return


def _prune(where: Path) -> None:
    entries = [(p, p.stat()) for p in where.iterdir()]
    total = sum(s.st_size for _, s in entries)
    for path, status in sorted(entries, key=lambda e: e[1].st_mtime):
        if total <= _LIMIT:
            return
        path.unlink(missing_ok=True)
        total -= status.st_size
