"""Mesh files as triangles: STL and OBJ read here, COLLADA with its colours by pycollada, all within limits of size.

trimesh reads these formats without limits of size and time.

The checks of COLLADA count elements, depth, textures and instances of nodes: a few lines of nodes that each instantiate
the next one twice describe a scene of any size.
"""

from __future__ import annotations

import itertools
import re
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any
from urllib.parse import unquote
from xml.parsers import expat

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.replays.geometry.shapes import GREY, Colour, Textures, clip_colour
from bellcrank.robot.formats.xml_tree import decoded

ReadReferenced = Callable[[str], bytes | None]  # content of a file that the mesh file names; None if there is none
MOST_FACES, MOST_PARTS = 4_000_000, 20_000
MOST_LIBRARIES, MOST_TEXTURES = 20, 1000  # material files and textures that one file may name
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84  # bytes before the facets: text and the number of facets
_SOLID = re.compile(rb"^[ \t]*(?:end)?solid[^\r\n]*", re.MULTILINE)  # with its name, which may be "vertex"
MOST_POINTS = 50_000_000  # vertices of all instances of a file's meshes
MOST_ELEMENTS, MOST_DEPTH = 400_000, 250
MOST_USES = 200_000  # instances of nodes and shapes in a scene
MOST_CHAIN = 50  # nodes that instantiate each other in a row
_TEXTS = ("init_from", "ref", "vcount")  # elements whose text is read
_USES = ("instance_geometry", "instance_controller")


class MeshError(Exception):
    """Why a mesh file cannot be drawn: a phrase that follows the file's name, such as "is broken"."""


def too_many() -> MeshError:
    """The error for a file with more triangles or parts than are read."""
    return MeshError(f"has more than the {MOST_FACES} triangles or {MOST_PARTS} parts that are read")


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


def collada_triangles(data: bytes, read_referenced: ReadReferenced) -> Iterator[tuple[Array, Colour | None]]:
    """The triangles (m, 3, 3) in metres and the colour of each primitive in a COLLADA file's scene."""
    import collada

    check_collada(data)
    ignored = [collada.common.DaeBrokenRefError, collada.common.DaeUnsupportedError]
    file = collada.Collada(BytesIO(data), ignore=ignored)
    if file.errors:  # a geometry with one unreadable material is left out: read again without these materials
        for binding in file.xmlnode.iter(file.tag("technique_common")):
            for material in binding.findall(file.tag("instance_material")):
                if material.get("target", "").removeprefix("#") not in file.materials:
                    binding.remove(material)
        file.xmlnode.write(again := BytesIO())
        file = collada.Collada(BytesIO(again.getvalue()), ignore=ignored)
    colours: dict[Any, Colour | None] = {None: None}
    scene, unit = file.scene or next(iter(file.scenes), None), float(file.assetInfo.unitmeter or 1.0)
    points, textures = 0, Textures(read_referenced)
    for bound in (b for kind in ("geometry", "controller") for b in (scene.objects(kind) if scene else ())):
        for primitive in bound.primitives():
            points += len(primitive.vertex) if getattr(primitive, "vertex", None) is not None else 0
            if points > MOST_POINTS:
                raise MeshError(f"instantiates more than {MOST_POINTS} vertices, the most that are read")
            shape = primitive.triangleset() if hasattr(primitive, "triangleset") else primitive
            if isinstance(shape, collada.triangleset.BoundTriangleSet):
                if shape.material not in colours:
                    colours[shape.material] = _colour(shape.material.effect, textures)
                turn = -1 if np.linalg.det(bound.matrix[:3, :3]) < 0.0 else 1  # mirrored: restore the orientation
                yield unit * shape.vertex.astype(float)[shape.vertex_index][:, ::turn], colours[shape.material]


def _colour(effect: Any, textures: Textures) -> Colour | None:
    """The diffuse colour of an effect plus half its ambient colour; the mean colour of a texture."""
    diffuse, ambient = effect.diffuse, effect.ambient
    if hasattr(diffuse, "sampler"):
        return textures.colour(unquote(diffuse.sampler.surface.image.path)) or GREY
    if diffuse is None:
        return None
    sky = ambient[:3] if isinstance(ambient, tuple) else (0.0, 0.0, 0.0)
    # files disagree on the meaning of opacity, which is left out
    return clip_colour((*(d + 0.5 * a for d, a in zip(diffuse, sky, strict=False)), 1.0))


# ---- checks before the file is read


@dataclass
class _Node:
    """A node: the number of its own shapes plus one, and the numbers or names of the nodes that it instantiates."""

    own: int = 1
    uses: list[int | str] = field(default_factory=list)


class _Counter:
    """Counts the elements that expat reports."""

    def __init__(self) -> None:
        self.elements = 0
        self.open: list[str] = []
        self.nodes = [_Node()]  # the first holds what is in no node
        self.within = [0]  # numbers of the enclosing nodes, outermost first
        self.ended: list[int] = []  # numbers of nodes, in the order of their end tags
        self.numbers: dict[str, int] = {}  # of named nodes
        self.names: dict[str, None] = {}  # of files
        self.corners = 0  # of polygons, by their vertex counts
        self.text: list[str] | None = None

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        name = tag.rpartition(":")[2]
        self.elements += 1
        self.open.append(name)
        if self.elements > MOST_ELEMENTS or len(self.open) > MOST_DEPTH:
            raise MeshError(f"has more than {MOST_ELEMENTS} elements, or more than {MOST_DEPTH} within each other")
        around = self.nodes[self.within[-1]]
        if name in _TEXTS:
            self.text = []
        elif name == "node":
            number = len(self.nodes)
            self.nodes.append(_Node())
            around.uses.append(number)
            self.within.append(number)
            self.numbers.setdefault(attributes.get("id", ""), number)
        elif name == "instance_node":
            around.uses.append(attributes.get("url", "").removeprefix("#"))
        elif name in _USES:
            around.own += 1

    def end(self, tag: str) -> None:
        name = self.open.pop()
        if name == "node":
            self.ended.append(self.within.pop())
        elif self.text is not None and name in _TEXTS:
            text, self.text = "".join(self.text), None
            if name == "vcount":
                self.corners += sum(int(word) for word in text.split() if word.isdecimal() and len(word) < 16)
            else:
                self.names[text.strip()] = None

    def characters(self, text: str) -> None:
        if self.text is not None:
            self.text.append(text)

    def doctype(self, *_: object) -> None:
        raise MeshError("declares XML entities, which are not read")


def check_collada(data: bytes) -> tuple[str, ...]:
    """The textures that a COLLADA file names. Raises MeshError if it is not XML or exceeds a limit."""
    counter = _Counter()
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    parser.StartElementHandler = counter.start
    parser.EndElementHandler = counter.end
    parser.CharacterDataHandler = counter.characters
    parser.StartDoctypeDeclHandler = counter.doctype
    try:
        parser.Parse(decoded(data, "it").encode("utf-8"), True)
    except (expat.ExpatError, InputError, UnicodeError) as error:
        raise MeshError(f"is broken (XML Parsing Error: {str(error)[:80]})") from None
    if counter.corners > len(data):  # each corner takes a number, and so two characters
        raise MeshError("declares more polygon vertices than it contains")
    if len(counter.names) > MOST_TEXTURES:
        raise MeshError(f"names more than the {MOST_TEXTURES} textures that are read")
    _check_uses(counter)
    return tuple(name for name in counter.names if name and not set("<>") & set(name))


def _check_uses(counter: _Counter) -> None:
    """Raise MeshError for chains that are too long and scenes with too many instances; pycollada refuses cycles."""
    total: dict[int, int] = {}  # instances below each node, including itself
    waiting = [*counter.ended, 0]
    for _ in range(MOST_CHAIN):
        left = []
        for number in waiting:
            node = counter.nodes[number]
            uses = [use if isinstance(use, int) else counter.numbers.get(use) for use in node.uses]
            known = [total.get(use) for use in uses if use is not None]
            if None in known:
                left.append(number)
            else:
                total[number] = min(node.own + sum(count or 0 for count in known), MOST_USES + 1)
        if not left or len(left) == len(waiting):
            break
        waiting = left
    else:
        raise MeshError(f"has more than {MOST_CHAIN} nodes that instantiate each other in a row")
    outermost = sum(total.get(use, 0) for use in counter.nodes[0].uses if isinstance(use, int))
    if max(outermost, *total.values(), 0) > MOST_USES:
        raise too_many()
