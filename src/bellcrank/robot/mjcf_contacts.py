"""Floors of an MJCF file, and the shapes of moving bodies that would touch them; contacts are not modelled."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from bellcrank.robot.mjcf_bodies import Body
from bellcrank.robot.mjcf_shapes import SIZES, Shape
from bellcrank.robot.robot_file import ContactShape, Floor

KINDS: Final = ("sphere", "capsule", "cylinder", "box", "ellipsoid")  # whose lowest points are computed


def floors_of(bodies: Sequence[Body]) -> tuple[tuple[Floor, ...], tuple[ContactShape, ...]]:
    """The planes fixed in the world, and the shapes of moving bodies that MuJoCo lets collide with one of them.

    Two shapes collide where the bits of `contype` of one and `conaffinity` of the other have one in common. Source:
    MuJoCo, Computation, collision detection. Meshes and shapes fitted to them are not looked at.
    """
    places: list[np.ndarray] = []
    for body in bodies:
        places.append(places[body.parent] @ body.place if places else np.eye(4))
    planes = [
        (shape, places[k] @ shape.place)
        for k, body in enumerate(bodies)
        if not body.moves
        for shape in body.shapes
        if shape.kind == "plane"
    ]
    touching: list[ContactShape] = []
    touched: set[int] = set()
    for body in bodies:
        for shape in body.shapes if body.moves else ():
            if shape.kind not in KINDS or shape.mesh is not None or len(shape.size) != SIZES[shape.kind][0]:
                continue
            met = [k for k, (plane, _) in enumerate(planes) if _collide(shape, plane)]
            if met:
                touched.update(met)
                named = shape.element.name or shape.kind
                touching.append(ContactShape(named, body.name, shape.kind, shape.size, _rows(shape.place), tuple(met)))
    floors = tuple(
        Floor(plane.element.name or f"plane in line {plane.element.line}", tuple(place[:3, 3]), tuple(place[:3, 2]))
        for plane, place in planes
    )
    return (floors, tuple(touching)) if touched else ((), ())


def _collide(one: Shape, other: Shape) -> bool:
    (type_1, affinity_1), (type_2, affinity_2) = (
        tuple(int(each.element.number(key, 1.0)) for key in ("contype", "conaffinity")) for each in (one, other)
    )
    return bool(type_1 & affinity_2 or type_2 & affinity_1)


def _rows(place: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in place.tolist())
