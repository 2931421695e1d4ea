"""STL and OBJ files as triangles, read in a time proportional to the size of the file."""

from __future__ import annotations

import itertools
import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO

import numpy as np

from bellcrank.arrays import Array
from bellcrank.replays.geometry.colours import Colour, Textures, clip_colour
from bellcrank.replays.geometry.mesh_limits import (
    MOST_FACES,
    MOST_LIBRARIES,
    MOST_PARTS,
    MOST_TEXTURES,
    MeshError,
    ReadReferenced,
    too_many,
)

_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84  # bytes before the facets: text and the number of facets
_SOLID = re.compile(rb"^[ \t]*(?:end)?solid[^\r\n]*", re.MULTILINE)  # with its name, which may be "vertex"


# ---- STL


def stl_triangles(data: bytes) -> Iterator[tuple[Array, Colour | None]]:
    """The triangles (m, 3, 3) of an STL file; none if it is empty or truncated. Raises MeshError or ValueError.

    The file is read as binary if its length is the one in its header, else as text.
    """
    count = int.from_bytes(data[_HEADER - 4 : _HEADER], "little")
    if len(data) >= _HEADER and len(data) == _HEADER + count * _FACET.itemsize:
        if count > MOST_FACES:
            raise too_many()
        yield np.frombuffer(data, _FACET, offset=_HEADER)["corners"].astype(np.float64), None
        return
    text = data.lower()
    if b"endsolid" not in text or b"\0" in text:
        return
    vertices = _SOLID.sub(b"", text).split(b"vertex", 3 * MOST_FACES + 1)[1:]
    if len(vertices) > 3 * MOST_FACES:
        raise too_many()
    numbers = array("d")
    for vertex in vertices:
        words = vertex.split(None, 3)
        if len(words) < 3:
            raise ValueError("a vertex does not have three numbers")
        numbers.extend(map(float, words[:3]))
    if len(vertices) % 3:
        raise ValueError("a triangle does not have three vertices")
    yield np.array(numbers).reshape(-1, 3, 3), None


# ---- OBJ


def obj_triangles(data: bytes, read_referenced: ReadReferenced) -> Iterator[tuple[Array, Colour | None]]:
    """The triangles (m, 3, 3) of each material of an OBJ file; polygons are split into fans.

    Raises MeshError or ValueError.
    """
    if b"\\" in data:
        data = data.replace(b"\\\r\n", b"").replace(b"\\\n", b"")  # continued lines
    vertices, materials, material = array("d"), dict[str, Colour | None](), ""
    faces: dict[str, array[int]] = {}
    found = faces.setdefault(material, array("q"))
    count = triangles = 0
    for line in BytesIO(data):
        words = line.split()
        if not words:
            continue
        if words[0] == b"v":
            if len(words) < 4:
                raise ValueError("a vertex does not have three numbers")
            vertices.extend(map(float, words[1:4]))
            count += 1
        elif words[0] == b"f":
            corners = [int(word.partition(b"/")[0]) for word in words[1:]]
            triangles += len(corners) - 2
            if len(corners) < 3:
                raise ValueError("a face does not have three vertices")
            if triangles > MOST_FACES:
                raise too_many()
            if 0 in corners or min(corners) < -count:
                raise ValueError("a vertex of a face is out of bounds")
            first, *others = (k - 1 if k > 0 else count + k for k in corners)  # 1 is the first, -1 the last so far
            for second, third in itertools.pairwise(others):
                found.extend((first, second, third))
        elif words[0] == b"usemtl":
            material = _rest(line)
            if len(faces) > MOST_PARTS:
                raise too_many()
            found = faces.setdefault(material, array("q"))
    textures = Textures(read_referenced)
    for name in obj_libraries(data):
        materials = _materials(read_referenced(name) or b"", textures) | materials
    points = np.array(vertices).reshape(-1, 3)
    for material, indices in faces.items():
        index = np.array(indices, dtype=np.int64).reshape(-1, 3)
        if index.max(initial=-1) >= count:
            raise ValueError(f"a vertex of a face is out of bounds: {index.max() + 1} of {count}")
        yield points[index], materials.get(material)


def obj_libraries(data: bytes) -> tuple[str, ...]:
    """The material files that an OBJ file names. Raises MeshError if there are too many."""
    names = dict.fromkeys(_rest(line) for line in BytesIO(data) if line.split(None, 1)[:1] == [b"mtllib"])
    if len(names) > MOST_LIBRARIES:
        raise MeshError(f"names more than the {MOST_LIBRARIES} material files that are read")
    return tuple(name for name in names if name)


def mtl_textures(data: bytes) -> tuple[str, ...]:
    """The diffuse textures that a material file names. Raises MeshError if there are too many."""
    names = dict.fromkeys(
        _rest(line) for line in BytesIO(data) if line.split(None, 1)[:1] in ([b"map_Kd"], [b"map_kd"])
    )
    if len(names) > MOST_TEXTURES:
        raise MeshError(f"names more than the {MOST_TEXTURES} textures that are read")
    return tuple(name for name in names if name)


@dataclass
class _Material:
    diffuse: tuple[float, float, float] | None = None
    opacity: float = 1.0
    texture: str = ""

    def colour(self, textures: Textures) -> Colour | None:
        """The mean colour of the texture if it can be read, else the diffuse colour; None without either."""
        found = textures.colour(self.texture) if self.texture else None
        diffuse = found[:3] if found else self.diffuse
        # an opacity of 0 would hide the part, and some files mean 1 by it
        return clip_colour((*diffuse, self.opacity or 1.0)) if diffuse else None


def _materials(data: bytes, textures: Textures) -> dict[str, Colour | None]:
    """The colours of the materials of a material file, by name."""
    found, material = dict[str, _Material](), _Material()
    for line in BytesIO(data):
        words = line.split()
        if len(words) < 2:
            continue
        key = words[0].lower()
        if key == b"newmtl":
            found[_rest(line)] = material = _Material()
        elif key == b"map_kd":
            material.texture = _rest(line)
        elif key in (b"kd", b"d"):
            try:
                numbers = [float(word) for word in words[1:]]
            except ValueError:
                continue  # such as "Kd spectral FILE"
            if key == b"kd":
                red, green, blue = numbers[:3] if len(numbers) >= 3 else [numbers[0]] * 3
                material.diffuse = red, green, blue
            else:
                material.opacity = numbers[-1]
    if len(found) > MOST_PARTS:
        raise too_many()
    mtl_textures(data)  # raises if there are too many
    return {name: material.colour(textures) for name, material in found.items()}


def _rest(line: bytes) -> str:
    """The text after the first word of a line."""
    return b" ".join(line.split(None, 1)[1:]).strip().decode(errors="replace")
