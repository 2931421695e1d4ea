"""The <visual> and <collision> elements and <material> colours of a URDF, as shapes whose meshes are not read yet."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from bellcrank.config.numbers import decimal_number
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess, read_bytes
from bellcrank.motion.kinematics.rotations import from_rpy
from bellcrank.replays.geometry.colours import GREY, Colour, Textures, clip_colour
from bellcrank.replays.geometry.placeholder_shapes import pose
from bellcrank.replays.geometry.shapes import DrawnShape, Pose
from bellcrank.robot.formats.mesh_path import find_mesh
from bellcrank.robot.formats.xml_tree import XmlElement

LARGEST = 1e6  # m: larger sizes are errors
MOST_TEXTURE = 64 * 2**20  # bytes
UNCOLOURED: Colour = (*GREY[:3], -1.0)  # marks a shape that the URDF gives no colour


@dataclass(frozen=True)
class UrdfShape:
    """The shape of an element (UNCOLOURED if the URDF gives no colour); for a mesh, its name, and its file if found."""

    shape: DrawnShape
    mesh: str = ""
    path: Path | None = None


class UrdfShapeReader:
    """Reads the shapes of one URDF.

    `notes` collects what could not be read. `access` says which files the URDF may name; default: those near it.
    """

    def __init__(self, root: XmlElement, source: Path, access: FileAccess | None = None) -> None:
        self.access = FileAccess.of(source.resolve()) if access is None else access
        self.source, self.notes, self.textured = source, list[str](), False
        self.textures = Textures(self._texture)
        self.paths: dict[str, Path | None] = {}
        named = [e for e in root.walk() if e.tag == "material" and e.attributes.get("name")]
        self.materials: dict[str, Colour] = {}
        for element in reversed(named):  # the first definition of a name counts
            colour = self._own_colour(element)
            if colour is not None:
                self.materials[element.attributes["name"].strip()] = colour

    def shapes(self, link: XmlElement, tag: str) -> tuple[UrdfShape, ...]:
        """The shapes of a link's elements of a tag, "visual" or "collision"; invalid ones are left out, with a note."""
        found = []
        for element in link.find_all(tag):
            try:
                found += self._element_shapes(element)
            except ValueError as error:
                name = link.attributes.get("name", "").strip()
                self.notes.append(f"link '{name}', <{tag}> (line {element.line}) is not drawn: {error}")
        return tuple(found)

    def _element_shapes(self, element: XmlElement) -> list[UrdfShape]:
        geometry, origin = element.find("geometry"), element.find("origin")
        if geometry is None or not geometry.children:
            raise ValueError("it has no geometry")
        solid, given = geometry.children[0], geometry.children[0].attributes
        place = origin.attributes if origin is not None else {}
        rotation = from_rpy(np.array(_numbers(place.get("rpy", "0 0 0"), 3)))
        position = np.array(_numbers(place.get("xyz", "0 0 0"), 3))
        where, colour = pose(rotation, position), self._colour(element.find("material"))
        if colour[3] == 0.0:
            return []
        if solid.tag == "box":
            x, y, z = _sizes(given.get("size", ""), 3)
            return [_shape("box", (x, y, z), colour, where)]
        if solid.tag == "sphere":
            return [_shape("sphere", _sizes(given.get("radius", ""), 1), colour, where)]
        if solid.tag in ("cylinder", "capsule"):
            radius, length = *_sizes(given.get("radius", ""), 1), *_sizes(given.get("length", ""), 1)
            found = [_shape("cylinder", (radius, length), colour, where)]
            for end in (-0.5, 0.5) if solid.tag == "capsule" else ():
                tip = pose(rotation, position + rotation[:, 2] * end * length)
                found.append(_shape("sphere", (radius,), colour, tip))
            return found
        if solid.tag == "mesh":
            name = given.get("filename", "").strip()
            scale = _numbers(given.get("scale", "1 1 1"), 3)
            if not name or 0.0 in scale:
                raise ValueError("its mesh has no filename" if not name else "its mesh has a scale of 0")
            if name not in self.paths:
                self.paths[name] = find_mesh(name, self.source, self.access)
            shape = DrawnShape(kind="mesh", size=scale, colour=colour, pose=where)
            return [UrdfShape(shape, name, self.paths[name])]
        raise ValueError(f"unknown geometry <{solid.tag[:30]}>")

    def _colour(self, material: XmlElement | None) -> Colour:
        """The colour of a visual's own material, or of the material of that name elsewhere in the file."""
        if material is None:
            return UNCOLOURED
        own = self._own_colour(material)
        return own or self.materials.get(material.attributes.get("name", "").strip(), UNCOLOURED)

    def _own_colour(self, material: XmlElement) -> Colour | None:
        colour, texture = material.find("color"), material.find("texture")
        if colour is not None:
            try:
                red, green, blue, *opacity = _numbers(colour.attributes.get("rgba", ""), None)
                return clip_colour((red, green, blue, opacity[0] if opacity else 1.0))
            except ValueError:
                self.notes.append(
                    f"line {colour.line}: the rgba of a <color> is not used; expected numbers from 0 to 1"
                )
        if texture is None:
            return None
        self.textured = True
        return self.textures.colour(texture.attributes.get("filename", "")) or GREY

    def _texture(self, name: str) -> bytes | None:
        """The content of a texture file; None if there is none or it is too large."""
        path = find_mesh(name, self.source, self.access)
        try:
            return None if path is None else read_bytes(path, MOST_TEXTURE)
        except InputError:
            return None


def _shape(
    kind: Literal["box", "cylinder", "sphere"], size: tuple[float, ...], colour: Colour, where: Pose
) -> UrdfShape:
    return UrdfShape(DrawnShape(kind=kind, size=size, colour=colour, pose=where))


def _numbers(text: str, count: int | None) -> tuple[float, ...]:
    """Finite numbers of at most LARGEST; ValueError says what is wrong."""
    try:
        numbers = tuple(decimal_number(word) for word in text.split())
    except ValueError:
        raise ValueError(f"{text[:40]!r} is not numbers") from None
    if count is not None and len(numbers) != count:
        raise ValueError(f"{text[:40]!r} is not {count} numbers")
    if not all(abs(x) <= LARGEST for x in numbers):
        raise ValueError(f"{text[:40]!r} is not finite or too large")
    return numbers


def _sizes(text: str, count: int) -> tuple[float, ...]:
    numbers = _numbers(text, count)
    if min(numbers) <= 0.0:
        raise ValueError(f"a size is {min(numbers):g}, which is not positive")
    return numbers
