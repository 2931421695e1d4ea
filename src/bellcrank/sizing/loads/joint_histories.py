"""Torque, speed and power of each sized joint, and of its motor's shaft, along a motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank.arrays import Array
from bellcrank.dynamics.inverse.input_breakpoints import force_times
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.sizing.loads.motion_grid import motion_sides

if TYPE_CHECKING:
    from bellcrank.actuators.actuator import Actuator
    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import RobotJoint
    from bellcrank.sizing.result import Sizing


class SizingInputs(NamedTuple):
    """What was sized: the mechanism, its motions (with extra rows at the rows of force tables) and the actuators by
    joint."""

    mechanism: Mechanism
    motions: tuple[Motion, ...]
    actuators: Mapping[str, Actuator]


def sizing_inputs(sizing: Sizing) -> SizingInputs:
    """What was sized. Raises InputError where the sizing does not hold it."""
    if sizing.inputs is None:
        raise InputError(f"sizing of {sizing.robot}: it does not hold its motions; make it with bellcrank.size")
    return sizing.inputs


class SampledStates(NamedTuple):
    """States at times (n,), s: position q (n, nq), velocity v and acceleration a (n, nv), SI units."""

    time: Array
    position: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True, eq=False)
class ShaftHistory:
    """A motor's shaft over time, without the safety factor.

    Attributes:
        torque: Shaft torque (n,), N m: τ / (N η) while the load takes power, τ η / N while it gives power back, plus
            J N q̈ (see `Actuator`).
        speed: Shaft speed N q̇ (n,), rad/s.
        power: Their product (n,), W.
    """

    torque: Array
    speed: Array
    power: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class JointLoadHistory:
    """A joint over time, for the nominal masses; arrays are (n,).

    Attributes:
        name: Name of the joint.
        kind: "revolute" or "prismatic".
        position: Position, rad or m.
        velocity: Velocity, rad/s or m/s.
        acceleration: Acceleration, rad/s² or m/s².
        torque: Torque, N m or N, that the motor applies; with an actuator that at the gear's output, without the
            rotor's inertia.
        power: Power into the joint, W.
        shaft: The motor's shaft; None without an actuator, and where its torque is unknown.
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
    """All sized joints at the rows of a motion.

    Attributes:
        motion: Name of the motion.
        time: Times (n,), s; a time that occurs twice holds both limits of a jump.
        joints: The history of each joint.
        multiplier_names: (constraint, label) of each multiplier of the constraints; none for an open chain.
        multipliers: Forces and moments (n, rows) of the constraints, N or N m, such as those in rods.
    """

    motion: str
    time: Array
    joints: tuple[JointLoadHistory, ...]
    multiplier_names: tuple[tuple[str, str], ...]
    multipliers: Array

    def joint(self, name: str) -> JointLoadHistory:
        """The history of one joint.

        Args:
            name: Name of the joint.

        Returns:
            Its JointHistory.

        Raises:
            InputError: For an unknown name.
        """
        for joint in self.joints:
            if joint.name == name:
                return joint
        raise InputError(
            f"history of '{self.motion}': {unknown_name('joint', name, [joint.name for joint in self.joints])}"
        )


def joint_torques(
    mechanism: Mechanism,
    joints: Sequence[RobotJoint],
    actuators: Mapping[str, Actuator],
    states: SampledStates,
    end: float | None = None,
) -> Array:
    """The torques (n, len(joints)), N m or N, that motors must apply, 0 at joints without a motor; with an actuator
    that at the gear's output, without the rotor's inertia.

    Where a time occurs twice, its first row is the limit from before; so is the row at `end` s, where a motion ends.
    """
    return _torques_and_multipliers(mechanism, joints, actuators, states, end)[0]


def _torques_and_multipliers(
    mechanism: Mechanism,
    joints: Sequence[RobotJoint],
    actuators: Mapping[str, Actuator],
    states: SampledStates,
    end: float | None,
) -> tuple[Array, Array]:
    """As `joint_torques`, and the multipliers (n, rows) of the constraints, N or N m."""
    time, q, v, a = states
    every, multipliers = mechanism.torques(force_times(time, end), q, v, a)
    places = {joint.name: k for k, joint in enumerate(mechanism.motors)}
    found = np.zeros((len(time), len(joints)))
    for k, joint in enumerate(joints):
        if joint.name in places:
            rotor = mechanism.robot.rotor_inertia[joint.v] if joint.name in actuators else 0.0
            found[:, k] = every[:, places[joint.name]] - rotor * a[:, joint.v]
    return found, multipliers


def motion_history(
    mechanism: Mechanism, joints: Sequence[RobotJoint], actuators: Mapping[str, Actuator], motion: Motion
) -> MotionHistory:
    """The history of joints at the rows of a motion."""
    states = SampledStates(motion.time, motion.position, motion.velocity, motion.acceleration)
    end = float(motion.time[-1])
    torques, multipliers = _torques_and_multipliers(mechanism, joints, actuators, states, end)
    of_sides = motion_sides(motion).of_velocity(force_times(motion.time, end), motion.velocity)
    histories = []
    for joint, torque in zip(joints, torques.T, strict=True):
        velocity, acceleration = motion.velocity[:, joint.v], motion.acceleration[:, joint.v]
        shaft, actuator = None, actuators.get(joint.name)
        if actuator is not None and not actuator.unknown_of_torque:
            shaft_torque = actuator.shaft_torque(torque, of_sides[:, joint.v], acceleration)
            speed = actuator.ratio * velocity
            shaft = ShaftHistory(torque=shaft_torque, speed=speed, power=shaft_torque * speed)
        histories.append(
            JointLoadHistory(
                name=joint.name,
                kind=joint.kind,
                position=motion.position[:, joint.q],
                velocity=velocity,
                acceleration=acceleration,
                torque=torque,
                power=torque * velocity,
                shaft=shaft,
            )
        )
    return MotionHistory(motion.name, motion.time, tuple(histories), mechanism.multiplier_names, multipliers)


def sizing_histories(sizing: Sizing) -> dict[str, MotionHistory]:
    """The histories of the joints of a sizing, by motion. Raises InputError where the sizing does not hold motions."""
    mechanism, motions, actuators = sizing_inputs(sizing)
    return {motion.name: motion_history(mechanism, mechanism.motors, actuators, motion) for motion in motions}
