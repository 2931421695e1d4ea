"""The robot file that the key `urdf` of a configuration names."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from bellcrank.config.fields import Fields
from bellcrank.files.access import FileAccess
from bellcrank.messages import unknown_name
from bellcrank.robot import catalog
from bellcrank.text import file_name_here


def robot_path(fields: Fields) -> Path:
    """The path of the file that the key `urdf` names by a path or by the name of a robot. Raises InputError."""
    text = fields.text("urdf")
    path_like = Path(text).suffix in catalog.SUFFIXES or "/" in text
    named = None if path_like or _is_there(fields.access.folder / file_name_here(text)) else catalog.find_named(text)
    if named is not None:
        return named
    path = fields.file("urdf")
    if _is_there(path):
        return path.resolve()
    if path_like:
        raise fields.error("urdf", f"there is no file {path}; write a path relative to the configuration's folder")
    raise fields.error("urdf", unknown_name("robot", text, catalog.names()))


def robot_access(fields: Fields, path: Path) -> FileAccess:
    """Which files the robot file may name."""
    named = fields.access.by(path)
    return replace(named, area=path.parent) if fields.overridden("urdf") else named


def _is_there(path: Path) -> bool:
    """Whether the path exists and is not a folder; the file may still be unreadable."""
    try:
        return path.exists() and not path.is_dir()
    except (OSError, ValueError):
        return False
