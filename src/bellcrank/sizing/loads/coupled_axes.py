"""The axes of a mechanism: its motors' joints, and the motors of coupled transmissions in place of their joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from bellcrank.actuators.coupled_transmission import CoupledTransmission
from bellcrank.arrays import Array
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.inverse.mechanism import Mechanism
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.sizing.loads.joint_loads import JointLoads

ROUNDING = 16.0 * float(np.finfo(np.float64).eps)  # of the terms of a sum


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
