"""Constraints on joint coordinates: a linear coupling of two joints, and a prescribed motion of a joint."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Self

from bellcrank.config.fields import Fields
from bellcrank.elements.constraint import Constraint, ReadContext, Residual
from bellcrank.elements.controller import read_motion_name
from bellcrank.elements.element import Settable, joint_unit, read_joint
from bellcrank.elements.signals import SignalSource, motion_source
from bellcrank.robot.robot import Robot, RobotJoint

if TYPE_CHECKING:
    from bellcrank.elements.symbols import Symbols


@dataclass(frozen=True)
class Coupling(Constraint):
    """θ_b = ratio θ_a + offset, as for gears, belts and `<mimic>`: φ = θ_b − ratio θ_a − offset.

    λ is the torque (N m, or force N) on joint b; the torque on joint a is −ratio λ. The offset is in rad or m.
    """

    joint_a: RobotJoint
    joint_b: RobotJoint
    ratio: float
    offset: float
    kind: ClassVar[str] = "coupling"

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """Read the constraint from its entry. Raises InputError naming file and key."""
        a, b = (read_joint(read, context.robot, key) for key in ("joint_a", "joint_b"))
        if a == b:
            raise read.error("joint_b", f"expected two different joints, found '{a.name}' twice")
        return cls(name, read, a, b, read.number("ratio", ""), read.number("offset", joint_unit(b, "position"), 0.0))

    @property
    def settable(self) -> dict[str, Settable]:
        """Ratio and offset can be set."""
        return {"ratio": Settable(""), "offset": Settable(joint_unit(self.joint_b, "position"))}

    def residual(self, symbols: Symbols) -> Residual:
        """One row."""
        import casadi

        a, b = symbols.joint(self.joint_a), symbols.joint(self.joint_b)
        residual = b.position - self.value(symbols, "ratio") * a.position - self.value(symbols, "offset")
        return Residual(residual, casadi.SX(0, 1))

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The torque on joint b."""
        return (f"torque on {self.joint_b.name} [{joint_unit(self.joint_b, 'torque')}]",)


@dataclass(frozen=True)
class PrescribedMotion(Constraint):
    """A joint follows a motion of the configuration: φ = θ − θ_motion(t).

    λ is the actuator's torque, N m or N. Its power is part of the work W.
    """

    joint: RobotJoint
    motion: SignalSource
    kind: ClassVar[str] = "prescribed_motion"

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """Read the constraint from its entry. Raises InputError naming file and key."""
        joint, motion = read_joint(read, context.robot), read_motion_name(read, context.motions)
        return cls(name, read, joint, motion_source(motion, partial(context.motion_of, motion), (joint,), 2))

    @property
    def source(self) -> SignalSource:
        """The motion with two time derivatives."""
        return self.motion

    def residual(self, symbols: Symbols) -> Residual:
        """One row."""
        import casadi

        return Residual(symbols.joint(self.joint).position - symbols.signal(self.motion)[0, 0], casadi.SX(0, 1))

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The actuator's torque."""
        return (f"[{joint_unit(self.joint, 'torque')}]",)
