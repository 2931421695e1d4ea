"""COLLADA files: their triangles and colours, read by pycollada, and checks of their size before they are read.

The checks count elements, depth, textures and instances of nodes: a few lines of nodes that each instantiate the next
one twice describe a scene of any size.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any
from urllib.parse import unquote
from xml.parsers import expat

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.replays.geometry.colours import GREY, Colour, Textures, clip_colour
from bellcrank.replays.geometry.mesh_limits import MOST_TEXTURES, MeshError, ReadReferenced, too_many
from bellcrank.robot.formats.xml_tree import decoded

MOST_POINTS = 50_000_000  # vertices of all instances of a file's meshes
MOST_ELEMENTS, MOST_DEPTH = 400_000, 250
MOST_USES = 200_000  # instances of nodes and shapes in a scene
MOST_CHAIN = 50  # nodes that instantiate each other in a row
_TEXTS = ("init_from", "ref", "vcount")  # elements whose text is read
_USES = ("instance_geometry", "instance_controller")


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
