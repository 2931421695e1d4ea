"""What acts on a mechanism's joints, shafts and supply in a state of motion: what sizing looks at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.actuator import Drive

if TYPE_CHECKING:
    from bellcrank.dynamics.mechanism import Mechanism
    from bellcrank.robot.robot import RobotJoint

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Loads:
    """The quantities whose maxima are wanted, as functions of time t (n,) and the state, for the joints with motors."""

    mechanism: Mechanism
    drives: Mapping[str, Drive]
    tolerance: float

    @property
    def joints(self) -> tuple[RobotJoint, ...]:
        """The joints with motors."""
        return self.mechanism.motors

    @property
    def columns(self) -> list[int]:
        """Velocity coordinates of the joints."""
        return [joint.v for joint in self.joints]

    @property
    def rotor(self) -> Array:
        """Rotor inertia (k,) in the robot's mass matrix that belongs to the shaft side of a drive."""
        given = self.mechanism.robot.rotor_inertia
        return np.array([given[joint.v] if joint.name in self.drives else 0.0 for joint in self.joints])

    def nominal(self, t: Array, q: Array, v: Array, a: Array) -> Array:
        """Torques (n, k) with the masses as they are given, a drive's rotor left out: what the gear's output gives."""
        return self.mechanism.torques(t, q, v, a)[0] - self.rotor * a[:, self.columns]

    def torque(self, t: Array, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Lowest and highest torque (n, k) within the mass tolerance (each link or payload as a whole,
        mass and inertia scaled by one factor within 1 ± tolerance), a drive's rotor left out."""
        nominal = self.nominal(t, q, v, a)
        if self.tolerance == 0.0:
            return nominal, nominal
        spread = self.tolerance * np.abs(self.mechanism.link_torques(t, q, v, a)).sum(axis=1)
        return nominal - spread, nominal + spread

    def forces(self, t: Array, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """Torques, speeds, powers, shaft torque, curve use and supply power; names that end in _ are no
        peaks."""
        low, high = self.torque(t, q, v, a)
        speed, rate = v[:, self.columns], a[:, self.columns]
        most, least = np.maximum(low * speed, high * speed), np.minimum(low * speed, high * speed)
        supply, back = most.copy(), least.copy()
        shaft, curve = np.zeros_like(low), np.zeros_like(low)
        for k, joint in enumerate(self.joints):
            if (drive := self.drives.get(joint.name)) is None:
                continue
            turns = drive.ratio * speed[:, k]
            ends = [drive.shaft_torque(end[:, k], speed[:, k], rate[:, k]) for end in (low, high)]
            shaft[:, k] = np.maximum(np.abs(ends[0]), np.abs(ends[1]))
            curve[:, k] = drive.curve_use(drive.safety_factor * shaft[:, k], turns)
            electric = [drive.electrical_power(end * turns) for end in ends]
            supply[:, k], back[:, k] = np.maximum(*electric), np.minimum(*electric)
        position = q[:, [joint.q for joint in self.joints]]
        return {
            "max_torque": high,
            "min_torque": -low,
            "peak_speed": np.abs(speed),
            "peak_motoring_power": np.maximum(most, 0.0),
            "peak_regenerating_power": np.maximum(-least, 0.0),
            "shaft_torque": shaft,
            "curve_use": curve,
            "upper": position,
            "lower": -position,
            "supply": np.maximum(supply.sum(axis=1, keepdims=True), 0.0),
            "regeneration": np.maximum(-back.sum(axis=1, keepdims=True), 0.0),
        }

    def reactions(self, t: Array, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """Bearing force and tilting moment (n, k) of each joint."""
        robot = self.mechanism.robot
        wrench = self.mechanism.reactions(t, q, v, a)
        names = list(robot.all_joint_names)
        force, moment = (np.zeros((len(q), len(self.joints))) for _ in range(2))
        for k, joint in enumerate(self.joints):
            axis = np.asarray(robot.joint_axis(joint.name))
            both = wrench[:, names.index(joint.name)]
            across = 0 if joint.kind == "prismatic" else 3
            both = both.copy()
            both[:, across : across + 3] -= np.outer(both[:, across : across + 3] @ axis, axis)
            force[:, k], moment[:, k] = (
                np.linalg.norm(both[:, :3], axis=1),
                np.linalg.norm(both[:, 3:], axis=1),
            )
        return {"peak_bearing_force": force, "peak_tilting_moment": moment}

    def inertia(self, t: Array, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """M_ii (n, k), a drive's rotor left out."""
        return {"largest_inertia": self.mechanism.inertia(t, q) - self.rotor}
