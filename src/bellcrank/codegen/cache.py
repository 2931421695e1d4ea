"""The cache on disk: parsed robots, recipes of compiled functions, machine code, meshes.

Cached machine code is executed, so that an entry is used only if it is the user's own:

- Each entry has an HMAC-SHA256 of its name and content with a secret in the user's state folder, not
  in the cache. Entries of a copied cache folder, entries that another user wrote or changed, renamed and damaged
  entries are ignored and made again.
- An entry that belongs to another user, is not a regular file, or is writable by others is not read.
- The folder (cache_folder.py) belongs to the user and is closed to others.

This does not protect against a program that runs as the user, which can read the secret.

The cache never makes a run fail: an entry that cannot be read is made again, and one that cannot be written is not
kept. The folder holds at most BELLCRANK_CACHE_LIMIT (1 GB); the least recently used entries are deleted first.
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

from bellcrank.codegen.cache_folder import folder, limit, users_folder

_MAGIC = b"bellcrank-cache-2\n"
_HEAD = len(_MAGIC) + 32
_ENTRY = re.compile(r"[a-z]+-[0-9a-f]{64}\Z")
_TEMPORARY = re.compile(r"temporary-[0-9a-f]{32}\Z")
_BLOCK = 4096  # bytes; files are counted in whole blocks of the disk
_KEPT = 0.8  # of the limit, after pruning
_ABANDONED = 3600.0  # s; an older temporary file belongs to a dead process
_RECENTLY = 60.0  # s; the time of use of an entry is updated at most this often


def digest(*parts: str | bytes) -> str:
    """The SHA-256, in hexadecimal, of parts with their lengths."""
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
    """The JSON data stored under `key` if it is of this kind, else None.

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
    """Store `payload` under `key` ("kind-SHA256") atomically; does nothing where the folder cannot be written."""
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
    """The folder and the secret; None where either is unavailable."""
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
            f"BELLCRANK_CACHE={chosen}: not used as a cache: the secret that protects its entries cannot "
            "be written to ~/.local/state/bellcrank; set XDG_STATE_HOME to a folder that you can write"
        )
        warnings.warn(message, stacklevel=2)


def _seal(own: bytes, key: str, payload: bytes) -> bytes:
    # hmac.digest lets other threads run, and fork, while OpenSSL holds locks of its own; hmac.new does not
    return hmac.new(own, key.encode() + b"\0" + payload, "sha256").digest()


def _read(path: Path) -> bytes:
    """Read a regular file of the user that others cannot write. Raises OSError for any other file."""
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
    """Whether a file belongs to the user and is not writable by others."""
    return facts.st_uid == os.geteuid() and not facts.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


# ---- the limit


def _use(where: Path, size: int) -> int | None:
    """Add `size` bytes to the count of used bytes and return the approximate total; None for a new count.

    The file `used` has one byte per block, so that processes count by appending at the same time, without listing all
    entries.
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
    """Delete files of dead processes and, above the limit, the least recently used entries."""
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


# ---- The secret with which entries of the cache are signed.
#
# It is 32 random bytes in XDG_STATE_HOME/bellcrank/cache-secret, else ~/.local/state/bellcrank/cache-secret, which
# only the user may read (mode 0600). It is not in the cache, so that a copied cache cannot bring its own.


_SIZE = 32


def secret() -> bytes | None:
    """The user's secret, created when first needed; None where it cannot be written."""
    base = users_folder("XDG_STATE_HOME", ".local/state")
    return None if base is None else _kept(base / "bellcrank" / "cache-secret")


@cache
def _kept(path: Path) -> bytes | None:
    try:
        return _read_secret(path) or _made(path)
    except OSError:
        return None


def _read_secret(path: Path) -> bytes | None:
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
    return _read_secret(path)
