"""The loads of a mechanism in motion: at its joints, at the motors' shafts and at the supply."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.coupled_transmission import CoupledTransmission
from bellcrank.arrays import Array
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.inverse.mechanism import Mechanism
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

if TYPE_CHECKING:
    from bellcrank.robot.robot import RobotJoint

ROUNDING = 16.0 * float(np.finfo(np.float64).eps)  # of the terms of a sum


@dataclass(frozen=True, kw_only=True, eq=False)
class LoadHistory:
    """Loads at n times, (n, k) for k motors, within the mass tolerance; N m, rad/s, W (N, m/s on prismatic joints).

    `position` and `speed` are the joints'; `shaft_torque` is the larger |torque| at the motor's shaft, without the
    safety factor, and `curve_use` the share of the torque-speed curve used, with it (both 0 without an actuator, and
    where figures of it are unknown). `supply_power` and `returned_power` (n, 1) sum all joints; they are 0 where
    `JointLoads.unknown_supply` names a joint.
    """

    position: Array
    speed: Array
    highest_torque: Array
    lowest_torque: Array
    motoring_power: Array
    regenerating_power: Array
    shaft_torque: Array
    curve_use: Array
    supply_power: Array
    returned_power: Array

    def maximised(self) -> dict[str, Array]:
        """The series whose maxima are wanted, by name; lowest torques and positions are negated."""
        return {
            "max_torque": self.highest_torque,
            "min_torque": -self.lowest_torque,
            "peak_speed": np.abs(self.speed),
            "peak_motoring_power": self.motoring_power,
            "peak_regenerating_power": self.regenerating_power,
            "shaft_torque": self.shaft_torque,
            "curve_use": self.curve_use,
            "highest_position": self.position,
            "lowest_position": -self.position,
            "supply": self.supply_power,
            "regeneration": self.returned_power,
        }


@dataclass(frozen=True)
class JointLoads:
    """What a mechanism's motors must overcome at times t (n,) and states q (n, nq), v and a (n, nv).

    Where a joint has an actuator, its torque is that at the gear's output: the rotor's inertia counts at the shaft.
    """

    mechanism: Mechanism
    actuators: Mapping[str, Actuator]
    mass_tolerance: float

    @property
    def joints(self) -> tuple[RobotJoint, ...]:
        """The joints with motors."""
        return self.mechanism.motors

    @property
    def joint_names(self) -> list[str]:
        """Names of the joints with motors."""
        return [joint.name for joint in self.joints]

    @property
    def columns(self) -> list[int]:
        """The joints' velocity coordinates."""
        return [joint.v for joint in self.joints]

    def knows_shaft(self, joint: str) -> bool:
        """Whether the torque at the shaft of a joint's motor is known: there is an actuator, and it states enough."""
        return joint in self.actuators and not self.actuators[joint].unknown_of_torque

    @property
    def unknown_supply(self) -> dict[str, tuple[str, ...]]:
        """What is missing for the power that the motor of each joint takes; only joints where something is."""
        missing = {name: one.unknown_of_supply for name, one in self.actuators.items()}
        return {name: what for name, what in missing.items() if what}

    @property
    def rotor_inertia(self) -> Array:
        """Reflected rotor inertia (k,) that is part of the robot's mass matrix and belongs to an actuator."""
        given = self.mechanism.robot.rotor_inertia
        return np.array([given[joint.v] if joint.name in self.actuators else 0.0 for joint in self.joints])

    def nominal_torque(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Joint torques (n, k) with the nominal masses."""
        return self.mechanism.torques(t, q, v, a)[0] - self.rotor_inertia * a[:, self.columns]

    def torque_range(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Lowest and highest joint torque (n, k) within the mass tolerance: each link and payload as a whole, mass and
        inertia, is scaled by one factor within 1 ± tolerance.
        """
        nominal = self.nominal_torque(t, q, v, a)
        if self.mass_tolerance == 0.0:
            return nominal, nominal
        spread = self.mass_tolerance * np.abs(self.link_torques(t, q, v, a)).sum(axis=1)
        return nominal - spread, nominal + spread

    def link_torques(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The part (n, links, k) of the torques that each link's mass and inertia cause."""
        return self.mechanism.link_torques(t, q, v, a)

    def moving(self, values: Array) -> Array:
        """Positions of the motors' joints, or their derivatives (n, k), as coordinates of what the motors move."""
        return values

    def history(self, t: Array, q: Array, v: Array, a: Array) -> LoadHistory:
        """Torques, speeds and powers at the joints, the shafts and the supply."""
        low, high = self.torque_range(t, q, v, a)
        speed, rate = self.moving(v[:, self.columns]), self.moving(a[:, self.columns])
        most, least = np.maximum(low * speed, high * speed), np.minimum(low * speed, high * speed)
        supply, back = most.copy(), least.copy()
        shaft, curve = np.zeros_like(low), np.zeros_like(low)
        for k, name in enumerate(self.joint_names):
            if not self.knows_shaft(name):
                continue
            actuator = self.actuators[name]
            turns = actuator.ratio * speed[:, k]
            ends = [actuator.shaft_torque(end[:, k], speed[:, k], rate[:, k]) for end in (low, high)]
            shaft[:, k] = np.maximum(np.abs(ends[0]), np.abs(ends[1]))
            if actuator.has_limits:
                curve[:, k] = np.maximum(*(actuator.curve_use(actuator.safety_factor * end, turns) for end in ends))
            if not actuator.unknown_of_supply:
                electric = [actuator.supply_power(end, turns) for end in ends]
                supply[:, k], back[:, k] = np.maximum(*electric), np.minimum(*electric)
        if self.unknown_supply:
            supply, back = np.zeros_like(supply), np.zeros_like(back)
        return LoadHistory(
            position=self.moving(q[:, [joint.q for joint in self.joints]]),
            speed=speed,
            highest_torque=high,
            lowest_torque=low,
            motoring_power=np.maximum(most, 0.0),
            regenerating_power=np.maximum(-least, 0.0),
            shaft_torque=shaft,
            curve_use=curve,
            supply_power=np.maximum(supply.sum(axis=1, keepdims=True), 0.0),
            returned_power=np.maximum(-back.sum(axis=1, keepdims=True), 0.0),
        )

    def reactions(self, t: Array, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """Bearing force and tilting moment (n, k) of each joint, N and N m, with the nominal masses."""
        robot = self.mechanism.robot
        wrench = self.mechanism.reactions(t, q, v, a)
        names = list(robot.all_joint_names)
        force, moment = (np.zeros((len(q), len(self.joints))) for _ in range(2))
        for k, joint in enumerate(self.joints):
            axis = np.asarray(robot.joint_axis(joint.name))
            both = wrench[:, names.index(joint.name)].copy()
            driven = slice(0, 3) if joint.kind == "prismatic" else slice(3, 6)  # what the motor takes along the axis
            both[:, driven] -= np.outer(both[:, driven] @ axis, axis)
            force[:, k], moment[:, k] = np.linalg.norm(both[:, :3], axis=1), np.linalg.norm(both[:, 3:], axis=1)
        return {"peak_bearing_force": force, "peak_tilting_moment": moment}

    def inertia(self, t: Array, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """M_ii (n, k), kg m² or kg, without the actuators' rotors, with the nominal masses."""
        return {"largest_inertia": self.mechanism.inertia(t, q) - self.rotor_inertia}


@dataclass(frozen=True, eq=False)
class AxisCoordinates:
    """The coordinates θ = C q of the axes of a mechanism, in the order of its motors' joints.

    Attributes:
        matrix: C (k, k).
        kinds: Of each axis; the motors of coupled transmissions are rotary.
        joints: Names of the joints that each axis moves.
        mounted_at: For each axis, by its name, the joint at whose origin its actuator is by default.
    """

    matrix: Array
    kinds: tuple[Literal["rotary", "linear"], ...]
    joints: tuple[tuple[str, ...], ...]
    mounted_at: Mapping[str, str]


def of_axes(matrix: Array, values: Array) -> Array:
    """The axes' coordinates C x (n, k), or their derivatives, of those of joints (n, k); 0 where the terms cancel but
    for rounding, as the speed of an axis does that rests while its joints move.
    """
    found, size = values @ matrix.T, np.abs(values) @ np.abs(matrix).T
    return np.asarray(np.where(np.abs(found) <= ROUNDING * size, 0.0, found))


def axis_coordinates(mechanism: Mechanism, transmissions: Sequence[CoupledTransmission]) -> AxisCoordinates:
    """The axes; the motors of a coupled transmission take the places of its joints, in their order.

    Raises InputError where a joint of a transmission has no motor of its own, or a motor has the name of a joint.
    """
    robot, motors = mechanism.robot, mechanism.motors
    names = [joint.name for joint in motors]
    matrix = np.eye(len(names))
    kinds: list[Literal["rotary", "linear"]] = ["linear" if joint.kind == "prismatic" else "rotary" for joint in motors]
    joints: list[tuple[str, ...]] = [(name,) for name in names]
    axes, at = list(names), list(names)
    for one in transmissions:
        for name in one.joints:
            if name not in names:
                raise InputError(f"transmissions of {robot.name}: {unknown_name('joint with a motor', name, names)}")
        for name in one.motors:
            if name in robot.all_joint_names:
                raise InputError(
                    f"transmissions of {robot.name}: motor '{name}' has the name of a joint; give it another name"
                )
        places = [names.index(name) for name in one.joints]
        matrix[np.ix_(places, places)] = one.matrix
        lowest = min(one.joints, key=lambda name: _height(mechanism, name))
        for place, motor, row in zip(places, one.motors, one.matrix, strict=True):
            kinds[place], axes[place], at[place] = "rotary", motor, lowest
            joints[place] = tuple(name for name, entry in zip(one.joints, row, strict=True) if entry != 0.0)
    return AxisCoordinates(matrix, tuple(kinds), tuple(joints), dict(zip(axes, at, strict=True)))


def _height(mechanism: Mechanism, joint: str) -> int:
    """The number of joints between a joint and the world."""
    tree = mechanism.robot.equations.tree
    place = next(k for k, frame in enumerate(tree.frames) if frame.is_joint and frame.name == joint)
    return len(tree.supporting_joints(place))


# ---- The loads at the axes of motors where coupled transmissions take the places of joints: θ = C q, τ_axis = C⁻ᵀ τ.
#
# Source: Tsai, Robot Analysis (1999), 7.4, as in actuators/coupled_transmission.py.


@dataclass(frozen=True)
class MotorLoads(JointLoads):
    """What the motors must overcome at their axes; `actuators` are by axis, the joint or the motor of a transmission.

    Reactions are those of joints, and 0 here.
    """

    coordinates: AxisCoordinates

    @cached_property
    def _force(self) -> Array:
        """C⁻ᵀ (k, k)."""
        return np.asarray(np.linalg.inv(self.coordinates.matrix).T)

    @property
    def joint_names(self) -> list[str]:
        """Names of the axes."""
        return list(self.coordinates.mounted_at)

    def moving(self, values: Array) -> Array:
        """The axes' coordinates (n, k) of values of the joints' coordinates (n, k): positions, or their derivatives."""
        return of_axes(self.coordinates.matrix, values)

    def nominal_torque(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Torques (n, k) at the axes with the nominal masses."""
        return np.asarray(super().nominal_torque(t, q, v, a) @ self._force.T)

    def link_torques(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """The part (n, links, k) of the torques at the axes that each link's mass and inertia cause."""
        return np.asarray(super().link_torques(t, q, v, a) @ self._force.T)

    def reactions(self, t: Array, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """Zeros (n, k): an axis that moves several joints has no wrench."""
        nothing = np.zeros((len(q), len(self.joints)))
        return {"peak_bearing_force": nothing, "peak_tilting_moment": nothing}

    def inertia(self, t: Array, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """The diagonal of P M Pᵀ (n, k) without the actuators' rotors; P (k, nv) gives the torques of joint forces."""
        if isinstance(self.mechanism, Linkage):
            shares = self.mechanism.force_maps(t, q)[0]
        else:
            shares = np.eye(self.mechanism.robot.nv)[self.columns]
        mass = self.mechanism.equations.mass_matrix(q)
        mass[:, self.columns, self.columns] -= self.rotor_inertia
        shares = self._force @ shares
        return {"largest_inertia": np.asarray(((shares @ mass) * shares).sum(axis=-1))}
