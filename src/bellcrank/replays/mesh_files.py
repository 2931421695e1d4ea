"""Reading mesh files: STL and OBJ with its materials here, COLLADA in collada.py, all into parts of one colour each."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import PurePosixPath

import numpy as np
from numpy.typing import NDArray

Colour = tuple[float, float, float, float]
Beside = Callable[[str], bytes | None]  # what a file that the mesh file names holds, None where there is none
GREY: Colour = (0.7, 0.7, 0.7, 1.0)  # stands for a texture that cannot be read
MOST_FACES = 4_000_000
MOST_PIXELS = 64_000_000


class MeshError(Exception):
    """Why a mesh file cannot be drawn: a phrase that follows the file's name."""


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one colour: vertices (k, 3) in the file's own unit (COLLADA: m), faces (m, 3); None: no colour."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    colour: Colour | None = None


def read_parts(data: bytes, suffix: str, beside: Beside) -> tuple[Part, ...]:
    """The parts of a mesh file by its suffix (.stl, .obj, .dae), at most one of each colour, each with a face or more.

    Raises MeshError where the file is of another kind, empty, broken or too large, or holds numbers that are not
    finite.
    """
    from bellcrank.replays.collada import read_collada

    try:
        if suffix.lower() == ".stl":
            parts = _merged((read_stl(data),))
        elif suffix.lower() == ".obj":
            parts = _merged(read_obj(data, beside))
        elif suffix.lower() == ".dae":
            parts = _merged(read_collada(data, beside))
        else:
            raise MeshError(f"is of the kind '{suffix[:10]}', and only .stl, .obj and .dae are read")
    except (ValueError, IndexError, KeyError, OverflowError, MemoryError) as error:
        raise MeshError(f"is broken ({str(error)[:80]})") from None
    if not parts:
        raise MeshError("holds no triangle")
    for part in parts:
        if part.faces.min() < 0 or part.faces.max() >= len(part.vertices):
            raise MeshError("is broken (a face names a vertex that is not there)")
        if not np.abs(part.vertices[part.faces]).max() < 1e15:  # also where there is a NaN
            raise MeshError("holds numbers that are not finite")
    return parts


def read_stl(data: bytes) -> Part:
    """The triangles of a binary or ASCII STL file; MeshError where it is truncated."""
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else 0
    if len(data) >= 84 + 50 * count and (count or not data.lstrip().startswith(b"solid")):
        _refuse_more_than(count)
        record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(data, record, count, 84)["corners"].reshape(-1, 3).astype(float)
    elif data.lstrip()[:5].lower() == b"solid":
        words = re.findall(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", data)
        corners = np.array(words, dtype="S32").astype(float).reshape(-1, 3)
        if len(corners) % 3 or b"endsolid" not in data[-1000:]:
            raise MeshError("is truncated")
    else:
        raise MeshError("is truncated" if len(data) >= 84 else "is no STL file")
    return Part(corners, np.arange(len(corners)).reshape(-1, 3))


def read_obj(data: bytes, beside: Beside) -> tuple[Part, ...]:
    """The faces of a Wavefront OBJ file, polygons as fans, coloured by the diffuse colours of its material files."""
    materials: dict[str, Colour] = {}
    vertices: list[list[bytes]] = []
    faces: dict[str, list[int]] = {}
    corners = faces.setdefault("", [])
    for line in data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] == b"v":
            vertices.append(words[1:4])
        elif words[0] == b"f":
            n = len(vertices)
            polygon = [int(word.split(b"/", 1)[0]) for word in words[1:]]
            polygon = [k - 1 if k > 0 else n + k for k in polygon]
            for k in range(1, len(polygon) - 1):
                corners += (polygon[0], polygon[k], polygon[k + 1])
        elif words[0] == b"usemtl":
            corners = faces.setdefault(line.split(None, 1)[-1].strip().decode(errors="replace"), [])
        elif words[0] == b"mtllib":
            materials |= _read_mtl(beside(line.split(None, 1)[-1].strip().decode(errors="replace")) or b"", beside)
    _refuse_more_than(sum(map(len, faces.values())) // 3)
    points = np.array(vertices, dtype="S32").astype(float).reshape(-1, 3)
    return tuple(
        Part(points, np.array(found).reshape(-1, 3), materials.get(name)) for name, found in faces.items() if found
    )


def _read_mtl(data: bytes, beside: Beside) -> dict[str, Colour]:
    """The colours of a material file by material: the mean of its texture, else its diffuse colour."""
    colours: dict[str, Colour] = {}
    name = ""
    for line in data.splitlines():
        words = line.split()
        if len(words) < 2:
            continue
        if words[0] == b"newmtl":
            name = line.split(None, 1)[1].strip().decode(errors="replace")
            colours[name] = GREY
        elif words[0] == b"Kd" and len(words) >= 4:
            red, green, blue = (float(word) for word in words[1:4])
            colours[name] = clipped((red, green, blue, colours.get(name, GREY)[3]))
        elif words[0] == b"d" and 0.0 < float(words[-1]) < 1.0:  # 0 would hide it: some writers mean 1 by it
            colours[name] = (*colours.get(name, GREY)[:3], float(words[-1]))
        elif words[0] == b"map_Kd":
            texture = texture_colour(beside(words[-1].decode(errors="replace")))
            colours[name] = (*texture[:3], colours.get(name, GREY)[3]) if texture else colours.get(name, GREY)
    return colours


def texture_colour(data: bytes | None) -> Colour | None:
    """The mean colour of an image file, its pixels weighed by their opacity; None where it cannot be read."""
    if data is None:
        return None
    from PIL import Image

    try:
        image = Image.open(BytesIO(data))
        if image.width * image.height > MOST_PIXELS:
            return None
        image.draft("RGB", (64, 64))  # JPEG files can be read small
        pixels = np.asarray(image.convert("RGBA"), dtype=float).reshape(-1, 4) / 255.0
    except Exception:  # an image reader meets whatever the file holds
        return None
    weight = float(pixels[:, 3].sum())
    red, green, blue = (pixels[:, :3] * pixels[:, 3:]).sum(axis=0) / weight if weight else GREY[:3]
    return clipped((red, green, blue, 1.0))


def clipped(colour: Colour) -> Colour:
    """The colour with each number brought into 0 to 1; ValueError where one is no number."""
    if not np.isfinite(colour).all():
        raise ValueError("a colour is not finite")
    red, green, blue, opacity = (round(min(max(float(x), 0.0), 1.0), 4) for x in colour)
    return red, green, blue, opacity


def named_files(data: bytes, suffix: str) -> tuple[str, ...]:
    """The files that a mesh file names: material files (.obj, .mtl) and textures (.mtl, .dae)."""
    patterns = {
        ".obj": rb"^[ \t]*mtllib[ \t]+([^\r\n]+)",
        ".mtl": rb"^[ \t]*map_Kd[ \t]+(?:[^\r\n]*[ \t])?([^ \t\r\n]+)",
        ".dae": rb"<(?:\w+:)?(?:init_from|ref)>\s*([^<>]+?)\s*</",
    }
    pattern = patterns.get(suffix.lower())
    found = re.findall(pattern, data, re.MULTILINE) if pattern else []
    return tuple(dict.fromkeys(name.strip().decode(errors="replace") for name in found))


def last_name(name: str) -> str:
    """The file's own name, of a path written on any system."""
    return PurePosixPath(name.replace("\\", "/")).name


def _refuse_more_than(count: int) -> None:
    if count > MOST_FACES:
        raise MeshError(f"has {count} triangles, more than the {MOST_FACES} that are read")


def _merged(parts: tuple[Part, ...]) -> tuple[Part, ...]:
    """One part of each colour."""
    by_colour: dict[Colour | None, list[Part]] = {}
    for part in parts:
        if len(part.faces):
            by_colour.setdefault(part.colour, []).append(part)
    _refuse_more_than(sum(len(part.faces) for part in parts))
    merged = []
    for colour, group in by_colour.items():
        starts = np.cumsum([0, *(len(part.vertices) for part in group)])
        faces = [part.faces + start for part, start in zip(group, starts, strict=False)]
        merged.append(Part(np.concatenate([part.vertices for part in group]), np.concatenate(faces), colour))
    return tuple(merged)
