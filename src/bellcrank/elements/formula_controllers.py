"""Controllers that are formulas of the state: a torque at one joint, and state feedback u = u_0 − K (x − x_0).

`active` is a formula: the controller acts while it is positive. The times at which it changes its sign are located.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Self

from bellcrank.config.fields import Fields
from bellcrank.elements.controller import ControlContext, Controller
from bellcrank.elements.controller_fields import Driven, read_joints, read_limit
from bellcrank.elements.element import GeneralisedForce, joint_unit, read_joint
from bellcrank.elements.expression import Expression, Term
from bellcrank.elements.force_table import table_text
from bellcrank.elements.formulas import FormulaReader, common, read_active
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
