"""Mesh files (STL, OBJ, COLLADA) as triangles, one part for each colour."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bellcrank.replays.geometry.collada_files import check_collada, collada_triangles
from bellcrank.replays.geometry.colours import Colour
from bellcrank.replays.geometry.mesh_limits import MOST_FACES, MOST_PARTS, MeshError, ReadReferenced, too_many
from bellcrank.replays.geometry.stl_obj_files import mtl_textures, obj_libraries, obj_triangles, stl_triangles

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ColouredTriangles:
    """Triangles of one colour (None: unknown): vertices (k, 3) in the file's unit (COLLADA: m), faces (m, 3)."""

    vertices: Array
    faces: NDArray[np.int64]
    colour: Colour | None = None


def read_parts(data: bytes, suffix: str, read_referenced: ReadReferenced) -> tuple[ColouredTriangles, ...]:
    """The parts of a mesh file, by its suffix (.stl, .obj, .dae): one for each colour, each with at least one triangle.

    As in RViz and Pinocchio, the unit of a COLLADA file is applied and its up axis is not. Raises MeshError if the file
    is of another kind, empty, broken or too large, or holds numbers that are not finite.
    """
    kind, found = suffix.lower().removeprefix("."), dict[Colour | None, list[Array]]()
    if kind not in ("stl", "obj", "dae"):
        raise MeshError(f"is of the kind '{suffix[:10]}'; only .stl, .obj and .dae are read")
    count = parts = 0
    try:
        if kind == "dae":
            primitives = collada_triangles(data, read_referenced)
        else:
            primitives = stl_triangles(data) if kind == "stl" else obj_triangles(data, read_referenced)
        with warnings.catch_warnings(action="ignore"):
            for corners, colour in primitives:
                count, parts = count + len(corners), parts + 1
                if count > MOST_FACES or parts > MOST_PARTS:
                    raise too_many()
                if corners.shape[1:] != (3, 3):
                    raise MeshError("is broken (a vertex does not have three numbers)")
                if not np.abs(corners).max(initial=0.0) < 1e15:  # also where there is a NaN
                    raise MeshError("holds numbers that are not finite")
                if len(corners):
                    found.setdefault(colour, []).append(corners)
    except MeshError:
        raise
    except Exception as error:  # an invalid file may raise anything
        raise MeshError(f"is broken ({str(error)[:80]})") from None
    if not found:
        raise MeshError(f"holds no triangle: it is empty, truncated or no {kind.upper()} file")
    soup = {colour: np.concatenate(corners).reshape(-1, 3) for colour, corners in found.items()}
    return tuple(
        ColouredTriangles(points, np.arange(len(points)).reshape(-1, 3), colour) for colour, points in soup.items()
    )


def named_files(data: bytes, suffix: str) -> tuple[str, ...]:
    """The files that a mesh file refers to: material files (of .obj) and textures (of .mtl, .dae). Raises MeshError."""
    kind = suffix.lower()
    if kind == ".dae":
        return check_collada(data)
    return obj_libraries(data) if kind == ".obj" else mtl_textures(data) if kind == ".mtl" else ()
