"""A scene's unsolved equations and their derivatives as machine code, evaluated at one state.

r₁ = M v̇ + h − f − τ − Jᵀ λ = 0,     r₂ = J v̇ + γ = 0.

M v̇ + h is recursive Newton-Euler (gravity included), f the scene's forces, controllers and friction, τ additional joint
forces, J and γ the Jacobian and drift of the constraints' velocity residuals w = (φ̇, ψ) (constraint_derivatives.py).
Their derivatives give those of v̇ and λ by implicit differentiation (equation_derivatives.py), and are much shorter than
those of the solved equations.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property, computed_once
from bellcrank.codegen import cache as disk
from bellcrank.codegen.locks import making
from bellcrank.dynamics.constraints.constraint_derivatives import (
    ConstraintDerivatives,
    SymbolicRows,
    differentiate_constraints,
    rows_by_constraint,
)
from bellcrank.dynamics.constraints.constraint_rows import rows_of, velocity_units
from bellcrank.dynamics.equations.assembly import applied_forces
from bellcrank.dynamics.equations.base_frame_elimination import mass_matrix
from bellcrank.dynamics.equations.kkt import KktSolver
from bellcrank.dynamics.equations.stuck_joints import key_of
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.dynamics.equations.system_layout import SparsityPattern, entries
from bellcrank.elements.symbols import Symbols
from bellcrank.errors import InputError
from bellcrank.scene.output_quantities import EquationSymbols

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.elements.signals import Signal
    from bellcrank.scene.scene import Scene

DIRECTIONS = ("position", "velocity", "acceleration", "multipliers", "time", "torque", "signals", "parameters")
_STORED = {str: (int, int, [int], [int])}
AT_SWITCH = 1e-12  # of a function of a switch, SI units: this state is at the switch
_RESIDUAL = ("position", "velocity", "time", "torque", "signals", "parameters")


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
        """The derivative of an expression by a displacement δ (nv) of the position (the axes of v)."""
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
    """The multipliers as symbols, for outputs (`Reactions` of scene/output_quantities.py)."""

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


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearEquations:
    """The equations r₁ and r₂ at one state, and their derivatives.

    Attributes:
        acceleration: v̇ (nv,).
        multipliers: λ (m,).
        solver: Solves the KKT system of this state.
        position_residual: φ (h,).
        velocity_residual: w = (φ̇, ψ) (m,).
        jacobian: J (m, nv) = ∂w/∂v; its first h rows are ∂φ/∂δ.
        velocity_by_position: ∂w/∂δ (m, nv).
        residual_by: ∂(r₁, r₂)/∂… (nv + m, …) by "position" (a displacement δ), "velocity", "time", "torque",
            "signals" and "parameters"; that by "time" has the signals advance with it.
    """

    acceleration: Array
    multipliers: Array
    solver: KktSolver
    position_residual: Array
    velocity_residual: Array
    jacobian: Array
    velocity_by_position: Array
    residual_by: dict[str, Array]

    def solved_by(self, direction: str) -> tuple[Array, Array]:
        """∂v̇ (nv, …) and ∂λ (m, …) by a direction: the solution of the KKT system for −∂(r₁, r₂)."""
        right = -self.residual_by[direction]
        nv = len(self.acceleration)
        return self.solver.solve(right[:nv], right[nv:])


class EquationCode:
    """The compiled functions of a scene's unsolved equations. `equation_code` makes one."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._key = disk.digest("implicit", scene.structure_key, rows_of(scene).signature if scene.constraints else "")
        self.nv = scene.robot.nv

    @cached_property
    def equations(self) -> ImplicitEquations:
        """The equations as expressions; traced when first asked for."""
        return implicit_equations(self._scene)

    def at(self, time: float, q: Array, v: Array, torque: Array | None = None) -> LinearEquations:
        """The equations at a state, with additional joint forces `torque` (nv,).

        Raises InputError where a controller is sampled, or a force is not smooth at this state.
        """
        scene = self._scene
        _refuse_switching(scene, time, q, v)
        inputs = np.array([time]), q, v, scene.signals_at(np.array([time]))[0], scene.parameter_values
        tau = np.zeros(self.nv) if torque is None else torque
        residual, position, velocity, *matrices = self._values(*inputs, tau)
        mass, jacobian = (pattern.matrix(x) for pattern, x in zip(self._patterns("values"), matrices, strict=True))
        rows, m = rows_of(scene) if scene.constraints else None, len(velocity)
        size = np.ones(m) if rows is None else np.sqrt(rows.scale)
        unit = np.ones(self.nv) if rows is None else velocity_units(scene)
        solver = KktSolver.of(mass, jacobian, size, unit)
        acceleration, multipliers = solver.solve(-residual[: self.nv], -residual[self.nv :])
        found = self._slopes(*inputs, acceleration, multipliers, tau)
        found = found if isinstance(found, tuple) else (found,)
        slopes = [pattern.matrix(x) for pattern, x in zip(self._patterns("slopes"), found, strict=True)]
        residual_by = dict(zip(_RESIDUAL, slopes[1:], strict=True))
        residual_by["time"] = residual_by["time"] + residual_by["signals"] @ signal_rates(scene.signals, time)[:, None]
        return LinearEquations(
            acceleration=acceleration,
            multipliers=multipliers,
            solver=solver,
            position_residual=position,
            velocity_residual=velocity,
            jacobian=jacobian,
            velocity_by_position=slopes[0],
            residual_by=residual_by,
        )

    def outputs_at(self, time: float, q: Array, v: Array, at: LinearEquations) -> tuple[Array, dict[str, Array]]:
        """The scene's outputs y (ny,) at a state, and ∂y by each of DIRECTIONS at fixed v̇ and λ."""
        scene = self._scene
        u = scene.signals_at(np.array([time]))[0]
        state = np.array([time]), q, v, u, scene.parameter_values, at.acceleration, at.multipliers, np.zeros(self.nv)
        value, *found = self._outputs(*state)
        slopes = [pattern.matrix(x) for pattern, x in zip(self._patterns("outputs"), found, strict=True)]
        return value, dict(zip(DIRECTIONS, slopes, strict=True))

    # ---- machine code

    @cached_property
    def _values(self) -> Compiled:
        """(t, q, v, u, p, τ) -> (r₁, r₂) at v̇ = 0 and λ = 0, φ, w, and the entries of M and J."""
        import casadi

        def build() -> casadi.Function:
            e = self.equations
            unknown = casadi.vertcat(e.acceleration, e.multipliers)
            rest = casadi.substitute(e.residual, unknown, casadi.SX.zeros(unknown.shape))
            found = [rest, e.position_residual, e.velocity_residual]
            inputs = [*e.arguments[:5], e.torque]
            return casadi.Function(
                "values", inputs, [casadi.densify(x) for x in found] + [entries(x) for x in self._matrices("values")]
            )

        return self._compiled("values", build)

    @cached_property
    def _slopes(self) -> Compiled:
        """(t, q, v, u, p, v̇, λ, τ) -> the entries of ∂w/∂δ and of each `residual_by`."""
        return self._entries("slopes", [])

    @cached_property
    def _outputs(self) -> Compiled:
        """(t, q, v, u, p, v̇, λ, τ) -> the outputs, and the entries of their derivatives by each of DIRECTIONS."""
        return self._entries("outputs", ["outputs"])

    def _entries(self, what: str, values: Sequence[str]) -> Compiled:
        import casadi

        def build() -> casadi.Function:
            e = self.equations
            found = [casadi.densify(getattr(e, name)) for name in values]
            return casadi.Function(what, e.arguments, found + [entries(x) for x in self._matrices(what)])

        return self._compiled(what, build)

    def _matrices(self, what: str) -> list[casadi.SX]:
        e = self.equations
        if what == "values":
            return [e.mass, e.jacobian]
        if what == "slopes":
            return [e.by_displacement(e.velocity_residual), *[_slope(e, e.residual, name) for name in _RESIDUAL]]
        return [_slope(e, e.outputs, name) for name in DIRECTIONS]

    def _patterns(self, what: str) -> list[SparsityPattern]:
        """Where the entries of these matrices are that are not always zero; kept on disk beside the code."""
        if what not in self._known:
            stored = disk.load_data(f"patterns-{what}-{self._key}", _STORED)
            if stored is None:
                found = [SparsityPattern.of(matrix) for matrix in self._matrices(what)]
                stored = {f"{k:02}": tuple(pattern) for k, pattern in enumerate(found)}
                disk.store(f"patterns-{what}-{self._key}", json.dumps(stored).encode())
            self._known[what] = [SparsityPattern(*stored[key]) for key in sorted(stored)]
        return self._known[what]

    @cached_property
    def _known(self) -> dict[str, list[SparsityPattern]]:
        return {}

    def _compiled(self, what: str, build: object) -> Compiled:
        with making:
            return self._scene.robot.compiled(f"{what} {self._key}", build, seldom=True)  # type: ignore[arg-type]


def _refuse_switching(scene: Scene, time: float, q: Array, v: Array) -> None:
    """Refuse equations that have no derivatives at a state (InputError)."""
    if scene.drives:
        raise InputError(
            f"{scene.source}: a drive ({scene.drives[0].name}) has states besides position and velocity, which these "
            "linear equations do not have; remove its 'model'"
        )
    if scene.works:
        raise InputError(f"{scene.source}: outputs.{scene.works[0].name}: work has no linear equations; remove it")
    if not scene.held_sources:
        return
    sampled = [part.name for part in scene.control if part.samples is not None]
    if sampled:
        raise InputError(
            f"{scene.source}: control '{sampled[0]}' is sampled, so the equations have no linear form in continuous "
            "time; remove it, and close the loop with the discrete model (scipy.signal.cont2discrete)"
        )
    if parts := (*scene.dry_friction, *scene.contacts):
        remedy = "give it a smoothed friction (forces, kind: friction), or none" if scene.dry_friction else "remove it"
        raise InputError(
            f"{scene.source}: {key_of(parts[0])}: a joint that sticks or meets a stop has no linear equations; {remedy}"
        )
    system, u = system_of(scene), scene.signals_at(np.array([time]))[0]
    state = np.concatenate([q, v, np.zeros(system.size - len(q) - len(v))])
    values = system.switches(np.array([time]), state, u, system_parameters(scene))
    names = [part.name for part in scene.elements for _ in part.switches]
    for name, value in zip(names, np.atleast_1d(values).tolist(), strict=True):
        if abs(value) < AT_SWITCH:
            raise InputError(
                f"{scene.source}: the force of '{name}' is not smooth at this state, where one of its formulas "
                "switches; linearise beside it"
            )


def _slope(e: ImplicitEquations, expression: casadi.SX, direction: str) -> casadi.SX:
    """The derivative of an expression by one of DIRECTIONS, sparse."""
    import casadi

    if direction == "position":
        return e.by_displacement(expression)
    s = e.symbols
    symbols = {
        "time": s.t, "velocity": s.v, "acceleration": e.acceleration, "multipliers": e.multipliers, "torque": e.torque,
        "signals": s.u, "parameters": s.p,
    }  # fmt: skip
    return casadi.sparsify(casadi.jacobian(expression, symbols[direction]))


def signal_rates(signals: Sequence[Signal], time: float) -> Array:
    """The time derivatives (nu,) of signals, those of the highest derivatives in u included."""
    rates = [np.zeros(0)]
    for signal in signals:
        width = signal.coefficients.shape[2]
        rates.append(replace(signal, derivatives=signal.derivatives + 1).at(np.array([time]))[0, width:])
    return np.concatenate(rates)


@computed_once
def equation_code(scene: Scene) -> EquationCode:
    """The compiled unsolved equations of a scene."""
    return EquationCode(scene)
