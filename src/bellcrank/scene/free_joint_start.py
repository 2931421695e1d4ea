"""The start of a joint with several degrees of freedom: a free base, or a floating, planar or spherical joint.

Floating: {position: [x, y, z], rpy | quaternion_xyzw, linear_velocity, angular_velocity, expressed_in}; planar:
{position: [x, y], angle, linear_velocity: [x, y], angular_velocity: RATE, expressed_in}; spherical:
{rpy | quaternion_xyzw, angular_velocity, expressed_in}. The pose is that of the child
link's frame in the joint's frame on the parent link, or in the world for a base. Velocities are those of the child
relative to the parent, the linear one at the child's origin, in the axes `expressed_in`: "parent" ("world" for a base)
or "body".

The search for a start that satisfies the constraints keeps the given values and adapts the others. Some components of a
vector may be left open, as in [0, ~, 0.1] or {z: 0.1}; without constraints they are 0. {guess: VALUE} instead of a
position, rpy, quaternion or angle is only the initial value of the search.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.config.fields import Fields
from bellcrank.messages import format_value
from bellcrank.numerics import length as norm
from bellcrank.robot.model.joints import unit_vector

if TYPE_CHECKING:
    from bellcrank.robot.robot import RobotJoint

START_KEYS = ("position", "rpy", "quaternion_xyzw", "angle", "linear_velocity", "angular_velocity")


@dataclass(frozen=True)
class Components:
    """A vector with the components that are given, and those that the search for a consistent start keeps (`held`)."""

    values: tuple[float, ...]
    given: tuple[bool, ...]
    held: tuple[bool, ...]

    def over(self, before: Array) -> Array:
        """The vector with its missing components taken from another vector."""
        return np.where(self.given, self.values, before)


@dataclass(frozen=True)
class FreeJointStart:
    """The start of a joint with several degrees of freedom; values that are not given are not changed.

    Attributes:
        position: Position (3 or 2; 0 for a spherical joint), m, in the parent's axes.
        rotation: Unit quaternion x y z w, or cosine and sine of the angle, or None.
        rotation_held: Whether the search for a consistent start keeps the rotation.
        linear: Linear velocity (3 or 2; 0 for a spherical joint), m/s.
        angular: Angular velocity (3 or 1), rad/s.
        in_body: Whether the velocities are in the body's axes; otherwise in the parent's.
    """

    position: Components
    rotation: tuple[float, ...] | None
    rotation_held: bool
    linear: Components
    angular: Components
    in_body: bool

    def place(self, joint: RobotJoint, q: Array) -> None:
        """Write the pose into the position q (nq,)."""
        middle = joint.q + len(self.position.values)
        q[joint.q : middle] = self.position.over(q[joint.q : middle])
        if self.rotation is not None:
            q[middle : joint.q + joint.nq] = self.rotation

    def move(self, joint: RobotJoint, q: Array, v: Array) -> None:
        """Write the velocity into v (…, nv), with the body's axes at the position q (…, nq)."""
        middle = joint.v + len(self.linear.values)
        for part, entry in ((slice(joint.v, middle), self.linear), (slice(middle, joint.v + joint.nv), self.angular)):
            if not any(entry.given):
                continue
            turn = np.eye(len(entry.given)) if self.in_body or len(entry.given) == 1 else body_axes(joint, q)
            there = entry.over((turn @ v[..., part, None])[..., 0])
            v[..., part] = (np.swapaxes(turn, -1, -2) @ there[..., None])[..., 0]

    def hold(self, joint: RobotJoint, held_q: Mask, held_v: Mask) -> None:
        """Mark the degrees of freedom (nv) whose positions and velocities are kept.

        Positions are along the parent's axes, velocities along the axes in which they are given.
        """
        turning = (self.rotation_held,) * len(self.angular.held)
        held_q[joint.v : joint.v + joint.nv] = (*self.position.held, *turning)
        held_v[joint.v : joint.v + joint.nv] = (*self.linear.held, *self.angular.held)

    def position_axes(self, joint: RobotJoint, q: Array) -> list[tuple[slice, Array]]:
        """(degrees of freedom, rotation body to parent) of the position."""
        if not (size := len(self.position.values)):
            return []
        return [(slice(joint.v, joint.v + size), body_axes(joint, q))]

    def velocity_axes(self, joint: RobotJoint, q: Array) -> list[tuple[slice, Array]]:
        """(degrees of freedom, rotation body to parent) of each velocity vector that is given in the parent's axes."""
        if self.in_body:
            return []
        turn = body_axes(joint, q)
        firsts = (joint.v, joint.v + 3) if joint.kind == "floating" else (joint.v,)
        return [(slice(first, first + len(turn)), turn) for first in firsts]


def read_free_joint_start(read: Fields, joint: RobotJoint, axes: str = "parent") -> FreeJointStart:
    """Read the start of a joint with several degrees of freedom; `axes` is the name of the parent's axes.

    Raises InputError.
    """
    planar = joint.kind == "planar"
    names = {"planar": "xy", "floating": "xyz", "spherical": ""}[joint.kind]
    rotation, rotation_held = _angle(read) if planar else _attitude(read)
    start = FreeJointStart(
        _components(read, "position", names, "m", guess=True),
        rotation,
        rotation_held,
        _components(read, "linear_velocity", names, "m/s"),
        _rate(read) if planar else _components(read, "angular_velocity", "xyz", "rad/s"),
        read.choice("expressed_in", (axes, "body"), axes) == "body",
    )
    read.done()
    return start


def body_axes(joint: RobotJoint, q: Array) -> Array:
    """Rotation matrices, body to parent (…, 3, 3), or of a planar joint in its plane (…, 2, 2)."""
    if joint.kind == "planar":
        cos, sin = q[..., joint.q + 2], q[..., joint.q + 3]
        return _matrices([[cos, -sin], [sin, cos]])
    return rotation_matrix(q[..., unit_vector(joint)])


def _components(read: Fields, key: str, names: str, unit: str, guess: bool = False) -> Components:
    """Read a vector: a list with numbers or ~, a mapping by component, or {guess: list}; none without names."""
    written = read.raw(key, None) if names else None
    none = (False,) * len(names)
    if written is None:
        return Components((0.0,) * len(names), none, none)
    if isinstance(written, Mapping):
        inner = read.mapping(key)
        if guess and "guess" in inner:
            found = _components(inner, "guess", names, unit)
            inner.done()
            return Components(found.values, found.given, none)
        inner.known(*names)
        values = [None if c not in inner or written[c] is None else inner.number(c, unit) for c in names]
        inner.done()
    elif isinstance(written, (list, tuple)) and len(written) == len(names):
        values = [None if entry is None else read.parsed(key, entry, unit) for entry in written]
    else:
        raise read.error(
            key,
            f"expected a list of {len(names)} numbers in {unit}, with ~ for open ones, or a mapping such as "
            f"{{{names[0]}: 0.1}}, found {format_value(written)}",
        )
    given = tuple(x is not None for x in values)
    return Components(tuple(x or 0.0 for x in values), given, given)


def _attitude(read: Fields) -> tuple[tuple[float, ...] | None, bool]:
    """Read `rpy` or `quaternion_xyzw`. Returns the quaternion x y z w or None, and whether it is held."""
    if "rpy" in read and "quaternion_xyzw" in read:
        raise read.error("rpy", "expected 'rpy' or 'quaternion_xyzw', found both")
    read.known("rpy", "quaternion_xyzw")
    key = next((key for key in ("rpy", "quaternion_xyzw") if key in read), None)
    if key is None:
        return None, False
    place, place_key, held = _guessed(read, key)
    if key == "rpy":
        quaternion = quaternion_of(place.vector(place_key, 3, "rad"))
    else:
        quaternion = np.array(place.vector(place_key, 4))
        length = norm(quaternion)
        if not 0.999 <= length <= 1.001:
            raise place.error(place_key, f"expected a quaternion x y z w of length 1, found length {length:.6g}")
        quaternion = quaternion / length
    if place is not read:
        place.done()
    return tuple(quaternion.tolist()), held


def _angle(read: Fields) -> tuple[tuple[float, ...] | None, bool]:
    """Read `angle` of a planar joint. Returns its cosine and sine or None, and whether it is held."""
    if "angle" not in read:
        read.known("angle")
        return None, False
    place, key, held = _guessed(read, "angle")
    angle = place.number(key, "rad")
    if place is not read:
        place.done()
    return (float(np.cos(angle)), float(np.sin(angle))), held


def _guessed(read: Fields, key: str) -> tuple[Fields, str, bool]:
    """The mapping and key of a value that may be written as {guess: VALUE}, and whether the value is held."""
    written: Any = read.raw(key)
    return (read.mapping(key), "guess", False) if isinstance(written, Mapping) else (read, key, True)


def _rate(read: Fields) -> Components:
    """Read the angular velocity of a planar joint."""
    if read.raw("angular_velocity", None) is None:
        return Components((0.0,), (False,), (False,))
    return Components((read.number("angular_velocity", "rad/s"),), (True,), (True,))


def quaternion_of(rpy: tuple[float, ...]) -> Array:
    """The quaternion x y z w of roll, pitch, yaw (rad) about the fixed x, y, z axes in that order."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(np.array(rpy) / 2.0), np.sin(np.array(rpy) / 2.0)
    return np.array(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ]
    )


def rotation_matrix(quaternion: Array) -> Array:
    """The rotation matrices (…, 3, 3) of unit quaternions x y z w (…, 4)."""
    x, y, z, w = np.moveaxis(np.asarray(quaternion), -1, 0)
    return _matrices(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _matrices(entries: list[list[Array]]) -> Array:
    return np.moveaxis(np.array(entries), (0, 1), (-2, -1))
