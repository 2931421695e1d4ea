"""Joint friction as it was asked for, gathered on the independent coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot

Array = NDArray[np.float64]
Friction = str | Mapping[str, tuple[float, float]]


def friction_coefficients(
    robot: Robot, friction: Friction, given: Mapping[str, tuple[float, float]]
) -> tuple[Array, Array]:
    """Viscous (N m s/rad or N s/m) and Coulomb (N m or N) friction, (nv,) each.

    `friction` is "urdf" (the values `given` by the file), "none", or {joint: (viscous, coulomb)}. What a
    mimicking joint has acts on its leader through the ratio of their speeds. Raises InputError.
    """
    viscous, coulomb = np.zeros(robot.nv), np.zeros(robot.nv)
    if friction == "none":
        return viscous, coulomb
    if friction == "urdf":
        ratios = {follower: (leader, m) for follower, leader, m, _ in robot.mimics()}
        for joint_name, (b, c) in given.items():
            name, ratio = joint_name, 1.0
            while name in ratios:
                name, m = ratios[name]
                ratio *= m
            index = robot.joint(name).v
            viscous[index] += ratio * ratio * b
            coulomb[index] += abs(ratio) * c
        return viscous, coulomb
    if isinstance(friction, str):
        raise InputError(f"friction must be 'urdf', 'none' or {{joint: (viscous, coulomb)}}, it is '{friction}'")
    for name, pair in friction.items():
        joint = robot.one_degree_joint(name, "friction")
        try:
            b, c = (float(x) for x in pair)
        except (TypeError, ValueError):
            raise InputError(f"friction of joint '{name}' must be (viscous, coulomb), it is {pair!r}") from None
        if not (np.isfinite([b, c]).all() and b >= 0.0 and c >= 0.0):
            raise InputError(f"friction of joint '{name}' must be two numbers >= 0, it is {pair!r}")
        viscous[joint.v], coulomb[joint.v] = b, c
    return viscous, coulomb
