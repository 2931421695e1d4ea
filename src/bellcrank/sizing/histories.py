"""What a sizing looked at over time: torque, speed and power at the joints and at the motors' shafts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

if TYPE_CHECKING:
    from bellcrank.actuators.actuator import Drive
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import RobotJoint

Array = NDArray[np.float64]
Torques = Callable[[Array, Array, Array, Array], Array]  # (t, q, v, a) -> (n, joints)


@dataclass(frozen=True, eq=False)
class ShaftHistory:
    """A motor's shaft over time: torque (n,) in N m, speed (n,) in rad/s and power (n,) in W.

    Torque is T = τ / (N η) while the load takes power, τ η / N while it gives power back, plus J N q̈ (`Drive`), speed
    is N q̇, power T N q̇; all without the safety factor.
    """

    torque: Array
    speed: Array
    power: Array


@dataclass(frozen=True, eq=False)
class JointHistory:
    """A joint over time, all (n,): position (rad or m), velocity (rad/s, m/s), acceleration (rad/s², m/s²), torque (N m
    or N) and power (W) that it is given; for the nominal masses.

    With a drive the torque is that of the gear's output, without the rotor's own inertia, and `shaft` is the motor's;
    without one `shaft` is None.
    """

    name: str
    kind: str
    position: Array
    velocity: Array
    acceleration: Array
    torque: Array
    power: Array
    shaft: ShaftHistory | None


@dataclass(frozen=True, eq=False)
class MotionHistory:
    """All sized joints over the rows of a motion, time (n,) in s; a time that stands twice has both sides of a jump."""

    motion: str
    time: Array
    joints: tuple[JointHistory, ...]

    def joint(self, name: str) -> JointHistory:
        """The history of one joint. Raises InputError for an unknown name."""
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise InputError(
            f"history of '{self.motion}': {unknown_name('joint', name, [joint.name for joint in self.joints])}"
        )


def motion_history(
    motion: Motion, joints: Sequence[RobotJoint], drives: Mapping[str, Drive], torques: Torques
) -> MotionHistory:
    """The history of joints along a motion; `torques` gives those of the joints, (n, joints), at times and states."""
    found = torques(motion.time, motion.position, motion.velocity, motion.acceleration)
    lines = []
    for joint, torque in zip(joints, found.T, strict=True):
        velocity, acceleration = motion.velocity[:, joint.v], motion.acceleration[:, joint.v]
        shaft, drive = None, drives.get(joint.name)
        if drive is not None:
            turned = drive.shaft_torque(torque, velocity, acceleration)
            speed = drive.ratio * velocity
            shaft = ShaftHistory(turned, speed, turned * speed)
        position = motion.position[:, joint.q]
        lines.append(
            JointHistory(joint.name, joint.kind, position, velocity, acceleration, torque, torque * velocity, shaft)
        )
    return MotionHistory(motion.name, motion.time, tuple(lines))
