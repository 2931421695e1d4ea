"""Checks of loads: that they are finite, and which motors move no mass."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.dynamics.inverse.closed_inverse_dynamics import Linkage
from bellcrank.dynamics.inverse.motor_shares import motor_shares
from bellcrank.errors import InputError
from bellcrank.robot.dynamics.articulated_inertia import vanishing_pivots
from bellcrank.robot.model.joints import postures

if TYPE_CHECKING:
    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import RobotJoint
    from bellcrank.sizing.joint_sizing import JointSizing, MotorSizing


REMEDY = "so the motor cannot be sized; check the masses, lengths, forces, actuator and accelerations there"
MOVES = 1e-9  # of the fastest joint's speed: a joint of a linkage that is slower does not move with the motor
POSTURES = 7  # of a motion, at which a linkage is evaluated
LISTED = 4  # links that a sentence names


def refuse_non_finite(robot: str, joints: Sequence[str], time: Array, values: Mapping[str, Array]) -> None:
    """InputError naming joint, quantity and the first time (n,) at which one of the values (n, k) is not finite."""
    bad = {name: ~np.isfinite(rows) for name, rows in values.items()}
    rows = {name: int(each.any(axis=1).argmax()) for name, each in bad.items() if each.any()}
    if not rows:
        return
    name = min(rows, key=lambda name: rows[name])
    row = rows[name]
    column = int(bad[name][row].argmax())
    who = f" of joint '{joints[column]}'" if values[name].shape[1] == len(joints) else " of all joints"
    raise InputError(
        f"sizing of {robot}: the {name.replace('_', ' ')}{who} is {_found(float(values[name][row, column]))} at "
        f"{time[row]:.6g} s, {REMEDY}"
    )


def refuse_non_finite_joint(robot: str, joint: JointSizing) -> None:
    """InputError naming joint and quantity where a number of a joint's sizing is not finite.

    A margin may be infinite where its limit is 0.
    """
    for name, value in _numbers(joint, ""):
        if not math.isfinite(value):
            raise InputError(f"sizing of {robot}: the {name} of joint '{joint.name}' is {_found(value)}, {REMEDY}")
    for name, margin, limit in (
        ("effort margin", joint.effort_margin, joint.effort_limit),
        ("velocity margin", joint.velocity_margin, joint.velocity_limit),
    ):
        if margin is not None and not math.isfinite(margin) and limit:
            raise InputError(f"sizing of {robot}: the {name} of joint '{joint.name}' is {_found(margin)}, {REMEDY}")


def refuse_non_finite_motor(robot: str, motor: MotorSizing) -> None:
    """InputError naming motor and quantity where a number of the sizing of a coupled transmission's motor is not
    finite.
    """
    for name, value in _numbers(motor, ""):
        if not math.isfinite(value):
            raise InputError(f"sizing of {robot}: the {name} of motor '{motor.name}' is {_found(value)}, {REMEDY}")


def _numbers(value: Any, name: str) -> Iterable[tuple[str, float]]:
    """All floats in a result, with the names of their fields."""
    if isinstance(value, float):
        yield name, value
    elif is_dataclass(value):
        for entry in fields(value):
            if entry.name == "judging":  # a use is infinite where the limit is 0, or the temperature rises without end
                continue
            yield from _numbers(getattr(value, entry.name), f"{name} {entry.name}".replace("_", " ").strip())
    elif isinstance(value, Mapping):
        for key, each in value.items():
            yield from _numbers(each, f"{name} {key}".replace("_", " ").removeprefix("peaks "))
    elif isinstance(value, tuple):
        for each in value:
            yield from _numbers(each, name)


def _found(value: float) -> str:
    return "not a number (NaN)" if math.isnan(value) else "infinite"


@dataclass(frozen=True)
class MasslessMotors:
    """A sentence for each joint whose motor moves no mass: those that cannot be sized, and those that are allowed."""

    refused: Mapping[str, str]
    allowed: Mapping[str, str]


def massless_motors(mechanism: Mechanism, motions: Sequence[Motion], allowed: Iterable[str] = ()) -> MasslessMotors:
    """The motors that move no mass. A payload is mass; a motor of a closed linkage moves all that its loops move.

    `allowed` names links without mass that may be moved; all that is fixed to such a link or follows it is allowed too.
    Raises InputError for a link that is unknown or moves mass.
    """
    robot, given = mechanism.robot, mechanism.equations.set_masses
    permitted: set[str] = set()
    named = tuple(allowed)
    for link in named:
        carrier = robot.carrier(link)
        links, mass = robot.moved_by([carrier] if carrier else [], given)
        if carrier is None or mass > 0.0:
            why = f"moves {mass:.6g} kg, so it is not massless" if carrier else "does not move"
            raise InputError(f"allow_massless: link '{link}' of {robot.name} {why}; remove it from the list")
        permitted.update(links)
    refused, let_pass = {}, {}
    for k, joint in enumerate(mechanism.motors):
        movers = _moving(mechanism, k, joint, motions)
        links, mass = robot.moved_by(movers, given)
        if mass > 0.0:
            continue
        if set(links) <= permitted:
            let_pass[joint.name] = (
                f"joint '{joint.name}' moves no mass ({_names(links)}), as allowed: its torque includes no inertia and "
                "no weight"
            )
            continue
        roots = [robot.urdf.joints[name].child for name in movers if name in robot.urdf.joints]
        options = " ".join(f"--allow-massless {link}" for link in roots)
        if robot.moved_by(movers)[1] > 0.0:
            why, remedy = "with the scene's parameters", "give those masses or factors above 0"
        else:
            why, remedy = "without <inertial>", "write the <inertial> of what it moves"
        refused[joint.name] = (
            f"joint '{joint.name}' moves no mass: {_names(links)} {why}; {remedy}, add a payload, or allow it with "
            f"{options}"
        )
    return MasslessMotors(refused, let_pass)


def refuse_massless(
    what: str, mechanism: Mechanism, motions: Sequence[Motion], allowed: Iterable[str]
) -> tuple[str, ...]:
    """Refuse motors that move no mass, because any actuator would seem to do; notes on those that are allowed.

    Args:
        what: For what, such as "selection".
        mechanism: An open chain or a linkage.
        motions: The motions.
        allowed: Links without mass that motors may move.

    Returns:
        A sentence for each motor that is allowed to move no mass.

    Raises:
        InputError: A motor moves no mass, or an argument is wrong.
    """
    links = arguments.several("allow_massless", allowed, str, "names of links", alone=True)
    found = massless_motors(mechanism, motions, links)
    for text in found.refused.values():
        raise InputError(f"{what} for {mechanism.robot.name}: {text}")
    return tuple(found.allowed.values())


def singular_joints(mechanism: Mechanism) -> dict[str, str]:
    """Sentences by joint about the joints of a tree about whose axis there is no inertia, parameters included."""
    robot, equations = mechanism.robot, mechanism.equations
    if not robot.singular_joints or not equations.sets_tree:
        return dict(robot.singular_joints)
    moves = np.random.default_rng(POSTURES).uniform(-1.5, 1.5, (POSTURES, robot.nq))
    matrices = equations.mass_matrix(postures(robot, moves, 0.1)) - np.diag(robot.rotor_inertia)
    singular = vanishing_pivots(matrices)
    return {name: text for name, text in robot.singular_joints.items() if singular[robot.joint(name).v]}


def _moving(mechanism: Mechanism, k: int, joint: RobotJoint, motions: Sequence[Motion]) -> list[str]:
    """The joints of the tree that move when only the k-th motor does."""
    robot, found = mechanism.robot, {joint.name}
    if isinstance(mechanism, Linkage):
        q = np.concatenate([motion.position[:: max(1, len(motion) // POSTURES)] for motion in motions])
        jacobian = mechanism.kinematics.jacobian(np.zeros(len(q)), q)
        share = np.abs(motor_shares(mechanism, q, jacobian).torques[:, k]).max(axis=0)
        found |= {j.name for j in robot.joints if share[j.v : j.v + j.nv].max() > MOVES * share.max()}
    leaders = {follower: leader for follower, leader, ratio, _ in robot.mimics() if ratio != 0.0}
    return [name for name in robot.all_joint_names if name in found or leaders.get(name) in found]


def _names(links: Sequence[str]) -> str:
    listed = ", ".join(f"'{name}'" for name in links[:LISTED])
    more = f" and {len(links) - LISTED} more" if len(links) > LISTED else ""
    return f"link{'' if len(links) == 1 else 's'} {listed}{more}"
