"""Meshes of an MJCF file: their files, and the mass and inertia of bodies of that shape.

Inertia: integrals over the tetrahedra between the triangles and a point, as in B. Mirtich, "Fast and accurate
computation of polyhedral mass properties", J. Graphics Tools 1(2), 1996. MuJoCo's default ("legacy") takes their
volumes as positive, first from the centroid of the surface, then from the centre of gravity that follows: more than the
volume of a mesh that is not star-shaped. MuJoCo keeps vertices in single precision, so that both agree to about 1e-7.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Final

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from bellcrank.arrays import Array
from bellcrank.files.access import FileAccess, read_bytes
from bellcrank.messages import format_value, unknown_name
from bellcrank.robot.formats.mesh_path import find_mesh
from bellcrank.robot.formats.mjcf_compiler import Compiler, Defaults
from bellcrank.robot.formats.mjcf_element import MjcfElement
from bellcrank.robot.formats.mjcf_placement import inverse, placement

MODES: Final = ("legacy", "exact", "convex", "shell")
_HEADER, _TRIANGLE = 84, 50  # bytes of a binary STL file


@dataclass(frozen=True)
class Solid:
    """Volume (m³; the area, m², of a shell), its centre (3,), and second moments about it (3, 3): ∫ r rᵀ dV."""

    volume: float
    center: Array
    moments: Array

    @property
    def inertia(self) -> Array:
        """The inertia about the centre for the density 1."""
        return np.asarray(np.trace(self.moments) * np.eye(3) - self.moments)


class MjcfMeshes:
    """The <mesh> assets of a file by name."""

    def __init__(
        self, root: MjcfElement, compiler: Compiler, defaults: Defaults, source: Path, access: FileAccess
    ) -> None:
        self._folder, self._source, self._access = compiler.mesh_folder, source, access
        self._elements: dict[str, MjcfElement] = {}
        self._solids: dict[str, Solid] = {}
        for asset in root.find_all("asset"):
            for mesh in asset.find_all("mesh"):
                name = mesh.name or PurePosixPath(mesh.attributes.get("file", "")).stem
                self._elements[name] = defaults.resolved(mesh, "mesh")

    def file(self, name: str) -> str | None:
        """The name of a mesh's file, relative to the main file; None where it has none."""
        element = self._elements.get(name)
        file = "" if element is None else element.attributes.get("file", "")
        return str(PurePosixPath(self._folder, file)) if file else None

    def missing(self) -> list[str]:
        """The files that are not there, or may not be read."""
        return list(dict.fromkeys(str(self.file(name)) for name in self._elements if self.is_missing(name)))

    def is_missing(self, name: str) -> bool:
        """Whether the file of a mesh is not there, or may not be read."""
        file = self.file(name)
        return file is not None and find_mesh(file, self._source, self._access) is None

    def drawing(self, name: str) -> tuple[Array, Array] | None:
        """The scale (3,) of a mesh and the placement (4, 4) of what is scaled by it; None where there is no such."""
        scale, place = self._scale(name), self._from_reference(name)
        turned = not np.array_equal(place[:3, :3], np.eye(3))
        if turned and not (scale == scale[0]).all():
            return None
        return scale, placement(scale * place[:3, 3], Rotation.from_matrix(place[:3, :3]))

    def _scale(self, name: str) -> Array:
        return np.array(self._elements[name].vector("scale", (1.0, 1.0, 1.0)))

    def _from_reference(self, name: str) -> Array:
        """What moves the frame of refpos and refquat to the origin, before the mesh is scaled."""
        element = self._elements[name]
        w, x, y, z = element.vector("refquat", (1.0, 0.0, 0.0, 0.0))
        if not any((w, x, y, z)):
            raise element.fail("refquat: is zero; expected a quaternion w x y z")
        turn = Rotation.from_quat([x, y, z, w])
        return inverse(placement(np.array(element.vector("refpos", (0.0, 0.0, 0.0))), turn))

    def solid(self, geom: MjcfElement, name: str) -> Solid:
        """Volume and moments of a mesh, which a <geom> names. Raises InputError."""
        if name not in self._elements:
            raise geom.fail(f"mesh: {unknown_name('mesh', name, self._elements)}")
        if name not in self._solids:
            self._solids[name] = self._measured(geom, name)
        return self._solids[name]

    def _measured(self, geom: MjcfElement, name: str) -> Solid:
        element = self._elements[name]
        triangles = self._triangles(geom, name)
        place = self._from_reference(name)
        triangles = (triangles @ place[:3, :3].T + place[:3, 3]) * self._scale(name)
        mode = element.choice("inertia", "legacy", *MODES)
        if mode == "exact" and not _is_oriented(triangles):
            raise element.fail(
                'two faces pass an edge in the same direction; turn one of them or write inertia="legacy"'
            )
        if mode == "convex":
            triangles = _hull(element, triangles.reshape(-1, 3))
        found = _MEASURES[mode](triangles)
        if not found.volume > 0.0:
            raise element.fail("the mesh encloses no volume; give the bodies of this shape an <inertial>")
        return found

    def _triangles(self, geom: MjcfElement, name: str) -> Array:
        """The triangles (n, 3, 3) of a mesh as its file has them."""
        element = self._elements[name]
        vertices = element.numbers("vertex", 12, 10**6)
        if vertices is not None:
            points = np.array(vertices[: len(vertices) // 3 * 3]).reshape(-1, 3)
            faces = element.numbers("face", 3, 10**6)
            return _hull(element, points) if faces is None else _indexed(element, points, np.array(faces))
        file = self.file(name)
        path = None if file is None else find_mesh(file, self._source, self._access)
        if path is None:
            what = "has no file" if file is None else f"is in the file {format_value(file)}, which is missing"
            raise geom.fail(
                f"the body has no <inertial>, so that its mass is that of its shapes, and the mesh '{name[:80]}' "
                f"{what}; put the file there or give the body an <inertial>"
            )
        reader = {".stl": _read_stl, ".obj": _read_obj}.get(path.suffix.lower())
        if reader is None:
            raise geom.fail(f"the mass of meshes is read from .stl and .obj files, not {path.name}; give an <inertial>")
        return reader(element, read_bytes(path))


def _read_stl(element: MjcfElement, data: bytes) -> Array:
    """The triangles of a binary STL file."""
    count = int.from_bytes(data[80:_HEADER], "little")
    if count == 0 or len(data) != _HEADER + _TRIANGLE * count:
        raise element.fail("the file is not a binary STL file; save it as one")
    rows = np.frombuffer(data, np.uint8, offset=_HEADER).reshape(count, _TRIANGLE)
    found = np.ascontiguousarray(rows[:, 12:48]).view("<f4").reshape(count, 3, 3).astype(float)
    return _finite(element, found)


def _read_obj(element: MjcfElement, data: bytes) -> Array:
    """The triangles of a Wavefront OBJ file; faces of more corners are split from their first one."""
    points: list[list[float]] = []
    faces: list[tuple[float, float, float]] = []
    for line in data.decode("utf-8", "replace").splitlines():
        words = line.split()
        try:
            if words[:1] == ["v"]:
                points.append([float(word) for word in words[1:4]])
            elif words[:1] == ["f"]:
                corners = [float(int(word.partition("/")[0])) for word in words[1:]]
                numbers = [k - 1 if k > 0 else len(points) + k for k in corners]
                faces.extend((numbers[0], *pair) for pair in pairwise(numbers[1:]))
        except (ValueError, IndexError, OverflowError):
            raise element.fail(f"the OBJ file has a line that is no vertex or face: {format_value(line)}") from None
    if not faces or any(len(point) != 3 for point in points):
        raise element.fail("the OBJ file has no triangles")
    return _indexed(element, np.array(points), np.array(faces, dtype=float).ravel())


def _indexed(element: MjcfElement, points: Array, faces: Array) -> Array:
    rows = faces[: len(faces) // 3 * 3].reshape(-1, 3)
    if rows.min() < 0.0 or rows.max() >= len(points) or (rows != np.floor(rows)).any():
        raise element.fail("a face names a vertex that does not exist")
    return _finite(element, points[rows.astype(int)])


def _finite(element: MjcfElement, triangles: Array) -> Array:
    if not np.isfinite(triangles).all() or np.abs(triangles).max() > 1e30:
        raise element.fail("the mesh has vertices that are not finite")
    return triangles


def _hull(element: MjcfElement, points: Array) -> Array:
    """The triangles of the convex hull."""
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        raise element.fail("the mesh is flat: it has no convex hull") from None
    triangles = points[hull.simplices]
    inside = points[hull.vertices].mean(axis=0)
    edges = triangles - inside
    turned = np.einsum("ni,ni->n", edges[:, 0], np.cross(edges[:, 1], edges[:, 2])) < 0.0
    triangles[turned] = triangles[turned][:, ::-1]
    return np.asarray(triangles)


def _is_oriented(triangles: Array) -> bool:
    """Whether neighbouring triangles have the same side outside: no edge is passed twice in one direction."""
    corners = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    edges = np.vstack([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    return len(np.unique(edges, axis=0)) == len(edges)


def _tetrahedra(triangles: Array, point: Array) -> tuple[Array, Array]:
    """Corners (n, 3, 3) from a point, and signed volumes (n,), of the tetrahedra between triangles and the point."""
    corners = triangles - point
    return corners, np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0


def _moments(corners: Array, weights: Array, factor: float) -> Array:
    """∫ r rᵀ over tetrahedra with a corner at the origin (1/20) or triangles (1/12), of these volumes or areas."""
    total = corners.sum(axis=1)
    squares = np.einsum("n,nki,nkj->ij", weights, corners, corners)
    return np.asarray(factor * (squares + np.einsum("n,ni,nj->ij", weights, total, total)))


def _surface_centre(triangles: Array) -> tuple[Array, Array]:
    """The areas (n,) and the centre of a surface (3,)."""
    areas = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1) / 2.0
    total = float(areas.sum())
    return areas, (areas @ triangles.mean(axis=1) / total if total > 0.0 else np.zeros(3))


def _exact(triangles: Array) -> Solid:
    return _solid(triangles, lambda volumes: volumes if volumes.sum() > 0.0 else -volumes)


def _legacy(triangles: Array) -> Solid:
    return _solid(triangles, np.abs)


def _solid(triangles: Array, counted: Callable[[Array], Array]) -> Solid:
    start = _surface_centre(triangles)[1]
    corners, volumes = _tetrahedra(triangles, start)
    volumes = counted(volumes)
    if not volumes.sum() > 0.0:
        return Solid(0.0, start, np.zeros((3, 3)))
    center = start + volumes @ corners.sum(axis=1) / 4.0 / volumes.sum()
    corners, volumes = _tetrahedra(triangles, center)
    volumes = counted(volumes)
    return Solid(float(volumes.sum()), center, _moments(corners, volumes, 1.0 / 20.0))


def _shell(triangles: Array) -> Solid:
    areas, center = _surface_centre(triangles)
    return Solid(float(areas.sum()), center, _moments(triangles - center, areas, 1.0 / 12.0))


_MEASURES: Final[dict[str, Callable[[Array], Solid]]] = {
    "legacy": _legacy, "exact": _exact, "convex": _exact, "shell": _shell,
}  # fmt: skip
