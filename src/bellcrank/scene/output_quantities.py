"""The quantities that outputs can record, as expressions of a scene's symbols and its equations of motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

from bellcrank.elements.constraint import Constraint
from bellcrank.elements.element import AuxiliaryStates, Force, joint_unit
from bellcrank.elements.expression import Expression
from bellcrank.elements.rolling_constraint import RollingDisk
from bellcrank.robot.robot import RobotJoint

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols

JOINT_WHAT: Final = ("position", "velocity", "acceleration", "torque")
ENERGIES: Final = ("kinetic", "potential", "total")
CONSTRAINT_WHAT: Final = ("multipliers", "contact_point", "friction_demand")


class Reactions(Protocol):
    """The constraint forces of a scene, as expressions."""

    def of(self, name: str) -> casadi.SX:
        """The multipliers of one constraint, N or N m, in the order of its labels."""
        ...

    @property
    def closeness(self) -> casadi.SX:
        """σ_min/σ_max of J M⁻¹ᐟ²: 0 where the constraints are singular."""
        ...


@dataclass(frozen=True, kw_only=True)
class EquationSymbols:
    """The symbols of a scene and the solution of its equations of motion over them.

    Attributes:
        symbols: Time, position, velocity, signals and parameters, and the kinematics.
        acceleration: v̇ (nv).
        joint_torque: The sum of the scene's forces at the joints (nv), without gravity, N m or N.
        kinetic: Kinetic energy, J.
        potential: Potential energy of gravity and springs, J.
        reactions: The constraint forces; None for a scene without constraints.
        work: The work W since the start, J.
    """

    symbols: Symbols
    acceleration: casadi.SX
    joint_torque: casadi.SX
    kinetic: casadi.SX
    potential: casadi.SX
    reactions: Reactions | None
    work: casadi.SX

    def multipliers(self, constraint: str) -> casadi.SX:
        """The multipliers of one constraint, N or N m, in the order of its labels."""
        assert self.reactions is not None  # outputs and events name constraints of the scene only
        return self.reactions.of(constraint)

    @property
    def closeness(self) -> casadi.SX:
        """σ_min/σ_max of J M⁻¹ᐟ²: 0 where the constraints are singular."""
        assert self.reactions is not None
        return self.reactions.closeness


FRAME_LABELS: Final = {
    "position": tuple(f"{c} [m]" for c in "xyz"),
    "velocity": tuple(f"{c} [m/s]" for c in "xyz"),
    "rotation": tuple(f"r{i}{j} [1]" for i in (1, 2, 3) for j in (1, 2, 3)),
    "angular_velocity": tuple(f"{c} [rad/s]" for c in "xyz"),
}
MOMENTA: Final = {
    "linear": tuple(f"{c} [kg m/s]" for c in "xyz"),
    "angular": tuple(f"{c} [kg m^2/s]" for c in "xyz"),
}


class OutputQuantity:
    """The quantity of an output: its expression, the frames that it uses, and the titles of its columns."""

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames that it uses."""
        return ()

    def suffixes(self) -> tuple[str, ...]:
        """The parts of the columns' titles that follow the output's name."""
        raise NotImplementedError

    def value(self, equations: EquationSymbols) -> casadi.SX:
        """The values of the columns."""
        raise NotImplementedError


@dataclass(frozen=True)
class FrameOutput(OutputQuantity):
    """A frame's position, velocity, rotation (by rows) or angular velocity, in world axes."""

    frame: str
    what: str

    @property
    def frames(self) -> tuple[str, ...]:
        """The frame."""
        return (self.frame,)

    def suffixes(self) -> tuple[str, ...]:
        """The parts of the columns' titles that follow the output's name."""
        return FRAME_LABELS[self.what]

    def value(self, equations: EquationSymbols) -> casadi.SX:
        """The values of the columns."""
        import casadi

        f = equations.symbols.frame(self.frame)
        return {
            "position": f.position, "velocity": f.linear, "rotation": casadi.vec(f.rotation.T),
            "angular_velocity": f.angular,
        }[self.what]  # fmt: skip


@dataclass(frozen=True)
class JointOutput(OutputQuantity):
    """A joint's position, velocity, acceleration, or torque (the sum of the scene's forces at it, without gravity)."""

    joint: RobotJoint
    what: str

    def suffixes(self) -> tuple[str, ...]:
        """The unit."""
        return (f"[{joint_unit(self.joint, self.what)}]",)

    def value(self, equations: EquationSymbols) -> casadi.SX:
        """One number."""
        position, velocity, index = equations.symbols.joint(self.joint)
        if self.what in ("position", "velocity"):
            return position if self.what == "position" else velocity
        return (equations.acceleration if self.what == "acceleration" else equations.joint_torque)[index]


@dataclass(frozen=True)
class EnergyOutput(OutputQuantity):
    """Kinetic energy, potential energy of gravity and springs, or their sum, J."""

    energy: str

    def suffixes(self) -> tuple[str, ...]:
        """The unit."""
        return ("[J]",)

    def value(self, equations: EquationSymbols) -> casadi.SX:
        """One number."""
        total = equations.kinetic + equations.potential
        return {"kinetic": equations.kinetic, "potential": equations.potential, "total": total}[self.energy]


@dataclass(frozen=True)
class MomentumOutput(OutputQuantity):
    """The momentum of the whole robot in the world: linear, kg m/s, or angular about the world's origin, kg m²/s.

    ∂T/∂(base velocity) is the momentum in the base's axes about the base's origin; it is transformed to the world.
    """

    momentum: str

    def suffixes(self) -> tuple[str, ...]:
        """One for each component."""
        return MOMENTA[self.momentum]

    def value(self, equations: EquationSymbols) -> casadi.SX:
        """The values of the columns."""
        import casadi

        conjugate = casadi.gradient(equations.kinetic, equations.symbols.v)[:6]
        q = equations.symbols.q
        position, turn = q[:3], _rotation(q[3:7])
        linear = turn @ conjugate[:3]
        if self.momentum == "linear":
            return linear
        return turn @ conjugate[3:] + casadi.cross(position, linear)


@dataclass(frozen=True)
class ForceOutput(OutputQuantity):
    """The force of a force or controller, as its `measure` returns it."""

    force: Force
    labels: tuple[str, ...]

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames of the force."""
        return self.force.frames

    def suffixes(self) -> tuple[str, ...]:
        """The labels of the force."""
        return self.labels

    def value(self, equations: EquationSymbols) -> casadi.SX:
        """The values of the columns."""
        return self.force.measure(equations.symbols)


@dataclass(frozen=True)
class WorkOutput(OutputQuantity):
    """The work (J) that forces and controllers have done since the start, which the solver integrates.

    With `rest` also that of the robot's own friction, and what is left of the work of the run: that of constraints that
    move, and of impacts.
    """

    name: str  # of the output
    parts: tuple[Force, ...]
    rest: bool

    @property
    def states(self) -> AuxiliaryStates:
        """The states that hold it."""
        names = [part.name for part in self.parts] + (["robot friction"] if self.rest else [])
        return AuxiliaryStates(f"work of output {self.name}", tuple(f"{name} [J]" for name in names))

    def rate(self, symbols: Symbols) -> casadi.SX:
        """The power of each, W."""
        import casadi

        found = [casadi.SX(part.generalised_force(symbols).power) for part in self.parts]
        if self.rest:
            found.append(-casadi.dot(symbols.robot.equations.friction(symbols.v), symbols.v))
        return casadi.vertcat(casadi.SX(0, 1), *found)

    def suffixes(self) -> tuple[str, ...]:
        """A column for each part; one without a name of its own where there is only one."""
        if not self.rest and len(self.parts) == 1:
            return ("[J]",)
        return (*self.states.labels, "constraints and impacts [J]") if self.rest else self.states.labels

    def value(self, equations: EquationSymbols) -> casadi.SX:
        """The values of the columns."""
        import casadi

        found = equations.symbols.auxiliary(self.states)
        return casadi.vertcat(found, equations.work - casadi.sum1(found)) if self.rest else found


@dataclass(frozen=True)
class ConstraintOutput(OutputQuantity):
    """A constraint's multipliers in the units of its labels; 0 for rows that a planar loop does not have."""

    constraint: Constraint
    labels: tuple[str, ...]

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames of the constraint."""
        return self.constraint.frames

    def suffixes(self) -> tuple[str, ...]:
        """The labels of the constraint."""
        return self.labels

    def value(self, equations: EquationSymbols) -> casadi.SX:
        """One number for each row."""
        return equations.multipliers(self.constraint.name)


@dataclass(frozen=True)
class ContactOutput(OutputQuantity):
    """The point of contact of a rolling disk with its plane (3), m, in the world."""

    disk: RollingDisk

    @property
    def frames(self) -> tuple[str, ...]:
        """The frame of the disk."""
        return self.disk.frames

    def suffixes(self) -> tuple[str, ...]:
        """One for each component."""
        return FRAME_LABELS["position"]

    def value(self, equations: EquationSymbols) -> casadi.SX:
        """The values of the columns."""
        return self.disk.contact_point(equations.symbols)


@dataclass(frozen=True)
class DemandOutput(OutputQuantity):
    """The coefficient of friction required for rolling: |friction| / normal force, infinite for a normal force of 0."""

    disk: RollingDisk

    def suffixes(self) -> tuple[str, ...]:
        """The unit 1."""
        return ("[1]",)

    def value(self, equations: EquationSymbols) -> casadi.SX:
        """One number."""
        import casadi

        normal, *friction = casadi.vertsplit(equations.multipliers(self.disk.name))
        return casadi.norm_2(casadi.vertcat(*friction)) / normal


@dataclass(frozen=True)
class ExpressionOutput(OutputQuantity):
    """An expression with its unit."""

    expression: Expression
    unit: str

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames in the expression."""
        return self.expression.frames

    def suffixes(self) -> tuple[str, ...]:
        """The unit."""
        return (f"[{self.unit}]",)

    def value(self, equations: EquationSymbols) -> casadi.SX:
        """One number."""
        return self.expression.value(equations.symbols, equations.acceleration)


def _rotation(quaternion: casadi.SX) -> casadi.SX:
    """The rotation matrix of a unit quaternion x y z w."""
    import casadi

    x, y, z, w = (quaternion[k] for k in range(4))
    return casadi.vertcat(
        casadi.horzcat(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        casadi.horzcat(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        casadi.horzcat(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
