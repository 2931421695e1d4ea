"""Forces at one joint: spring, damper, friction, and a motor's torque."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Final, Self

from bellcrank.config.fields import Fields
from bellcrank.elements.element import (  # fmt: skip
    ANY,
    NONNEGATIVE,
    POSITIVE,
    Bound,
    Force,
    GeneralisedForce,
    Settable,
    joint_unit,
    number,
    read_joint,
)
from bellcrank.elements.force_table import INTERPOLATIONS, read_torque_table
from bellcrank.elements.signals import SignalSource
from bellcrank.robot.friction import FRICTION_WIDTH
from bellcrank.robot.robot import Robot, RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols

REQUIRED: Final = None  # as a default in NUMBERS
Numbers = Mapping[str, tuple[str, float | None, Bound]]


@dataclass(frozen=True)
class JointForce(Force):
    """A force along one joint's coordinate θ (rad or m).

    NUMBERS gives the quantity, the default and the bound of each field.
    """

    joint: RobotJoint
    NUMBERS: ClassVar[Numbers] = {}

    @classmethod
    def read(cls, name: str, read: Fields, robot: Robot) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        read.known("joint", *cls.NUMBERS)
        joint = read_joint(read, robot)
        values = {
            key: number(read, key, joint_unit(joint, quantity), default, bound)
            for key, (quantity, default, bound) in cls.NUMBERS.items()
        }
        return cls(name, read, joint, **values)

    @property
    def settable(self) -> dict[str, Settable]:
        """Every number can be set."""
        return {key: Settable(joint_unit(self.joint, what), bound) for key, (what, _, bound) in self.NUMBERS.items()}

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The generalised force at the joint."""
        return (f"[{joint_unit(self.joint, 'torque')}]",)

    def measure(self, symbols: Symbols) -> casadi.SX:
        """The generalised force at the joint, N m or N."""
        return self.generalised_force(symbols).force[self.joint.v]


@dataclass(frozen=True)
class JointSpring(JointForce):
    """τ = preload − stiffness (θ − rest) − damping θ̇, with V = ½ stiffness (θ − rest)² − preload θ.

    stiffness is in N m/rad or N/m; rest (rad or m), preload (N m or N) and damping (N m s/rad or N s/m) are 0 by
    default.
    """

    stiffness: float
    rest: float
    preload: float
    damping: float
    kind: ClassVar[str] = "joint_spring"
    NUMBERS: ClassVar[Numbers] = {
        "stiffness": ("stiffness", REQUIRED, ANY),
        "rest": ("position", 0.0, ANY),
        "preload": ("torque", 0.0, ANY),
        "damping": ("damping", 0.0, NONNEGATIVE),
    }

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        angle, rate, index = symbols.joint(self.joint)
        stiffness, rest, preload, damping = (self.value(symbols, name) for name in self.NUMBERS)
        stretch = angle - rest
        torque = preload - stiffness * stretch - damping * rate
        potential = 0.5 * stiffness * stretch * stretch - preload * angle
        return GeneralisedForce(symbols.joint_force(index, torque), potential, -damping * rate * rate, False)


@dataclass(frozen=True)
class Damper(JointForce):
    """τ = −coefficient θ̇ with the coefficient in N m s/rad or N s/m."""

    coefficient: float
    kind: ClassVar[str] = "damper"
    NUMBERS: ClassVar[Numbers] = {"coefficient": ("damping", REQUIRED, NONNEGATIVE)}

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        _, rate, index = symbols.joint(self.joint)
        torque = -self.value(symbols, "coefficient") * rate
        return GeneralisedForce(symbols.joint_force(index, torque), symbols.zero, torque * rate, False)


@dataclass(frozen=True)
class Friction(JointForce):
    """τ = −viscous θ̇ − coulomb θ̇ / sqrt(θ̇² + width²): Coulomb friction smoothed over `width` (rad/s or m/s).

    It is added to the friction that the configuration's key `friction` gives the robot.
    """

    viscous: float
    coulomb: float
    width: float
    kind: ClassVar[str] = "friction"
    NUMBERS: ClassVar[Numbers] = {
        "viscous": ("damping", 0.0, NONNEGATIVE),
        "coulomb": ("torque", 0.0, NONNEGATIVE),
        "width": ("velocity", FRICTION_WIDTH, POSITIVE),
    }

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        import casadi

        _, rate, index = symbols.joint(self.joint)
        viscous, coulomb, width = (self.value(symbols, name) for name in self.NUMBERS)
        torque = -viscous * rate
        if not (isinstance(coulomb, float) and coulomb == 0.0):
            torque -= coulomb * rate / casadi.sqrt(rate * rate + width * width)
        return GeneralisedForce(symbols.joint_force(index, torque), symbols.zero, torque * rate, False)


@dataclass(frozen=True)
class Torque(JointForce):
    """A motor's torque: a constant `value` (N m or N), or a table over time in a CSV `file`.

    The table has the columns "time [s]" and "JOINT torque [N m]" (or the column named by `column`). `interpolation` is
    "linear" (the default), "cubic" (a not-a-knot spline) or "hold" (each value until the next). The first and last
    values are held before and after the table. In inverse dynamics and sizing the torque is a load in addition to that
    of the joint's motor.
    """

    constant: float
    table: SignalSource | None
    text: str = field(default="", repr=False, compare=False)  # of the table's file
    kind: ClassVar[str] = "torque"

    @classmethod
    def read(cls, name: str, read: Fields, robot: Robot) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        read.known("joint", "value", "file", "interpolation", "column")
        joint = read_joint(read, robot)
        unit = joint_unit(joint, "torque")
        if ("value" in read) == ("file" in read):
            found = "both" if "file" in read else "neither"
            raise read.error("value", f"expected a 'value' in {unit} or a 'file' with a table over time, found {found}")
        if "value" in read:
            for key in ("interpolation", "column"):
                if key in read:
                    raise read.error(key, f"'{key}' requires a 'file'; it is not used with a constant value")
            return cls(name, read, joint, read.number("value", unit), None)
        interpolation = read.choice("interpolation", INTERPOLATIONS, "linear")
        column = read.text("column", f"{joint.name} torque")
        table, text = read_torque_table(read, column, unit, interpolation)
        return cls(name, read, joint, 0.0, table, text)

    @property
    def settable(self) -> dict[str, Settable]:
        """The constant value can be set."""
        return {"value": Settable(joint_unit(self.joint, "torque"))} if self.table is None else {}

    def number(self, name: str) -> float:
        """The constant value."""
        return self.constant

    @property
    def source(self) -> SignalSource | None:
        """The table."""
        return self.table

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        _, rate, index = symbols.joint(self.joint)
        torque = self.value(symbols, "value") if self.table is None else symbols.signal(self.table)[0]
        return GeneralisedForce(symbols.joint_force(index, torque), symbols.zero, torque * rate, True)
