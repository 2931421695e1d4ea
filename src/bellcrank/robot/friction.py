"""Joint friction as it was asked for, gathered on the independent coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank import arguments

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot

Array = NDArray[np.float64]
Friction = str | Mapping[str, tuple[float, float]]


def checked_friction(friction: object) -> Friction:
    """A friction as it may be asked for, a mapping copied: joints are looked up later. Raises InputError."""
    expected = "'urdf', 'none' or a mapping of joints to (viscous, coulomb)"
    if isinstance(friction, str):
        return arguments.one_of("friction", friction, ("urdf", "none"))
    pairs: dict[str, tuple[float, float]] = {}
    for name, pair in arguments.mapping("friction", friction, expected).items():
        own = f'friction["{name:.80}"]'
        b, c = arguments.vector(own, pair, 2, "viscous, coulomb", most=arguments.LARGEST).tolist()
        if min(b, c) < 0.0:
            arguments.refuse(own, "two numbers of at least 0 (viscous, coulomb)", min(b, c))
        pairs[name] = (b, c)
    return pairs


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
    if isinstance(friction, str):
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
    for name, (b, c) in friction.items():
        joint = robot.one_degree_joint(name, "friction")
        viscous[joint.v], coulomb[joint.v] = b, c
    return viscous, coulomb
