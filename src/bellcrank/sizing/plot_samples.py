"""A motion as it is drawn: dense states, and the torques of all joints at them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.dynamics.force_table_breakpoints import force_times
from bellcrank.sizing.joint_histories import SampledStates, joint_torques
from bellcrank.sizing.motion_grid import motion_sides

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import RobotJoint
    from bellcrank.sizing.result import SizingInputs

Array = NDArray[np.float64]
POINTS = 1001  # a motion with fewer rows is drawn with this many points besides them


@dataclass(frozen=True, eq=False)
class DrawnMotion:
    """States of a motion, and the torques (n, len(joints)), N m or N, of the joints with one degree of freedom.

    `sided` are the velocities (n, nv) with the signs of their sides (sizing/one_sided.py).
    """

    name: str
    joints: tuple[RobotJoint, ...]
    states: SampledStates
    torque: Array
    sided: Array

    def torque_of(self, joint: str) -> Array:
        """The torque (n,) of one joint."""
        return self.torque[:, [each.name for each in self.joints].index(joint)]


def drawn_motions(inputs: SizingInputs) -> list[DrawnMotion]:
    """The motions of a sizing as they are drawn."""
    mechanism, motions, actuators = inputs
    joints = tuple(joint for joint in mechanism.robot.joints if joint.nv == 1)
    drawn = []
    for motion in motions:
        states = drawn_states(motion)
        end = float(states.time[-1])
        torque = joint_torques(mechanism, joints, actuators, states, end)
        sided = motion_sides(motion).of_velocity(force_times(states.time, end), states.velocity)
        drawn.append(DrawnMotion(motion.name, joints, states, torque, sided))
    return drawn


def drawn_states(motion: Motion) -> SampledStates:
    """The rows of a motion, and points between them where there are few."""
    rows = SampledStates(motion.time, motion.position, motion.velocity, motion.acceleration)
    if len(motion.time) >= POINTS:
        return rows
    between = np.setdiff1d(np.linspace(motion.time[0], motion.time[-1], POINTS), motion.time)
    at = np.searchsorted(motion.time, between)
    values = (between, *motion.at(between))
    return SampledStates(*(np.insert(old, at, new, axis=0) for old, new in zip(rows, values, strict=True)))
