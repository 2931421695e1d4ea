"""Reading STL and OBJ files into triangles, in a time that grows as the file does."""

from __future__ import annotations

import itertools
import re
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from bellcrank.replays.geometry.colours import Colour, Textures, clipped

Array = NDArray[np.float64]
Beside = Callable[[str], bytes | None]  # what a file that the mesh file names holds, None where there is none
MOST_FACES, MOST_PARTS = 4_000_000, 20_000
MOST_LIBRARIES, MOST_TEXTURES = 20, 1000  # material files and textures that one file may name
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84  # bytes before the facets: any text, and how many there are
_SOLID = re.compile(rb"^[ \t]*(?:end)?solid[^\r\n]*", re.MULTILINE)  # with its name, which can be "vertex"


class MeshError(Exception):
    """Why a mesh file cannot be drawn: a phrase that follows the file's name."""


def too_many() -> MeshError:
    """The error of a file with more triangles or parts than are read."""
    return MeshError(f"has more than the {MOST_FACES} triangles or {MOST_PARTS} parts that are read")


# ---- STL


def stl_triangles(data: bytes) -> Iterator[tuple[Array, Colour | None]]:
    """The triangles (m, 3, 3) of an STL file, binary where its length is what its header says, else text; none where it
    is empty or truncated. Raises MeshError or ValueError.
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


def obj_triangles(data: bytes, beside: Beside) -> Iterator[tuple[Array, Colour | None]]:
    """The triangles (m, 3, 3) of each material of an OBJ file, polygons cut into fans. Raises MeshError, ValueError."""
    if b"\\" in data:
        data = data.replace(b"\\\r\n", b"").replace(b"\\\n", b"")  # lines that go on
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
            first, *others = (k - 1 if k > 0 else count + k for k in corners)  # the first is 1, the last so far -1
            for second, third in itertools.pairwise(others):
                found.extend((first, second, third))
        elif words[0] == b"usemtl":
            material = _rest(line)
            if len(faces) > MOST_PARTS:
                raise too_many()
            found = faces.setdefault(material, array("q"))
    textures = Textures(beside)
    for name in obj_libraries(data):
        materials = _materials(beside(name) or b"", textures) | materials
    points = np.array(vertices).reshape(-1, 3)
    for material, indices in faces.items():
        index = np.array(indices, dtype=np.int64).reshape(-1, 3)
        if index.max(initial=-1) >= count:
            raise ValueError(f"a vertex of a face is out of bounds: {index.max() + 1} of {count}")
        yield points[index], materials.get(material)


def obj_libraries(data: bytes) -> tuple[str, ...]:
    """The material files that an OBJ file names. Raises MeshError where they are more than are read."""
    names = dict.fromkeys(_rest(line) for line in BytesIO(data) if line.split(None, 1)[:1] == [b"mtllib"])
    if len(names) > MOST_LIBRARIES:
        raise MeshError(f"names more than the {MOST_LIBRARIES} material files that are read")
    return tuple(name for name in names if name)


def mtl_textures(data: bytes) -> tuple[str, ...]:
    """The textures of diffuse colour that a material file names. Raises MeshError where they are too many."""
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
        """The mean colour of the texture where it can be read, else the diffuse one, None where there is neither."""
        found = textures.colour(self.texture) if self.texture else None
        diffuse = found[:3] if found else self.diffuse
        return clipped((*diffuse, self.opacity or 1.0)) if diffuse else None  # 0 would hide it: some mean 1 by it


def _materials(data: bytes, textures: Textures) -> dict[str, Colour | None]:
    """The colours of a material file's materials by name."""
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
    mtl_textures(data)  # not too many
    return {name: material.colour(textures) for name, material in found.items()}


def _rest(line: bytes) -> str:
    """What follows the first word of a line."""
    return b" ".join(line.split(None, 1)[1:]).strip().decode(errors="replace")
