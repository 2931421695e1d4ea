"""The controllers of a scene. They add actuator torques, whose power is part of the work W.

Each entry of the list `control` has a `kind`, an optional `name`, and the keys of its kind. A gain is one number, or
{joint: number}. `limit` clamps the torque of the controller at each joint to ±limit: a number (N m or N), or "effort"
for the URDF's limits. The limit applies to one controller; two controllers at a joint may add up to the sum of their
limits.

`active` is a formula: the controller acts while it is positive. The times at which it changes its sign are located.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Final, Self

from bellcrank.config.fields import Fields
from bellcrank.elements.controller import (
    ControlContext,
    Controller,
    Driven,
    Gain,
    all_joints,
    read_gain,
    read_joints,
    read_limit,
    read_mass_error,
    read_motion_name,
)
from bellcrank.elements.element import GeneralisedForce, joint_named, joint_unit, named_entries, read_joint
from bellcrank.elements.expression import Expression, Term
from bellcrank.elements.force_table import table_text
from bellcrank.elements.formulas import FormulaReader, common, read_active
from bellcrank.elements.sampled_controllers import StateSpace
from bellcrank.elements.signals import SignalSource, motion_source
from bellcrank.messages import format_value
from bellcrank.robot.robot import Robot, RobotJoint

if TYPE_CHECKING:
    from bellcrank.elements.symbols import Symbols


@dataclass(frozen=True)
class FormulaController(Controller):
    """A controller whose torques are formulas; it acts while `active` is positive, or always without it."""

    active: Expression | None

    @property
    def demands(self) -> tuple[Term, ...]:
        """The torques at its joints where it acts, before the limit."""
        raise NotImplementedError

    @property
    def formulas(self) -> tuple[Expression, ...]:
        """The torques at its joints."""
        return tuple(
            Expression("", self._acting(demand, joint)) for demand, joint in zip(self.demands, self.joints, strict=True)
        )

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames in its formulas."""
        return common(self.formulas)

    def _acting(self, torque: Term, joint: RobotJoint) -> Term:
        """A torque within the limit while the controller is active."""
        if self.active is not None:
            torque = Term("*", (Term("step", (self.active.term,)), torque))
        field = f"limit.{joint.name}" if isinstance(self.limit, Mapping) else "limit"
        if self.limit is None or math.isinf(self.number(field)):
            return torque
        most = Term("setting", value=(self.owner, self.name, field, self.number(field)))
        return Term("max", (Term("min", (torque, most)), Term("negative", (most,))))

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        sides = symbols.sides(self)
        return self.applied(symbols, [formula.value(symbols, None, sides) for formula in self.formulas])


@dataclass(frozen=True)
class FormulaTorque(FormulaController):
    """τ = `value` at one joint: a formula (expression.py) of time, positions, velocities, parameters and outputs."""

    value_of: Expression
    kind: ClassVar[str] = "torque"

    @classmethod
    def read(cls, name: str, read: Fields, context: ControlContext) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        read.known("joint", "value", "limit", "active")
        robot = context.driven.robot
        joints = context.driven.checked(read, "joint", (read_joint(read, robot),))
        value = context.formulas.read(read, "value", joint_unit(joints[0], "torque"))
        return cls(name, read, joints, read_limit(read, joints, robot), read_active(read, context.formulas), value)

    @property
    def demands(self) -> tuple[Term, ...]:
        """The value."""
        return (self.value_of.term,)


@dataclass(frozen=True)
class StateFeedback(FormulaController):
    """τ = feedforward − K (x − reference) at its joints, where x are `states`.

    `states` are formulas, by default the positions of all joints with one degree of freedom, then their velocities: the
    states of an open chain's linearisation (analysis/linearise.py). K (joints × states) is `gain`, or in a CSV `file`
    with a row for each joint. Source: K. J. Åström and R. M. Murray, Feedback Systems (2nd ed. 2020), sec. 7.2.
    """

    states: tuple[Expression, ...]
    gain: tuple[tuple[Expression, ...], ...]
    reference: tuple[Expression, ...]
    feedforward: tuple[Expression, ...]
    text: str = field(default="", repr=False, compare=False)  # of the file with the gain
    kind: ClassVar[str] = "state_feedback"

    @classmethod
    def read(cls, name: str, read: Fields, context: ControlContext) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        read.known("joint", "joints", "states", "gain", "file", "reference", "feedforward", "limit", "active")
        driven, formulas = context.driven, context.formulas
        joints = read_joints(read, driven, driven.joints)
        states = formulas.several(read, "states") if "states" in read else _all_states(driven, formulas, read)
        gain = _read_gain(read, formulas, len(joints), len(states))
        zero = formulas.parsed(read, "", 0.0)
        reference = _read_values(read, "reference", formulas, len(states), "rad or m") or (zero,) * len(states)
        unit = joint_unit(joints[0], "torque") if len(joints) == 1 else "N m or N"
        feedforward = _read_values(read, "feedforward", formulas, len(joints), unit) or (zero,) * len(joints)
        limit, active = read_limit(read, joints, driven.robot), read_active(read, formulas)
        text = table_text(read.file("file")) if "file" in read else ""
        return cls(name, read, joints, limit, active, states, gain, reference, feedforward, text)

    @property
    def demands(self) -> tuple[Term, ...]:
        """The torques at its joints."""
        errors = [Term("-", (x.term, wanted.term)) for x, wanted in zip(self.states, self.reference, strict=True)]
        found = []
        for feedforward, row in zip(self.feedforward, self.gain, strict=True):
            torque = feedforward.term
            for gain, error in zip(row, errors, strict=True):
                torque = Term("-", (torque, Term("*", (gain.term, error))))
            found.append(torque)
        return tuple(found)


def _all_states(driven: Driven, formulas: FormulaReader, read: Fields) -> tuple[Expression, ...]:
    """The positions, then the velocities of all joints with one degree of freedom."""
    robot: Robot = driven.robot
    names = [joint.name for joint in robot.joints if joint.nv == 1]
    return tuple(
        formulas.parsed(read, "states", f"joint({name!r}).{what}")
        for what in ("position", "velocity")
        for name in names
    )


def _read_gain(read: Fields, formulas: FormulaReader, rows: int, columns: int) -> tuple[tuple[Expression, ...], ...]:
    """Read `gain`, or the matrix in `file`. Raises InputError naming file and key."""
    if ("gain" in read) == ("file" in read):
        found = "both" if "file" in read else "neither"
        raise read.error("gain", f"expected a 'gain' with {rows} rows of {columns} numbers, or a 'file', found {found}")
    if "file" in read:
        given: object = _csv_rows(table_text(read.file("file")))
        key = "file"
    else:
        given, key = read.raw("gain"), "gain"
        if rows == 1 and isinstance(given, (list, tuple)) and given and not isinstance(given[0], (list, tuple)):
            given = [given]  # one row
    fits = isinstance(given, (list, tuple)) and len(given) == rows
    if not fits or not all(isinstance(row, (list, tuple)) and len(row) == columns for row in given):  # type: ignore[attr-defined]
        shape = f"{len(given)} rows" if isinstance(given, (list, tuple)) else format_value(given)
        raise read.error(
            key,
            f"expected {rows} row{'s' if rows > 1 else ''} (a joint each) of {columns} numbers (a state each), found "
            f"{shape if not fits else 'rows of another length'}",
        )
    return tuple(tuple(formulas.parsed(read, key, one) for one in row) for row in given)  # type: ignore[attr-defined]


def _csv_rows(text: str) -> list[list[str]]:
    """The cells of a CSV text; lines that begin with # are comments."""
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    return [[cell.strip() for cell in line.split(",")] for line in lines]


def _read_values(
    read: Fields, key: str, formulas: FormulaReader, count: int, unit: str
) -> tuple[Expression, ...] | None:
    """Read a list of as many numbers or formulas; None where the key is missing. Raises InputError."""
    if key not in read:
        return None
    found = formulas.several(read, key, unit)
    if len(found) != count:
        raise read.error(key, f"expected a list of {count} numbers or formulas, found {len(found)}")
    return found


@dataclass(frozen=True)
class PD(Controller):
    """τ = kp (target − θ) + kd (target rate − θ̇) at each joint.

    It acts at `joint`, or at `joints` (a list, or "all" with motors); by default at the joints of `target`, or at all
    with motors.
    `target` is a constant posture {joint: rad or m}; `motion` is a motion of the configuration, whose velocity is
    used too. kp is in N m/rad or N/m, kd in N m s/rad or N s/m.
    """

    kp: Gain
    kd: Gain
    target: Mapping[str, float] | None
    motion: SignalSource | None
    kind: ClassVar[str] = "pd"

    @classmethod
    def read(cls, name: str, read: Fields, context: ControlContext) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        driven = context.driven
        read.known("joint", "joints", "target", "motion", "kp", "kd", "limit")
        if ("target" in read) == ("motion" in read):
            found = "both" if "target" in read else "neither"
            raise read.error("target", f"expected a 'target' {{joint: value}} or the name of a 'motion', found {found}")
        target, source = None, None
        if "target" in read:
            places = read.mapping("target")
            of = {key: joint_named(places, key, key, driven.robot) for key in places}
            target = {key: places.number(key, joint_unit(j, "position")) for key, j in of.items()}
            joints = read_joints(read, driven, tuple(of.values()), "target")
            for joint in joints:
                if joint.name not in target:
                    raise read.error("target", f"expected a value for joint '{joint.name}', found none")
            driven.checked(read, "target", tuple(of.values()))
            for unused in target.keys() - {joint.name for joint in joints}:
                raise read.error("target", f"joint '{unused}' is not one of 'joints'; add it there, or remove it here")
        else:
            joints = read_joints(read, driven, driven.joints)
            motion = read_motion_name(read, context.motions)
            source = motion_source(motion, partial(context.motion_of, motion), joints, 1)
        kp, kd = read_gain(read, "kp", joints, "stiffness"), read_gain(read, "kd", joints, "damping", 0.0)
        return cls(name, read, joints, read_limit(read, joints, driven.robot), kp, kd, target, source)

    def quantities(self) -> dict[str, str]:
        """Gains, targets and the limit."""
        return super().quantities() | {"kp": "stiffness", "kd": "damping", "target": "position"}

    @property
    def source(self) -> SignalSource | None:
        """The motion."""
        return self.motion

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        wanted = None if self.motion is None else symbols.signal(self.motion)
        torques = []
        for k, joint in enumerate(self.joints):
            angle, rate, _ = symbols.joint(joint)
            aim = self.of_joint(symbols, "target", joint) if wanted is None else wanted[k, 0]
            aim_rate = 0.0 if wanted is None else wanted[k, 1]
            kp, kd = self.of_joint(symbols, "kp", joint), self.of_joint(symbols, "kd", joint)
            torques.append(kp * (aim - angle) + kd * (aim_rate - rate))
        return self.clamped(symbols, torques)


@dataclass(frozen=True)
class ComputedTorque(Controller):
    """τ = inverse dynamics of (θ, θ̇, a) with a = θ̈_d + kd (θ̇_d − θ̇) + kp (θ_d − θ) along a motion.

    With an exact model the error e obeys ë + kd ė + kp e = 0: kd = 2 √kp is critically damped. kp 1/s², kd 1/s.
    `mass_error` scales mass and inertia of the links in the controller's model by 1 + mass_error. The model includes
    the robot's friction and rotor inertia, but not the scene's forces. Source: J. Craig, Introduction to Robotics
    (2005), ch. 10.
    """

    motion: SignalSource
    kp: Gain
    kd: Gain
    mass_error: float
    kind: ClassVar[str] = "computed_torque"

    @classmethod
    def read(cls, name: str, read: Fields, context: ControlContext) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        driven = context.driven
        read.known("motion", "kp", "kd", "limit", "mass_error")
        robot, joints = driven.robot, all_joints(driven.robot)
        other = next((joint for joint in robot.joints if joint.nv != 1), None)
        if other is not None:
            raise read.error(
                "kind",
                f"computed_torque requires joints with one degree of freedom, '{other.name}' is {other.kind}; use pd",
            )
        free = [joint.name for joint in joints if joint not in driven.joints]
        if free:
            raise read.error(
                "kind",
                f"computed_torque requires a motor at each joint, and 'actuated' and 'actuators' name none at "
                f"{', '.join(free)}; use pd, or add the joint to 'actuated'",
            )
        motion = read_motion_name(read, context.motions)
        kp, kd = read_gain(read, "kp", joints, "1/s^2"), read_gain(read, "kd", joints, "1/s")
        source = motion_source(motion, partial(context.motion_of, motion), joints, 2)
        error = read_mass_error(read)
        return cls(name, read, joints, read_limit(read, joints, robot), source, kp, kd, error)

    def quantities(self) -> dict[str, str]:
        """Gains, the mass error and the limit."""
        return super().quantities() | {"kp": "1/s^2", "kd": "1/s", "mass_error": ""}

    @property
    def source(self) -> SignalSource | None:
        """The motion."""
        return self.motion

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        import casadi

        wanted = symbols.signal(self.motion)
        demand = casadi.SX.zeros(symbols.robot.nv, 1)
        for k, joint in enumerate(self.joints):
            angle, rate, index = symbols.joint(joint)
            kp, kd = self.of_joint(symbols, "kp", joint), self.of_joint(symbols, "kd", joint)
            demand[index] = wanted[k, 2] + kd * (wanted[k, 1] - rate) + kp * (wanted[k, 0] - angle)
        scale = 1.0 + self.value(symbols, "mass_error")
        torque = symbols.inverse_dynamics(symbols.q, symbols.v, demand, scale)
        torque += symbols.robot.equations.friction(symbols.v)
        return self.clamped(symbols, [torque[joint.v] for joint in self.joints])


@dataclass(frozen=True)
class GravityCompensation(Controller):
    """τ = the gravity torque at θ, with the masses of the links scaled by 1 + mass_error.

    It acts at `joints` (a list, or "all" with motors, the default), and not on a free base, which has none.
    """

    mass_error: float
    kind: ClassVar[str] = "gravity_compensation"

    @classmethod
    def read(cls, name: str, read: Fields, context: ControlContext) -> Self:
        """Read it from its entry. Raises InputError naming file and key."""
        driven = context.driven
        joints = read_joints(read, driven, driven.joints)
        return cls(name, read, joints, read_limit(read, joints, driven.robot), read_mass_error(read))

    def quantities(self) -> dict[str, str]:
        """The mass error and the limit."""
        return super().quantities() | {"mass_error": ""}

    def generalised_force(self, symbols: Symbols) -> GeneralisedForce:
        """The generalised force, potential energy and power that it adds to the equations of motion."""
        import casadi

        rest = casadi.SX(symbols.robot.nv, 1)
        torque = symbols.inverse_dynamics(symbols.q, rest, rest) * (1.0 + self.value(symbols, "mass_error"))
        return self.clamped(symbols, [torque[joint.v] for joint in self.joints])


KINDS: Final[
    dict[str, type[PD | ComputedTorque | GravityCompensation | FormulaTorque | StateFeedback | StateSpace]]
] = {cls.kind: cls for cls in (PD, ComputedTorque, GravityCompensation, FormulaTorque, StateFeedback, StateSpace)}


def read_control(read: Fields, context: ControlContext) -> tuple[Controller, ...]:
    """Read the list `control`. Raises InputError naming the key."""
    controllers: list[Controller] = []
    for name, entry in named_entries(read, "control"):
        kind = KINDS[entry.choice("kind", tuple(KINDS))]
        controllers.append(kind.read(name, entry, context))
        entry.done()
    return tuple(controllers)
