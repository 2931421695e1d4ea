"""The bodies of actuators on a mechanism: where they are, and the motion of their mounts.

A body is fixed to a link or frame of the robot, its centre of gravity at a point of it, and has rotational symmetry
about an axis through that point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.mount import Mount
from bellcrank.elements.symbols import FrameSymbols, Symbols
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.dynamics.mechanism import Mechanism

Array = NDArray[np.float64]
_POSE, _TWIST = 12, 6  # numbers of a frame: position 3 and rotation 9; linear and angular 3 each


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


@dataclass(frozen=True)
class MountedBody:
    """A body at a mount.

    Attributes:
        name: Name of the axis whose actuator it is.
        frame: Name of the link or frame that carries it.
        offset: Its centre of gravity (3,) in that frame, m.
        axis: Its axis (3,) in that frame, a unit vector.
        joints: Numbers (from 1) of the joints between it and the world.
        columns: The velocity coordinates that move it.
    """

    name: str
    frame: str
    offset: tuple[float, ...]
    axis: tuple[float, ...]
    joints: frozenset[int]
    columns: tuple[int, ...]


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
    """Poses of the joints and motions of the bodies at the mounts of a mechanism.

    Args:
        mechanism: The mechanism.
        joints: For each axis, its name and the joint (its nearest to the base) at which its actuator is by default.
        mounts: Mounts other than the default, by the name of the axis.

    Raises:
        InputError: A mount is of an unknown axis, or on an unknown link or frame.
    """

    def __init__(self, mechanism: Mechanism, joints: Mapping[str, str], mounts: Mapping[str, Mount]) -> None:
        self.mechanism = mechanism
        robot = mechanism.robot
        for name, mount in mounts.items():
            if name not in joints:
                raise InputError(f"mounts of {robot.name}: {unknown_name('joint or motor', name, joints)}")
            if mount.link is not None and mount.link not in robot.frame_names:
                raise InputError(
                    f"mounts of {robot.name}: {name}: {unknown_name('link or frame', mount.link, robot.frame_names)}"
                )
        frames = robot.equations.tree.frames
        own = {frame.name: frame for frame in frames if frame.is_joint}
        parents = {joint: frames[own[joint].parent_frame].name for joint in joints.values()}
        chosen = {name: mounts.get(name, Mount()) for name in joints}
        carriers = {name: chosen[name].link or parents[joint] for name, joint in joints.items()}
        self._frames = tuple(dict.fromkeys(carriers.values()))
        self._moving = [self._joints_and_columns(name) for name in self._frames]
        self.motors = tuple(joint.name for joint in mechanism.motors)
        neutral = States(np.zeros(1), robot.neutral[None], np.zeros((1, robot.nv)), np.zeros((1, robot.nv)))
        poses, carried = self._read(neutral)
        self.bodies = tuple(
            self._body(name, carriers[name], joints[name], parents[joints[name]], chosen[name].axis, poses, carried)
            for name in joints
        )

    def _body(
        self,
        name: str,
        frame: str,
        joint: str,
        parent: str,
        axis: tuple[float, ...] | None,
        poses: Array,
        carried: Sequence[Array],
    ) -> MountedBody:
        """A body, from the poses of joints and frames in the neutral position, where its joint is at 0."""
        place = self._frames.index(frame)
        offset, direction = np.zeros(3), np.array([0.0, 0.0, 1.0])
        if frame == parent:
            own, link = poses[0, self.motors.index(joint)], carried[place][0]
            turned = link[3:12].reshape(3, 3).T
            offset = turned @ (own[:3] - link[:3])
            direction = turned @ own[3:].reshape(3, 3) @ self.mechanism.robot.joint_axis(joint)
        if axis is not None:
            direction = np.array(axis)
        direction = direction / np.linalg.norm(direction)
        joints, columns = self._moving[place]
        return MountedBody(name, frame, tuple(offset.tolist()), tuple(direction.tolist()), frozenset(joints), columns)

    def _joints_and_columns(self, frame: str) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """The joints (numbers from 1) below a frame, and the velocity coordinates that move it."""
        robot = self.mechanism.robot
        joints = robot.equations.tree.supporting_joints(robot.frame_index(frame))
        leaders = {mimic.follower: mimic.leader for mimic in robot.mimics()}
        names = {robot.all_joint_names[number - 1] for number in joints}
        moving = {leaders.get(name, name) for name in names}
        columns = [range(j.v, j.v + j.nv) for j in robot.joints if j.name in moving]
        return joints, tuple(column for each in columns for column in each)

    def at(self, states: States) -> tuple[Array, tuple[BodyMotion, ...]]:
        """The poses (n, k, 12) of the motors' joints (position, rotation row by row), and the motion of each body."""
        poses, carried = self._read(states)
        return poses, tuple(_moved(body, carried[self._frames.index(body.frame)]) for body in self.bodies)

    def _read(self, states: States) -> tuple[Array, list[Array]]:
        """Poses of the joints (n, k, 12), and for each frame its pose, twist, rate of the twist and Jacobian (n, …)."""
        n, k = len(states.time), len(self.motors)
        flat = np.asarray(self._code(states.position, states.velocity, states.acceleration, self._parameters))
        sizes = [_POSE * k, *(_POSE + 2 * _TWIST + _TWIST * len(columns) for _, columns in self._moving)]
        parts = np.split(flat.reshape(n, -1), np.cumsum(sizes)[:-1], axis=1)
        return parts[0].reshape(n, k, _POSE), parts[1:]

    @property
    def _parameters(self) -> Array:
        equations = self.mechanism.equations
        return equations.parameters if equations.sets_tree else np.zeros(0)

    @property
    def _code(self) -> Compiled:
        equations = self.mechanism.equations
        targets = (
            [p.sets for p in equations.scene.parameters.values()]
            if equations.scene is not None and equations.sets_tree
            else []
        )
        key = f"mounts {self._frames!r} {self.motors!r} {targets!r}"
        return self.mechanism.robot.compiled(key, self._function)

    def _function(self) -> casadi.Function:
        """(q, v, a, p) -> the numbers that `_read` divides."""
        import casadi

        equations = self.mechanism.equations
        parameters = equations.scene.parameters if equations.scene is not None and equations.sets_tree else {}
        s = Symbols(self.mechanism.robot, parameters)
        a = casadi.SX.sym("a", self.mechanism.robot.nv)
        names = list(self.mechanism.robot.all_joint_names)
        joints = s.joint_frames()
        found = [_pose(joints[names.index(name)]) for name in self.motors]
        frames, rate = s.frames_at(self._frames, s.q), s.algorithm("configuration_rate")(s.q, s.v)
        for name, (_, columns) in zip(self._frames, self._moving, strict=True):
            frame = frames[name]
            twist = casadi.vertcat(frame.linear, frame.angular)
            jacobian = casadi.jacobian(twist, s.v)
            change = casadi.jtimes(twist, s.q, rate) + jacobian @ a
            found += [_pose(frame), twist, change, casadi.vec(jacobian[:, list(columns)])]
        return casadi.Function("mounts", [s.q, s.v, a, s.p], [casadi.densify(casadi.vertcat(*found))])


def _pose(frame: FrameSymbols) -> casadi.SX:
    import casadi

    return casadi.vertcat(frame.position, casadi.vec(frame.rotation.T))


def _moved(body: MountedBody, carrier: Array) -> BodyMotion:
    """The motion of a body from that (n, …) of the frame that carries it, by the kinematics of a rigid body."""
    n = len(carrier)
    rotation = carrier[:, 3:12].reshape(n, 3, 3)
    arm, axis = rotation @ np.array(body.offset), rotation @ np.array(body.axis)
    angular, linear_rate, angular_rate = carrier[:, 15:18], carrier[:, 18:21], carrier[:, 21:24]
    jacobian = carrier[:, 24:].reshape(n, len(body.columns), _TWIST).transpose(0, 2, 1).copy()
    jacobian[:, :3] += np.cross(jacobian[:, 3:], arm[:, :, None], axis=1)
    return BodyMotion(
        point=carrier[:, :3] + arm,
        axis=axis,
        linear_acceleration=linear_rate + np.cross(angular_rate, arm) + np.cross(angular, np.cross(angular, arm)),
        angular_velocity=angular,
        angular_acceleration=angular_rate,
        jacobian=jacobian,
    )
