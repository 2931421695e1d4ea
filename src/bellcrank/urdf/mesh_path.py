"""Where a mesh file lies that a URDF names."""

from __future__ import annotations

from pathlib import Path

from bellcrank.locale_text import file_name_here


def find_mesh(mesh: str, source: Path) -> Path | None:
    """The mesh file of a URDF: package://… and model://… below a folder above it, else beside it; None if missing."""
    folder, mesh = source.resolve().parent, file_name_here(mesh)
    kind, separator, rest = mesh.partition("://")
    if not separator or kind == "file":
        tried = [folder / (rest if separator else mesh)]
    elif kind in ("package", "model"):
        rest = rest.lstrip("/")
        package, _, inside = rest.partition("/")
        above = (folder, *folder.parents)
        tried = [path for up in above for path in (up / rest, *((up / inside,) if up.name == package else ()))]
    else:
        return None
    for path in tried:
        try:
            if path.is_file():
                return path
        except (OSError, ValueError):  # a name too long, or with a zero in it
            return None
    return None
