"""Shapes of an MJCF file that are drawn, as <visual> elements of URDF links: those of groups 0 to 2, as in MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from bellcrank.robot.formats.mjcf_bodies import MjcfBody
from bellcrank.robot.formats.mjcf_compiler import Defaults
from bellcrank.robot.formats.mjcf_element import MjcfElement
from bellcrank.robot.formats.mjcf_meshes import MjcfMeshes
from bellcrank.robot.formats.mjcf_placement import Array
from bellcrank.robot.formats.mjcf_shapes import MjcfShape
from bellcrank.robot.formats.mjcf_urdf import origin
from bellcrank.robot.formats.xml_tree import quoted

LAST_GROUP = 2  # MuJoCo's viewer shows groups 0 to 2


class Visuals:
    """The <visual> elements of bodies; `undrawn` are kinds of shapes that are not drawn."""

    def __init__(self, root: MjcfElement, defaults: Defaults, meshes: MjcfMeshes) -> None:
        self._meshes = meshes
        self._colours: dict[str, str] = {}
        self.undrawn: set[str] = set()
        for asset in root.find_all("asset"):
            for material in asset.find_all("material"):
                colour = defaults.resolved(material, "material").attributes.get("rgba")
                if colour is not None:
                    self._colours[material.name] = colour

    def of(self, bodies: Sequence[MjcfBody]) -> Mapping[str, str]:
        """The <visual> elements by the name of the body."""
        return {body.name: "".join(map(self._visual, body.shapes)) for body in bodies[1:] if body.shapes}

    def _visual(self, shape: MjcfShape) -> str:
        if shape.group > LAST_GROUP:
            return ""
        drawn = self._mesh(str(shape.mesh)) if shape.kind == "mesh" else _primitive(shape)
        if drawn is None:
            self.undrawn.add(shape.kind)
            return ""
        geometry, place = drawn
        colour = shape.element.attributes.get("rgba") or self._colours.get(shape.element.attributes.get("material", ""))
        paint = f'<material name=""><color rgba={quoted(colour)}/></material>' if colour else ""
        return f"<visual>{origin(shape.place @ place)}<geometry>{geometry}</geometry>{paint}</visual>"

    def _mesh(self, name: str) -> tuple[str, Array] | None:
        """The <mesh> of a URDF and the placement of it in the shape."""
        file = self._meshes.file(name)
        drawing = None if file is None else self._meshes.drawing(name)
        if file is None or drawing is None:
            return None
        scale = " ".join(repr(float(factor)) for factor in drawing[0])
        return f'<mesh filename={quoted(file)} scale="{scale}"/>', drawing[1]


def _primitive(shape: MjcfShape) -> tuple[str, Array] | None:
    """The element of a URDF for a shape, and the placement of it in the shape; None for what a URDF cannot say."""
    if not shape.size or shape.kind == "ellipsoid" or shape.mesh is not None:
        return None
    if shape.kind == "box":
        geometry = f'<box size="{" ".join(repr(2.0 * side) for side in shape.size)}"/>'
    elif shape.kind == "sphere":
        geometry = f'<sphere radius="{shape.size[0]!r}"/>'
    else:
        geometry = f'<{shape.kind} radius="{shape.size[0]!r}" length="{2.0 * shape.size[1]!r}"/>'
    return geometry, np.eye(4)
