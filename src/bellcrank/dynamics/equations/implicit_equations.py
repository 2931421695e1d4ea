"""A scene's equations of motion before they are solved, with accelerations and multipliers as symbols.

    r₁ = M v̇ + h − f − τ − Jᵀ λ = 0,     r₂ = J v̇ + γ = 0.

M v̇ + h is recursive Newton-Euler (gravity included), f the scene's forces, controllers and friction, τ additional joint
forces, J and γ the Jacobian and drift of the constraints' velocity residuals w = (φ̇, ψ) (constraint_derivatives.py).
Their derivatives give those of v̇ and λ by implicit differentiation (equation_derivatives.py), and are much shorter than
those of the solved equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bellcrank.dynamics.constraints.constraint_derivatives import (
    ConstraintDerivatives,
    SymbolicRows,
    differentiate_constraints,
    rows_by_constraint,
)
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.equations.assembly import applied_forces
from bellcrank.dynamics.equations.base_frame_elimination import mass_matrix
from bellcrank.elements.symbols import Symbols
from bellcrank.errors import InputError
from bellcrank.scene.equation_symbols import EquationSymbols

if TYPE_CHECKING:
    import casadi

    from bellcrank.scene.scene import Scene


@dataclass(frozen=True, kw_only=True)
class ImplicitEquations:
    """The residuals as casadi expressions, in SI units.

    Attributes:
        symbols: t, q, v, u and p, and the kinematics.
        acceleration: v̇ (nv), symbols.
        multipliers: λ (m) of the rows that are kept, symbols.
        torque: τ (nv), symbols.
        mass: M (nv, nv), sparse.
        jacobian: J (m, nv), sparse.
        position_residual: φ (h).
        velocity_residual: w = (φ̇, ψ) (m), the rows of φ first.
        residual: (r₁, r₂) (nv + m).
        outputs: The columns of the scene's outputs, one after the other.
    """

    symbols: Symbols
    acceleration: casadi.SX
    multipliers: casadi.SX
    torque: casadi.SX
    mass: casadi.SX
    jacobian: casadi.SX
    position_residual: casadi.SX
    velocity_residual: casadi.SX
    residual: casadi.SX
    outputs: casadi.SX

    @property
    def arguments(self) -> list[casadi.SX]:
        """t, q, v, u, p, v̇, λ and τ."""
        s = self.symbols
        return [s.t, s.q, s.v, s.u, s.p, self.acceleration, self.multipliers, self.torque]

    def by_displacement(self, expression: casadi.SX) -> casadi.SX:
        """The derivative of an expression by a displacement δ (nv) of the position (tangent_space.py)."""
        import casadi

        s = self.symbols
        step = casadi.SX.sym("step", s.v.size1())
        rate = s.algorithm("configuration_rate")(s.q, step)
        return casadi.sparsify(casadi.jacobian(expression, s.q) @ casadi.jacobian(rate, step))


def implicit_equations(scene: Scene) -> ImplicitEquations:
    """The unsolved equations of a scene. Raises InputError where a force cannot act on its robot."""
    import casadi

    nv = scene.robot.nv
    s = Symbols(scene.robot, scene.parameters, scene.frames, scene.initial.clock)
    for source in scene.signal_sources:  # all of them, in the order of the scene's signals
        s.signal(source)
    forces = applied_forces(scene, s)
    acceleration, torque = casadi.SX.sym("a", nv), casadi.SX.sym("tau", nv)
    constraints = _constraints(scene, s)
    multipliers = casadi.SX.sym("lambda", constraints.jacobian.size1())
    applied = forces.actuator + forces.passive
    motion = s.algorithm("inverse_dynamics")(s.q, s.v, acceleration, s.tracer_parameters)
    energy = s.algorithm("energy")(s.q, s.v, s.tracer_parameters)
    equations = EquationSymbols(
        work=casadi.SX(0),
        symbols=s,
        acceleration=acceleration,
        joint_torque=applied + torque,
        kinetic=energy[0],
        potential=energy[1] + forces.potential,
        reactions=_GivenReactions(scene, constraints, multipliers, s) if scene.constraints else None,
    )
    outputs = [output.value(equations) for output in scene.outputs.values()]
    return ImplicitEquations(
        symbols=s,
        acceleration=acceleration,
        multipliers=multipliers,
        torque=torque,
        mass=mass_matrix(s),
        jacobian=constraints.jacobian,
        position_residual=constraints.position_residual,
        velocity_residual=constraints.velocity_residual,
        residual=casadi.vertcat(
            motion - applied - torque - constraints.jacobian.T @ multipliers,
            constraints.jacobian @ acceleration + constraints.drift,
        ),
        outputs=casadi.vertcat(casadi.SX(0, 1), *outputs),
    )


def _constraints(scene: Scene, s: Symbols) -> ConstraintDerivatives:
    kept = rows_of(scene).kept if scene.constraints else ()
    return differentiate_constraints(scene.constraints, SymbolicRows.unscaled(kept), s)


class _GivenReactions:
    """The multipliers as symbols, for outputs (`Reactions` of scene/equation_symbols.py)."""

    def __init__(self, scene: Scene, constraints: ConstraintDerivatives, multipliers: casadi.SX, s: Symbols) -> None:
        self._place = {row: k for k, row in enumerate(constraints.rows.kept)}
        self._rows, self._multipliers = rows_by_constraint(scene.constraints, s), multipliers

    def of(self, name: str) -> casadi.SX:
        """The multipliers of one constraint in the order of its labels; 0 for rows that were left out."""
        import casadi

        found = [self._multipliers[self._place[r]] if r in self._place else casadi.SX(0) for r in self._rows[name]]
        return casadi.vertcat(*found)

    @property
    def closeness(self) -> casadi.SX:
        """Not available: only events use it, and these are not part of the equations."""
        raise InputError("the distance to a singularity has no derivative here; it is available to events only")
