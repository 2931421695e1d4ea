"""Constraints differentiated: their residuals, Jacobian and drift as expressions.

With φ(q, t) = 0 (holonomic rows) and ψ(q, v, t) = 0 (non-holonomic rows), the position residual is φ and the velocity
residual is (φ̇, ψ). J = ∂(φ̇, ψ)/∂v is the Jacobian, and the drift γ is what (φ̈, ψ̇) is at v̇ = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bellcrank.dynamics.equations.base_frame_elimination import BaseRotation
from bellcrank.elements.constraint import Constraint
from bellcrank.elements.loop_constraints import Hinge, Weld

if TYPE_CHECKING:
    import casadi

    from bellcrank.elements.symbols import Symbols
    from bellcrank.scene.scene import Scene


def aligned_constraints(scene: Scene) -> tuple[str, ...]:
    """The names of these constraints, in the order of the scene."""
    return tuple(constraint.name for constraint in scene.constraints if isinstance(constraint, (Weld, Hinge)))


def sine_rows(scene: Scene, rows: Sequence[tuple[str, str]]) -> dict[str, list[int]]:
    """Which of the kept rows, given as (constraint, label), are sines of angles, by constraint."""
    return {
        constraint: [k for k, (name, label) in enumerate(rows) if name == constraint and label.endswith("[N m]")]
        for constraint in aligned_constraints(scene)
    }


def alignment_owners(scene: Scene) -> list[int]:
    """Which of these constraints, by number, each row of their alignment residual belongs to."""
    aligned = [constraint for constraint in scene.constraints if isinstance(constraint, (Weld, Hinge))]
    return [k for k, constraint in enumerate(aligned) for _ in range(constraint.alignment_rows)]


@dataclass(frozen=True)
class SymbolicRows:
    """The rows of constraints that are kept, and their usual sizes as numbers or symbols.

    For each row: its usual J M⁻¹ Jᵀ (`scale`), its usual sum of squares of J with columns scaled by `columns`
    (`square`), and its unit of length or angle (`unit`). `columns` (nv) is the characteristic length, m, for
    coordinates in m and 1 for others. `singular` says that M is singular: some joint moves no mass of its own.
    """

    kept: tuple[int, ...]
    scale: casadi.SX
    square: casadi.SX
    unit: casadi.SX
    columns: casadi.SX
    singular: bool = False

    @classmethod
    def unscaled(cls, kept: Sequence[int]) -> SymbolicRows:
        """Rows whose sizes are not needed."""
        import casadi

        ones = casadi.SX.ones(len(kept), 1)
        return cls(tuple(kept), ones, ones, ones, casadi.SX.ones(1, 1))


@dataclass(frozen=True, kw_only=True)
class ConstraintDerivatives:
    """A scene's constraints as expressions, all linear or quadratic in the velocities v (nv).

    Attributes:
        position_residual: φ (h), m or rad.
        position_rate: φ̇ (h).
        nonholonomic_residual: ψ (k).
        jacobian: J (h + k, nv).
        drift: γ (h + k).
        explicit_rate: (φ̇, ψ) at v = 0, (h + k): the rate by time alone.
        v: The symbols of the velocity.
        step: Symbols (nv) of a small displacement of the position.
        velocity_change: The first-order change (h + k) of the velocity residual with that displacement.
        rows: Which rows of the constraints (all φ, then all ψ) these are.
    """

    position_residual: casadi.SX
    position_rate: casadi.SX
    nonholonomic_residual: casadi.SX
    jacobian: casadi.SX
    drift: casadi.SX
    explicit_rate: casadi.SX
    v: casadi.SX
    step: casadi.SX
    velocity_change: casadi.SX
    rows: SymbolicRows

    @property
    def velocity_residual(self) -> casadi.SX:
        """(φ̇, ψ) (h + k), which must vanish."""
        import casadi

        return casadi.vertcat(self.position_rate, self.nonholonomic_residual)

    @property
    def padded_position_residual(self) -> casadi.SX:
        """(φ, 0) (h + k), with zeros for the non-holonomic rows."""
        import casadi

        return casadi.vertcat(self.position_residual, casadi.SX(self.nonholonomic_residual.size1(), 1))

    def required_acceleration(self, alpha: casadi.SX | float, beta: casadi.SX | float) -> casadi.SX:
        """What J v̇ must be (h + k), with Baumgarte's terms of the gains α (1/s) and β (1/s)."""
        return -self.drift - 2.0 * alpha * self.velocity_residual - beta * beta * self.padded_position_residual

    def power(self, multipliers: casadi.SX) -> casadi.SX:
        """The power (W) of constraints that move with time: v·Jᵀλ = −λ·(φ_t, ψ at rest) where φ̇ = 0 and ψ = 0."""
        import casadi

        return -casadi.dot(multipliers, self.explicit_rate)


def differentiate_constraints(
    constraints: Sequence[Constraint], rows: SymbolicRows | None, s: Symbols
) -> ConstraintDerivatives:
    """Differentiate constraints. `rows` are those to keep of all φ and then all ψ; None keeps all of them."""
    import casadi

    base = BaseRotation(s) if s.robot.floating_base else None
    written = s if base is None else s.with_frames(base)
    residuals = [constraint.residual(written) for constraint in constraints]
    position = casadi.vertcat(casadi.SX(0, 1), *[r.position for r in residuals])
    velocity = casadi.vertcat(casadi.SX(0, 1), *[r.velocity for r in residuals])
    h = position.size1()
    if rows is None:
        rows = SymbolicRows.unscaled(range(h + velocity.size1()))
    kept = rows.kept
    position = casadi.vertcat(casadi.SX(0, 1), *[position[k] for k in kept if k < h])
    velocity = casadi.vertcat(casadi.SX(0, 1), *[velocity[k - h] for k in kept if k >= h])
    rate = time_derivative(position, s, base)
    residual = casadi.vertcat(rate, velocity)
    at_rest, step = casadi.SX.zeros(s.v.size1(), 1), casadi.SX.sym("step", s.v.size1())
    expand = casadi.sparsify if base is None else base.expand
    return ConstraintDerivatives(
        position_residual=expand(position),
        position_rate=expand(rate),
        nonholonomic_residual=expand(velocity),
        jacobian=expand(casadi.jacobian(residual, s.v)),
        drift=expand(time_derivative(residual, s, base)),
        explicit_rate=expand(casadi.substitute(residual, s.v, at_rest)),
        v=s.v,
        step=step,
        velocity_change=expand(derivative_along(residual, s, step, base)),
        rows=rows,
    )


def time_derivative(expression: casadi.SX, s: Symbols, base: BaseRotation | None = None) -> casadi.SX:
    """The time derivative along q̇ = E(q) v at constant v, with time and signals advancing.

    `base` is the rotation that the expression is written in, if any.
    """
    import casadi

    explicit = casadi.jtimes(expression, casadi.vertcat(s.t, s.u), casadi.vertcat(1.0, s.signal_rates))
    return derivative_along(expression, s, s.v, base) + explicit


def derivative_along(expression: casadi.SX, s: Symbols, step: casadi.SX, base: BaseRotation | None = None) -> casadi.SX:
    """The derivative of an expression of q and v, q moving along E(q) `step`, where `step` (nv) is like a velocity."""
    import casadi

    if base is not None:
        return base.derivative_along(expression, step)
    return casadi.jtimes(expression, s.q, s.algorithm("configuration_rate")(s.q, step))


def row_names(constraints: Sequence[Constraint], s: Symbols) -> list[tuple[str, str]]:
    """(constraint, label of its multiplier) of every row, all φ and then all ψ."""
    position, velocity = [], []
    for constraint in constraints:
        h = constraint.residual(s).position.size1()
        names = [(constraint.name, label) for label in constraint.labels(s.robot)]
        position += names[:h]
        velocity += names[h:]
    return position + velocity


def rows_by_constraint(constraints: Sequence[Constraint], s: Symbols) -> dict[str, list[int]]:
    """The rows of each constraint among all φ and then all ψ, in the order of its labels."""
    sizes = [[part.size1() for part in constraint.residual(s)] for constraint in constraints]
    first, second = 0, sum(h for h, _ in sizes)
    rows = {}
    for constraint, (h, k) in zip(constraints, sizes, strict=True):
        rows[constraint.name] = [*range(first, first + h), *range(second, second + k)]
        first, second = first + h, second + k
    return rows
