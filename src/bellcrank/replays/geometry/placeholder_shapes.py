"""Simple shapes for what a URDF gives no visual for: bones between joints, joints, and boxes of the right inertia."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bellcrank.replays.film.film import Pose, Shape
from bellcrank.replays.geometry.colours import Colour
from bellcrank.replays.geometry.rotations import quaternions
from bellcrank.replays.geometry.skeleton import Skeleton, placement

Array = NDArray[np.float64]

BONE, HINGE, HINGE_LENGTH, SLIDE = 0.018, 0.03, 0.1, (0.06, 0.06, 0.12)  # of the length that sets the robot's scale
THICKEST = 0.12  # of a bone's own length, which keeps the bones of small fingers thin
POINT, THINNEST = 0.05, 0.01  # a point mass' radius and the thinnest edge of a box, of the scale
LEAST = 1e-3  # of the scale: what is shorter is no bone


def stand_ins(skeleton: Skeleton, carrier: str, colour: Colour) -> tuple[Shape, ...]:
    """Shapes for a body of which nothing else is known, by the link that carries it, in that link's frame.

    Bones go to the joints and links on it, and to its centre of mass where there is nothing else; its own joint is a
    pin or a slider; what has neither is the box of its inertia.
    """
    scale = skeleton.scale
    above = skeleton.above.get(carrier)
    links = [(skeleton.inside[link], skeleton.urdf.links[link].inertial) for link in skeleton.carried[carrier]]
    massive = [(place, inertial) for place, inertial in links if inertial is not None and inertial.mass > 0.0]
    centres = [(place @ np.array([*inertial.xyz, 1.0]))[:3] for place, inertial in massive]
    shapes = bones(skeleton.ends[carrier], scale, colour) or (bones(centres, scale, colour) if above else ())
    if above is not None and above.type != "floating":
        return (*shapes, *joint(above.type, np.array(above.axis), scale, colour))
    if shapes:
        return shapes
    for place, inertial in massive:
        xx, xy, xz, yy, yz, zz = inertial.inertia
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        centre = place @ placement(inertial.xyz, inertial.rpy)
        shapes += (inertia_box(inertial.mass, inertia, centre, scale, colour),)
    return shapes or joint("fixed", np.zeros(3), scale, colour)


def bones(points: Sequence[Array], scale: float, colour: Colour) -> tuple[Shape, ...]:
    """Rods from the origin to points (3,) m of a body's frame, of a robot whose longest link is `scale` (m) long."""
    shapes: list[Shape] = []
    ends: list[Array] = []
    for point in points:
        length = float(np.linalg.norm(point))
        if length < LEAST * scale or any(np.linalg.norm(point - end) < LEAST * scale for end in ends):
            continue
        ends.append(point)
        radius = min(BONE * scale, THICKEST * length)
        shapes.append(Shape("cylinder", (radius, length), colour, pose_along(point, 0.5 * point), stand_in=True))
        shapes.append(Shape("sphere", (1.2 * radius,), colour, pose(np.eye(3), point), stand_in=True))
    return tuple(shapes)


def joint(kind: str, axis: Array, scale: float, colour: Colour) -> tuple[Shape, ...]:
    """A joint at a body's origin by its kind: a pin along a revolute joint's axis, a box along a prismatic one's."""
    if kind in ("revolute", "continuous"):
        size = (HINGE * scale, HINGE_LENGTH * scale)
        return (Shape("cylinder", size, colour, pose_along(axis, np.zeros(3)), stand_in=True),)
    if kind == "prismatic":
        x, y, z = (share * scale for share in SLIDE)
        return (Shape("box", (x, y, z), colour, pose_along(axis, np.zeros(3)), stand_in=True),)
    return (Shape("sphere", (HINGE * scale,), colour, stand_in=True),)


def inertia_box(mass: float, inertia: Array, centre: Array, scale: float, colour: Colour) -> Shape:
    """The uniform box of this mass (kg) and inertia (3, 3) kg m², at the transform (4, 4) of its centre and axes.

    Its edges come from m (b² + c²)/12 and so on; a body without inertia is a small sphere for the `scale` (m).
    """
    moments, axes = np.linalg.eigh(inertia)
    squares = 6.0 * (moments.sum() - 2.0 * moments) / max(mass, 1e-30)
    if mass <= 0.0 or squares.max() < (THINNEST * scale) ** 2:
        return Shape("sphere", (POINT * scale,), colour, pose(np.eye(3), centre[:3, 3]), stand_in=True)
    x, y, z = np.maximum(np.sqrt(np.maximum(squares, 0.0)), THINNEST * scale).tolist()
    axes[:, 0] *= np.linalg.det(axes)  # right-handed
    return Shape("box", (x, y, z), colour, pose(centre[:3, :3] @ axes, centre[:3, 3]), stand_in=True)


def pose(rotation: Array, position: Array) -> Pose:
    """A rotation matrix (3, 3) and a position (3,) m as seven numbers."""
    x, y, z, w = quaternions(rotation).tolist()
    return (*_triple(position), x, y, z, w)


def pose_along(direction: Array, position: Array) -> Pose:
    """The pose at a position (3,) m that turns z the shortest way into a direction (3,)."""
    x, y, z = (direction / np.linalg.norm(direction)).tolist()
    w = math.sqrt(max(0.5 * (1.0 + z), 0.0))
    if w < 1e-6:
        return (*_triple(position), 1.0, 0.0, 0.0, 0.0)
    return (*_triple(position), -y / (2.0 * w), x / (2.0 * w), 0.0, w)


def _triple(point: Array) -> tuple[float, float, float]:
    x, y, z = point.tolist()
    return x, y, z
