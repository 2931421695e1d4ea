"""Shapes of MJCF bodies (<geom>), and mass and inertia of bodies.

These are from <inertial>, or from the shapes, of even density, within the bounds of <compiler>.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from bellcrank.arrays import Array
from bellcrank.messages import unknown_name
from bellcrank.robot.formats.mjcf_compiler import Compiler
from bellcrank.robot.formats.mjcf_element import MjcfElement
from bellcrank.robot.formats.mjcf_meshes import MjcfMeshes
from bellcrank.robot.formats.mjcf_placement import Angles, placement, z_to

SIZES: Final = {  # numbers of a shape's size, without and with `fromto`
    "sphere": (1, 0), "capsule": (2, 1), "cylinder": (2, 1), "ellipsoid": (3, 1), "box": (3, 1), "plane": (0, 0),
    "hfield": (0, 0), "mesh": (0, 0), "sdf": (0, 0),
}  # fmt: skip
MASSLESS = ("plane", "hfield")
LEAST_LENGTH, MOST_LENGTH = 1e-12, 1e12  # m
DENSITY = 1000.0  # kg/m³, MuJoCo's default


@dataclass(frozen=True)
class MjcfShape:
    """A <geom>: its kind, size (m: radius and half-length along z, half-axes or half-sides) and placement in the body.

    `mass` (kg) comes before `density` (kg/m³, or kg/m² of a shell).
    """

    kind: str
    size: tuple[float, ...]
    place: Array
    mass: float | None
    density: float
    shell: bool
    mesh: str | None
    element: MjcfElement

    @property
    def group(self) -> float:
        """The visualisation group."""
        return self.element.number("group", 0.0)

    @property
    def collides(self) -> bool:
        """Whether MuJoCo computes contacts of it with other shapes."""
        return bool(self.element.number("contype", 1.0)) or bool(self.element.number("conaffinity", 1.0))


def shape_of(geom: MjcfElement, angles: Angles, frame: Array) -> MjcfShape:
    """The shape of a resolved <geom>, in a frame (4, 4) of its body. Raises InputError."""
    kind = geom.attributes.get("type", "sphere")
    if kind not in SIZES:
        raise geom.fail(unknown_name("type", kind, SIZES))
    mesh = geom.attributes.get("mesh")
    size, place = geometry_of(geom, kind, angles, has_mesh=mesh is not None)
    mass = geom.number("mass", 0.0, 0.0) if "mass" in geom.attributes else None
    density = geom.number("density", DENSITY, 0.0)
    shell = geom.flag("shellinertia", False)
    return MjcfShape(kind, size, frame @ place, mass, density, shell, mesh, geom)


def geometry_of(
    geom: MjcfElement, kind: str, angles: Angles, has_mesh: bool = False
) -> tuple[tuple[float, ...], Array]:
    """The size and placement of a resolved <geom> or <site>. Raises InputError."""
    size = geom.numbers("size", 1, 3) or ()
    ends = geom.numbers("fromto", 6, 6)
    if ends is None or not SIZES[kind][1]:
        needed = 0 if has_mesh else SIZES[kind][0]
        _check_size(geom, kind, size, needed)
        return size[: SIZES[kind][0]], angles.placement(geom)
    _check_size(geom, kind, size, SIZES[kind][1])
    start, end = np.array(ends[:3]), np.array(ends[3:])
    length = float(np.linalg.norm(end - start))
    if length < 1e-14:
        raise geom.fail("fromto: the two points coincide; expected a segment")
    place = placement((start + end) / 2.0, z_to((start - end) / length))
    return (size[0], *([size[0]] if SIZES[kind][0] == 3 else []), length / 2.0), place


def _check_size(geom: MjcfElement, kind: str, size: tuple[float, ...], needed: int) -> None:
    if len(size) < needed:
        raise geom.fail(f"size: a {kind} needs {needed} numbers, m; found {len(size)}")
    for value in size[:needed]:
        if not LEAST_LENGTH <= value <= MOST_LENGTH:
            raise geom.fail(f"size: expected lengths from {LEAST_LENGTH:g} to {MOST_LENGTH:g} m; found {value:g}")


def inertia_of(shape: MjcfShape) -> tuple[float, Array]:
    """Mass (kg) and inertia (3,) about the principal axes (kg m²) of a primitive shape of even density.

    Solids: R. Featherstone, "Rigid Body Dynamics Algorithms", and any handbook; a capsule is a cylinder with two half
    balls, moved by the parallel-axis theorem. A shell has its mass on the surface. Raises InputError.
    """
    if shape.mass == 0.0 or (shape.mass is None and shape.density == 0.0) or shape.kind in MASSLESS:
        return 0.0, np.zeros(3)
    make = (_SHELLS if shape.shell else _SOLIDS).get(shape.kind)
    if make is None or len(shape.size) != SIZES[shape.kind][0]:
        kind = f"{shape.kind}{' shell' if shape.shell else ''}{' fitted to a mesh' if shape.mesh else ''}"
        raise shape.element.fail(f"the inertia of a {kind} is not computed; give its body an <inertial>")
    measure, radii = make(*shape.size)
    mass = shape.density * measure if shape.mass is None else shape.mass
    return mass, mass * np.array(radii)


Radii = tuple[float, float, float]  # inertia per mass about x, y, z, m²


def _sphere(r: float) -> tuple[float, Radii]:
    return 4.0 / 3.0 * math.pi * r**3, (0.4 * r * r,) * 3


def _ellipsoid(a: float, b: float, c: float) -> tuple[float, Radii]:
    return 4.0 / 3.0 * math.pi * a * b * c, ((b * b + c * c) / 5.0, (a * a + c * c) / 5.0, (a * a + b * b) / 5.0)


def _box(a: float, b: float, c: float) -> tuple[float, Radii]:
    return 8.0 * a * b * c, ((b * b + c * c) / 3.0, (a * a + c * c) / 3.0, (a * a + b * b) / 3.0)


def _cylinder(r: float, h: float) -> tuple[float, Radii]:
    across = r * r / 4.0 + h * h / 3.0
    return 2.0 * math.pi * r * r * h, (across, across, r * r / 2.0)


def _capsule(r: float, h: float) -> tuple[float, Radii]:
    tube, ball = 2.0 * math.pi * r * r * h, 4.0 / 3.0 * math.pi * r**3
    (across, _, along), whole = _cylinder(r, h)[1], tube + ball
    # a half ball: its centre of gravity is 3/8 r from its flat side, its inertia about a diameter of that 2/5 m r²
    ends = 0.4 * r * r - (0.375 * r) ** 2 + (h + 0.375 * r) ** 2
    x = (tube * across + ball * ends) / whole
    return whole, (x, x, (tube * along + ball * 0.4 * r * r) / whole)


def _sphere_shell(r: float) -> tuple[float, Radii]:
    return 4.0 * math.pi * r * r, (2.0 / 3.0 * r * r,) * 3


def _cylinder_shell(r: float, h: float) -> tuple[float, Radii]:
    side, ends = 4.0 * math.pi * r * h, 2.0 * math.pi * r * r
    x = (side * (r * r / 2.0 + h * h / 3.0) + ends * (r * r / 4.0 + h * h)) / (side + ends)
    return side + ends, (x, x, (side * r * r + ends * r * r / 2.0) / (side + ends))


def _capsule_shell(r: float, h: float) -> tuple[float, Radii]:
    side, ball = 4.0 * math.pi * r * h, 4.0 * math.pi * r * r
    # a half sphere: its centre of gravity is r/2 from its flat side, its inertia about a diameter of that 2/3 m r²
    ends = 2.0 / 3.0 * r * r - r * r / 4.0 + (h + r / 2.0) ** 2
    x = (side * (r * r / 2.0 + h * h / 3.0) + ball * ends) / (side + ball)
    return side + ball, (x, x, (side * r * r + ball * 2.0 / 3.0 * r * r) / (side + ball))


def _box_shell(a: float, b: float, c: float) -> tuple[float, Radii]:
    faces = 8.0 * np.array([b * c, a * c, a * b])  # two faces each, normal to x, y and z
    lengths = np.array([a, b, c])
    squares = np.empty(3)  # integral of the square of each coordinate over the surface
    for k in range(3):
        across = [j for j in range(3) if j != k]
        squares[k] = lengths[k] ** 2 * (faces[k] + faces[across].sum() / 3.0)
    area = float(faces.sum())
    x, y, z = ((squares.sum() - squares) / area).tolist()
    return area, (x, y, z)


Formula = Callable[..., tuple[float, Radii]]  # of the size: volume (m³) or area (m²), and inertia per mass
_SOLIDS: Final[dict[str, Formula]] = {
    "sphere": _sphere, "ellipsoid": _ellipsoid, "box": _box, "cylinder": _cylinder, "capsule": _capsule,
}  # fmt: skip
_SHELLS: Final[dict[str, Formula]] = {
    "sphere": _sphere_shell, "box": _box_shell, "cylinder": _cylinder_shell, "capsule": _capsule_shell,
}  # fmt: skip


# ---- mass and inertia of bodies


@dataclass(frozen=True)
class BodyInertia:
    """Mass (kg), centre of gravity (3,) in the body (m), and inertia (3, 3) about it in the body's axes (kg m²)."""

    mass: float
    center: Array
    inertia: Array

    def scaled(self, factor: float) -> BodyInertia:
        """The same body of another mass."""
        return BodyInertia(self.mass * factor, self.center, self.inertia * factor)


NOTHING = BodyInertia(0.0, np.zeros(3), np.zeros((3, 3)))


@dataclass(frozen=True)
class InertiaReader:
    """Finds inertias of bodies as MuJoCo's compiler does."""

    compiler: Compiler
    meshes: MjcfMeshes

    def of(
        self, inertials: Sequence[tuple[MjcfElement, Array]], shapes: Sequence[MjcfShape], moves: bool
    ) -> BodyInertia | None:
        """The inertia of a body: of its <inertial>, with its frame (4, 4), or of its shapes.

        None where the body does not move and its inertia is that of a mesh whose file is missing. Raises InputError.
        """
        if not moves and not inertials and any(self._is_missing(shape) for shape in shapes):
            return None
        if len(inertials) > 1:
            raise inertials[1][0].fail("is the second <inertial> of its body; remove one of them")
        if inertials and self.compiler.inertia_from_geoms != "true":
            return self._bounded(self._given(*inertials[0]))
        return self._bounded(NOTHING if self.compiler.inertia_from_geoms == "false" else self._of_shapes(shapes))

    def _given(self, inertial: MjcfElement, frame: Array) -> BodyInertia:
        """The inertia that an <inertial> gives."""
        inertial.required("pos")
        inertial.required("mass")
        full, diagonal = inertial.numbers("fullinertia", 6, 6), inertial.numbers("diaginertia", 3, 3)
        place = frame @ self.compiler.angles.placement(inertial)
        if full is not None and diagonal is not None:
            raise inertial.fail("has diaginertia and fullinertia; remove one of them")
        if full is not None:
            xx, yy, zz, xy, xz, yz = full
            about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            about = np.diag(diagonal or (0.0, 0.0, 0.0))
        return _moved(BodyInertia(inertial.number("mass", 0.0, 0.0), np.zeros(3), about), place)

    def _of_shapes(self, shapes: Sequence[MjcfShape]) -> BodyInertia:
        """The inertia of the shapes whose groups count: sums of masses, first moments and moved inertias."""
        least, most = self.compiler.inertia_groups
        parts = [self._of_shape(shape) for shape in shapes if least <= shape.group <= most]
        mass = sum(part.mass for part in parts)
        if mass == 0.0:
            return NOTHING
        center = sum((part.mass * part.center for part in parts), np.zeros(3)) / mass
        inertia = np.zeros((3, 3))
        for part in parts:
            arm = part.center - center
            inertia += part.inertia + part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return BodyInertia(mass, center, inertia)

    def _is_missing(self, shape: MjcfShape) -> bool:
        return shape.kind == "mesh" and self.meshes.is_missing(str(shape.mesh))

    def _of_shape(self, shape: MjcfShape) -> BodyInertia:
        """The inertia of one shape, in the frame of its body."""
        if shape.kind == "mesh" and shape.mass != 0.0 and not (shape.mass is None and shape.density == 0.0):
            solid = self.meshes.solid(shape.element, str(shape.mesh))
            density = shape.density if shape.mass is None else shape.mass / solid.volume
            return _moved(BodyInertia(density * solid.volume, solid.center, density * solid.inertia), shape.place)
        mass, principal = (0.0, np.zeros(3)) if shape.kind == "mesh" else inertia_of(shape)
        return _moved(BodyInertia(mass, np.zeros(3), np.diag(principal)), shape.place)

    def _bounded(self, found: BodyInertia) -> BodyInertia:
        """The inertia after boundmass, boundinertia and balanceinertia, which act on the principal inertias."""
        compiler = self.compiler
        if not (compiler.least_mass or compiler.least_inertia or compiler.balance_inertia):
            return found
        values, axes = np.linalg.eigh(found.inertia)
        values = np.maximum(values, compiler.least_inertia)
        if compiler.balance_inertia and values[0] + values[1] < values[2]:
            values = np.full(3, values.mean())
        return BodyInertia(max(found.mass, compiler.least_mass), found.center, axes @ np.diag(values) @ axes.T)


def _moved(body: BodyInertia, place: Array) -> BodyInertia:
    """The inertia of a body that is placed in another one, in the frame of that one."""
    turn = place[:3, :3]
    return BodyInertia(body.mass, place[:3, 3] + turn @ body.center, turn @ body.inertia @ turn.T)


def total_scale(bodies: Sequence[BodyInertia], compiler: Compiler) -> float:
    """The factor by which `settotalmass` multiplies all masses and inertias; 1 without it."""
    total = sum(body.mass for body in bodies)
    return compiler.total_mass / total if compiler.total_mass and total > 0.0 else 1.0
