"""Shapes of an MJCF file that are drawn, as <visual> elements of URDF links: those of groups 0 to 2, as in MuJoCo."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath
from xml.sax.saxutils import quoteattr

import numpy as np
from scipy.spatial.transform import Rotation

from bellcrank.files.access import FileAccess
from bellcrank.robot.mesh_path import find_mesh
from bellcrank.robot.mjcf_bodies import Body
from bellcrank.robot.mjcf_compiler import Compiler, Defaults
from bellcrank.robot.mjcf_element import MjcfElement
from bellcrank.robot.mjcf_placement import Array, inverse, placement
from bellcrank.robot.mjcf_shapes import Shape
from bellcrank.robot.mjcf_urdf import origin

LAST_GROUP = 2  # MuJoCo's viewer shows groups 0 to 2


class Visuals:
    """The <visual> elements of bodies; `missing` are mesh files that are not there, `undrawn` kinds of other shapes."""

    def __init__(self, root: MjcfElement, compiler: Compiler, defaults: Defaults) -> None:
        self._folder = compiler.mesh_folder
        self._meshes: dict[str, MjcfElement] = {}
        self._colours: dict[str, str] = {}
        self.undrawn: set[str] = set()
        for asset in root.find_all("asset"):
            for mesh in asset.find_all("mesh"):
                found = defaults.resolved(mesh, "mesh")
                self._meshes[mesh.name or PurePosixPath(mesh.attributes.get("file", "")).stem] = found
            for material in asset.find_all("material"):
                colour = defaults.resolved(material, "material").attributes.get("rgba")
                if colour is not None:
                    self._colours[material.name] = colour

    def of(self, bodies: Sequence[Body]) -> Mapping[str, str]:
        """The <visual> elements by the name of the body."""
        return {body.name: "".join(map(self._visual, body.shapes)) for body in bodies[1:] if body.shapes}

    def missing(self, source: Path, access: FileAccess) -> list[str]:
        """The mesh files that are not there, or may not be read."""
        files = dict.fromkeys(file for mesh in self._meshes.values() if (file := self._file(mesh)))
        return [file for file in files if find_mesh(file, source, access) is None]

    def _file(self, mesh: MjcfElement) -> str | None:
        file = mesh.attributes.get("file")
        return None if not file else str(PurePosixPath(self._folder, file))

    def _visual(self, shape: Shape) -> str:
        if shape.group > LAST_GROUP:
            return ""
        geometry, place = self._geometry(shape), shape.place
        if geometry is None:
            self.undrawn.add(shape.kind)
            return ""
        if shape.kind == "mesh":
            place = place @ inverse(_reference(self._meshes[str(shape.mesh)]))
        colour = shape.element.attributes.get("rgba") or self._colours.get(shape.element.attributes.get("material", ""))
        paint = f'<material name=""><color rgba={quoteattr(colour)}/></material>' if colour else ""
        return f"<visual>{origin(place)}<geometry>{geometry}</geometry>{paint}</visual>"

    def _geometry(self, shape: Shape) -> str | None:
        if shape.kind == "mesh":
            mesh = self._meshes.get(str(shape.mesh))
            file = None if mesh is None else self._file(mesh)
            if mesh is None or file is None:
                return None
            x, y, z = mesh.vector("scale", (1.0, 1.0, 1.0))
            return f'<mesh filename={quoteattr(file)} scale="{x!r} {y!r} {z!r}"/>'
        if len(shape.size) == 0 or shape.kind == "ellipsoid" or shape.mesh is not None:
            return None
        if shape.kind == "box":
            return f'<box size="{" ".join(repr(2.0 * side) for side in shape.size)}"/>'
        if shape.kind == "sphere":
            return f'<sphere radius="{shape.size[0]!r}"/>'
        return f'<{shape.kind} radius="{shape.size[0]!r}" length="{2.0 * shape.size[1]!r}"/>'


def _reference(mesh: MjcfElement) -> Array:
    """The placement in a mesh's own frame that MuJoCo makes its origin."""
    w, x, y, z = mesh.vector("refquat", (1.0, 0.0, 0.0, 0.0))
    return placement(np.array(mesh.vector("refpos", (0.0, 0.0, 0.0))), Rotation.from_quat([x, y, z, w]))
