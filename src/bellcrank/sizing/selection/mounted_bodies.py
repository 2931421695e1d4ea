"""The bodies of actuators on a mechanism: where they are, and the motion of their mounts.

A body is fixed to a link or frame of the robot, its centre of gravity at a point of it, and has rotational symmetry
about an axis through that point.

Poses are those of the robot's equations; rates follow from one joint to the next. A joint at p with rotation R moves
its child relative to its parent by the linear velocity l and the angular velocity u; with r from the parent's joint to
p, ω = ω_p + u and

    ω̇ = ω̇_p + R u̇' + ω_p × u,
    p̈ = p̈_p + ω̇_p × r + ω_p × (ω_p × r) + 2 ω_p × l + R l̇' + u × l,

where u̇' and l̇' are in the joint's own axes. Source: relative motion of rigid bodies, e.g. Siciliano et al., Robotics
(2009), 7.2.3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank.actuators.mount import Mount
from bellcrank.arrays import Array
from bellcrank.elements.symbols import Symbols
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

if TYPE_CHECKING:
    import casadi

    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.elements.parameters import Parameter
    from bellcrank.robot.model.tree import TreeJoint


_POSE = 12  # numbers of a pose: position 3, rotation 9 row by row


@dataclass(frozen=True, eq=False)
class JointMotion:
    """A joint's frame in the world at n states, at rest at the origin for the world itself.

    Attributes:
        point: Origin (n, 3), m.
        rotation: (n, 3, 3), from the joint's axes to the world's.
        angular_velocity: (n, 3).
        angular_acceleration: (n, 3).
        acceleration: Of the origin (n, 3).
        axes: Linear, then angular velocity (n, 6, nv) of the child relative to its parent, per unit of each of the
            joint's velocity coordinates.
    """

    point: Array
    rotation: Array
    angular_velocity: Array
    angular_acceleration: Array
    acceleration: Array
    axes: Array


class TreeMotion:
    """The motion of the joints of a mechanism's tree.

    Args:
        mechanism: The mechanism; parameters of its scene that place joints count.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        robot, self._mechanism = mechanism.robot, mechanism
        self._tree = robot.equations.tree
        leaders = {mimic.follower: (mimic.leader, mimic.multiplier) for mimic in self._tree.mimics}
        independent = {joint.name: joint for joint in robot.joints}
        self._columns: list[list[int]] = []  # of each joint: the coordinates of v that move it, and
        self._ratios: list[float] = []  # its own speed per speed of these
        for number in range(1, len(self._tree.joints) + 1):
            leader, ratio = leaders.get(number, (number, 1.0))
            joint = independent[self._tree.joints[leader - 1].name]
            self._columns.append(list(range(joint.v, joint.v + joint.nv)))
            self._ratios.append(ratio)

    def neutral_poses(self, frames: Sequence[str]) -> list[tuple[Array, Array]]:
        """Position (3,) and rotation (3, 3) of all joints in the neutral position, then of some frames."""
        poses = self._poses_at(self._mechanism.robot.neutral[None], frames)
        return [(point[0], rotation[0]) for point, rotation in poses]

    def _poses_at(self, q: Array, frames: Sequence[str] = ()) -> list[tuple[Array, Array]]:
        """Position (n, 3) and rotation (n, 3, 3) of all joints, in the order of the tree, then of some frames."""
        key = f"joint poses {[parameter.sets for parameter in self._set.values()]!r} {list(frames)!r}"
        code = self._mechanism.robot.compiled(key, lambda: self._poses(frames), seldom=True)
        poses = np.asarray(code(q, self._parameters)).reshape(len(q), -1, _POSE).transpose(1, 0, 2)
        return [(pose[:, :3], pose[:, 3:].reshape(-1, 3, 3)) for pose in poses]

    def _poses(self, frames: Sequence[str]) -> casadi.Function:
        """(q, p) -> the poses of all joints, then of some frames."""
        import casadi

        s = Symbols(self._mechanism.robot, self._set)
        by_name = s.frames_at(frames, s.q) if frames else {}
        found = [*s.joint_frames(), *(by_name[name] for name in frames)]
        flat = [part for frame in found for part in (frame.position, casadi.vec(frame.rotation.T))]
        return casadi.Function("poses", [s.q, s.p], [casadi.densify(casadi.vertcat(casadi.SX(0, 1), *flat))])

    @property
    def _set(self) -> Mapping[str, Parameter]:
        """The parameters of the scene, if some of them place joints or frames."""
        equations = self._mechanism.equations
        return equations.scene.parameters if equations.scene is not None and equations.sets_tree else {}

    @property
    def _parameters(self) -> Array:
        return self._mechanism.equations.parameters if self._set else np.zeros(0)

    def at(self, q: Array, v: Array, a: Array) -> list[JointMotion]:
        """The motion of the world (number 0) and of each joint, numbered from 1 as in the tree."""
        n = len(q)
        none = np.zeros((n, 3))
        found = [JointMotion(none, np.tile(np.eye(3), (n, 1, 1)), none, none, none, np.zeros((n, 6, 0)))]
        for number, (point, rotation) in enumerate(self._poses_at(q)):
            joint, ratio = self._tree.joints[number], self._ratios[number]
            columns, parent = self._columns[number], found[joint.parent]
            local = _freedoms(joint)
            axes = np.concatenate([rotation @ local[:3], rotation @ local[3:]], axis=1)
            speed, rate = (ratio * x[:, columns, None] for x in (v, a))
            linear, angular = np.split((axes @ speed)[:, :, 0], 2, axis=1)
            linear_rate, angular_rate = np.split((axes @ rate)[:, :, 0], 2, axis=1)
            before, arm = parent.angular_velocity, point - parent.point
            found.append(
                JointMotion(
                    point=point,
                    rotation=rotation,
                    angular_velocity=before + angular,
                    angular_acceleration=parent.angular_acceleration + angular_rate + np.cross(before, angular),
                    acceleration=parent.acceleration
                    + np.cross(parent.angular_acceleration, arm)
                    + np.cross(before, np.cross(before, arm))
                    + np.cross(2.0 * before + angular, linear)
                    + linear_rate,
                    axes=axes,
                )
            )
        return found

    def columns(self, joints: Sequence[int]) -> tuple[int, ...]:
        """The coordinates of v that move some joints (numbers from 1), in rising order."""
        return tuple(sorted({column for number in joints for column in self._columns[number - 1]}))

    def jacobian(self, motions: Sequence[JointMotion], joints: Sequence[int], point: Array) -> Array:
        """The Jacobian (n, 6, c) of the linear velocity of points (n, 3) that move with the last of some joints of one
        branch, and of the angular velocity, by their `columns`.
        """
        columns = self.columns(joints)
        found = np.zeros((len(point), 6, len(columns)))
        for number in joints:
            axes, arm = motions[number].axes, point - motions[number].point
            for k, column in enumerate(self._columns[number - 1]):
                moved = self._ratios[number - 1] * axes[:, :, k]
                place = columns.index(column)
                found[:, :3, place] += moved[:, :3] + np.cross(moved[:, 3:], arm)
                found[:, 3:, place] += moved[:, 3:]
        return found


def _freedoms(joint: TreeJoint) -> Array:
    """The linear, then angular velocities (6, nv) of a joint's child per unit of its coordinates, in its own axes."""
    if joint.kind == "floating":
        return np.eye(6)
    if joint.kind == "planar":  # x, y and the angle about z
        return np.eye(6)[:, [0, 1, 5]]
    if joint.kind == "spherical":
        return np.eye(6)[:, 3:]
    axis, none = np.array(joint.axis), np.zeros(3)
    if joint.kind == "prismatic":
        return np.append(axis, none)[:, None]
    return np.append(joint.pitch * axis, axis)[:, None]


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
