"""Directional derivatives of a scene's equations of motion, for sensitivities along a run.

With the accelerations a and multipliers λ that solve the equations of motion

    R(q, v, a, λ, p) = M a + bias − τ − Jᵀ λ = 0,    C(q, v, a, p) = J a + γ + 2 α (φ̇, ψ) + β² (φ, 0) = 0,

their change along a direction (dq, dv, dp) follows by implicit differentiation from the factorisation that gives a and
λ:

    M da − Jᵀ dλ = −dR,    J da = −dC,    dR, dC at constant a and λ.

This needs no derivative of the factorisation. Source: J. Carpentier, N. Mansard, Analytical derivatives of rigid body
dynamics algorithms, RSS 2018; for constraints the same on the KKT system of kkt.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from bellcrank.codegen.directional import Directional, directional
from bellcrank.codegen.expression_graph import graph_of
from bellcrank.codegen.locks import making
from bellcrank.dynamics.equations.base_frame_elimination import mass_matrix
from bellcrank.dynamics.equations.kkt import PROJECTING, REFINEMENTS, Factor, proximal
from bellcrank.dynamics.equations.latch_impact import latch_impact
from bellcrank.dynamics.equations.system import system_of

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.dynamics.equations.assembly import Assembly
    from bellcrank.scene.scene import Scene


JUMPS = frozenset({"sign", "floor", "ceil", "lt", "le", "eq", "ne", "and", "or", "not", "fmod", "if_else_zero"})


class DirectionalEquations:
    """Compiled directional derivatives of a scene's equations, along (dq, dv) and some of its parameters.

    Args:
        scene: The scene.
        places: Which of the scene's parameters (in their order) directions contain.
    """

    def __init__(self, scene: Scene, places: tuple[int, ...]) -> None:
        self._scene, self._places, self._system = scene, places, system_of(scene)

    # ---- the stepper's functions: at a point (t, x, u, p), and along (tape, dx, dp)

    @cached_property
    def rate(self) -> Directional:
        """(q̇, v̇) and the guard of the plain solution at a point (1 without constraints); its change."""
        return self._directional("rate", lambda: self._rate(plain=True), 2)

    @cached_property
    def fallback(self) -> Directional:
        """The same by the proximal solution, without a guard."""
        return self._directional("fallback rate", lambda: self._rate(plain=False), 2)

    @cached_property
    def project(self) -> Directional:
        """The guard at a point; the correction of (dq, dv) that satisfies the constraints' derivatives."""
        return self._directional("project", lambda: self._project(plain=True), 2)

    @cached_property
    def project_fallback(self) -> Directional:
        """The same correction by the proximal solution."""
        return self._directional("fallback project", lambda: self._project(plain=False), 2)

    @cached_property
    def switches(self) -> tuple[str, ...]:
        """The operations of the right-hand side that jump, such as "sign"."""
        a = self._system.assembly
        rate = a.state_rate if a.solution is None else a.plain_state_rate
        graph = graph_of(Direction.of(a, ()).function("rate", [rate]).serialize().encode("latin-1"))
        return tuple(sorted({node.op for node in graph.nodes} & JUMPS))

    # ---- results: functions of (t, x, u, p, …) for batches

    @cached_property
    def residual(self) -> Compiled:
        """(t, x, u, p, dx, dp) -> the change of φ, and of (φ̇, ψ)."""

        def build() -> casadi.Function:
            c, d = self._solution.derivatives, self._direction
            return d.function("residual", [d.along(c.position_residual), d.along(c.velocity_residual)])

        return self._compiled("residual", build)

    @cached_property
    def events(self) -> Compiled:
        """(t, x, u, p, dx, dp, du/dt) -> the total time derivatives of the event functions, and their change."""

        def build() -> casadi.Function:
            d = self._direction
            return d.function("events", [d.in_time(d.assembly.events), d.along(d.assembly.events)], d.signal_rate)

        return self._compiled("events", build)

    @cached_property
    def observation(self) -> Compiled:
        """(t, x, u, p, dx, dp) -> the changes of v̇, λ, (T, V), actuator and passive forces, and each output."""

        def build() -> casadi.Function:
            import casadi

            d, a = self._direction, self._direction.assembly
            multipliers = casadi.SX(0, 1) if a.solution is None else a.solution.proximal.multipliers
            energy = casadi.vertcat(a.kinetic, a.potential)
            found = [a.acceleration, multipliers, energy, a.actuator, a.passive, *a.outputs.values()]
            return d.function("observation", [d.along(each) for each in found])

        return self._compiled("observation", build)

    def latch(self, k: int) -> Compiled:
        """(t, x, u, p, dx, dp, du/dt, dt) -> the change of the velocity after the impact of event k, of the impulses of
        the constraints and of the latch, and of the energy lost, with the time of the event moving by dt.
        """

        def build() -> casadi.Function:
            import casadi

            d, dt = self._direction, casadi.SX.sym("dt")
            found = latch_impact(self._scene.events[k], d.assembly)
            moved = [d.along(each) + dt * d.explicit(each) for each in found]
            return d.function("latch", moved, d.signal_rate, dt)

        return self._compiled(f"latch {k}", build)

    # ---- expressions

    @cached_property
    def _direction(self) -> Direction:
        return Direction.of(self._system.assembly, self._places)

    @property
    def _solution(self):  # type: ignore[no-untyped-def]
        solution = self._system.assembly.solution
        assert solution is not None
        return solution

    def _rate(self, *, plain: bool) -> casadi.Function:
        import casadi

        d, a, s = self._direction, self._system.assembly, self._system.assembly.symbols
        solution, tree = a.solution, s.tracer_parameters
        accelerations = casadi.SX.sym("a", a.v.size1())
        torque = a.actuator + a.passive
        residual = s.algorithm("inverse_dynamics")(a.q, a.v, accelerations, tree) - torque
        if solution is None:
            factor = Factor(mass_matrix(s), casadi.SX(0, a.v.size1()), casadi.SX(0, 1))
            found = factor.solve(torque - a.bias, casadi.SX(0, 1))[0]
            change = factor.solve(-d.along(residual), casadi.SX(0, 1))[0]
            guard = [casadi.SX(1.0)]
        else:
            c = solution.derivatives
            solved = solution.plain if plain else solution.proximal
            factor = solution.plain_factor if plain else solution.proximal_factor
            multipliers = casadi.SX.sym("l", c.jacobian.size1())
            alpha, beta = _gains(self._scene, a)
            required = c.required_acceleration(alpha, beta)
            right = -d.along(c.jacobian @ accelerations - required)
            force = -d.along(residual - c.jacobian.T @ multipliers)
            if c.rows.singular:  # M + Jᵀ W J stands in place of M, as in kkt.py
                force = force + c.jacobian.T @ (right / c.rows.scale)
            refinements = 0 if plain else REFINEMENTS
            change = casadi.substitute(proximal(factor, force, right, refinements)[0], multipliers, solved.multipliers)
            found, guard = solved.acceleration, [solution.guard] if plain else []
        change = casadi.substitute(change, accelerations, found)
        rate = casadi.vertcat(a.rate, found)
        return d.function("rate", [rate, *guard, casadi.vertcat(d.along(a.rate), change)])

    def _project(self, *, plain: bool) -> casadi.Function:
        import casadi

        d, s, solution = self._direction, self._system.assembly.symbols, self._solution
        c = solution.derivatives
        factor = solution.plain_factor if plain else solution.proximal_factor
        refinements, no_force = 0 if plain else PROJECTING, casadi.SX(s.v.size1(), 1)
        rolling = casadi.SX(c.nonholonomic_residual.size1(), 1)
        step = proximal(factor, no_force, -casadi.vertcat(d.along(c.position_residual), rolling), refinements)[0]
        q_step = s.algorithm("configuration_rate")(s.q, step)
        moved = d.along(c.velocity_residual) + casadi.jtimes(c.velocity_residual, s.q, q_step)
        change = proximal(factor, no_force, -moved, refinements)[0]
        guard = [solution.guard] if plain else []
        return d.function("project", [*guard, casadi.vertcat(q_step, change)])

    # ---- code

    def _key(self, what: str) -> str:
        return f"directional {what} {self._places} {self._system.key}"

    def _directional(self, what: str, build: Callable[[], casadi.Function], directions: int) -> Directional:
        with making:
            return directional(what, [self._scene.robot.key, self._key(what)], build, directions)

    def _compiled(self, what: str, build: Callable[[], casadi.Function]) -> Compiled:
        with making:
            return self._scene.robot.compiled(self._key(what), build, True)


@dataclass(frozen=True)
class Direction:
    """A direction (dq, dv, dp) as symbols, and derivatives of expressions along it.

    Attributes:
        assembly: The equations.
        state: dq and dv (nq + nv).
        parameters: dp of the chosen parameters.
        chosen: The symbols of these parameters.
        signal_rate: du/dt as symbols.
    """

    assembly: Assembly
    state: casadi.SX
    parameters: casadi.SX
    chosen: casadi.SX
    signal_rate: casadi.SX

    @classmethod
    def of(cls, assembly: Assembly, places: tuple[int, ...]) -> Direction:
        """A direction along q, v and the parameters at these places."""
        import casadi

        size = assembly.q.size1() + assembly.v.size1()
        return cls(
            assembly,
            casadi.SX.sym("dx", size),
            casadi.SX.sym("dp", len(places)),
            casadi.vertcat(casadi.SX(0, 1), *[assembly.p[k] for k in places]),
            casadi.SX.sym("du", assembly.u.size1()),
        )

    def along(self, expression: casadi.SX) -> casadi.SX:
        """The derivative of an expression along the direction."""
        import casadi

        a = self.assembly
        symbols = casadi.vertcat(a.q, a.v, self.chosen)
        return casadi.densify(casadi.jtimes(expression, symbols, casadi.vertcat(self.state, self.parameters)))

    def explicit(self, expression: casadi.SX) -> casadi.SX:
        """The derivative of an expression by time alone, with the signals advancing."""
        import casadi

        a = self.assembly
        return casadi.jtimes(expression, casadi.vertcat(a.t, a.u), casadi.vertcat(1.0, self.signal_rate))

    def in_time(self, expression: casadi.SX) -> casadi.SX:
        """The total time derivative of an expression along the motion."""
        import casadi

        a = self.assembly
        moving = casadi.jtimes(expression, casadi.vertcat(a.q, a.v), casadi.vertcat(a.rate, a.acceleration))
        return self.explicit(expression) + moving

    def function(self, name: str, outputs: list[casadi.SX], *more: casadi.SX) -> casadi.Function:
        """(t, x, u, p, dx, dp, …) -> outputs; directions last."""
        import casadi

        a = self.assembly
        inputs = [a.t, a.state, a.u, a.p, self.state, self.parameters, *more]
        return casadi.Function(name, inputs, [casadi.densify(o) for o in outputs])


def _gains(scene: Scene, assembly: Assembly) -> tuple[casadi.SX | float, casadi.SX | float]:
    """Baumgarte's gains α and β in the parameters of the equations, 0 without them."""
    if scene.settings.stabilisation.kind != "baumgarte":
        return 0.0, 0.0
    first = len(scene.parameters)
    return assembly.p[first], assembly.p[first + 1]
