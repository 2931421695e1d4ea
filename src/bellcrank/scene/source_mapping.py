"""YAML data with the source of each key: its line in the file, or the override that set it."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from bellcrank import arguments
from bellcrank.config.yaml_file import Lines
from bellcrank.errors import InputError
from bellcrank.messages import format_value

DEEPEST = 100


class SourceMapping(Lines):
    """A mapping with the line of each key, and the path of the override that set it."""

    overrides: dict[str, str]

    @classmethod
    def like(cls, other: Mapping[str, Any]) -> SourceMapping:
        """An empty mapping with the lines and overrides of another."""
        copy = cls()
        copy.lines = dict(getattr(other, "lines", {}))
        copy.overrides = dict(getattr(other, "overrides", {}))
        return copy


def source_mapping(value: Any, override: str | None = None, depth: int = 0) -> Any:
    """Copy YAML data with the lines of its keys, numpy values converted to plain numbers.

    If `override` is given, all keys of the copy are marked as set by that override. Raises InputError for values that
    YAML cannot represent.
    """
    if depth > DEEPEST:
        raise InputError("the value is nested too deeply")
    if isinstance(value, Mapping):
        copy = SourceMapping.like(value)
        for key, entry in value.items():
            if not isinstance(key, str):
                raise InputError(f"expected a string key, found {format_value(key)}; put it in quotes")
            copy[key] = source_mapping(entry, override, depth + 1)
            if override:
                copy.overrides[key] = override
        return copy
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, (list, tuple)):
        return [source_mapping(entry, override, depth + 1) for entry in value]
    if value is None or isinstance(value, (str, bool, int, float)):
        return value
    if isinstance(value, (date, Path)):
        return str(value)
    raise InputError(f"the value contains {arguments.found(value)}, which a scene file cannot contain")


def plain(value: Any) -> Any:
    """Convert the data to plain dicts and lists."""
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    return [plain(entry) for entry in value] if isinstance(value, list) else value
