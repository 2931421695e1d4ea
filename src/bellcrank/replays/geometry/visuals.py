"""What a robot looks like: the visuals of its URDF, and simple shapes where the URDF gives none."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.files.access import FileAccess
from bellcrank.replays.film.film import Body, Shape
from bellcrank.replays.geometry.colours import Colour
from bellcrank.replays.geometry.meshes import Detail, Meshes, load_meshes
from bellcrank.replays.geometry.placeholder_shapes import inertia_box, stand_ins
from bellcrank.replays.geometry.skeleton import Skeleton, placement
from bellcrank.replays.geometry.urdf_shapes import UNCOLOURED, Drawing, DrawingReader
from bellcrank.robot.mesh_path import looked_for
from bellcrank.robot.xml_tree import parse_xml

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot

Drawings = Mapping[str, tuple[Drawing, ...]]

MOST_HINT = 1.5  # of the robot's size: a larger collision shape is a floor or a fence
SHOWN = 3  # names in a note; "and 4 more" says the rest
LONGEST = 80  # characters of a file's name in a note
# M. Okabe and K. Ito, "Color Universal Design", 2008, without its black and yellow, made lighter for shading
PALETTE: tuple[Colour, ...] = (
    (0.20, 0.49, 0.74, 1.0), (0.91, 0.65, 0.19, 1.0), (0.19, 0.64, 0.50, 1.0), (0.85, 0.45, 0.22, 1.0),
    (0.46, 0.74, 0.92, 1.0), (0.80, 0.54, 0.69, 1.0),
)  # fmt: skip
BASE: Colour = (0.45, 0.46, 0.48, 1.0)  # what stands still
PLAIN: Colour = (0.78, 0.79, 0.81, 1.0)  # a mesh that neither the URDF nor its file colours
LOAD: Colour = (0.55, 0.42, 0.30, 1.0)


def bodies(
    robot: Robot, detail: Detail = "reduced", progress: Callable[[float], None] = lambda share: None
) -> tuple[tuple[Body, ...], tuple[str, ...]]:
    """The bodies of a robot, each named by the frame that carries it, in the order of the frames, and notes.

    Bodies are links with visuals, links of which only joints, collision shapes or inertia are known (shapes that are
    `stand_in`), and payloads. "reduced" simplifies meshes as far as the eye does not see, "full" does not. What cannot
    be drawn, such as a missing mesh file, raises nothing: the notes name it. `progress` hears what share of the meshes
    is done, where they are not in the cache.
    """
    urdf = robot.urdf
    root = parse_xml(urdf.text, urdf.source)
    reader, skeleton = DrawingReader(root, robot.mesh_source, robot.mesh_access), Skeleton(urdf, robot.user_frames)
    elements = {element.attributes.get("name", "").strip(): element for element in root.find_all("link")}
    drawings = {link: reader.drawings(elements[link], "visual") for link in urdf.links}
    meshes = _meshes(drawings, skeleton.size, detail, progress, robot.mesh_access)
    colours = _colours(skeleton)

    def drawn(source: Drawings) -> dict[str, tuple[Shape, ...]]:
        return {link: tuple(s for d in source[link] for s in _shapes(d, meshes, colours[link])) for link in source}

    shapes = drawn(drawings)
    lost = {link for link, found in drawings.items() if found and not shapes[link]}
    bare = _bare(skeleton, shapes, lost)
    collisions = {link: reader.drawings(elements[link], "collision") for links in bare.values() for link in links}
    if collisions:
        everything = {link: drawings[link] + collisions.get(link, ()) for link in drawings}
        meshes = _meshes(everything, skeleton.size, detail, progress, robot.mesh_access)
        for link, found in drawn(collisions).items():
            near = (s for s in found if _extent(s) <= MOST_HINT * (skeleton.size or np.inf))
            shapes[link] = tuple(replace(s, stand_in=True) for s in near)
        drawings = everything
    for carrier in _bare(skeleton, shapes, lost):
        shapes[carrier] = (*shapes[carrier], *stand_ins(skeleton, carrier, colours[carrier]))
    for k, load in enumerate(robot.payloads):
        xx, xy, yy, xz, yz, zz = load.inertia
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        shapes[f"payload {k + 1}"] = (
            inertia_box(load.mass, inertia, placement(load.cg, (0, 0, 0)), skeleton.scale, LOAD),
        )
    names = [name for name in dict.fromkeys(robot.frame_names) if shapes.get(name)]
    notes = [*reader.notes, *_file_notes(drawings, meshes, robot), *_simplified_notes(drawings, meshes)]
    if reader.textured:
        notes.append("textures are shown as their mean colours")
    return tuple(Body(name, shapes[name]) for name in names), tuple(notes)


def _meshes(
    drawings: Drawings, size: float, detail: Detail, progress: Callable[[float], None], access: FileAccess
) -> Meshes:
    uses: dict[Path, list[float]] = {}
    for drawing in (d for found in drawings.values() for d in found):
        if drawing.path is not None:
            uses.setdefault(drawing.path, []).append(max(abs(x) for x in drawing.shape.size))
    return load_meshes(uses, size, detail, progress, access)


def _shapes(drawing: Drawing, meshes: Meshes, colour: Colour) -> Iterable[Shape]:
    """A drawing's shapes: one, or one a piece of its mesh; none where the mesh is missing."""
    shape = drawing.shape
    if not drawing.mesh:
        yield shape if shape.colour is not UNCOLOURED else replace(shape, colour=colour)
        return
    for piece in meshes.pieces.get(drawing.path, ()) if drawing.path is not None else ():
        own = piece.colour or PLAIN if shape.colour is UNCOLOURED else shape.colour
        yield replace(shape, mesh=piece.mesh, colour=own)


def _extent(shape: Shape) -> float:
    """How far a shape reaches along one of its own axes, from side to side (m)."""
    if shape.mesh is not None:
        return float((np.ptp(shape.mesh.vertices, axis=0) * np.abs(shape.size)).max())
    radius = 0.0 if shape.kind == "box" else shape.size[0]
    return max(2.0 * radius, max(shape.size))


def _bare(skeleton: Skeleton, shapes: Mapping[str, tuple[Shape, ...]], lost: Collection[str]) -> dict[str, list[str]]:
    """By carrier: it and its fixed links where nothing is drawn of them all, else those of `lost` without a shape."""
    found = {}
    for carrier, links in skeleton.carried.items():
        drawn = any(shapes.get(link) for link in links)
        if bare := [link for link in links if not shapes.get(link) and (link in lost or not drawn)]:
            found[carrier] = bare
    return found


def _colours(skeleton: Skeleton) -> dict[str, Colour]:
    """A colour for each link: one after the other of the palette, and never that of the link below it in the tree."""
    chosen: dict[str, Colour] = {}
    turn = 0
    for carrier, links in skeleton.carried.items():
        colour = BASE
        if carrier in skeleton.above:
            below = chosen[skeleton.carrier[skeleton.above[carrier].parent]]
            turn += PALETTE[turn % len(PALETTE)] == below
            colour = PALETTE[turn % len(PALETTE)]
            turn += 1
        for link in links:
            chosen[link] = colour
    return chosen


def _file_notes(drawings: Drawings, meshes: Meshes, robot: Robot) -> Iterable[str]:
    """What became of each mesh file that is not drawn: missing ones together, broken ones one by one."""
    missing: dict[str, list[str]] = {}
    broken: dict[Path, list[str]] = {}
    for link, found in drawings.items():
        for drawing in found:
            if drawing.mesh and drawing.path is None:
                missing.setdefault(drawing.mesh, []).append(link)
            elif drawing.path is not None and drawing.path in meshes.failures:
                broken.setdefault(drawing.path, []).append(link)
    if missing:
        files = [_short(name) for name in missing]
        links = [f"'{link}'" for link in dict.fromkeys(link for users in missing.values() for link in users)]
        count = f"{len(files)} mesh files were" if len(files) > 1 else "a mesh file was"
        beyond = looked_for(missing, robot.mesh_source, robot.mesh_access)
        yield f"{count} not found: {_listed(files)}, of link{'s' * (len(links) > 1)} {_listed(links)}{beyond}"
    for path, users in broken.items():
        links = [f"'{link}'" for link in dict.fromkeys(users)]
        yield f"the mesh file {_short(path.name)} of {_listed(links)} is not drawn: it {meshes.failures[path]}"


def _simplified_notes(drawings: Drawings, meshes: Meshes) -> Iterable[str]:
    pieces = [p for found in drawings.values() for d in found if d.path for p in meshes.pieces.get(d.path, ())]
    written, faces = sum(p.written for p in pieces), sum(len(p.mesh.faces) for p in pieces)
    if meshes.shift and faces < written:
        yield (
            f"meshes simplified from {written} to {faces} faces, their surfaces shifted by at most "
            f"{1e3 * meshes.shift:.2g} mm (root mean square)"
        )


def _short(name: str) -> str:
    return name if len(name) <= LONGEST else f"…{name[-LONGEST:]}"


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
