"""A robot's independent joints: where their coordinates lie in q and v, which are lengths, and which are unit vectors.

A joint of one degree of freedom has one coordinate (rad or m; rad for a screw), whose rate is its velocity. A planar
joint has x, y (m), cos θ and sin θ; a floating joint x, y, z (m, in the parent's frame) and a unit quaternion x y z w;
a spherical joint a unit quaternion alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array, Mask
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

if TYPE_CHECKING:
    from bellcrank.robot.model.joint_frame_lookup import RobotDescription

KINDS = {  # (nq, nv) by kind of joint
    "revolute": (1, 1), "prismatic": (1, 1), "screw": (1, 1), "planar": (4, 3), "spherical": (4, 3), "floating": (7, 6),
}  # fmt: skip
BALL = (  # what there is for a spherical joint
    "; a spherical joint takes a `spherical_spring`, a torque as a `wrench` on a frame of its link, and motions as CSV "
    "files with its quaternion; for motors, write three revolute joints"
)
LENGTHS = {"prismatic": 1, "planar": 2, "floating": 3}  # leading coordinates that are lengths, by kind of joint


class JointLike(Protocol):
    """A joint's name, kind and place in the position (q, nq) and velocity (v, nv) vectors."""

    @property
    def name(self) -> str:
        """Name."""

    @property
    def kind(self) -> str:
        """One of KINDS."""

    @property
    def q(self) -> int:
        """First index in the position."""

    @property
    def nq(self) -> int:
        """Number of position coordinates."""

    @property
    def v(self) -> int:
        """First index in the velocity."""

    @property
    def nv(self) -> int:
        """Number of velocity coordinates."""


class RobotLike(Protocol):
    """A robot, or some of its joints: what reading and checking a motion needs."""

    @property
    def name(self) -> str:
        """Name."""

    @property
    def joints(self) -> Sequence[JointLike]:
        """The joints."""

    @property
    def lower(self) -> Array:
        """Lower limits (nq,), rad or m."""

    @property
    def upper(self) -> Array:
        """Upper limits (nq,), rad or m."""


@dataclass(frozen=True)
class RobotJoint:
    """An independent joint: its kind, and where its coordinates lie in position (q) and velocity (v)."""

    name: str
    kind: str  # one of KINDS
    q: int
    nq: int
    v: int
    nv: int


class JointMimic(NamedTuple):
    """A joint that follows another one: q_follower = multiplier q_leader + offset (rad or m)."""

    follower: str
    leader: str
    multiplier: float
    offset: float


def joint_named(robot: str, joints: Sequence[RobotJoint], mimics: Iterable[JointMimic], name: str) -> RobotJoint:
    """The independent joint of that name; `robot` is the robot's name for messages. Raises InputError."""
    arguments.text("name", name, "the name of a joint")
    for joint in joints:
        if joint.name == name:
            return joint
    for mimic in mimics:
        if mimic.follower == name:
            raise InputError(
                f"{robot}: joint '{name}' mimics '{mimic.leader}' and has no coordinate of its own; set "
                f"'{mimic.leader}' instead"
            )
    raise InputError(f"{robot}: " + unknown_name("joint", name, [joint.name for joint in joints]))


def require_one_degree(joint: RobotJoint, what: str) -> RobotJoint:
    """The joint, which has one degree of freedom. Raises InputError, beginning with `what`, for any other."""
    if joint.nv != 1:
        raise InputError(
            f"{what}: joint '{joint.name}' is {joint.kind}; a joint with one degree of freedom (revolute, prismatic or "
            f"screw) is required{BALL if joint.kind == 'spherical' else ''}"
        )
    return joint


def one_degree_columns(joints: Iterable[JointLike]) -> tuple[list[int], list[int]]:
    """Where the joints with one degree of freedom stand in q and in v."""
    found = [joint for joint in joints if joint.nv == 1]
    return [joint.q for joint in found], [joint.v for joint in found]


def require_uniform(joint: RobotJoint, what: str) -> RobotJoint:
    """The joint, of which one number can hold for every degree of freedom. Raises InputError as above."""
    return joint if joint.kind == "spherical" else require_one_degree(joint, what)


def lengths_in_velocity(robot: RobotDescription) -> Mask:
    """Which entries of v (nv,) are in m/s; the others are in rad/s."""
    lengths = np.zeros(robot.nv, dtype=bool)
    for joint in robot.joints:
        lengths[joint.v : joint.v + LENGTHS.get(joint.kind, 0)] = True
    return lengths


def lengths_in_position(robot: RobotDescription) -> Mask:
    """Which entries of q (nq,) are in m; the others are in rad, or parts of a unit vector."""
    lengths = np.zeros(robot.nq, dtype=bool)
    for joint in robot.joints:
        lengths[joint.q : joint.q + LENGTHS.get(joint.kind, 0)] = True
    return lengths


def unit_vector(joint: JointLike) -> slice | None:
    """Where a unit vector stands in q: a quaternion (floating, spherical), a planar joint's (cos, sin); else None."""
    if joint.nq == joint.nv:
        return None
    return slice(joint.q + LENGTHS.get(joint.kind, 0), joint.q + joint.nq)


def quaternion_part(joint: JointLike) -> slice | None:
    """Where a quaternion x y z w stands in q, for a floating or spherical joint; None for others."""
    return None if joint.kind == "planar" else unit_vector(joint)


def unit_vectors(joints: Iterable[JointLike]) -> list[slice]:
    """Where all unit vectors stand in q, in the order of the joints."""
    return [part for part in map(unit_vector, joints) if part is not None]


def random_posture(robot: RobotDescription, random: np.random.Generator, length: float = 1.0) -> Array:
    """A position (nq,) with every joint within 1.5 rad or 1.5 `length` (m) of zero, and unit rotations."""
    return np.asarray(postures(robot, random.uniform(-1.5, 1.5, (1, robot.nq)), length)[0])


def postures(robot: RobotDescription, moves: Array, length: float) -> Array:
    """Positions (n, nq) displaced from the neutral one by `moves` (n, nq), rad or `length` (m), with unit rotations."""
    q = robot.neutral + np.where(lengths_in_position(robot), length * moves, moves)
    for part in unit_vectors(robot.joints):
        q[:, part] /= np.linalg.norm(q[:, part], axis=1, keepdims=True)
    return np.asarray(q)
