"""Reading mesh files into parts of one colour each: STL and OBJ by trimesh, COLLADA by pycollada."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from bellcrank.replays.colours import GREY, Colour, clipped, texture_colour

Array = NDArray[np.float64]
Beside = Callable[[str], bytes | None]  # what a file that the mesh file names holds, None where there is none
MOST_FACES, MOST_PARTS = 4_000_000, 20_000
_NAMES = {
    ".obj": rb"^[ \t]*mtllib[ \t]+([^\r\n]+)",
    ".mtl": rb"^[ \t]*map_Kd[ \t]+(?:[^\r\n]*[ \t])?([^ \t\r\n]+)",
    ".dae": rb"<(?:\w+:)?(?:init_from|ref)>\s*([^<>]+?)\s*</",
}


class MeshError(Exception):
    """Why a mesh file cannot be drawn: a phrase that follows the file's name."""


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
        with warnings.catch_warnings(action="ignore"):
            warnings.filterwarnings("error", "string or file could not be read to its end")  # numpy's, of bad numbers
            for corners, colour in _collada(data, beside) if kind == "dae" else _trimesh(data, kind, beside):
                count, parts = count + len(corners), parts + 1
                if count > MOST_FACES or parts > MOST_PARTS:
                    raise MeshError(f"has more than the {MOST_FACES} triangles or {MOST_PARTS} parts that are read")
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
    soups = {colour: np.concatenate(pieces).reshape(-1, 3) for colour, pieces in found.items()}
    return tuple(Part(points, np.arange(len(points)).reshape(-1, 3), colour) for colour, points in soups.items())


def _trimesh(data: bytes, kind: str, beside: Beside) -> Iterator[tuple[Array, Colour | None]]:
    """The triangles (m, 3, 3) and the colour of each material of an STL or OBJ file."""
    import trimesh

    class Resolver(trimesh.resolvers.Resolver):
        def __init__(self) -> None: ...

        def get(self, key: str) -> bytes:
            if (content := beside(key)) is None:
                raise FileNotFoundError(key)
            return content

        keys = write = namespaced = NotImplemented

    scene = trimesh.load_scene(BytesIO(data), file_type=kind, resolver=Resolver(), process=False)
    for mesh in scene.geometry.values():
        if isinstance(mesh, trimesh.Trimesh):
            material = getattr(mesh.visual, "material", None)
            image = getattr(material, "image", None)
            texture = None if image is None else image.info.get("file_path")  # without one it is trimesh's own grey
            given = getattr(material, "kwargs", {}) | (
                {"kd": texture_colour(beside(texture)) or GREY} if texture else {}
            )
            opacity = float(given.get("d", [1.0])[-1]) or 1.0  # 0 would hide it: some writers mean 1 by it
            yield mesh.vertices[mesh.faces], clipped((*given["kd"][:3], opacity)) if "kd" in given else None


def _collada(data: bytes, beside: Beside) -> Iterator[tuple[Array, Colour | None]]:
    """The triangles (m, 3, 3) in metres and the colour of each primitive in a COLLADA file's scene."""
    import collada

    if b"<!ENTITY" in data or b"<!DOCTYPE" in data:
        raise MeshError("declares XML entities, which are not read")
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
    for bound in (b for kind in ("geometry", "controller") for b in (scene.objects(kind) if scene else ())):
        for primitive in bound.primitives():
            shape = primitive.triangleset() if hasattr(primitive, "triangleset") else primitive
            if isinstance(shape, collada.triangleset.BoundTriangleSet):
                if shape.material not in colours:
                    colours[shape.material] = _colour(shape.material.effect, beside)
                turn = -1 if np.linalg.det(bound.matrix[:3, :3]) < 0.0 else 1  # mirrored: seen from outside again
                yield unit * shape.vertex.astype(float)[shape.vertex_index][:, ::turn], colours[shape.material]


def _colour(effect: Any, beside: Beside) -> Colour | None:
    """An effect's diffuse colour and half its ambient one, as under a bright sky; of a texture the mean."""
    diffuse, ambient = effect.diffuse, effect.ambient
    if hasattr(diffuse, "sampler"):
        return texture_colour(beside(unquote(diffuse.sampler.surface.image.path))) or GREY
    if diffuse is None:
        return None
    sky = ambient[:3] if isinstance(ambient, tuple) else (0.0, 0.0, 0.0)
    return clipped((*(d + 0.5 * a for d, a in zip(diffuse, sky, strict=False)), 1.0))  # opacity: files disagree on it


def named_files(data: bytes, suffix: str) -> tuple[str, ...]:
    """The files that a mesh file names: material files (.obj, .mtl) and textures (.mtl, .dae)."""
    found = re.findall(_NAMES[suffix.lower()], data, re.MULTILINE) if suffix.lower() in _NAMES else []
    return tuple(dict.fromkeys(name.strip().decode(errors="replace") for name in found))
