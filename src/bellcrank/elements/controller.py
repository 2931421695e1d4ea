"""The base class of controllers, and what their entries are read with."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Final

from bellcrank.elements.controller_fields import Driven, Gain, unit_of
from bellcrank.elements.element import (  # fmt: skip
    ANY,
    MASS_ERROR,
    NONNEGATIVE,
    POSITIVE,
    Force,
    GeneralisedForce,
    Settable,
    joint_unit,
)
from bellcrank.elements.formulas import FormulaReader
from bellcrank.robot.robot import Robot, RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols
    from bellcrank.motion.motion import Motion

BOUNDS: Final = {"limit": POSITIVE, "kp": NONNEGATIVE, "kd": NONNEGATIVE, "target": ANY, "mass_error": MASS_ERROR}


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
