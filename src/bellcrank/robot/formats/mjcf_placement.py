"""Placements in MJCF: positions and orientations in the notations that its <compiler> element selects.

A placement is a homogeneous matrix (4, 4): positions in m, columns of the rotation are the axes of the placed frame in
the frame that it is placed in. Notations: MuJoCo's documentation, "Modeling", section "Frame orientations".
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from bellcrank.arrays import Array
from bellcrank.robot.formats.mjcf_element import MjcfElement
from bellcrank.robot.formats.urdf_elements import Vector3

NOTATIONS = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
TINY = 1e-14  # MuJoCo's least length of a vector that is normalised (mjMINVAL 1e-15 squared is below this)


@dataclass(frozen=True)
class Angles:
    """How angles are written: in degrees or radians, and the sequence of axes of Euler angles.

    Lower-case letters of the sequence turn about the axes of the turned frame, upper-case ones about fixed axes.
    """

    degrees: bool = True
    sequence: str = "xyz"

    def radians(self, angle: float) -> float:
        """An angle of the file in rad."""
        return math.radians(angle) if self.degrees else angle

    def euler(self, angles: Array) -> Rotation:
        """The rotation of Euler angles (3,) as the file writes them, or the rotations of many (n, 3)."""
        turn = Rotation.identity()
        for k, letter in enumerate(self.sequence):
            axis = np.eye(3)["xyz".index(letter.lower())]
            angle = angles[..., k, None]
            step = Rotation.from_rotvec((np.radians(angle) if self.degrees else angle) * axis)
            turn = turn * step if letter.islower() else step * turn
        return turn

    def rotation(self, element: MjcfElement) -> Rotation:
        """The orientation of an element; identity where it has none. Raises InputError."""
        given = [key for key in NOTATIONS if key in element.attributes]
        if not given:
            return Rotation.identity()
        if len(given) > 1:
            raise element.fail(f"has {' and '.join(given)}; an element has one orientation: remove all but one")
        key = given[0]
        count = {"quat": 4, "axisangle": 4, "xyaxes": 6}.get(key, 3)
        numbers = np.array(element.numbers(key, count, count))
        if key == "quat":
            return Rotation.from_quat(_unit(element, key, numbers)[[1, 2, 3, 0]])
        if key == "axisangle":
            return Rotation.from_rotvec(self.radians(numbers[3]) * _unit(element, key, numbers[:3]))
        if key == "euler":
            return self.euler(numbers)
        if key == "zaxis":
            return z_to(_unit(element, key, numbers))
        x = _unit(element, key, numbers[:3])
        y = _unit(element, key, numbers[3:] - x * (x @ numbers[3:]))
        return Rotation.from_matrix(np.column_stack([x, y, np.cross(x, y)]))

    def placement(self, element: MjcfElement) -> Array:
        """The placement (4, 4) by `pos` and orientation of an element. Raises InputError."""
        return placement(np.array(element.vector("pos", (0.0, 0.0, 0.0))), self.rotation(element))


def placement(position: Array, rotation: Rotation) -> Array:
    """A placement (4, 4)."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = rotation.as_matrix(), position
    return result


def translation(position: Array) -> Array:
    """A placement (4, 4) without rotation."""
    result = np.eye(4)
    result[:3, 3] = position
    return result


def inverse(place: Array) -> Array:
    """The inverse of a placement."""
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = place[:3, :3].T, -place[:3, :3].T @ place[:3, 3]
    return result


def z_to(direction: Array) -> Rotation:
    """The shortest rotation of the z axis into a unit vector (about x where it is opposed)."""
    axis = np.cross([0.0, 0.0, 1.0], direction)
    length = float(np.linalg.norm(axis))
    if length < 1e-10:
        axis, length = np.array([1.0, 0.0, 0.0]), 0.0
    else:
        axis = axis / length
    return Rotation.from_rotvec(math.atan2(length, direction[2]) * axis)


def roll_pitch_yaw(rotation: Array) -> Vector3:
    """The angles of URDF, rad: R = Rz(yaw) Ry(pitch) Rx(roll), as exact at a pitch of ±90° as elsewhere."""
    yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    rest = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ rotation
    return math.atan2(-rest[1, 2], rest[1, 1]), math.atan2(-rest[2, 0], rest[0, 0]), yaw


def vector(values: Array) -> Vector3:
    """Three numbers as a tuple."""
    x, y, z = (float(value) + 0.0 for value in values)
    return x, y, z


def _unit(element: MjcfElement, key: str, values: Array) -> Array:
    length = float(np.linalg.norm(values))
    if length < TINY:
        raise element.fail(f"{key}: a vector has the length zero; expected a direction")
    return values / length
