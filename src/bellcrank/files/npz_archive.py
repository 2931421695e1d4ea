"""Reads an .npz file of a JSON text, `about`, and float64 arrays under limits.

What the file claims is compared with what it holds before memory is allocated for it.
"""

from __future__ import annotations

import json
import os
import re
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Sequence
from typing import IO, Any, NoReturn

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from bellcrank.arrays import Array

MOST_LISTED = 8 * 2**20  # bytes of the list of members: about 100,000 of them
MOST_HEADER = 512  # characters of an array's header, of which numpy writes about 120
MOST_TEXT, MOST_STRUCTURE = 512 * 2**20, 16 * 2**20  # bytes of the JSON text, and of what is no string in it
MOST_DEPTH = 50  # of lists and mappings in it
UNPACKED, RATIO = 256 * 2**20, 20  # compressed members may hold UNPACKED bytes and RATIO times the file's size
PART = 2**24  # bytes read at a time
_ENCRYPTED = 0x1
_TAIL, _TAIL64 = struct.Struct("<4s4H2LH"), struct.Struct("<4sQ2H2L4Q")  # end of the archive, APPNOTE 4.3.16 and 4.3.14
_LOCATOR64 = struct.Struct("<4sLQL")
_BRACKET = re.compile(rb"[\[{\]}]")
_STRING = re.compile(rb'"[^"\\]*+(?:\\.[^"\\]*+)*+"?', re.DOTALL)
DAMAGE = (
    OSError, ValueError, EOFError, NotImplementedError, OverflowError, MemoryError, RecursionError, SyntaxError,
    TypeError, tokenize.TokenError, zipfile.BadZipFile, zlib.error, struct.error,
)  # fmt: skip  # what numpy, zipfile and json raise on files that are not what they say


class NoAboutError(Exception):
    """A whole archive without a JSON mapping `about`: that of another program."""


def read_archive(
    stream: IO[bytes], members: re.Pattern[str], unpacked: int | None = None
) -> tuple[dict[str, Any], dict[str, Array]]:
    """Read the JSON mapping and the float64 arrays, by name, of an open file.

    `members` matches the names of the arrays that the file may have. `unpacked` are the bytes that its members may hold
    beyond RATIO times its size, UNPACKED by default.

    Raises NoAboutError for an archive of something else, an OSError where the file cannot be read, and one of DAMAGE,
    whose text says what is wrong, for all else.
    """
    _check_list(stream)
    with zipfile.ZipFile(stream) as archive:
        listed = archive.infolist()
        if "about.npy" not in (member.filename for member in listed):
            raise NoAboutError
        spare = UNPACKED if unpacked is None else unpacked
        _check_members(listed, members, stream.seek(0, os.SEEK_END), archive.start_dir, spare)
        arrays: dict[str, Array] = {}
        about: Any = None
        for member in listed:
            with archive.open(member) as content:
                if member.filename == "about.npy":
                    about = _json(_read(content, member, np.dtype(np.uint8)).tobytes())
                else:
                    arrays[member.filename.removesuffix(".npy")] = _read(content, member, np.dtype(np.float64))
    if not isinstance(about, dict):
        raise NoAboutError
    return about, arrays


def _check_list(stream: IO[bytes]) -> None:
    """Refuse an archive whose list of members is longer than any expected one, before it is read."""
    size = stream.seek(0, os.SEEK_END)
    if size < _TAIL.size:
        raise ValueError("it is empty or truncated")
    stream.seek(size - _TAIL.size)
    signature, *_, listed, _, comment = _TAIL.unpack(stream.read(_TAIL.size))
    if signature != b"PK\5\6" or comment:
        raise ValueError("it is not a zip archive, or is truncated")
    if listed == 0xFFFFFFFF or size > 0xFFFFFFFF:
        stream.seek(max(size - _TAIL.size - _LOCATOR64.size - _TAIL64.size, 0))
        first, *_, listed, _ = _TAIL64.unpack(stream.read(_TAIL64.size))
        if first != b"PK\6\6":
            raise ValueError("it is not a zip archive, or is truncated")
    if listed > MOST_LISTED:
        raise ValueError(f"its list of members takes {listed} bytes, at most {MOST_LISTED} were expected")


def _check_members(
    members: Sequence[zipfile.ZipInfo], expected: re.Pattern[str], size: int, listed: int, spare: int
) -> None:
    """Refuse members of unexpected names, that overlap, or that claim more than they can hold."""
    names, end = set(), 0
    for member in sorted(members, key=lambda member: member.header_offset):
        name = member.filename
        if name in names:
            raise ValueError(f"it has two members {brief(name)}")
        if name != "about.npy" and not (name.endswith(".npy") and expected.fullmatch(name.removesuffix(".npy"))):
            raise ValueError(f"the member {brief(name)} is not expected")
        names.add(name)
        if member.flag_bits & _ENCRYPTED or member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"the member {brief(name)} is encrypted, or compressed in an unusual way")
        if member.header_offset < end:
            raise ValueError("its members overlap")
        end = member.header_offset + 30 + len(name) + member.compress_size  # 30: a local header
    if end > listed:
        raise ValueError("its members overlap")
    unpacked, most = sum(member.file_size for member in members), spare + RATIO * size
    if unpacked > most:
        raise ValueError(f"its members unpack to {unpacked} bytes; the limit for a file of {size} bytes is {most}")


def _read(stream: IO[bytes], member: zipfile.ZipInfo, dtype: np.dtype[Any]) -> NDArray[Any]:
    """The array that a member holds, which must be of this type and as large as the member says."""
    name = member.filename.removesuffix(".npy")
    if npy.read_magic(stream) != (1, 0):
        _refuse(name, "has an unusual header")
    shape, transposed, found = npy.read_array_header_1_0(stream, max_header_size=MOST_HEADER)
    if found != dtype:
        _refuse(name, f"holds {brief(str(found), '')}, expected {dtype}")
    if any(n < 0 for n in shape) or len(shape) > 3:
        _refuse(name, "has an impossible shape")
    count = 1
    for n in shape:
        count *= n  # Python's integers: no overflow
    if stream.tell() + count * dtype.itemsize != member.file_size:
        _refuse(name, f"claims {count} numbers, its member does not hold as many")
    data = np.empty(count, dtype)
    view, place = data.data.cast("B") if count else memoryview(b""), 0
    while place < len(view):
        part = stream.read(min(PART, len(view) - place))
        if not part:
            _refuse(name, "ends too early")
        view[place : place + len(part)] = part
        place += len(part)
    if stream.read(1):  # at the end zipfile compares the checksum
        _refuse(name, "holds more than it claims")
    return data.reshape(shape, order="F" if transposed else "C")


def _json(text: bytes) -> Any:
    """The JSON value of a text within limits of length and depth, without NaN and repeated keys."""
    if len(text) > MOST_TEXT:
        raise ValueError(f"its text takes {len(text)} bytes, at most {MOST_TEXT} are read")
    structure = _STRING.sub(b"", text)
    if len(structure) > MOST_STRUCTURE:
        raise ValueError(f"its text has more than {MOST_STRUCTURE} bytes of entries")
    depth = 0
    for bracket in _BRACKET.findall(structure):
        depth += 1 if bracket in b"[{" else -1
        if depth > MOST_DEPTH:
            raise ValueError(f"its text is nested more than {MOST_DEPTH} deep")
    return json.loads(text.decode("utf-8"), object_pairs_hook=_unique, parse_constant=_no_number)


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("its text has a duplicate key")
    return found


def _no_number(text: str) -> NoReturn:
    raise ValueError(f"its text holds {text}, expected finite numbers")


def _refuse(name: str, what: str) -> NoReturn:
    raise ValueError(f"'{name}' {what}")


def brief(value: object, quote: str = "'") -> str:
    """A value in at most 40 characters of one line, for a message."""
    text = value if isinstance(value, str) else repr(value)
    text = "".join(c if c.isprintable() else "?" for c in text[:41])
    return f"{quote}{text[:40]}{'…' if len(text) > 40 else ''}{quote}"
