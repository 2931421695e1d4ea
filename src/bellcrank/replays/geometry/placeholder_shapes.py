"""Placeholder shapes for bodies without visuals: rods between joints, pins and sliders, boxes of equal inertia."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from bellcrank.arrays import Array
from bellcrank.motion.kinematics.rotations import from_matrices, from_rpy
from bellcrank.replays.geometry.shapes import Colour, DrawnShape, Pose, triple

if TYPE_CHECKING:
    from bellcrank.robot.formats.urdf_file import Joint, Urdf


DEFAULT_SCALE = 0.5  # m, of a robot whose joints all coincide
ROD_RADIUS, PIN_RADIUS, PIN_LENGTH, SLIDER = 0.018, 0.03, 0.1, (0.06, 0.06, 0.12)  # of the robot's scale
THICKEST_ROD = 0.12  # radius over length, which keeps the rods of small fingers thin
POINT_RADIUS, THINNEST_BOX = 0.05, 0.01  # of a point mass, and the thinnest edge of a box, of the scale
SHORTEST_ROD = 1e-3  # of the scale


def transform(xyz: tuple[float, ...], rpy: tuple[float, ...]) -> Array:
    """The homogeneous transform (4, 4) of a position (m) and roll, pitch, yaw (rad)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = from_rpy(np.array(rpy, dtype=float)), xyz
    return matrix


class LinkLayout:
    """Links grouped into rigid bodies: a carrier link, which is the root or moves by a joint, and links fixed to it.

    Attributes:
        carrier: The carrier of each link.
        links_of: The links of each carrier, the carrier first.
        parent_joint: The joint above each link but the root.
        in_carrier: Transform (4, 4) of each link in the frame of its carrier.
        ends: Points (3,) m in each carrier's frame where joints, fixed links or user frames are.
        size: Diagonal of the box around all link origins with every joint at zero (m).
        scale: Largest distance between joints on one carrier (m), at most four times the median.
    """

    def __init__(self, urdf: Urdf, frames: Mapping[str, tuple[str, tuple[float, ...], tuple[float, ...]]]) -> None:
        self.urdf = urdf
        self.parent_joint: dict[str, Joint] = {joint.child: joint for joint in urdf.joints.values()}
        below: dict[str, list[Joint]] = {link: [] for link in urdf.links}
        for joint in urdf.joints.values():
            below[joint.parent].append(joint)
        self.carrier = {urdf.root: urdf.root}
        self.links_of: dict[str, list[str]] = {urdf.root: [urdf.root]}
        self.in_carrier: dict[str, Array] = {urdf.root: np.eye(4)}
        self.ends: dict[str, list[Array]] = {urdf.root: []}
        at_zero: dict[str, Array] = {urdf.root: np.eye(4)}
        waiting = [urdf.root]
        while waiting:
            link = waiting.pop()
            carrier = self.carrier[link]
            for joint in below[link]:
                child, place = joint.child, self.in_carrier[link] @ transform(joint.xyz, joint.rpy)
                at_zero[child] = at_zero[link] @ transform(joint.xyz, joint.rpy)
                self.ends[carrier].append(place[:3, 3])
                fixed = joint.type == "fixed"
                self.carrier[child] = carrier if fixed else child
                self.in_carrier[child] = place if fixed else np.eye(4)
                if fixed:
                    self.links_of[carrier].append(child)
                else:
                    self.links_of[child], self.ends[child] = [child], []
                waiting.append(child)
        for link, xyz, _ in frames.values():
            if link in self.carrier:
                self.ends[self.carrier[link]].append((self.in_carrier[link] @ np.array([*xyz, 1.0]))[:3])
        origins = np.array([place[:3, 3] for place in at_zero.values()])
        self.size = float(np.linalg.norm(np.ptp(origins, axis=0)))
        spans = [float(np.linalg.norm(end)) for ends in self.ends.values() for end in ends]
        spans = [span for span in spans if span > 0.0]
        # the base may be far longer than the links
        self.scale = min(max(spans), 4.0 * float(np.median(spans))) if spans else DEFAULT_SCALE


def placeholder_shapes(layout: LinkLayout, carrier: str, colour: Colour) -> tuple[DrawnShape, ...]:
    """Shapes for a carrier link of which nothing is drawn, in that link's frame.

    Rods go to the joints and links on it, or to its centre of mass if there are none; its own joint is a pin or a
    slider. A link with neither is the box with its mass and inertia.
    """
    scale = layout.scale
    above = layout.parent_joint.get(carrier)
    links = [(layout.in_carrier[link], layout.urdf.links[link].inertial) for link in layout.links_of[carrier]]
    massive = [(place, inertial) for place, inertial in links if inertial is not None and inertial.mass > 0.0]
    centres = [(place @ np.array([*inertial.xyz, 1.0]))[:3] for place, inertial in massive]
    shapes = rods(layout.ends[carrier], scale, colour) or (rods(centres, scale, colour) if above else ())
    if above is not None and above.type != "floating":
        return (*shapes, *joint_shapes(above.type, np.array(above.axis), scale, colour))
    if shapes:
        return shapes
    for place, inertial in massive:
        xx, xy, xz, yy, yz, zz = inertial.inertia
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        centre = place @ transform(inertial.xyz, inertial.rpy)
        shapes += (inertia_box(inertial.mass, inertia, centre, scale, colour),)
    return shapes or joint_shapes("fixed", np.zeros(3), scale, colour)


def rods(points: Sequence[Array], scale: float, colour: Colour) -> tuple[DrawnShape, ...]:
    """Rods with a ball at the end, from the origin to points (3,) m of a body's frame; `scale` (m) of the robot."""
    shapes: list[DrawnShape] = []
    ends: list[Array] = []
    for point in points:
        length = float(np.linalg.norm(point))
        shortest = SHORTEST_ROD * scale
        if length < shortest or any(np.linalg.norm(point - end) < shortest for end in ends):
            continue
        ends.append(point)
        radius = min(ROD_RADIUS * scale, THICKEST_ROD * length)
        shapes.append(_placeholder("cylinder", (radius, length), colour, pose_along(point, 0.5 * point)))
        shapes.append(_placeholder("sphere", (1.2 * radius,), colour, pose(np.eye(3), point)))
    return tuple(shapes)


def joint_shapes(kind: str, axis: Array, scale: float, colour: Colour) -> tuple[DrawnShape, ...]:
    """A joint at a body's origin: a pin along a revolute joint's or screw's axis, a box along a prismatic joint's."""
    if kind in ("revolute", "continuous", "screw"):
        size = (PIN_RADIUS * scale, PIN_LENGTH * scale)
        return (_placeholder("cylinder", size, colour, pose_along(axis, np.zeros(3))),)
    if kind == "prismatic":
        x, y, z = (share * scale for share in SLIDER)
        return (_placeholder("box", (x, y, z), colour, pose_along(axis, np.zeros(3))),)
    return (_placeholder("sphere", (PIN_RADIUS * scale,), colour, pose(np.eye(3), np.zeros(3))),)


def inertia_box(mass: float, inertia: Array, centre: Array, scale: float, colour: Colour) -> DrawnShape:
    """The uniform box of a mass (kg) and inertia (3, 3) kg m², at the transform (4, 4) of its centre and axes.

    Its edges follow from the principal moments m (b² + c²)/12 and so on. A body without inertia is a small sphere,
    sized by the robot's `scale` (m).
    """
    moments, axes = np.linalg.eigh(inertia)
    squares = 6.0 * (moments.sum() - 2.0 * moments) / max(mass, 1e-30)
    if mass <= 0.0 or squares.max() < (THINNEST_BOX * scale) ** 2:
        return _placeholder("sphere", (POINT_RADIUS * scale,), colour, pose(np.eye(3), centre[:3, 3]))
    x, y, z = np.maximum(np.sqrt(np.maximum(squares, 0.0)), THINNEST_BOX * scale).tolist()
    axes[:, 0] *= np.linalg.det(axes)  # right-handed
    return _placeholder("box", (x, y, z), colour, pose(centre[:3, :3] @ axes, centre[:3, 3]))


def _placeholder(
    kind: Literal["box", "cylinder", "sphere"], size: tuple[float, ...], colour: Colour, at: Pose
) -> DrawnShape:
    return DrawnShape(kind=kind, size=size, colour=colour, pose=at, placeholder=True)


def pose(rotation: Array, position: Array) -> Pose:
    """The pose of a rotation matrix (3, 3) and a position (3,) m."""
    x, y, z, w = from_matrices(rotation).tolist()
    return (*triple(position), x, y, z, w)


def pose_along(direction: Array, position: Array) -> Pose:
    """The pose at a position (3,) m with the smallest rotation that takes z into a direction (3,)."""
    x, y, z = (direction / np.linalg.norm(direction)).tolist()
    w = math.sqrt(max(0.5 * (1.0 + z), 0.0))
    if w < 1e-6:
        return (*triple(position), 1.0, 0.0, 0.0, 0.0)
    return (*triple(position), -y / (2.0 * w), x / (2.0 * w), 0.0, w)
