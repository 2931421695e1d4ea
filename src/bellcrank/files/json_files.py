"""JSON files of results. Numbers that are not finite, which JSON does not have, are written as null."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bellcrank.errors import InputError
from bellcrank.files.access import read_text
from bellcrank.files.atomic_write import write_text, writing
from bellcrank.messages import utf8


def write_json(path: Path, content: Any, *, indent: int = 1, ascii_only: bool = False) -> Path:
    """Write data as JSON in one step and return the path. Raises InputError where the file cannot be written."""
    write_text(path, json_text(content, indent=indent, ascii_only=ascii_only))
    return path


def list_files(path: Path, listed: Sequence[str], names: Sequence[str]) -> None:
    """Replace the list of files under the key "files" of a JSON file that `write_json` wrote, with one step of indent.

    The rest is not made again. Raises InputError where the file cannot be written.
    """
    before, after = (utf8(json_text({"files": list(each)})[1:-3]) for each in (listed, names))
    with writing(path) as temporary:
        temporary.write_bytes(path.read_bytes().replace(before, after, 1))


def listed_files(path: Path, ours: re.Pattern[str]) -> list[str]:
    """The names under the key "files" of a JSON file that match; none where there is no such file.

    Only names that a writer of results gives are returned, so that no other file can be removed.
    """
    try:
        document = json.loads(read_text(path))
    except (InputError, ValueError, RecursionError):
        return []
    listed = document.get("files") if isinstance(document, dict) else None
    return [name for name in listed if isinstance(name, str) and ours.match(name)] if isinstance(listed, list) else []


def json_text(content: Any, *, indent: int = 1, ascii_only: bool = False) -> str:
    """The text of a JSON file; `ascii_only` writes other characters as escapes."""
    return json.dumps(_finite(content), indent=indent, ensure_ascii=ascii_only, allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    """The value with plain numbers, and None for those that are not finite."""
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
