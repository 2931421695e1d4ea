"""Mass and inertia of MJCF bodies: from <inertial>, or from their shapes, within the bounds of <compiler>."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bellcrank.robot.formats.mjcf_compiler import Compiler
from bellcrank.robot.formats.mjcf_element import MjcfElement
from bellcrank.robot.formats.mjcf_meshes import MjcfMeshes
from bellcrank.robot.formats.mjcf_placement import Array
from bellcrank.robot.formats.mjcf_shapes import MjcfShape, inertia_of


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
