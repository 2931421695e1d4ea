"""What need not be made twice, kept on disk: robots that were read, traced recipes, machine code, meshes.

Machine code on disk is executed, so that an entry is used only where it is known to be the user's own:

- Each entry carries an HMAC-SHA256 of its name and content under a secret (secret.py) that lies in the user's state
  folder, not in the cache. A cache folder that came from somewhere else (in an archive, by mail, on a shared disk), an
  entry that another user put there or changed, one under another's name and one that is damaged are made anew.
- An entry that belongs to another user, is no regular file, or may be written by others is not even read.
- The folder itself (cache_folder.py) is the user's own, closed to others.

Whoever can write as the user can read the secret too, and is not kept out.

Nothing here ever fails a run: what cannot be read is made anew, and what cannot be written is not kept. The folder
holds BELLCRANK_CACHE_LIMIT (1 GB) at most; the least recently used entries go first.
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import json
import os
import re
import stat
import time
import warnings
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Any, get_args

from bellcrank.codegen.cache_folder import folder, limit
from bellcrank.codegen.cache_secret import secret

_MAGIC = b"bellcrank-cache-2\n"
_HEAD = len(_MAGIC) + 32
_ENTRY = re.compile(r"[a-z]+-[0-9a-f]{64}\Z")
_TEMPORARY = re.compile(r"temporary-[0-9a-f]{32}\Z")
_BLOCK = 4096  # bytes: files take whole blocks on disk, and are counted so
_KEPT = 0.8  # of the limit, after pruning
_ABANDONED = 3600.0  # s after which a temporary file belongs to a process that was killed
_RECENTLY = 60.0  # s within which it need not be noted again that an entry is used


def digest(*parts: str | bytes) -> str:
    """The SHA-256, in hexadecimal, of parts that cannot run into each other."""
    h = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        h.update(len(data).to_bytes(8, "little"))
        h.update(data)
    return h.hexdigest()


def load(key: str) -> bytes | None:
    """The payload stored under `key`, or None."""
    place = _place()
    if place is None:
        return None
    where, own = place
    try:
        data = _read(where / key)
    except OSError:
        return None
    payload = data[_HEAD:]
    if data[: len(_MAGIC)] != _MAGIC or not hmac.compare_digest(data[len(_MAGIC) : _HEAD], _seal(own, key, payload)):
        return None
    return payload


def load_data(key: str, kind: Any) -> Any:
    """The JSON data stored under `key` where it is of this kind, else None.

    A kind is a type or a union of types (float takes any number, object anything), [kind] for a list, (kind, …) for a
    list of that length, {str: kind} for a mapping, or {"name": kind, …} for one with these keys.
    """
    payload = load(key)
    try:
        data = None if payload is None else json.loads(payload)
    except (ValueError, RecursionError):
        return None
    return data if fits(data, kind) else None


def fits(data: Any, kind: Any) -> bool:
    """Whether JSON data is of a kind, as `load_data` says."""
    if isinstance(kind, UnionType):
        return any(fits(data, one) for one in get_args(kind))
    if isinstance(kind, list):
        return isinstance(data, list) and all(fits(entry, kind[0]) for entry in data)
    if isinstance(kind, tuple):
        return isinstance(data, list) and len(data) == len(kind) and all(map(fits, data, kind))
    if isinstance(kind, dict) and str in kind:
        return isinstance(data, dict) and all(fits(entry, kind[str]) for entry in data.values())
    if isinstance(kind, dict):
        return isinstance(data, dict) and data.keys() == kind.keys() and all(fits(data[k], kind[k]) for k in kind)
    return kind is object or type(data) is kind or (kind is float and type(data) is int)


def store(key: str, payload: bytes) -> None:
    """Keep `payload` under `key` ("kind-SHA256"), atomically; silently not, where the folder cannot be written."""
    place = _place()
    if place is None or len(payload) + _HEAD > limit():
        return
    where, own = place
    temporary = where / f"temporary-{os.urandom(16).hex()}"
    try:
        used = _use(where, len(payload) + _HEAD)
        try:
            handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
            with os.fdopen(handle, "wb") as file:
                file.write(_MAGIC + _seal(own, key, payload) + payload)
            os.replace(temporary, where / key)
        finally:
            temporary.unlink(missing_ok=True)
        if used is None or used > limit():
            _prune(where)
    except OSError:
        return


def _place() -> tuple[Path, bytes] | None:
    """The folder and the secret; None where either cannot be had."""
    where = folder()
    if where is None:
        return None
    own = secret()
    if own is None:
        _say_no_secret(os.environ.get("BELLCRANK_CACHE", ""))
        return None
    return where, own


@cache
def _say_no_secret(chosen: str) -> None:
    if chosen:
        message = (
            f"BELLCRANK_CACHE={chosen}: the folder is not used as a cache: the secret that makes its entries "
            "your own cannot be kept in ~/.local/state/bellcrank; let XDG_STATE_HOME name a folder that you may write"
        )
        warnings.warn(message, stacklevel=2)


def _seal(own: bytes, key: str, payload: bytes) -> bytes:
    # hmac.digest lets other threads run, and fork, while OpenSSL holds locks of its own; hmac.new does not
    return hmac.new(own, key.encode() + b"\0" + payload, "sha256").digest()


def _read(path: Path) -> bytes:
    """A file of the user's own, regular and closed to others; OSError for anything else."""
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)  # a FIFO must not wait
    try:
        facts = os.fstat(handle)
        if not _is_own(facts) or not stat.S_ISREG(facts.st_mode) or facts.st_size > limit():
            raise PermissionError(path)
        if abs(time.time() - facts.st_mtime) > _RECENTLY:
            with contextlib.suppress(OSError):
                os.utime(handle)  # marks it as used, for pruning
        parts, left = [], facts.st_size
        while left and (part := os.read(handle, left)):
            parts.append(part)
            left -= len(part)
        return b"".join(parts)
    finally:
        os.close(handle)


def _is_own(facts: os.stat_result) -> bool:
    """Whether a file belongs to the user and nobody else may write it."""
    return facts.st_uid == os.geteuid() and not facts.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


# ---- the limit


def _use(where: Path, size: int) -> int | None:
    """Count `size` bytes as used and return how many are, about; None where nobody has counted yet.

    The file `used` has one byte for each block, so that appending to it counts, whoever else does at the same time, and
    no store has to look at all entries.
    """
    flags = (
        os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    )  # a FIFO must not wait
    handle = os.open(where / "used", flags, 0o600)
    try:
        before = os.fstat(handle).st_size
        os.write(handle, bytes(_blocks(size)))
        return _BLOCK * (before + _blocks(size)) if before else None
    finally:
        os.close(handle)


def _blocks(size: int) -> int:
    return -(-size // _BLOCK)


def _prune(where: Path) -> None:
    """Delete what processes that were killed left, and the least recently used entries where all are too large."""
    entries: list[tuple[float, int, Path]] = []
    total, now = 0, time.time()
    with os.scandir(where) as found:
        for file in found:
            temporary = _TEMPORARY.match(file.name)
            with contextlib.suppress(OSError):  # another process may delete it at the same time
                facts = file.stat(follow_symlinks=False)
                if not stat.S_ISREG(facts.st_mode) or not (temporary or _ENTRY.match(file.name)):
                    continue
                if temporary and now - facts.st_mtime > _ABANDONED:
                    Path(file.path).unlink()
                    continue
                total += _blocks(facts.st_size)
                if not temporary:
                    entries.append((facts.st_mtime, _blocks(facts.st_size), Path(file.path)))
    wanted = _KEPT * limit() if total * _BLOCK > limit() else limit()
    for _, blocks, path in sorted(entries):
        if total * _BLOCK <= wanted:
            break
        with contextlib.suppress(OSError):
            path.unlink()
            total -= blocks
    os.truncate(where / "used", max(total, 1))
