"""What is read of mesh files at most, and the error of a file that cannot be drawn."""

from __future__ import annotations

from collections.abc import Callable

ReadReferenced = Callable[[str], bytes | None]  # content of a file that the mesh file names; None if there is none
MOST_FACES, MOST_PARTS = 4_000_000, 20_000
MOST_LIBRARIES, MOST_TEXTURES = 20, 1000  # material files and textures that one file may name


class MeshError(Exception):
    """Why a mesh file cannot be drawn: a phrase that follows the file's name, such as "is broken"."""


def too_many() -> MeshError:
    """The error for a file with more triangles or parts than are read."""
    return MeshError(f"has more than the {MOST_FACES} triangles or {MOST_PARTS} parts that are read")
