"""Mass and inertia of MJCF bodies: from <inertial>, or from their shapes, within the bounds of <compiler>."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bellcrank.robot.mjcf_compiler import Compiler
from bellcrank.robot.mjcf_element import MjcfElement
from bellcrank.robot.mjcf_placement import Array
from bellcrank.robot.mjcf_shapes import Shape, inertia_of


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


def body_inertia(
    body: MjcfElement, frame_of_inertial: Array, inertial: MjcfElement | None, shapes: Sequence[Shape],
    compiler: Compiler,
) -> BodyInertia:  # fmt: skip
    """The inertia of a body as MuJoCo's compiler finds it. Raises InputError."""
    if inertial is not None and compiler.inertia_from_geoms != "true":
        found = _given(inertial, frame_of_inertial, compiler)
    elif compiler.inertia_from_geoms == "false":
        found = NOTHING
    else:
        found = _of_shapes(shapes, compiler)
    return _bounded(body, found, compiler)


def _given(inertial: MjcfElement, frame: Array, compiler: Compiler) -> BodyInertia:
    """The inertia that an <inertial> gives."""
    inertial.required("pos")
    inertial.required("mass")
    full, diagonal = inertial.numbers("fullinertia", 6, 6), inertial.numbers("diaginertia", 3, 3)
    place = frame @ compiler.angles.placement(inertial)
    if full is not None and diagonal is not None:
        raise inertial.fail("has diaginertia and fullinertia; remove one of them")
    if full is not None:
        xx, yy, zz, xy, xz, yz = full
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    else:
        about = np.diag(diagonal or (0.0, 0.0, 0.0))
    turn = place[:3, :3]
    return BodyInertia(inertial.number("mass", 0.0, 0.0), place[:3, 3], turn @ about @ turn.T)


def _of_shapes(shapes: Sequence[Shape], compiler: Compiler) -> BodyInertia:
    """The inertia of the shapes whose groups count: sums of masses, first moments and moved inertias."""
    least, most = compiler.inertia_groups
    parts = []
    for shape in shapes:
        if least <= shape.group <= most:
            mass, principal = inertia_of(shape)
            if mass > 0.0:
                turn = shape.place[:3, :3]
                parts.append(BodyInertia(mass, shape.place[:3, 3], turn @ np.diag(principal) @ turn.T))
    if not parts:
        return NOTHING
    mass = sum(part.mass for part in parts)
    center = sum((part.mass * part.center for part in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        arm = part.center - center
        inertia += part.inertia + part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return BodyInertia(mass, center, inertia)


def _bounded(body: MjcfElement, found: BodyInertia, compiler: Compiler) -> BodyInertia:
    """The inertia after boundmass, boundinertia and balanceinertia, which act on the principal inertias."""
    if not (compiler.least_mass or compiler.least_inertia or compiler.balance_inertia):
        return found
    mass = max(found.mass, compiler.least_mass)
    values, axes = np.linalg.eigh(found.inertia)
    values = np.maximum(values, compiler.least_inertia)
    if compiler.balance_inertia and values[0] + values[1] < values[2]:
        values = np.full(3, values.mean())
    return BodyInertia(mass, found.center, axes @ np.diag(values) @ axes.T)


def total_scale(bodies: Sequence[BodyInertia], compiler: Compiler) -> float:
    """The factor by which `settotalmass` multiplies all masses and inertias; 1 without it."""
    total = sum(body.mass for body in bodies)
    return compiler.total_mass / total if compiler.total_mass and total > 0.0 else 1.0
