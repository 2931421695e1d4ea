"""What acts on a robot's joints, shafts and supply in a state of motion: what sizing looks at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.sizing.drive import Drive

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Loads:
    """The quantities whose maxima are wanted, as functions of the state, for the joints that can have a
    motor."""

    robot: Robot
    joints: tuple[RobotJoint, ...]
    drives: Mapping[str, Drive]
    tolerance: float

    @property
    def columns(self) -> list[int]:
        """Velocity coordinates of the joints."""
        return [joint.v for joint in self.joints]

    @property
    def rotor(self) -> Array:
        """Rotor inertia (k,) in the robot's mass matrix that belongs to the shaft side of a drive."""
        return np.array(
            [self.robot.rotor_inertia[joint.v] if joint.name in self.drives else 0.0 for joint in self.joints]
        )

    def torque(self, q: Array, v: Array, a: Array) -> tuple[Array, Array]:
        """Lowest and highest torque (n, k) within the mass tolerance (each link or payload as a whole,
        mass and inertia scaled by one factor within 1 ± tolerance), a drive's rotor left out."""
        nominal = np.asarray(self.robot.inverse_dynamics(q, v, a))[:, self.columns] - self.rotor * a[:, self.columns]
        if self.tolerance == 0.0:
            return nominal, nominal
        spread = self.tolerance * np.abs(self.robot.link_torques(q, v, a)).sum(axis=1)[:, self.columns]
        return nominal - spread, nominal + spread

    def forces(self, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """Torques, speeds, powers, shaft torque, curve use and supply power; names that end in _ are no
        peaks."""
        low, high = self.torque(q, v, a)
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

    def reactions(self, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """Bearing force and tilting moment (n, k) of each joint."""
        wrench = self.robot.joint_reactions(q, v, a)
        names = list(self.robot.all_joint_names)
        force, moment = (np.zeros((len(q), len(self.joints))) for _ in range(2))
        for k, joint in enumerate(self.joints):
            axis = np.asarray(self.robot.joint_axis(joint.name))
            both = wrench[:, names.index(joint.name)]
            across = 0 if joint.kind == "prismatic" else 3
            both = both.copy()
            both[:, across : across + 3] -= np.outer(both[:, across : across + 3] @ axis, axis)
            force[:, k], moment[:, k] = (
                np.linalg.norm(both[:, :3], axis=1),
                np.linalg.norm(both[:, 3:], axis=1),
            )
        return {"peak_bearing_force": force, "peak_tilting_moment": moment}

    def inertia(self, q: Array, v: Array, a: Array) -> dict[str, Array]:
        """M_ii (n, k), a drive's rotor left out."""
        diagonal = np.diagonal(self.robot.mass_matrix(q), axis1=-2, axis2=-1)
        return {"largest_inertia": np.asarray(diagonal[:, self.columns] - self.rotor)}
