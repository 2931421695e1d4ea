"""The motion of all joints of a robot's tree in the world, and Jacobians of points that move with them.

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
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.elements.symbols import Symbols

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
