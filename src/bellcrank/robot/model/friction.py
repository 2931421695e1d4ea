"""Joint friction: viscous and Coulomb coefficients of the independent joints."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.robot.model.joints import JointMimic, RobotJoint, joint_named, require_uniform

Friction = str | Mapping[str, tuple[float, float]]
FRICTION_WIDTH = 1e-3  # rad/s or m/s: Coulomb friction is at 71 % of its value at this speed


def checked_friction(friction: object) -> Friction:
    """The `friction` argument of load_robot, a mapping copied; the joints' names are checked later.

    Raises InputError.
    """
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
    robot: str,
    joints: Sequence[RobotJoint],
    mimics: Iterable[JointMimic],
    friction: Friction,
    in_urdf: Mapping[str, tuple[float, float]],
) -> tuple[Array, Array]:
    """Viscous (N m s/rad or N s/m) and Coulomb (N m or N) friction, (nv,) each, of the independent joints.

    `friction` is "urdf" (the coefficients `in_urdf`), "none", or {joint: (viscous, coulomb)}; `robot` is the robot's
    name for messages. The friction of a mimicking joint acts on its leader through the ratio of their speeds; that of a
    spherical joint acts about each axis. Raises InputError.
    """
    nv = sum(joint.nv for joint in joints)
    viscous, coulomb = np.zeros(nv), np.zeros(nv)
    if friction == "none":
        return viscous, coulomb
    mimics = tuple(mimics)
    if isinstance(friction, str):
        leaders = {mimic.follower: mimic for mimic in mimics}
        for joint_name, (b, c) in in_urdf.items():
            name, ratio = joint_name, 1.0
            while name in leaders:
                ratio *= leaders[name].multiplier
                name = leaders[name].leader
            joint = joint_named(robot, joints, (), name)
            viscous[joint.v : joint.v + joint.nv] += ratio * ratio * b
            coulomb[joint.v : joint.v + joint.nv] += abs(ratio) * c
        return viscous, coulomb
    for name, (b, c) in friction.items():
        joint = require_uniform(joint_named(robot, joints, mimics, name), "friction")
        viscous[joint.v : joint.v + joint.nv], coulomb[joint.v : joint.v + joint.nv] = b, c
    return viscous, coulomb
