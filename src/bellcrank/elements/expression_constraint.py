"""Constraints that the user defines: by an expression in the scene file, or by a Python function."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from bellcrank import arguments
from bellcrank.config.fields import Fields
from bellcrank.elements.constraint import Constraint, ReadContext, Residual
from bellcrank.elements.expression import Expression, parse_expression
from bellcrank.errors import InputError
from bellcrank.robot.robot import Robot

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols


@dataclass(frozen=True)
class ExpressionConstraint(Constraint):
    """An expression (expression.py) that is kept at zero.

    Without velocities it is a position residual φ(q, t) (holonomic); with velocities, in which it must be linear, a
    velocity residual ψ(q, v, t) (non-holonomic). λ is the generalised force per unit of the expression: a force in N
    for an expression in m, a torque in N m for one in rad. `unit` ("m", "rad", "1", …) is the unit of the expression.
    """

    expression: Expression
    unit: str
    kind: ClassVar[str] = "expression"

    @classmethod
    def read(cls, name: str, read: Fields, context: ReadContext) -> Self:
        """Read the constraint from its entry. Raises InputError naming file and key."""
        text = read.text("expression")
        try:
            expression = parse_expression(text, context.robot, context.parameters)
        except InputError as error:
            raise read.error("expression", str(error)) from None
        if any(leaf.operation == "joint" and leaf.value[1] == "acceleration" for leaf in expression.term.leaves()):
            raise read.error(
                "expression", "a constraint must be an expression of positions or velocities, not of accelerations"
            )
        return cls(name, read, expression, read.unit())

    @property
    def moves(self) -> bool:
        """Whether the expression contains a joint or a frame."""
        return any(leaf.operation in ("joint", "frame") for leaf in self.expression.term.leaves())

    @property
    def frames(self) -> tuple[str, ...]:
        """The frames in the expression."""
        return self.expression.frames

    def residual(self, symbols: Symbols) -> Residual:
        """One row."""
        return one_row(self.name, self.expression.value(symbols), symbols)

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The generalised force."""
        moving = any(
            leaf.operation in ("joint", "frame") and leaf.value[1][0] == "v" for leaf in self.expression.term.leaves()
        )
        return (label_of(self.unit, moving),)


@dataclass(frozen=True)
class FunctionConstraint(Constraint):
    """A constraint that a Python function builds; made by `Scene.with_constraint`.

    `function` takes Symbols and returns a casadi.SX column; each row is a residual as in ExpressionConstraint, in
    `unit`. `digest` identifies the expressions, since functions cannot be compared.
    """

    function: Callable[[Symbols], Any] = field(compare=False)
    rows: int
    moving: bool
    unit: str
    digest: str
    kind: ClassVar[str] = "own"

    def residual(self, symbols: Symbols) -> Residual:
        """The rows that the function returns. Raises InputError if the scene's clock does not start at 0."""
        if symbols.clock:
            raise InputError(
                f"constraint '{self.name}' is a Python function whose t starts at 0, and the scene's clock starts at "
                f"{symbols.clock:.6g} s; remove initial.clock"
            )
        return one_row(self.name, _column(self.function(symbols)), symbols)

    def labels(self, robot: Robot) -> tuple[str, ...]:
        """The generalised forces."""
        one = label_of(self.unit, self.moving)
        return (one,) if self.rows == 1 else tuple(f"{k + 1} {one}" for k in range(self.rows))


def function_constraint(
    function: Callable[[Symbols], Any], name: str, unit: str, symbols: Symbols, source: Path
) -> FunctionConstraint:
    """The constraint that keeps function(symbols) at zero.

    Raises InputError, which names the scene's file `source`, if the function does not return a column of expressions of
    the symbols.
    """
    import casadi

    if inspect.isclass(function):
        arguments.refuse("function", "a function of Symbols that returns casadi expressions", function)
    s, column = symbols, _column(function(symbols))
    if s.u.numel():
        raise InputError(f"{source}: with_constraint: '{name}' uses signals; write t and parameters instead")
    known = casadi.vertcat(s.t, s.q, s.v, s.p)
    unknown = [str(x) for x in casadi.symvar(column) if not casadi.depends_on(known, x)]
    if unknown:
        raise InputError(
            f"{source}: with_constraint: '{name}' depends on {', '.join(unknown)}, which is not a symbol of the "
            "scene; use the positions, velocities, t and parameters of the Symbols that the function is called with"
        )
    text = casadi.Function("own", [s.t, s.q, s.v, s.p], [casadi.densify(column)]).serialize()
    digest = hashlib.sha256(text.encode("latin-1")).hexdigest()
    moving = bool(casadi.depends_on(column, s.v))
    own = FunctionConstraint(name, Fields({}, str(source)), function, column.size1(), moving, unit, digest)
    own.residual(s)
    return own


def one_row(name: str, value: casadi.SX, symbols: Symbols) -> Residual:
    """A position residual, or a velocity residual if the value depends on v. Raises InputError if not linear in v."""
    import casadi

    if not casadi.depends_on(value, symbols.v):
        return Residual(value, casadi.SX(0, 1))
    if casadi.depends_on(casadi.jacobian(value, symbols.v), symbols.v):
        raise InputError(f"{symbols.robot.name}: constraint '{name}' must be linear in velocities")
    return Residual(casadi.SX(0, 1), value)


def label_of(unit: str, moving: bool) -> str:
    """The label of a multiplier λ: λ times a position residual is in J, λ times a velocity residual in W."""
    known = {"m": "force [N]", "rad": "torque [N m]", "m/s": "force [N]", "rad/s": "torque [N m]"}
    energy = "W" if moving else "J"
    return known.get(unit, f"multiplier [{energy}]" if unit == "1" else f"multiplier [{energy}/({unit})]")


def _column(value: Any) -> casadi.SX:
    import casadi

    try:
        column = casadi.SX(value) if not isinstance(value, (list, tuple)) else casadi.vertcat(*value)
        return casadi.SX(casadi.vec(column))
    except (TypeError, NotImplementedError, RuntimeError) as error:
        raise InputError(f"a constraint's function must return a column of casadi.SX, found {value!r}") from error
