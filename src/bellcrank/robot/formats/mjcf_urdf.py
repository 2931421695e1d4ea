"""The bodies of an MJCF file as the elements of a URDF in the extended sense.

Coordinates are MuJoCo's: at `ref` a joint is where the file places its body, and a free joint's position is that of the
body in the world. A body with several joints, or with a joint away from its origin, gets massless links between. Shapes
of groups 0 to 2 are drawn, as in MuJoCo.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from bellcrank.arrays import Array
from bellcrank.robot.formats.mjcf_bodies import MOVING, MjcfBody, MjcfJoint
from bellcrank.robot.formats.mjcf_compiler import Defaults
from bellcrank.robot.formats.mjcf_element import MjcfElement
from bellcrank.robot.formats.mjcf_meshes import MjcfMeshes
from bellcrank.robot.formats.mjcf_placement import placement, translation
from bellcrank.robot.formats.mjcf_shapes import MjcfShape
from bellcrank.robot.formats.urdf_writing import Names, element, inertial_element, joint_element, numbers, shape_element
from bellcrank.robot.formats.xml_tree import XmlElement

TYPES = {"hinge": "revolute", "slide": "prismatic", "ball": "spherical", "free": "floating"}
LAST_GROUP = 2  # MuJoCo's viewer shows groups 0 to 2


class BodyWriter:
    """Makes elements of named bodies; `visuals` makes those of their shapes, `efforts` are largest torques by joint."""

    def __init__(self, bodies: Sequence[MjcfBody], visuals: Visuals | None, efforts: Mapping[str, float]) -> None:
        self._bodies, self._visuals, self._efforts = bodies, visuals, efforts
        self._links = Names([*(b.name for b in bodies), *(s.link for b in bodies for s in b.sites)])
        self._joints = Names([joint.name for body in bodies for joint in body.joints])

    def robot(self, name: str) -> XmlElement:
        """The <robot>."""
        return element("robot", 1, *self._parts(), name=name)

    def _parts(self) -> Iterator[XmlElement]:
        for body in self._bodies:
            line = body.element.line
            drawn = () if self._visuals is None or body is self._bodies[0] else self._visuals.of(body)
            yield element("link", line, *_inertial(body), *drawn, name=body.name)
            if body is not self._bodies[0]:
                yield from self._chain(body)
            for site in body.sites:
                yield element("link", line, name=site.link)
                yield self._fixed(site.link, body.name, site.link, site.place, line)

    def _chain(self, body: MjcfBody) -> Iterator[XmlElement]:
        """The joints from the parent's link to the body's link, and the links between."""
        at, place = self._bodies[body.parent].name, body.place
        for k, joint in enumerate(body.joints):
            if joint.kind == "free":
                yield self._moving(joint, at, body.name, np.eye(4))
                return
            last = k == len(body.joints) - 1 and not joint.pos.any()
            child = body.name if last else self._links.new(f"{body.name}_after_{joint.name}")
            if not last:
                yield element("link", joint.element.line, name=child)
            yield self._moving(joint, at, child, place @ translation(joint.pos) @ _to_zero(joint))
            at, place = child, translation(-joint.pos)
        if at != body.name:
            yield self._fixed(body.name, at, body.name, place, body.element.line)

    def _fixed(self, name: str, parent: str, child: str, place: Array, line: int) -> XmlElement:
        return joint_element(self._joints.new(f"{name}_fixed"), "fixed", parent, child, place, line)

    def _moving(self, joint: MjcfJoint, parent: str, child: str, place: Array) -> XmlElement:
        kind = "continuous" if joint.kind == "hinge" and joint.range is None else TYPES[joint.kind]
        line, parts = joint.element.line, []
        if joint.kind in MOVING:
            parts.append(element("axis", line, xyz=numbers(joint.axis)))
            lower, upper = joint.range or (None, None)
            effort = self._efforts.get(joint.name)
            if (lower, effort) != (None, None):
                parts.append(element("limit", line, lower=lower, upper=upper, effort=effort))
        if joint.kind != "free" and (joint.damping[0] or joint.friction):
            parts.append(element("dynamics", line, damping=joint.damping[0], friction=joint.friction))
        return joint_element(joint.name, kind, parent, child, place, line, *parts)


def _to_zero(joint: MjcfJoint) -> Array:
    """What moves the joint from its reference to the coordinate 0."""
    if joint.kind == "hinge":
        return placement(np.zeros(3), Rotation.from_rotvec(-joint.ref * joint.axis))
    return translation(-joint.ref * joint.axis) if joint.kind == "slide" else np.eye(4)


def _inertial(body: MjcfBody) -> Iterator[XmlElement]:
    own = body.inertia
    if own.mass != 0.0 or own.inertia.any():
        i = (own.inertia + own.inertia.T) / 2.0
        line = body.element.line
        yield inertial_element(own.mass, element("origin", line, xyz=numbers(own.center)), i[np.triu_indices(3)], line)


class Visuals:
    """Makes <visual> elements of bodies; `undrawn` are kinds of shapes that are not drawn."""

    def __init__(self, root: MjcfElement, defaults: Defaults, meshes: MjcfMeshes) -> None:
        self._meshes = meshes
        self._colours: dict[str, str] = {}
        self.undrawn: set[str] = set()
        for asset in root.find_all("asset"):
            for material in asset.find_all("material"):
                colour = defaults.resolved(material, "material").attributes.get("rgba")
                if colour is not None:
                    self._colours[material.name] = colour

    def of(self, body: MjcfBody) -> Iterator[XmlElement]:
        """The <visual> elements of a body."""
        for shape in body.shapes:
            if shape.group > LAST_GROUP:
                continue
            line = shape.element.line
            drawn = self._mesh(str(shape.mesh), line) if shape.kind == "mesh" else _primitive(shape, line)
            if drawn is None:
                self.undrawn.add(shape.kind)
                continue
            given = shape.element.attributes
            colour = given.get("rgba") or self._colours.get(given.get("material", ""), "")
            yield shape_element("visual", shape.place @ drawn[1], drawn[0], colour, line)

    def _mesh(self, name: str, line: int) -> tuple[XmlElement, Array] | None:
        """The <mesh> of a URDF and the placement of it in the shape."""
        file = self._meshes.file(name)
        drawing = None if file is None else self._meshes.drawing(name)
        if file is None or drawing is None:
            return None
        return element("mesh", line, filename=file, scale=numbers(drawing[0])), drawing[1]


def _primitive(shape: MjcfShape, line: int) -> tuple[XmlElement, Array] | None:
    """The element of a URDF for a shape, and the placement of it in the shape; None for what a URDF cannot say."""
    if not shape.size or shape.kind == "ellipsoid" or shape.mesh is not None:
        return None
    if shape.kind == "box":
        return element("box", line, size=numbers(2.0 * side for side in shape.size)), np.eye(4)
    length = None if shape.kind == "sphere" else 2.0 * shape.size[1]
    return element(shape.kind, line, radius=shape.size[0], length=length), np.eye(4)
