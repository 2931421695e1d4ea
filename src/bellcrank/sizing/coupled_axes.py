"""The axes of a mechanism: its motors' joints, and the motors of coupled transmissions in place of their joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.coupled_transmission import CoupledTransmission
from bellcrank.dynamics.mechanism import Mechanism
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

Array = NDArray[np.float64]
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
