"""The bodies of actuators on a mechanism: where they are, and the motion of their mounts.

A body is fixed to a link or frame of the robot, its centre of gravity at a point of it, and has rotational symmetry
about an axis through that point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank.actuators.mount import Mount
from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.sizing.selection.tree_kinematics import JointMotion, TreeMotion

if TYPE_CHECKING:
    from bellcrank.dynamics.inverse.mechanism import Mechanism


class States(NamedTuple):
    """States of a mechanism: times (n,), s, at which forces are evaluated, q (n, nq), v and a (n, nv)."""

    time: Array
    position: Array
    velocity: Array
    acceleration: Array

    @property
    def at_rest(self) -> States:
        """The same postures at rest."""
        rest = np.zeros_like(self.velocity)
        return States(self.time, self.position, rest, rest)


@dataclass(frozen=True, kw_only=True)
class MountedBody:
    """A body at a mount.

    Attributes:
        name: Name of the axis whose actuator it is.
        mount: Name of the link or frame that carries it.
        mount_point: Its centre of gravity (3,) in that link or frame, m.
        mount_direction: Its axis (3,) there, a unit vector.
        joints: Numbers (from 1) of the joints between it and the world, the one next to it first.
        columns: The velocity coordinates that move it, in rising order.
        offset: Its centre of gravity (3,), m, in the frame of the joint next to it, or in the world.
        axis: Its axis (3,) there.
    """

    name: str
    mount: str
    mount_point: tuple[float, float, float]
    mount_direction: tuple[float, float, float]
    joints: tuple[int, ...]
    columns: tuple[int, ...]
    offset: tuple[float, float, float]
    axis: tuple[float, float, float]

    @property
    def carrier(self) -> int:
        """Number of the joint next to it, 0 for the world."""
        return self.joints[0] if self.joints else 0


class BodyMotion(NamedTuple):
    """The motion of a body in the world at n states: point, axis, linear acceleration, angular velocity and
    acceleration (n, 3), and the Jacobian (n, 6, c) of its linear, then angular velocity by its columns of v.
    """

    point: Array
    axis: Array
    linear_acceleration: Array
    angular_velocity: Array
    angular_acceleration: Array
    jacobian: Array


class MountKinematics:
    """The motions of the joints of a mechanism, and of the bodies at its mounts.

    Args:
        mechanism: The mechanism.
        joints: For each axis, its name and the joint (its nearest to the base) at which its actuator is by default.
        mounts: Mounts other than the default, by the name of the axis.

    Raises:
        InputError: A mount is of an unknown axis, or on an unknown link or frame.
    """

    def __init__(self, mechanism: Mechanism, joints: Mapping[str, str], mounts: Mapping[str, Mount]) -> None:
        self.mechanism = mechanism
        self._motion = TreeMotion(mechanism)
        robot = mechanism.robot
        for name, mount in mounts.items():
            if name not in joints:
                raise InputError(f"mounts of {robot.name}: {unknown_name('joint or motor', name, joints)}")
            if mount.link is not None and mount.link not in robot.frame_names:
                raise InputError(
                    f"mounts of {robot.name}: {name}: {unknown_name('link or frame', mount.link, robot.frame_names)}"
                )
        tree = robot.equations.tree
        own = {frame.name: frame for frame in tree.frames if frame.is_joint}
        parents = {joint: tree.frames[own[joint].parent_frame].name for joint in joints.values()}
        carriers = {name: mounts.get(name, Mount()).link or parents[joint] for name, joint in joints.items()}
        frames = tuple(dict.fromkeys(carriers.values()))
        poses = self._motion.neutral_poses(frames)
        numbers, found = list(robot.all_joint_names), []
        for name, joint in joints.items():
            link, axis = poses[len(tree.joints) + frames.index(carriers[name])], mounts.get(name, Mount()).axis
            point, direction = link[0], link[1][:, 2] if axis is None else link[1] @ axis
            if carriers[name] == parents[joint]:
                point, turned = poses[numbers.index(joint)]  # in the neutral position, where the joint is at 0
                direction = turned @ robot.joint_axis(joint) if axis is None else direction
            direction = direction / np.abs(direction).max()  # first, or the square of a small number is 0
            direction = direction / np.linalg.norm(direction)
            below = tree.supporting_joints(robot.frame_index(carriers[name]))
            carrier = poses[below[0] - 1] if below else (np.zeros(3), np.eye(3))
            found.append(
                MountedBody(
                    name=name,
                    mount=carriers[name],
                    mount_point=_numbers(link[1].T @ (point - link[0])),
                    mount_direction=_numbers(link[1].T @ direction),
                    joints=below,
                    columns=self._motion.columns(below),
                    offset=_numbers(carrier[1].T @ (point - carrier[0])),
                    axis=_numbers(carrier[1].T @ direction),
                )
            )
        self.bodies = tuple(found)

    def at(self, states: States) -> tuple[list[JointMotion], tuple[BodyMotion, ...]]:
        """The motions of the world (number 0) and all joints of the tree (from 1), and of each body."""
        joints = self._motion.at(*states[1:])
        return joints, tuple(self._moved(body, joints) for body in self.bodies)

    def _moved(self, body: MountedBody, joints: Sequence[JointMotion]) -> BodyMotion:
        """The motion of a body from that of the joint next to it, by the kinematics of a rigid body."""
        carrier = joints[body.carrier]
        arm, angular = carrier.rotation @ np.array(body.offset), carrier.angular_velocity
        turning = np.cross(carrier.angular_acceleration, arm) + np.cross(angular, np.cross(angular, arm))
        point = carrier.point + arm
        return BodyMotion(
            point=point,
            axis=carrier.rotation @ np.array(body.axis),
            linear_acceleration=carrier.acceleration + turning,
            angular_velocity=angular,
            angular_acceleration=carrier.angular_acceleration,
            jacobian=self._motion.jacobian(joints, body.joints, point),
        )


def _numbers(vector: Array) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z
