"""The folder and the size limit of the cache.

The base folder is BELLCRANK_CACHE, else XDG_CACHE_HOME/bellcrank, else ~/.cache/bellcrank. The cache is the folder
`bellcrank-cache-2` in it, which bellcrank creates, closed to others, with the marker CACHEDIR.TAG
(bford.info/cachedir). Other contents of the base folder are not touched.
"""

from __future__ import annotations

import os
import re
import stat
import warnings
from functools import cache
from pathlib import Path

NAME = "bellcrank-cache-2"
MARKER = "CACHEDIR.TAG"
_TAG = b"""Signature: 8a477f597d28d172789f06886806bc55
# This folder is bellcrank's cache: all files in it can be deleted at any time, bellcrank makes them anew.
"""
_LIMIT = 10**9  # bytes
_SIZE = re.compile(r"\A([0-9]{1,18}(?:\.[0-9]{1,6})?)\s*([A-Za-z]*)")
_UNITS = {"": 1, "B": 1, "kB": 10**3, "MB": 10**6, "GB": 10**9, "KiB": 2**10, "MiB": 2**20, "GiB": 2**30}
try:
    _BEGUN_IN = str(Path.cwd())  # for relative paths, also after the process changes its folder
except OSError:  # the folder is gone
    _BEGUN_IN = ""


def folder() -> Path | None:
    """The folder of the cache; None where BELLCRANK_CACHE is "off" or the folder cannot be used.

    Warns once, with the reason, if the folder named by BELLCRANK_CACHE is not used.
    """
    chosen = os.environ.get("BELLCRANK_CACHE", "")
    if chosen.lower() == "off":
        return None
    if chosen:
        return _chosen(chosen)
    base = users_folder("XDG_CACHE_HOME", ".cache")
    return None if base is None else _default(base)


def users_folder(variable: str, usual: str) -> Path | None:
    """A user folder by the XDG specification: the value of the variable, if absolute, else `usual` in the home folder;
    None where there is no home.
    """
    named = Path(os.environ.get(variable, ""))
    if named.is_absolute():
        return named
    home = Path(os.path.expanduser("~"))  # Path.home raises where there is none
    return home / usual if home.is_absolute() else None


def limit() -> int:
    """The size limit of the cache in bytes: BELLCRANK_CACHE_LIMIT, such as 500000000 or "500 MB", else 1 GB.

    Warns once if the variable is not valid.
    """
    return _limit(os.environ.get("BELLCRANK_CACHE_LIMIT", ""))


@cache
def _limit(text: str) -> int:
    if not text.strip():
        return _LIMIT
    match = _SIZE.fullmatch(text.strip())
    units = {name.lower(): factor for name, factor in _UNITS.items()}
    if match is None or match.group(2).lower() not in units:
        message = f"BELLCRANK_CACHE_LIMIT={text!r:.60} is not a size such as '500 MB' or '2 GB'; the limit is 1 GB"
        warnings.warn(message, stacklevel=2)
        return _LIMIT
    return int(float(match.group(1)) * units[match.group(2).lower()])


@cache
def _default(base: Path) -> Path | None:
    try:
        return _own(base / "bellcrank")
    except OSError:
        return None


@cache
def _chosen(name: str) -> Path | None:
    try:
        return _named(name)
    except OSError as error:
        why = error.strerror or str(error)
        warnings.warn(f"BELLCRANK_CACHE={name}: the folder is not used as a cache: {why}", stacklevel=2)
        return None


def _named(name: str) -> Path:
    """The cache's folder in the one that BELLCRANK_CACHE names; OSError says why it cannot be used."""
    expanded = os.path.expanduser(name)
    path = Path(_BEGUN_IN, expanded)
    if expanded.startswith("~") or not path.is_absolute():
        raise OSError("the home folder does not exist" if expanded.startswith("~") else "the path is not absolute")
    return _own(path)


def why_unused() -> str:
    """Why the folder of the cache cannot be used, with its path; "" where it can."""
    chosen = os.environ.get("BELLCRANK_CACHE", "")
    base = users_folder("XDG_CACHE_HOME", ".cache")
    if not chosen and base is None:
        return "there is no home folder"
    try:
        _named(chosen) if chosen else _own(Path(base or "", "bellcrank"))
    except OSError as error:
        return f"{chosen or base}: {error.strerror or error}"
    return ""


def _own(base: Path) -> Path:
    """The cache's folder in `base`, made where it is missing; OSError says why it cannot be used."""
    base.mkdir(mode=0o700, parents=True, exist_ok=True)
    base = base.resolve()
    for parent in (base, *base.parents):
        mode = parent.stat().st_mode
        if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            raise OSError(f"{parent} is writable by everybody; choose another folder, or run chmod o-w")
    path = base / NAME
    try:
        path.mkdir(mode=0o700)
    except FileExistsError:
        _check(path)
    else:
        _mark(path)
    if not os.access(path, os.R_OK | os.W_OK | os.X_OK):
        raise OSError(f"no permission to write in {path}")
    return path


def _check(path: Path) -> None:
    """OSError where a folder that is there already is not a cache of the user's own."""
    facts = path.lstat()
    if not stat.S_ISDIR(facts.st_mode):
        raise OSError(f"{path} is not a folder")
    if facts.st_uid != os.geteuid():
        raise OSError(f"{path} belongs to another user")
    if facts.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise OSError(f"{path} is writable by others; delete it")
    for _ in range(2):  # another process may be creating it
        if (path / MARKER).is_file():
            with (path / MARKER).open("rb") as file:
                if file.read(len(_TAG) + 1) == _TAG:  # another file may be large
                    return
            break
        if all(file.name.startswith(f".{MARKER}-") for file in path.iterdir()):
            _mark(path)
            return
    raise OSError(f"{path} was not made by bellcrank; delete it, or choose another folder")


def _mark(path: Path) -> None:
    temporary = path / f".{MARKER}-{os.urandom(8).hex()}"
    temporary.write_bytes(_TAG)
    os.replace(temporary, path / MARKER)
