"""A scene's equations of motion as machine code: the functions that the stepper and the results call."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from bellcrank.arrays import Array
from bellcrank.cached_values import cached_property
from bellcrank.codegen.compile import Compiled
from bellcrank.codegen.locks import making
from bellcrank.dynamics.constraints.constraint_derivatives import time_derivative
from bellcrank.dynamics.equations.assembly import Assembly, assemble
from bellcrank.dynamics.equations.kkt import ConstrainedSolution
from bellcrank.dynamics.equations.latch_impact import latch_impact
from bellcrank.dynamics.equations.observed_quantities import ObservedLayout, observed_quantities
from bellcrank.dynamics.equations.system_layout import Sizes, SparsityPattern, SystemLayout, entries
from bellcrank.elements.drives import Drive
from bellcrank.elements.expression import term_value
from bellcrank.elements.sampled_controllers import Sampled

if TYPE_CHECKING:
    import casadi

    from bellcrank.scene.scene import Scene

# The Jacobian as one expression has about 0.6 n times the operations of the right-hand side; beyond this bound
# directional derivatives in SIMD lanes are cheaper to compile and as fast to run.
LARGEST_JACOBIAN = 3_000
LARGEST_STAGED = 16  # states: up to here the memory traffic is a good part of the time of an evaluation


class System:
    """Compiled functions of (t, x, u, p): time (1), state x = q, v, z and maybe W (n), signals (nu), parameters (np).

    Each takes one state or a batch with a leading axis, and returns arrays in SI units. Made by `system_of`
    (system.py). Nothing is traced while the machine code is in the cache. `key` identifies the equations.

    Attributes:
        nq: The size of the position q.
        nv: The size of the velocity v.
        nz: The number of auxiliary states z.
        has_work: Whether x ends with the work W (J).
        size: The size of the state x.
    """

    def __init__(self, scene: Scene, key: str, parameters: int) -> None:
        self._scene, self._key = scene, key
        self.nq, self.nv = scene.robot.nq, scene.robot.nv
        self.nz = sum(states.size for states in scene.auxiliary_states)
        signals = sum(source.size for source in scene.signal_sources)

        def sizes(has_work: bool) -> Sizes:
            return 1, self.nq + self.nv + self.nz + has_work, signals, parameters

        layout = SystemLayout.load("system-" + key)
        if layout is None or layout.sizes != sizes(layout.has_work):
            a = self.assembly
            operations = self.function_of_state("rhs", [a.state_rate]).n_instructions()
            layout = SystemLayout.of(scene, a, operations, sizes(a.has_work))
            layout.store("system-" + key)
        self.json_layout = layout
        self.has_work = layout.has_work
        self.size = self.nq + self.nv + self.nz + self.has_work

    @cached_property
    def assembly(self) -> Assembly:
        """The equations as expressions; traced when first asked for."""
        return assemble(self._scene)

    @property
    def key(self) -> str:
        """What identifies the equations."""
        return self._key

    @property
    def multiplier_names(self) -> tuple[tuple[str, str], ...]:
        """(constraint, label) of each multiplier, such as ("hook", "z [N]")."""
        return self.json_layout.multiplier_names

    @property
    def operations(self) -> int:
        """The number of operations of the right-hand side."""
        return self.json_layout.operations

    @property
    def is_loaded(self) -> bool:
        """Whether the code for stepping has been asked for in this process."""
        return not {"rhs", "stage"}.isdisjoint(vars(self))

    # ---- stepping

    @cached_property
    def rhs(self) -> Compiled:
        """(t, x, u, p) -> dx/dt; with constraints by the plain solution, and its guard, which is positive where it
        holds.
        """
        return self._compiled("rhs", lambda: self.function_of_state("rhs", self._rates()))

    @cached_property
    def stage(self) -> Compiled:
        """(t, x, u, p, k, s) -> dx/dt at x + s k, for the stages of a step."""
        return self._compiled("stage", lambda: self._staged("stage", self._rates()))

    @cached_property
    def fallback(self) -> Compiled:
        """(t, x, u, p) -> dx/dt by the proximal solution, which holds also where constraints depend on each other."""
        return self._compiled("fallback", lambda: self.function_of_state("fallback", [self.assembly.state_rate]))

    @cached_property
    def fallback_stage(self) -> Compiled:
        """(t, x, u, p, k, s) -> `fallback` at x + s k."""
        return self._compiled("fallback stage", lambda: self._staged("fallback_stage", [self.assembly.state_rate]))

    def _rates(self) -> list[casadi.SX]:
        a = self.assembly
        return [a.state_rate] if a.solution is None else [a.plain_state_rate, a.solution.guard]

    def _staged(self, name: str, outputs: list[casadi.SX]) -> casadi.Function:
        import casadi

        a, f = self.assembly, self.function_of_state("f", outputs)
        x, k, s = casadi.SX.sym("x", self.size), casadi.SX.sym("k", self.size), casadi.SX.sym("s")
        return casadi.Function(name, [a.t, x, a.u, a.p, k, s], f.call([a.t, x + s * k, a.u, a.p]))

    @cached_property
    def project(self) -> Compiled:
        """(t, x, u, p) -> the correction of q and v that takes φ, φ̇ and ψ to 0 to first order, and the guard."""

        def build() -> casadi.Function:
            return self.function_of_state("project", [self._projection(plain=True), self._solution.guard])

        return self._compiled("project", build)

    @cached_property
    def project_fallback(self) -> Compiled:
        """(t, x, u, p) -> the same correction by the proximal solution, which needs no guard."""
        return self._compiled(
            "project fallback", lambda: self.function_of_state("project_fallback", [self._projection(plain=False)])
        )

    def _projection(self, *, plain: bool) -> casadi.SX:
        import casadi

        a, solved = self.assembly, self._solution.plain if plain else self._solution.proximal
        q_step = a.symbols.algorithm("configuration_rate")(a.q, solved.displacement)
        return casadi.vertcat(q_step, solved.velocity_change)

    @cached_property
    def auxiliary_start(self) -> Compiled:
        """(t, x, u, p) -> the auxiliary states at the start (nz), of the position and velocity in x."""
        return self._compiled(
            "auxiliary start", lambda: self.function_of_state("auxiliary_start", [self.assembly.auxiliary_start])
        )

    @cached_property
    def events(self) -> Compiled:
        """(t, x, u, p) -> the event functions, whose zeros are the events."""
        return self._compiled("events", lambda: self.function_of_state("events", [self.assembly.events]))

    @cached_property
    def switches(self) -> Compiled:
        """(t, x, u, p) -> the functions at whose zeros forces are not smooth, in the order of their sides in u, then
        those that are positive while the modes of joints with dry friction last.
        """

        def build() -> casadi.Function:
            import casadi

            s, found = self.assembly.symbols, []
            for part in self._scene.elements:
                found += [term_value(term, s, s.sides(part)) for term in part.switches]
            return self.function_of_state("switches", [casadi.vertcat(*found, self.assembly.mode_switches)])

        return self._compiled("switches", build)

    @cached_property
    def mode_turn(self) -> Compiled:
        """(t, x, u, p) -> what a run needs to find new modes of joints with dry friction (stuck_joints.py)."""
        return self._compiled("modes", lambda: self.function_of_state("modes", [self.assembly.mode_turn]))

    @cached_property
    def _updates(self) -> dict[tuple[int, int], Compiled]:
        return {}  # whoever steps knows their addresses only

    def update(self, k: int, instant: int) -> Compiled:
        """(t, x, u, p) -> what all sampled controllers hold after an instant of controller k of the scene."""
        if (k, instant) not in self._updates:
            self._updates[k, instant] = self._update(k, instant)
        return self._updates[k, instant]

    def _update(self, k: int, instant: int) -> Compiled:
        def build() -> casadi.Function:
            import casadi

            s = self.assembly.symbols
            held = [
                part.update(instant, s) if i == k else s.signal(part.samples)
                for i, part in enumerate(self._scene.control)
                if isinstance(part, Sampled | Drive) and part.samples is not None
            ]
            return self.function_of_state("update", [casadi.vertcat(*held)])

        return self._compiled(f"update {k} {instant}", build)

    def latch(self, k: int) -> Compiled:
        """(t, x, u, p) -> the impact of the latch of event k (latch_impact.py)."""

        def build() -> casadi.Function:
            return self.function_of_state("latch", latch_impact(self._scene.events[k], self.assembly))

        return self._compiled(f"latch {k}", build)

    # ---- derivatives

    @property
    def whole_jacobian(self) -> bool:
        """Whether the Jacobian is one expression; otherwise it is made of directional derivatives."""
        return bool(0.6 * self.size * self.operations <= LARGEST_JACOBIAN)

    @cached_property
    def jacobian(self) -> Compiled:
        """(t, x, u, p) -> d(dx/dt)/dx, column after column."""

        def build() -> casadi.Function:
            import casadi

            a = self.assembly
            return self.function_of_state("jacobian", [_flat(casadi.jacobian(a.state_rate, a.state))])

        return self._compiled("jacobian", build)

    @cached_property
    def tangent(self) -> Compiled:
        """(t, x, u, p, dx) -> the directional derivative of dx/dt along dx."""

        def build() -> casadi.Function:
            import casadi

            a, dx = self.assembly, casadi.SX.sym("dx", self.size)
            along = casadi.jtimes(a.state_rate, a.state, dx)
            return casadi.Function("tangent", [a.t, a.state, a.u, a.p, dx], [casadi.densify(along)])

        return self._compiled("tangent", build)

    # ---- constraints

    @property
    def _solution(self) -> ConstrainedSolution:
        solution = self.assembly.solution
        assert solution is not None
        return solution

    @cached_property
    def constraint(self) -> Compiled:
        """(t, x, u, p) -> multipliers, φ, and (φ̇, ψ), of the kept rows."""

        def build() -> casadi.Function:
            c = self._solution.derivatives
            return self.function_of_state(
                "closure", [self._solution.proximal.multipliers, c.position_residual, c.velocity_residual]
            )

        return self._compiled("closure", build, seldom=True)

    def linearised_constraints(self, t: Array, x: Array, u: Array, p: Array) -> tuple[Array, Array, Array]:
        """φ (h), (φ̇, ψ) (rows) and J (rows, nv) at a state, or at each state of a batch."""
        position, velocity, numbers = self.linearised(t, x, u, p)
        return position, velocity, self.jacobian_pattern.matrix(numbers)

    @property
    def jacobian_pattern(self) -> SparsityPattern:
        """Where the entries of J are that are not always zero."""
        return self.json_layout.sparsity["jacobian"]

    @cached_property
    def linearised(self) -> Compiled:
        """(t, x, u, p) -> φ, (φ̇, ψ), and the entries of J that are not always zero."""

        def build() -> casadi.Function:
            c = self._solution.derivatives
            return self.function_of_state("linearised", [c.position_residual, c.velocity_residual, entries(c.jacobian)])

        return self._compiled("linearised", build, seldom=True)

    def constraint_metric(self, t: Array, x: Array, u: Array, p: Array) -> tuple[Array, Array]:
        """J (rows, nv) and M (nv, nv) at a state, or at each state of a batch."""
        jacobian, mass = self._metric(t, x, u, p)
        return self.json_layout.sparsity["jacobian"].matrix(jacobian), self.json_layout.sparsity["mass"].matrix(mass)

    @cached_property
    def _metric(self) -> Compiled:
        """(t, x, u, p) -> the entries of J and of M that are not always zero."""

        def build() -> casadi.Function:
            solution = self._solution
            return self.function_of_state("metric", [entries(solution.derivatives.jacobian), entries(solution.mass)])

        return self._compiled("metric", build, seldom=True)

    @cached_property
    def alignment_cosines(self) -> Compiled:
        """(t, x, u, p) -> the cosine of the angle between the sides of each weld and hinge
        (constraint_alignment.py).
        """

        def build() -> casadi.Function:
            import casadi

            found = [constraint.alignment_cosine(self.assembly.symbols) for constraint in self._scene.constraints]
            return self.function_of_state("facing", [casadi.vertcat(*found)])

        return self._compiled("facing", build)

    @cached_property
    def alignment_residual(self) -> Compiled:
        """(t, x, u, p) -> a residual that vanishes only where these cosines are 1; its derivative by v, flattened."""

        def build() -> casadi.Function:
            import casadi

            s = self.assembly.symbols
            found = casadi.vertcat(*[constraint.alignment_residual(s) for constraint in self._scene.constraints])
            slope = casadi.jacobian(time_derivative(found, s), s.v)
            return self.function_of_state("way", [found, _flat(slope)])

        return self._compiled("way", build, seldom=True)

    # ---- results

    @cached_property
    def observation(self) -> Compiled:
        """(t, x, u, p) -> v̇, (T, V), actuator and passive joint forces, and each named output."""

        def build() -> casadi.Function:
            import casadi

            a = self.assembly
            energy = casadi.vertcat(a.kinetic, a.potential)
            return self.function_of_state(
                "observation", [a.acceleration, energy, a.actuator, a.passive, *a.outputs.values()]
            )

        return self._compiled("observation", build, seldom=True)

    @cached_property
    def observe(self) -> Compiled:
        """(t, x, u, p) -> the quantities whose extremes an ensemble of runs finds (observed_quantities.py)."""

        return self._compiled("observe", lambda: self.function_of_state("observe", [self._observed(plain=False)]))

    @cached_property
    def plain_observe(self) -> Compiled:
        """The same by the plain solution of the constraints, for states where the guard of `rhs` is positive."""
        return self._compiled("plain observe", lambda: self.function_of_state("observe", [self._observed(plain=True)]))

    def _observed(self, *, plain: bool) -> casadi.SX:
        return observed_quantities(self._scene, self.assembly, self.multiplier_names, plain=plain)

    @cached_property
    def observed_layout(self) -> ObservedLayout:
        """Where these quantities are in the vector."""
        return ObservedLayout.of(self._scene, self.observe.output_sizes[0])

    @cached_property
    def residual(self) -> Compiled:
        """(t, x, u, p) -> the residual of the equations of motion (nv) and the bias force (nv), N m or N.

        The residual is the inverse dynamics of the computed acceleration less the joint forces; the bias force is
        gravity, Coriolis and centrifugal forces.
        """

        def build() -> casadi.Function:
            return self.function_of_state("residual", [self.assembly.residual, self.assembly.bias])

        return self._compiled("residual", build, seldom=True)

    def frame(self, name: str) -> Compiled:
        """(t, x, u, p) -> a frame's position 3, rotation 9 (row major), linear and angular velocity, world axes."""
        return self._compiled(f"frame {name}", lambda: self.function_of_state("frame", [self.assembly.frame(name)]))

    def function_of_state(self, name: str, outputs: list[casadi.SX]) -> casadi.Function:
        """(t, x, u, p) -> expressions of the assembly."""
        import casadi

        a = self.assembly
        return casadi.Function(name, [a.t, a.state, a.u, a.p], [casadi.densify(o) for o in outputs])

    def _compiled(self, what: str, build: Callable[[], casadi.Function], seldom: bool = False) -> Compiled:
        with making:
            return self._scene.robot.compiled(f"{what} {self._key}", build, seldom, self.json_layout.sizes)


def _flat(matrix: casadi.SX) -> casadi.SX:
    import casadi

    return casadi.vec(casadi.densify(matrix))
