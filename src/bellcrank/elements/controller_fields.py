"""Reads the fields of controllers: joints, gains, limits, motions and mass errors."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from bellcrank.config.fields import Fields
from bellcrank.elements.element import MASS_ERROR, NONNEGATIVE, POSITIVE, common_unit, joint_named, number
from bellcrank.messages import unknown_name
from bellcrank.robot.robot import Robot, RobotJoint

Gain = float | Mapping[str, float]


def unit_of(joints: tuple[RobotJoint, ...], quantity: str) -> str:
    """The unit of a quantity ("stiffness", "torque", …) at joints; a text that is a unit already is returned."""
    return common_unit(joints, quantity) if quantity in ("stiffness", "damping", "torque", "position") else quantity


def all_joints(robot: Robot) -> tuple[RobotJoint, ...]:
    """The joints with one degree of freedom, which can have motors."""
    return tuple(joint for joint in robot.joints if joint.nv == 1)


@dataclass(frozen=True)
class Driven:
    """The joints at which controllers may act.

    Attributes:
        robot: The robot.
        joints: Those with motors: named by `actuated`, or with actuators; all with one degree of freedom where the
            file names none.
        named: Whether the file names any.
    """

    robot: Robot
    joints: tuple[RobotJoint, ...]
    named: bool

    @classmethod
    def of(cls, robot: Robot, motors: Collection[str]) -> Driven:
        """Those of a robot whose joints with motors have these names."""
        joints = all_joints(robot)
        return cls(robot, tuple(joint for joint in joints if joint.name in motors) if motors else joints, bool(motors))

    def checked(self, read: Fields, key: str, joints: tuple[RobotJoint, ...]) -> tuple[RobotJoint, ...]:
        """Joints that a key names. Raises InputError where one has no motor."""
        for joint in joints:
            if joint not in self.joints:
                names = ", ".join(one.name for one in self.joints)
                raise read.error(
                    key,
                    f"joint '{joint.name}' has no motor: those of the file are at {names}; add it to 'actuated' (or "
                    "give it an actuator), or write a force under 'forces'",
                )
        return joints


def read_joints(
    read: Fields, driven: Driven, otherwise: tuple[RobotJoint, ...], otherwise_key: str = "joints"
) -> tuple[RobotJoint, ...]:
    """Read `joint` or `joints` (a list, or "all": those with motors); `otherwise`, which `otherwise_key` names, without
    these keys. Raises InputError naming the key.
    """
    robot = driven.robot
    read.known("joint", "joints")
    if "joint" in read and "joints" in read:
        raise read.error("joints", "expected 'joint' or 'joints', found both")
    if "joint" in read:
        return driven.checked(read, "joint", (joint_named(read, "joint", read.text("joint"), robot),))
    key = "joints"
    if "joints" not in read:
        joints, key = otherwise, otherwise_key
    elif read.raw("joints") == "all":
        joints = driven.joints
    else:
        given = read.raw("joints")
        if not isinstance(given, list) or not all(isinstance(name, str) for name in given):
            raise read.error("joints", 'expected a list of joint names, or "all"')
        if len(set(given)) < len(given):
            raise read.error("joints", "expected each joint once, found one of them twice")
        joints = tuple(joint_named(read, "joints", name, robot) for name in given)
    if not joints:
        raise read.error("joints", "expected at least one joint with one degree of freedom, found none")
    return driven.checked(read, key, joints)


def read_motion_name(read: Fields, motions: Mapping[str, Any]) -> str:
    """Read the name of a motion of the configuration. Raises InputError naming file and key."""
    name = read.text("motion")
    if name not in motions:
        raise read.error("motion", unknown_name("motion", name, motions))
    return name


def read_gain(
    read: Fields, key: str, joints: tuple[RobotJoint, ...], quantity: str, default: float | None = None
) -> Gain:
    """Read one gain for all joints, or {joint: gain}. Raises InputError naming file and key."""
    if isinstance(read.raw(key, default), Mapping):
        each = read.mapping(key)
        gains = {j.name: number(each, j.name, unit_of((j,), quantity), None, NONNEGATIVE) for j in joints}
        each.done()
        return gains
    return number(read, key, unit_of(joints, quantity), default, NONNEGATIVE)


def read_limit(read: Fields, joints: tuple[RobotJoint, ...], robot: Robot) -> Gain | None:
    """Read one limit, "effort" (the URDF's limit of each joint) or nothing. Raises InputError naming file and key."""
    given = read.raw("limit", None)
    if given is None:
        return None
    if given == "effort":
        return {joint.name: float(robot.effort_limit[joint.v]) for joint in joints}
    return number(read, "limit", unit_of(joints, "torque"), None, POSITIVE)


def read_mass_error(read: Fields) -> float:
    """Read the relative mass error of the controller's model, above -1. Raises InputError naming file and key."""
    return number(read, "mass_error", "", 0.0, MASS_ERROR)
