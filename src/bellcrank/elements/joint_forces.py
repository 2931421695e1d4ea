"""Forces at one joint: spring, damper, friction, and a motor's torque."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Final, NamedTuple, Self

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
from bellcrank.elements.expression import Expression, Term
from bellcrank.elements.force_table import INTERPOLATIONS, read_torque_table
from bellcrank.elements.formulas import FormulaReader, active_switches, common, on_or_off, read_active
from bellcrank.elements.signals import SignalSource
from bellcrank.robot.model.friction import FRICTION_WIDTH
from bellcrank.robot.robot import Robot, RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.element import AuxiliaryStates
    from bellcrank.elements.symbols import Symbols

REQUIRED: Final = None  # as a default in NUMBERS
NO_ROW: Final = -1  # a row that is none of v and the auxiliary states
Numbers = Mapping[str, tuple[str, float | None, Bound]]


class Shaft(NamedTuple):
    """What turns or slides.

    Attributes:
        velocity: rad/s or m/s.
        row: The place of the velocity in v and the auxiliary states; −1: it is none of them, as at a pin of a loop.
        inertia: The own inertia of a rotor; None: the robot moves it.
        own: Of a rotor, or of the twist of a gear: the place of its velocity in v and the auxiliary states, and how
            much a unit force accelerates it beside what the robot does.
        against: Of the twist of a gear, which is a motion relative to a joint: the place of the joint's velocity in v.
    """

    velocity: casadi.SX
    row: int
    inertia: casadi.SX | None = None
    own: tuple[int, casadi.SX] | None = None
    against: int | None = None


@dataclass(frozen=True)
class JointForce(Force):
    """A force along one joint's coordinate θ (rad or m).

    NUMBERS gives the quantity, the default and the bound of each field.
    """

    joint: RobotJoint
    NUMBERS: ClassVar[Numbers] = {}

    @classmethod
    def read(cls, name: str, read: Fields, formulas: FormulaReader) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        read.known("joint", *cls.NUMBERS)
        joint = read_joint(read, formulas.robot)
        values = {
            key: number(read, key, joint_unit(joint, quantity), default, bound)
            for key, (quantity, default, bound) in cls.NUMBERS.items()
        }
        return cls(name, read, joint, **values)

    @property
    def settable(self) -> dict[str, Settable]:
        """Every number can be set."""
        return {key: Settable(joint_unit(self.joint, what), bound) for key, (what, _, bound) in self.NUMBERS.items()}

    @property
    def rotor(self) -> tuple[AuxiliaryStates, int] | None:
        """Which of a drive's own states is the velocity of the rotor that it acts on; None: it acts on the joint."""
        return None

    @property
    def row(self) -> int:
        """The place of the joint's velocity in v."""
        return self.joint.v

    def shaft(self, symbols: Symbols) -> Shaft:
        """What it acts on: the joint, or a rotor."""
        return Shaft(symbols.joint(self.joint).velocity, self.joint.v)

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
    """A motor's torque: a `value` (N m or N), which is a number or a formula, or a table in a CSV `file`.

    A formula (expression.py) contains time, positions, velocities, parameters and outputs. A table over time has the
    columns "time [s]" and "JOINT torque [N m]" (or the column named by `column`); `interpolation` is "linear" (the
    default), "cubic" (a not-a-knot spline) or "hold" (each value until the next). A table over a formula, `over`, has
    its values in the first column (formulas.py). The first and last values are held before and after the table. With
    `active`, a formula, it acts while that is positive; the times at which its sign changes are located. In inverse
    dynamics and sizing the torque is a load in addition to that of the joint's motor.
    """

    constant: float
    table: SignalSource | None
    text: str = field(default="", repr=False, compare=False)  # of the table's file
    formula: Expression | None = None
    active: Expression | None = None
    kind: ClassVar[str] = "torque"
    actuator: ClassVar[bool] = True  # whether a motor exerts it

    @classmethod
    def read(cls, name: str, read: Fields, formulas: FormulaReader) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        read.known("joint", "value", "file", "interpolation", "column", "over")
        joint, active = read_joint(read, formulas.robot), read_active(read, formulas)
        unit = joint_unit(joint, "torque")
        if ("value" in read) == ("file" in read):
            found = "both" if "file" in read else "neither"
            raise read.error("value", f"expected a 'value' in {unit} or a 'file' with a table, found {found}")
        if "value" in read:
            for key in ("interpolation", "column", "over"):
                if key in read:
                    raise read.error(key, f"'{key}' requires a 'file'; it is not used with a value")
            formula = formulas.read(read, "value", unit)
            if formula.term.operation in ("number", "negative") and not formula.operations - {"number"}:
                return cls(name, read, joint, read.number("value", unit), None, active=active)
            return cls(name, read, joint, 0.0, None, formula=formula, active=active)
        column = read.text("column", f"{joint.name} torque")
        if "over" in read:
            tables, text = formulas.tables(read, {column: unit})
            return cls(name, read, joint, 0.0, None, text, tables[column], active)
        interpolation = read.choice("interpolation", INTERPOLATIONS, "linear")
        table, text = read_torque_table(read, column, unit, interpolation)
        return cls(name, read, joint, 0.0, table, text, active=active)

    @property
    def settable(self) -> dict[str, Settable]:
        """The constant value can be set."""
        if self.table is not None or self.formula is not None:
            return {}
        return {"value": Settable(joint_unit(self.joint, "torque"))}

    def number(self, name: str) -> float:
        """The constant value."""
        return self.constant

    @property
    def source(self) -> SignalSource | None:
        """The table over time."""
        return self.table

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames in its formula."""
        return common(self.formulas)

    @property
    def formulas(self) -> tuple[Expression, ...]:
        """Its formula, and `active`."""
        return tuple(one for one in (self.formula, self.active) if one is not None)

    @property
    def switches(self) -> tuple[Term, ...]:
        """Those of its formulas, and `active`."""
        return active_switches(super().switches, self.active)

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        _, rate, index = symbols.joint(self.joint)
        torque: casadi.SX | float
        sides = symbols.sides(self)
        if self.formula is not None:
            torque = self.formula.value(symbols, None, sides)
        else:
            torque = self.value(symbols, "value") if self.table is None else symbols.signal(self.table)[0]
        if self.active is not None:
            torque *= on_or_off(self.active, symbols, sides)
        return GeneralisedForce(symbols.joint_force(index, torque), symbols.zero, torque * rate, self.actuator)


@dataclass(frozen=True)
class JointLoad(Torque):
    """A force along a joint's coordinate (N m or N) that no motor exerts, such as that of a press or a process.

    Its keys are those of a `torque`.
    """

    kind: ClassVar[str] = "joint_force"
    actuator: ClassVar[bool] = False
