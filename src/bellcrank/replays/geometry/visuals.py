"""The bodies of a robot: the visuals of its URDF, and placeholder shapes for links without visuals."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from bellcrank.config.units import decimal_number
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess, read_bytes
from bellcrank.motion.kinematics.rotations import from_rpy
from bellcrank.replays.geometry.meshes import Detail, Meshes, load_meshes
from bellcrank.replays.geometry.placeholder_shapes import LinkLayout, inertia_box, placeholder_shapes, pose, transform
from bellcrank.replays.geometry.shapes import GREY, Colour, DrawnBody, DrawnShape, Pose, Textures, clip_colour
from bellcrank.robot.formats.mesh_path import find_mesh, looked_for
from bellcrank.robot.formats.xml_tree import XmlElement

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot


LARGEST = 1e6  # m: larger sizes are errors
MOST_TEXTURE = 64 * 2**20  # bytes
UNCOLOURED: Colour = (*GREY[:3], -1.0)  # marks a shape that the URDF gives no colour
MOST_COLLISION_SIZE = 1.5  # of the robot's size: a larger collision shape is a floor or a fence
MOST_NAMES = 3  # in a note; "and 4 more" stands for the rest
MOST_CHARACTERS = 80  # of a file's name in a note
# M. Okabe and K. Ito, "Color Universal Design", 2008, without its black and yellow, made lighter for shading
PALETTE: tuple[Colour, ...] = (
    (0.20, 0.49, 0.74, 1.0), (0.91, 0.65, 0.19, 1.0), (0.19, 0.64, 0.50, 1.0), (0.85, 0.45, 0.22, 1.0),
    (0.46, 0.74, 0.92, 1.0), (0.80, 0.54, 0.69, 1.0),
)  # fmt: skip
BASE_COLOUR: Colour = (0.45, 0.46, 0.48, 1.0)  # of links that do not move
MESH_COLOUR: Colour = (0.78, 0.79, 0.81, 1.0)  # of a mesh without a colour in the URDF and in its file
PAYLOAD_COLOUR: Colour = (0.55, 0.42, 0.30, 1.0)


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


LinkShapes = Mapping[str, tuple[UrdfShape, ...]]  # by link


def robot_bodies(
    robot: Robot, detail: Detail = "reduced", progress: Callable[[float], None] = lambda share: None
) -> tuple[tuple[DrawnBody, ...], tuple[str, ...]]:
    """The bodies of a robot, each named after the frame that carries it, in the order of the frames; and notes.

    Bodies are links with visuals, payloads, and links of which only joints, collision shapes or inertia are known;
    these get shapes marked as `placeholder`. Meshes are simplified without visible loss, unless `detail` is "full".
    What cannot be drawn, such as a missing mesh file, raises nothing; the notes name it. `progress` is called with the
    completed share of the meshes that are not in the cache.
    """
    urdf, root = robot.urdf, robot.file.urdf
    reader, layout = UrdfShapeReader(root, robot.mesh_source, robot.mesh_access), LinkLayout(urdf, robot.user_frames)
    elements = {element.attributes.get("name", "").strip(): element for element in root.find_all("link")}
    urdf_shapes = {link: reader.shapes(elements[link], "visual") if link in elements else () for link in urdf.links}
    meshes = _load_meshes(urdf_shapes, layout.size, detail, progress, robot.mesh_access)
    colours = _link_colours(layout)

    def drawn(source: LinkShapes) -> dict[str, tuple[DrawnShape, ...]]:
        return {link: tuple(s for d in source[link] for s in _shapes(d, meshes, colours[link])) for link in source}

    shapes = drawn(urdf_shapes)
    lost = {link for link, found in urdf_shapes.items() if found and not shapes[link]}
    bare = _links_without_shapes(layout, shapes, lost)
    collisions = {
        link: reader.shapes(elements[link], "collision")
        for links in bare.values()
        for link in links
        if link in elements
    }
    if collisions:
        urdf_shapes = {link: found + collisions.get(link, ()) for link, found in urdf_shapes.items()}
        meshes = _load_meshes(urdf_shapes, layout.size, detail, progress, robot.mesh_access)
        for link, found in drawn(collisions).items():
            near = (s for s in found if _extent(s) <= MOST_COLLISION_SIZE * (layout.size or np.inf))
            shapes[link] = tuple(replace(s, placeholder=True) for s in near)
    for carrier in _links_without_shapes(layout, shapes, lost):
        shapes[carrier] = (*shapes[carrier], *placeholder_shapes(layout, carrier, colours[carrier]))
    for k, load in enumerate(robot.payloads):
        xx, xy, yy, xz, yz, zz = load.inertia
        inertia, centre = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), transform(load.cg, (0, 0, 0))
        shapes[f"payload {k + 1}"] = (inertia_box(load.mass, inertia, centre, layout.scale, PAYLOAD_COLOUR),)
    names = [name for name in dict.fromkeys(robot.frame_names) if shapes.get(name)]
    notes = [*reader.notes, *_file_notes(urdf_shapes, meshes, robot), *_simplification_notes(urdf_shapes, meshes)]
    if reader.textured:
        notes.append("textures are shown as their mean colours")
    return tuple(DrawnBody(name, shapes[name]) for name in names), tuple(notes)


def _load_meshes(
    urdf_shapes: LinkShapes, size: float, detail: Detail, progress: Callable[[float], None], access: FileAccess
) -> Meshes:
    uses: dict[Path, list[float]] = {}
    for each in (s for found in urdf_shapes.values() for s in found):
        if each.path is not None:
            uses.setdefault(each.path, []).append(max(abs(x) for x in each.shape.size))
    return load_meshes(uses, size, detail, progress, access)


def _shapes(urdf_shape: UrdfShape, meshes: Meshes, colour: Colour) -> Iterable[DrawnShape]:
    """The shape of a URDF element with its colour, or one for each part of its mesh; none if the mesh is missing."""
    shape = urdf_shape.shape
    if not urdf_shape.mesh:
        yield shape if shape.colour is not UNCOLOURED else replace(shape, colour=colour)
        return
    for part in meshes.parts.get(urdf_shape.path, ()) if urdf_shape.path is not None else ():
        own = part.colour or MESH_COLOUR if shape.colour is UNCOLOURED else shape.colour
        yield replace(shape, mesh=part.mesh, colour=own)


def _extent(shape: DrawnShape) -> float:
    """The largest extent of a shape along one of its own axes (m)."""
    if shape.mesh is not None:
        return float((np.ptp(shape.mesh.vertices, axis=0) * np.abs(shape.size)).max())
    radius = 0.0 if shape.kind == "box" else shape.size[0]
    return max(2.0 * radius, max(shape.size))


def _links_without_shapes(
    layout: LinkLayout, shapes: Mapping[str, tuple[DrawnShape, ...]], lost: Collection[str]
) -> dict[str, list[str]]:
    """Links to draw by other means, by carrier: all its links if none has a shape, else those of `lost` without one."""
    found = {}
    for carrier, links in layout.links_of.items():
        drawn = any(shapes.get(link) for link in links)
        if bare := [link for link in links if not shapes.get(link) and (link in lost or not drawn)]:
            found[carrier] = bare
    return found


def _link_colours(layout: LinkLayout) -> dict[str, Colour]:
    """A colour for each link, in the order of the palette, other than that of its parent body."""
    chosen: dict[str, Colour] = {}
    turn = 0
    for carrier, links in layout.links_of.items():
        colour = BASE_COLOUR
        if carrier in layout.parent_joint:
            below = chosen[layout.carrier[layout.parent_joint[carrier].parent]]
            turn += PALETTE[turn % len(PALETTE)] == below
            colour = PALETTE[turn % len(PALETTE)]
            turn += 1
        for link in links:
            chosen[link] = colour
    return chosen


def _file_notes(urdf_shapes: LinkShapes, meshes: Meshes, robot: Robot) -> Iterable[str]:
    """Notes on mesh files that are not drawn: missing ones together, broken ones one by one."""
    missing: dict[str, list[str]] = {}
    broken: dict[Path, list[str]] = {}
    for link, found in urdf_shapes.items():
        for each in found:
            if each.mesh and each.path is None:
                missing.setdefault(each.mesh, []).append(link)
            elif each.path is not None and each.path in meshes.failures:
                broken.setdefault(each.path, []).append(link)
    if missing:
        files = [_shorten(name) for name in missing]
        links = [f"'{link}'" for link in dict.fromkeys(link for users in missing.values() for link in users)]
        count = f"{len(files)} mesh files were" if len(files) > 1 else "a mesh file was"
        beyond = looked_for(missing, robot.mesh_source, robot.mesh_access)
        yield f"{count} not found: {_listed(files)}, of link{'s' * (len(links) > 1)} {_listed(links)}{beyond}"
    for path, users in broken.items():
        links = [f"'{link}'" for link in dict.fromkeys(users)]
        yield f"the mesh file {_shorten(path.name)} of {_listed(links)} is not drawn: it {meshes.failures[path]}"


def _simplification_notes(urdf_shapes: LinkShapes, meshes: Meshes) -> Iterable[str]:
    parts = [p for found in urdf_shapes.values() for s in found if s.path for p in meshes.parts.get(s.path, ())]
    written, faces = sum(p.written for p in parts), sum(len(p.mesh.faces) for p in parts)
    if meshes.tolerance and faces < written:
        yield (
            f"meshes simplified from {written} to {faces} faces; surfaces shifted by at most "
            f"{1e3 * meshes.tolerance:.2g} mm (root mean square)"
        )


def _shorten(name: str) -> str:
    return name if len(name) <= MOST_CHARACTERS else f"…{name[-MOST_CHARACTERS:]}"


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(names[:MOST_NAMES]) + more
