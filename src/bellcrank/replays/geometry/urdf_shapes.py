"""Reading what a URDF draws: <visual> and <collision> elements and <material> colours, as shapes without meshes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bellcrank.config.numbers import decimal_number
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess, read_bytes
from bellcrank.motion.rotations import from_rpy
from bellcrank.replays.film.film import Shape
from bellcrank.replays.geometry.colours import GREY, Colour, Textures, clipped
from bellcrank.replays.geometry.placeholder_shapes import pose
from bellcrank.robot.mesh_path import find_mesh
from bellcrank.robot.xml_tree import Element

LARGEST = 1e6  # m: what is larger is no robot's
MOST_TEXTURE = 64 * 2**20  # bytes
UNCOLOURED: Colour = (*GREY[:3], -1.0)  # stands in a shape for a colour that the URDF does not give


@dataclass(frozen=True)
class Drawing:
    """One element: its shape, UNCOLOURED where the URDF gives no colour; of a mesh its name, and its file if found."""

    shape: Shape
    mesh: str = ""
    path: Path | None = None


class DrawingReader:
    """Reads the elements of one URDF; `notes` says in phrases what could not be read. `access` says which files the
    URDF may name, by default those near it.
    """

    def __init__(self, root: Element, source: Path, access: FileAccess | None = None) -> None:
        self.access = FileAccess.of(source.resolve()) if access is None else access
        self.source, self.notes, self.textured = source, list[str](), False
        self.textures = Textures(self._texture)
        self.paths: dict[str, Path | None] = {}
        named = [e for e in root.walk() if e.tag == "material" and e.attributes.get("name")]
        self.materials: dict[str, Colour] = {}
        for element in reversed(named):  # the first definition of a name holds
            colour = self._own_colour(element)
            if colour is not None:
                self.materials[element.attributes["name"].strip()] = colour

    def drawings(self, link: Element, tag: str) -> tuple[Drawing, ...]:
        """A link's elements of a tag, "visual" or "collision"; what makes no sense is left out, with a note."""
        found = []
        for element in link.find_all(tag):
            try:
                found += self._drawings(element)
            except ValueError as error:
                name = link.attributes.get("name", "").strip()
                self.notes.append(f"link '{name}', <{tag}> (line {element.line}) is not drawn: {error}")
        return tuple(found)

    def _drawings(self, element: Element) -> list[Drawing]:
        geometry, origin = element.find("geometry"), element.find("origin")
        if geometry is None or not geometry.children:
            raise ValueError("it has no geometry")
        solid = geometry.children[0]
        place = origin.attributes if origin is not None else {}
        rotation = from_rpy(np.array(_numbers(place.get("rpy", "0 0 0"), 3)))
        position = np.array(_numbers(place.get("xyz", "0 0 0"), 3))
        where, colour = pose(rotation, position), self._colour(element.find("material"))
        if colour[3] == 0.0:
            return []
        given = solid.attributes
        if solid.tag == "box":
            x, y, z = _sizes(given.get("size", ""), 3)
            return [Drawing(Shape("box", (x, y, z), colour, where))]
        if solid.tag == "sphere":
            return [Drawing(Shape("sphere", _sizes(given.get("radius", ""), 1), colour, where))]
        if solid.tag in ("cylinder", "capsule"):
            radius, length = *_sizes(given.get("radius", ""), 1), *_sizes(given.get("length", ""), 1)
            drawn = [Drawing(Shape("cylinder", (radius, length), colour, where))]
            for end in (-0.5, 0.5) if solid.tag == "capsule" else ():
                tip = pose(rotation, position + rotation[:, 2] * end * length)
                drawn.append(Drawing(Shape("sphere", (radius,), colour, tip)))
            return drawn
        if solid.tag == "mesh":
            name = given.get("filename", "").strip()
            scale = _numbers(given.get("scale", "1 1 1"), 3)
            if not name or 0.0 in scale:
                raise ValueError("its mesh has no filename" if not name else "its mesh has a scale of 0")
            if name not in self.paths:
                self.paths[name] = find_mesh(name, self.source, self.access)
            return [Drawing(Shape("mesh", scale, colour, where), name, self.paths[name])]
        raise ValueError(f"<{solid.tag[:30]}> is not known")

    def _colour(self, material: Element | None) -> Colour:
        """A visual's colour by its own material, or by the material of that name elsewhere in the file."""
        if material is None:
            return UNCOLOURED
        own = self._own_colour(material)
        return own or self.materials.get(material.attributes.get("name", "").strip(), UNCOLOURED)

    def _own_colour(self, material: Element) -> Colour | None:
        colour, texture = material.find("color"), material.find("texture")
        if colour is not None:
            try:
                red, green, blue, *opacity = _numbers(colour.attributes.get("rgba", ""), None)
                return clipped((red, green, blue, opacity[0] if opacity else 1.0))
            except ValueError:
                self.notes.append(
                    f"line {colour.line}: the rgba of a <color> is not read; expected numbers from 0 to 1"
                )
        if texture is None:
            return None
        self.textured = True
        return self.textures.colour(texture.attributes.get("filename", "")) or GREY

    def _texture(self, name: str) -> bytes | None:
        """What the file of a texture holds; None where there is none, or it is too large."""
        path = find_mesh(name, self.source, self.access)
        try:
            return None if path is None else read_bytes(path, MOST_TEXTURE)
        except InputError:
            return None


def _numbers(text: str, count: int | None) -> tuple[float, ...]:
    """Finite numbers of a reasonable size; ValueError says what is wrong with them."""
    try:
        numbers = tuple(decimal_number(word) for word in text.split())
    except ValueError:
        raise ValueError(f"{text[:40]!r} is not numbers") from None
    if count is not None and len(numbers) != count:
        raise ValueError(f"{text[:40]!r} was expected to be {count} numbers")
    if not all(abs(x) <= LARGEST for x in numbers):
        raise ValueError(f"{text[:40]!r} is not finite or too large")
    return numbers


def _sizes(text: str, count: int) -> tuple[float, ...]:
    numbers = _numbers(text, count)
    if min(numbers) <= 0.0:
        raise ValueError(f"a size is {min(numbers):g}, and positive was expected")
    return numbers
