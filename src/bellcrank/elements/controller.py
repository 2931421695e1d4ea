"""The base class of controllers, and the reading of their fields: joints, gains, limits, motions and mass errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Final

from bellcrank.config.fields import Fields
from bellcrank.elements.element import (
    ANY,
    MASS_ERROR,
    NONNEGATIVE,
    POSITIVE,
    Force,
    GeneralisedForce,
    Settable,
    common_unit,
    joint_named,
    joint_unit,
    number,
)
from bellcrank.elements.formulas import FormulaReader
from bellcrank.messages import unknown_name
from bellcrank.robot.robot import Robot, RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols
    from bellcrank.motion.motion import Motion


Gain = float | Mapping[str, float]
BOUNDS: Final = {"limit": POSITIVE, "kp": NONNEGATIVE, "kd": NONNEGATIVE, "target": ANY, "mass_error": MASS_ERROR}


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


@dataclass(frozen=True)
class ControlContext:
    """What the entries of `control` may name.

    Attributes:
        driven: The joints at which controllers may act.
        motions: The motions of the configuration by name.
        motion_of: Computes one of them by its name.
        formulas: Reads expressions.
        clock: The clock at the start of a simulation, s.
        held: What sampled controllers held at the end of the run that is continued, by the name of their signal.
    """

    driven: Driven
    motions: Mapping[str, Any]
    motion_of: Callable[[str], Motion]
    formulas: FormulaReader
    clock: float
    held: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Controller(Force):
    """Torques at some joints. `limit` is None, a number (N m or N), or {joint: effort limit}."""

    joints: tuple[RobotJoint, ...]
    limit: Gain | None
    owner: ClassVar[str] = "control"

    @property
    def settable(self) -> dict[str, Settable]:
        """Gains, the limit, targets and mass errors can be set."""
        found: dict[str, Settable] = {}
        for name, quantity in self.quantities().items():
            value, bound = getattr(self, name), BOUNDS[name]
            if isinstance(value, Mapping):
                mine = [joint for joint in self.joints if joint.name in value]
                found |= {f"{name}.{j.name}": Settable(unit_of((j,), quantity), bound) for j in mine}
            elif value is not None:
                found[name] = Settable(unit_of(self.joints, quantity), bound)
        return found

    def quantities(self) -> dict[str, str]:
        """The quantity (a key of JOINT_UNITS) or the unit of each field."""
        return {"limit": "torque"} if isinstance(self.limit, float) else {}

    def of_joint(self, symbols: Symbols, name: str, joint: RobotJoint) -> casadi.SX | float:
        """A gain, target or limit at one joint."""
        each = isinstance(getattr(self, name), Mapping)
        return self.value(symbols, f"{name}.{joint.name}" if each else name)

    def clamped(self, symbols: Symbols, torques: list[casadi.SX]) -> GeneralisedForce:
        """Clamp the torques, one for each joint, and return them as a force of actuators."""
        return self.applied(symbols, self.within_limit(symbols, torques))

    def within_limit(self, symbols: Symbols, torques: list[casadi.SX]) -> list[casadi.SX]:
        """The torques, one for each joint, clamped to the limit."""
        import casadi

        if self.limit is None:
            return torques
        found = []
        for joint, torque in zip(self.joints, torques, strict=True):
            most = self.of_joint(symbols, "limit", joint)
            free = isinstance(most, float) and math.isinf(most)
            found.append(torque if free else casadi.fmax(casadi.fmin(torque, most), -most))
        return found

    def applied(self, symbols: Symbols, torques: list[casadi.SX]) -> GeneralisedForce:
        """Torques, one for each joint, as a force of actuators."""
        import casadi

        force, power = casadi.SX.zeros(symbols.robot.nv, 1), symbols.zero
        for joint, torque in zip(self.joints, torques, strict=True):
            force[joint.v] = torque
            power += torque * symbols.v[joint.v]
        return GeneralisedForce(force, symbols.zero, power, True)

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The torque at each of its joints."""
        if len(self.joints) == 1:
            return (f"[{joint_unit(self.joints[0], 'torque')}]",)
        return tuple(f"{joint.name} [{joint_unit(joint, 'torque')}]" for joint in self.joints)

    def measure(self, symbols: Symbols) -> casadi.SX:
        """The torque at each of its joints, N m or N."""
        return self.generalised_force(symbols).force[[joint.v for joint in self.joints]]
