"""Reading mesh files into parts of one colour each: STL and OBJ (triangle_files.py), and COLLADA by pycollada."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from bellcrank.replays.geometry.collada_limits import check_collada
from bellcrank.replays.geometry.colours import GREY, Colour, Textures, clipped
from bellcrank.replays.geometry.triangle_files import (
    MOST_FACES,
    MOST_PARTS,
    Beside,
    MeshError,
    mtl_textures,
    obj_libraries,
    obj_triangles,
    stl_triangles,
    too_many,
)

Array = NDArray[np.float64]
MOST_POINTS = 50_000_000  # vertices of all the uses of a COLLADA file's meshes together


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one colour: vertices (k, 3) in the file's own unit (COLLADA: m), faces (m, 3); None: no colour."""

    vertices: Array
    faces: NDArray[np.int64]
    colour: Colour | None = None


def read_parts(data: bytes, suffix: str, beside: Beside) -> tuple[Part, ...]:
    """The parts of a mesh file by its suffix (.stl, .obj, .dae), at most one of each colour, each with a triangle.

    As RViz and Pinocchio do, the unit of a COLLADA file is applied and its up axis is not. Raises MeshError where the
    file is of another kind, empty, broken or too large, or holds numbers that are not finite.
    """
    kind, found = suffix.lower().removeprefix("."), dict[Colour | None, list[Array]]()
    if kind not in ("stl", "obj", "dae"):
        raise MeshError(f"is of the kind '{suffix[:10]}', and only .stl, .obj and .dae are read")
    count = parts = 0
    try:
        if kind == "dae":
            pieces = _collada(data, beside)
        else:
            pieces = stl_triangles(data) if kind == "stl" else obj_triangles(data, beside)
        with warnings.catch_warnings(action="ignore"):
            for corners, colour in pieces:
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
    except Exception as error:  # readers meet whatever the file holds
        raise MeshError(f"is broken ({str(error)[:80]})") from None
    if not found:
        raise MeshError(f"holds no triangle: it is empty, truncated or no {kind.upper()} file")
    soups = {colour: np.concatenate(soup).reshape(-1, 3) for colour, soup in found.items()}
    return tuple(Part(points, np.arange(len(points)).reshape(-1, 3), colour) for colour, points in soups.items())


def _collada(data: bytes, beside: Beside) -> Iterator[tuple[Array, Colour | None]]:
    """The triangles (m, 3, 3) in metres and the colour of each primitive in a COLLADA file's scene."""
    import collada

    check_collada(data)
    ignored = [collada.common.DaeBrokenRefError, collada.common.DaeUnsupportedError]
    file = collada.Collada(BytesIO(data), ignore=ignored)
    if file.errors:  # it leaves out a geometry that has one material it cannot read: again without those materials
        for binding in file.xmlnode.iter(file.tag("technique_common")):
            for material in binding.findall(file.tag("instance_material")):
                if material.get("target", "").removeprefix("#") not in file.materials:
                    binding.remove(material)
        file.xmlnode.write(again := BytesIO())
        file = collada.Collada(BytesIO(again.getvalue()), ignore=ignored)
    colours: dict[Any, Colour | None] = {None: None}
    scene, unit = file.scene or next(iter(file.scenes), None), float(file.assetInfo.unitmeter or 1.0)
    points, textures = 0, Textures(beside)
    for bound in (b for kind in ("geometry", "controller") for b in (scene.objects(kind) if scene else ())):
        for primitive in bound.primitives():
            points += len(primitive.vertex) if getattr(primitive, "vertex", None) is not None else 0
            if points > MOST_POINTS:
                raise MeshError(f"uses more than the {MOST_POINTS} vertices that are read")
            shape = primitive.triangleset() if hasattr(primitive, "triangleset") else primitive
            if isinstance(shape, collada.triangleset.BoundTriangleSet):
                if shape.material not in colours:
                    colours[shape.material] = _colour(shape.material.effect, textures)
                turn = -1 if np.linalg.det(bound.matrix[:3, :3]) < 0.0 else 1  # mirrored: seen from outside again
                yield unit * shape.vertex.astype(float)[shape.vertex_index][:, ::turn], colours[shape.material]


def _colour(effect: Any, textures: Textures) -> Colour | None:
    """An effect's diffuse colour and half its ambient one, as under a bright sky; of a texture the mean."""
    diffuse, ambient = effect.diffuse, effect.ambient
    if hasattr(diffuse, "sampler"):
        return textures.colour(unquote(diffuse.sampler.surface.image.path)) or GREY
    if diffuse is None:
        return None
    sky = ambient[:3] if isinstance(ambient, tuple) else (0.0, 0.0, 0.0)
    return clipped((*(d + 0.5 * a for d, a in zip(diffuse, sky, strict=False)), 1.0))  # opacity: files disagree on it


def named_files(data: bytes, suffix: str) -> tuple[str, ...]:
    """The files that a mesh file names: material files (.obj, .mtl) and textures (.mtl, .dae). Raises MeshError."""
    kind = suffix.lower()
    if kind == ".dae":
        return check_collada(data)
    return obj_libraries(data) if kind == ".obj" else mtl_textures(data) if kind == ".mtl" else ()
