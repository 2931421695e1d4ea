"""Reading COLLADA (.dae): the geometry of its scene in metres, one part a colour.

As RViz and Pinocchio do, the file's unit is applied and its up axis is not. After "COLLADA: Digital Asset Schema
Release 1.4.1", Khronos 2008.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from bellcrank.replays.mesh_files import GREY, MOST_FACES, Beside, Colour, MeshError, Part, clipped, texture_colour

MOST_DEPTH, MOST_INSTANCES = 50, 20_000  # nodes may stand for other nodes: more than this is no robot's part

Array = NDArray[np.float64]
Element = ElementTree.Element


def read_collada(data: bytes, beside: Beside) -> tuple[Part, ...]:
    """The parts of a file's scene (of all its geometries where it has none); MeshError where it is no COLLADA."""
    if b"<!ENTITY" in data or b"<!DOCTYPE" in data:
        raise MeshError("declares XML entities, which are not read")
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise MeshError(f"is not well-formed XML ({error})") from None
    return _File(root, beside).parts()


class _File:
    """A parsed file: its elements by id, and what was read of them so far."""

    def __init__(self, root: Element, beside: Beside) -> None:
        for element in root.iter():
            element.tag = element.tag.rpartition("}")[2]
        self.root, self.beside = root, beside
        self.by_id = {name: element for element in root.iter() if (name := element.get("id"))}
        self.pieces: dict[str, list[tuple[str, Array, NDArray[np.int64]]]] = {}
        self.colours: dict[str, Colour | None] = {}
        self.instances, self.faces = 0, 0

    def parts(self) -> tuple[Part, ...]:
        unit = self.root.find("asset/unit")
        meter = float(unit.get("meter", 1.0)) if unit is not None else 1.0
        place = np.diag([meter, meter, meter, 1.0])
        instance = self.root.find("scene/instance_visual_scene")
        scene = self.target(instance) if instance is not None else self.root.find("library_visual_scenes/visual_scene")
        if scene is not None:
            return tuple(part for node in scene.findall("node") for part in self.node(node, place, 0))
        names = [g.get("id", "") for g in self.root.findall("library_geometries/geometry")]
        return tuple(part for name in names for part in self.placed(name, {}, place))

    def target(self, element: Element | None) -> Element | None:
        """The element that a url or target attribute points to."""
        link = "" if element is None else element.get("url") or element.get("target") or ""
        return self.by_id.get(link.removeprefix("#"))

    def node(self, node: Element, place: Array, depth: int) -> Iterator[Part]:
        if depth > MOST_DEPTH:
            raise MeshError("nests its nodes too deeply")
        place = place @ _transform(node)
        for child in node:
            if child.tag == "node":
                yield from self.node(child, place, depth + 1)
            elif child.tag == "instance_node" and (found := self.target(child)) is not None:
                self.count()
                yield from self.node(found, place, depth + 1)
            elif child.tag in ("instance_geometry", "instance_controller"):
                yield from self.instance(child, place)

    def instance(self, instance: Element, place: Array) -> Iterator[Part]:
        materials = {m.get("symbol", ""): self.target(m) for m in instance.iter("instance_material")}
        name = instance.get("url", "").removeprefix("#")
        if instance.tag == "instance_controller":
            skin = None if (controller := self.target(instance)) is None else controller.find("skin")
            name = "" if skin is None else skin.get("source", "").removeprefix("#")
        yield from self.placed(name, materials, place)

    def placed(self, name: str, materials: dict[str, Element | None], place: Array) -> Iterator[Part]:
        self.count()
        if not np.isfinite(place).all():
            raise MeshError("holds numbers that are not finite")
        if name not in self.pieces:
            self.pieces[name] = list(self.geometry(self.by_id.get(name)))
        for symbol, points, faces in self.pieces[name]:
            self.faces += len(faces)
            if self.faces > MOST_FACES:
                raise MeshError(f"has more than the {MOST_FACES} triangles that are read")
            material = materials.get(symbol)
            yield Part(
                points @ place[:3, :3].T + place[:3, 3],
                faces if np.linalg.det(place[:3, :3]) > 0.0 else faces[:, ::-1],
                self.colour(self.by_id.get(symbol) if material is None else material),
            )

    def count(self) -> None:
        self.instances += 1
        if self.instances > MOST_INSTANCES:
            raise MeshError("places more parts than a robot's link has")

    def geometry(self, geometry: Element | None) -> Iterator[tuple[str, Array, NDArray[np.int64]]]:
        mesh = None if geometry is None else geometry.find("mesh")
        for group in mesh if mesh is not None else ():
            if group.tag not in ("triangles", "polylist", "polygons", "tristrips", "trifans"):
                continue
            inputs = group.findall("input")
            vertex = next((i for i in inputs if i.get("semantic") == "VERTEX"), None)
            if vertex is None:
                continue
            stride = 1 + max(int(i.get("offset", 0)) for i in inputs)
            runs = [
                np.array((p.text or "").split(), dtype=np.int64).reshape(-1, stride)[:, int(vertex.get("offset", 0))]
                for p in group.iter("p")
            ]
            faces = _triangles(group, runs)
            if len(faces):
                yield group.get("material", ""), self.positions(vertex), faces

    def positions(self, vertex: Element) -> Array:
        vertices = self.by_id[vertex.get("source", "").removeprefix("#")]
        source = next(i for i in vertices.findall("input") if i.get("semantic") == "POSITION").get("source", "")
        floats, accessor = (self.by_id[source.removeprefix("#")].find(x) for x in ("float_array", ".//accessor"))
        if floats is None:
            raise MeshError("is broken (positions without a float_array)")
        stride = 3 if accessor is None else int(accessor.get("stride", 3))
        return np.array((floats.text or "").split(), dtype=float).reshape(-1, stride)[:, :3]

    def colour(self, material: Element | None) -> Colour | None:
        """The diffuse colour of a material, or the mean of its texture; None where it has neither."""
        effect = None if material is None else self.target(material.find("instance_effect"))
        if effect is None:
            return None
        name = effect.get("id", "")
        if name not in self.colours:
            self.colours[name] = self.diffuse(effect)
        return self.colours[name]

    def diffuse(self, effect: Element) -> Colour | None:
        diffuse = next(effect.iter("diffuse"), None)
        texture = None if diffuse is None else diffuse.find("texture")
        if texture is not None:
            return texture_colour(self.beside(unquote(self.image(effect, texture.get("texture", ""))))) or GREY
        text = "" if diffuse is None else diffuse.findtext("color") or ""
        if len(text.split()) < 3:
            return None
        red, green, blue = (float(word) for word in text.split()[:3])
        return clipped((red, green, blue, 1.0))  # opacity: files disagree on what 1 means

    def image(self, effect: Element, name: str) -> str:
        """The file of a texture: by way of its sampler and surface, of profile COMMON, to an <image>."""
        parameters = {p.get("sid"): p for p in effect.iter("newparam")}
        for _ in range(4):
            if name not in parameters:
                break
            inside = {x.tag: x for x in parameters[name].iter()}
            reference = inside.get("instance_image")
            if reference is not None:
                name = reference.get("url", "").removeprefix("#")
            else:
                following = inside.get("source", inside.get("init_from"))
                name = "" if following is None else (following.text or "").strip()
        image = self.by_id.get(name)
        words = [] if image is None else [(x.text or "").strip() for x in image.iter() if x.tag in ("init_from", "ref")]
        return next((word for word in words if word), name)


def _transform(node: Element) -> Array:
    """The node's placement (4, 4) in its parent, the product of its transformations in the order of the file."""
    place = np.eye(4)
    for child in node:
        step: Any = np.eye(4)
        if child.tag not in ("matrix", "translate", "rotate", "scale"):
            continue
        numbers = np.array((child.text or "").split(), dtype=float)
        if child.tag == "matrix":
            step = numbers.reshape(4, 4)
        elif child.tag == "translate":
            step[:3, 3] = numbers
        elif child.tag == "scale":
            step[:3, :3] = np.diag(numbers.reshape(3))
        else:
            from scipy.spatial.transform import Rotation

            axis = numbers[:3] / max(float(np.linalg.norm(numbers[:3])), 1e-12)
            step[:3, :3] = Rotation.from_rotvec(axis * np.radians(numbers[3])).as_matrix()
        place = place @ step
    return place


def _triangles(group: Element, runs: list[NDArray[np.int64]]) -> NDArray[np.int64]:
    """Faces (m, 3) of the vertex numbers of a <triangles>, <polylist>, <polygons>, <tristrips> or <trifans>."""
    empty = np.zeros((0, 3), dtype=np.int64)
    if not runs:
        return empty
    if group.tag == "triangles":
        return np.concatenate(runs).reshape(-1, 3)
    if group.tag == "tristrips":
        strips = [np.stack([run[:-2], run[1:-1], run[2:]], axis=1) for run in runs if len(run) >= 3]
        for strip in strips:
            strip[1::2] = strip[1::2, [1, 0, 2]]
        return np.concatenate([empty, *strips])
    corners = np.concatenate(runs)
    if group.tag == "polylist":
        sizes = np.array((group.findtext("vcount") or "").split(), dtype=np.int64)
        if sizes.sum() != len(corners) or (sizes < 0).any():
            raise MeshError("is broken (a polylist does not have as many corners as it says)")
    else:
        sizes = np.array([len(run) for run in runs])
    # a polygon of n corners is a fan of n - 2 triangles round its first
    fans = np.maximum(sizes - 2, 0)
    first = np.repeat(np.cumsum(sizes) - sizes, fans)
    turn = np.arange(fans.sum()) - np.repeat(np.cumsum(fans) - fans, fans)
    return np.asarray(corners[np.stack([first, first + turn + 1, first + turn + 2], axis=1)])
