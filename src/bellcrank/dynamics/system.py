"""A scene's equations of motion as machine code: the functions that the stepper and the results call.

Systems are shared between scenes that differ only in numbers (start, parameters, tolerances), and nothing is traced
while the machine code lies in the cache.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen import cache as disk
from bellcrank.codegen.compile import Compiled
from bellcrank.codegen.locks import making
from bellcrank.derived import cached_property, computed_once
from bellcrank.dynamics.assembly import Assembly, assemble
from bellcrank.dynamics.constraint_rows import rows_of
from bellcrank.dynamics.constraint_derivatives import REGULARISATION, flow, row_names
from bellcrank.dynamics.latch_impact import latch
from bellcrank.dynamics.system_layout import Places, entries

if TYPE_CHECKING:
    import casadi

    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
# The Jacobian as one expression has about 0.6 n times the operations of the right-hand side; beyond this it is cheaper
# to compile, and as quick to run, as directional derivatives in SIMD lanes.
LARGEST_JACOBIAN = 3_000
LARGEST_STAGED = 16  # states: up to here the way through memory is a good part of an evaluation
RECENT = 16  # systems that are kept though no scene is there that uses them
_systems: WeakValueDictionary[str, System] = WeakValueDictionary()
_recent: dict[str, System] = {}  # the last of them is the newest
_FACTS = {
    "has_work": bool,
    "rows": [(str, str)],
    "operations": int,
    "outputs": {str: int},
    "places": {str: (int, int, [int], [int])},
    "sizes": (int, int, int, int),
}


class System:
    """Compiled functions of (t, x, u, p): time (1), state x = q, v and maybe W (n), signals (nu), parameters (np).

    SI units throughout. `has_work` says whether x ends with the work W (J).
    """

    def __init__(self, scene: Scene, key: str) -> None:
        self._scene, self._key = scene, key
        self.nq, self.nv = scene.robot.nq, scene.robot.nv
        signals = sum(source.size for source in scene.signal_sources)
        sizes = {w: [1, self.nq + self.nv + w, signals, len(system_parameters(scene))] for w in (False, True)}
        stored = disk.load_data("system-" + key, _FACTS)
        sound = stored is not None and stored["sizes"] == sizes[stored["has_work"]]
        self._facts: dict[str, Any] = stored if sound else self._find_facts(sizes)
        self.has_work: bool = self._facts["has_work"]
        self.size = self.nq + self.nv + self.has_work
        self._places = {name: Places(*places) for name, places in self._facts["places"].items()}

    def _find_facts(self, sizes: dict[bool, list[int]]) -> dict[str, Any]:
        a = self.assembly
        rhs = self._state_function("rhs", [a.state_rate])
        solution = a.solution
        rows = [] if solution is None else row_names(self._scene.constraints, a.symbols)
        facts = {
            "has_work": a.has_work,
            "rows": [rows[k] for k in solution.closed.kept] if solution is not None else [],
            "operations": rhs.n_instructions(),
            "outputs": {name: expression.numel() for name, expression in a.outputs.items()},
            "places": {}
            if solution is None
            else {"jacobian": Places.of(solution.closed.jacobian), "mass": Places.of(solution.mass)},
            "sizes": sizes[a.has_work],
        }
        disk.store("system-" + self._key, json.dumps(facts).encode())
        return facts

    @cached_property
    def assembly(self) -> Assembly:
        """The equations as expressions; traced when first asked for."""
        return assemble(self._scene)

    @cached_property
    def rhs(self) -> Compiled:
        """(t, x, u, p) -> dx/dt; with constraints by the plain solve, and a guard, which is positive where that holds."""
        return self._compiled("rhs", lambda: self._state_function("rhs", self._rates()))

    def _rates(self) -> list[casadi.SX]:
        a = self.assembly
        return [a.state_rate] if a.solution is None else [a.plain_state_rate, a.solution.guard]

    @cached_property
    def stage(self) -> Compiled:
        """(t, x, u, p, k, s) -> dx/dt at x + s k: a stage of a step that takes its newest slope as it comes."""

        def build() -> casadi.Function:
            return self._staged("stage", self._rates())

        return self._compiled("stage", build)

    @cached_property
    def fallback(self) -> Compiled:
        """(t, x, u, p) -> dx/dt by the proximal solve, which also holds where constraints depend on each other."""
        return self._compiled("fallback", lambda: self._state_function("fallback", [self.assembly.state_rate]))

    @cached_property
    def fallback_stage(self) -> Compiled:
        """The same at x + s k."""
        return self._compiled("fallback stage", lambda: self._staged("fallback_stage", [self.assembly.state_rate]))

    def _staged(self, name: str, outputs: list[casadi.SX]) -> casadi.Function:
        import casadi

        a, f = self.assembly, self._state_function("f", outputs)
        x, k, s = casadi.SX.sym("x", self.size), casadi.SX.sym("k", self.size), casadi.SX.sym("s")
        return casadi.Function(name, [a.t, x, a.u, a.p, k, s], f.call([a.t, x + s * k, a.u, a.p]))

    @cached_property
    def project(self) -> Compiled:
        """(t, x, u, p) -> the correction of q and v that closes φ, φ̇ and ψ to first order, and the guard."""
        return self._compiled("project", lambda: self._projection("project", plain=True))

    @cached_property
    def project_fallback(self) -> Compiled:
        """(t, x, u, p) -> the same correction by the proximal solve, which needs no guard."""
        return self._compiled("project fallback", lambda: self._projection("project_fallback", plain=False))

    def _projection(self, name: str, *, plain: bool) -> casadi.Function:
        import casadi

        a = self.assembly
        assert a.solution is not None
        step, change = a.solution.plain_projection if plain else a.solution.projection
        correction = casadi.vertcat(a.symbols.algorithm("configuration_rate")(a.q, step), change)
        return self._state_function(name, [correction, a.solution.guard] if plain else [correction])

    @cached_property
    def constraint(self) -> Compiled:
        """(t, x, u, p) -> multipliers, φ, and (φ̇, ψ), of the rows that bind."""

        def build() -> casadi.Function:
            solution = self.assembly.solution
            assert solution is not None
            c = solution.closed
            return self._state_function("closure", [solution.multipliers, c.position, c.speed])

        return self._compiled("closure", build, seldom=True)

    def linearised_constraints(self, t: Array, x: Array, u: Array, p: Array) -> tuple[Array, Array, Array]:
        """φ (h), (φ̇, ψ) (rows) and J (rows, nv) at a state, or at each state of a batch."""
        position, speed, numbers = self._linearised(t, x, u, p)
        return position, speed, self._places["jacobian"].matrix(numbers)

    @cached_property
    def _linearised(self) -> Compiled:
        """(t, x, u, p) -> φ, (φ̇, ψ), and the entries of J that are not always zero."""

        def build() -> casadi.Function:
            solution = self.assembly.solution
            assert solution is not None
            c = solution.closed
            return self._state_function("linearised", [c.position, c.speed, entries(c.jacobian)])

        return self._compiled("linearised", build, seldom=True)

    def constraint_metric(self, t: Array, x: Array, u: Array, p: Array) -> tuple[Array, Array]:
        """J (rows, nv) and M (nv, nv) at a state, or at each state of a batch."""
        jacobian, mass = self._metric(t, x, u, p)
        return self._places["jacobian"].matrix(jacobian), self._places["mass"].matrix(mass)

    @cached_property
    def facing(self) -> Compiled:
        """(t, x, u, p) -> the cosine of the angle between the sides of each constraint that has one (`turning`)."""

        def build() -> casadi.Function:
            import casadi

            found = [constraint.facing(self.assembly.symbols) for constraint in self._scene.constraints]
            return self._state_function("facing", [casadi.vertcat(*found)])

        return self._compiled("facing", build)

    @cached_property
    def way(self) -> Compiled:
        """(t, x, u, p) -> what vanishes where all these cosines are 1, and its derivative by v, column after column."""

        def build() -> casadi.Function:
            import casadi

            s = self.assembly.symbols
            found = casadi.vertcat(*[constraint.way(s) for constraint in self._scene.constraints])
            return self._state_function("way", [found, _dense(casadi.jacobian(flow(found, s), s.v))])

        return self._compiled("way", build)

    @cached_property
    def _metric(self) -> Compiled:
        """(t, x, u, p) -> the entries of J and of M that are not always zero."""

        def build() -> casadi.Function:
            solution = self.assembly.solution
            assert solution is not None
            return self._state_function("metric", [entries(solution.closed.jacobian), entries(solution.mass)])

        return self._compiled("metric", build, seldom=True)

    def latch(self, k: int) -> Compiled:
        """(t, x, u, p) -> what happens where the lock of event k closes (dynamics/latch.py)."""

        def build() -> casadi.Function:
            return self._state_function("latch", latch(self._scene.events[k], self.assembly))

        return self._compiled(f"latch {k}", build)

    @property
    def is_loaded(self) -> bool:
        """Whether the code that steps has been asked for in this process."""
        return not {"rhs", "stage"}.isdisjoint(vars(self))

    @property
    def multiplier_names(self) -> tuple[tuple[str, str], ...]:
        """(constraint, what it is) of each multiplier."""
        return tuple((name, label) for name, label in self._facts["rows"])

    @cached_property
    def observation(self) -> Compiled:
        """(t, x, u, p) -> v̇, (T, V), actuator and passive joint forces, and each named output."""

        def build() -> casadi.Function:
            import casadi

            a = self.assembly
            energy = casadi.vertcat(a.kinetic, a.potential)
            return self._state_function(
                "observation", [a.acceleration, energy, a.actuator, a.passive, *a.outputs.values()]
            )

        return self._compiled("observation", build, seldom=True)

    @cached_property
    def residual(self) -> Compiled:
        """(t, x, u, p) -> inverse dynamics of the computed acceleration less the joint forces, and the bias force
        (gravity, Coriolis, centrifugal); (nv) each, N m or N.
        """

        def build() -> casadi.Function:
            return self._state_function("residual", [self.assembly.residual, self.assembly.bias])

        return self._compiled("residual", build, seldom=True)

    @cached_property
    def events(self) -> Compiled:
        """(t, x, u, p) -> the event functions, whose zeros are the events."""
        return self._compiled("events", lambda: self._state_function("events", [self.assembly.events]))

    @property
    def whole_jacobian(self) -> bool:
        """Whether the Jacobian is one expression; otherwise it is made of directional derivatives."""
        return bool(0.6 * self.size * self._facts["operations"] <= LARGEST_JACOBIAN)

    @cached_property
    def jacobian(self) -> Compiled:
        """(t, x, u, p) -> d(dx/dt)/dx, column after column."""

        def build() -> casadi.Function:
            import casadi

            a = self.assembly
            x = a.state
            return casadi.Function("jacobian", [a.t, x, a.u, a.p], [_dense(casadi.jacobian(self._rate_of(x), x))])

        return self._compiled("jacobian", build)

    @cached_property
    def tangent(self) -> Compiled:
        """(t, x, u, p, dx) -> the directional derivative of dx/dt along dx."""

        def build() -> casadi.Function:
            import casadi

            a = self.assembly
            x, dx = a.state, casadi.SX.sym("dx", self.size)
            along = casadi.jtimes(self._rate_of(x), x, dx)
            return casadi.Function("tangent", [a.t, x, a.u, a.p, dx], [casadi.densify(along)])

        return self._compiled("tangent", build)

    def frame(self, name: str) -> Compiled:
        """(t, x, u, p) -> a frame's position 3, rotation 9 (row major), linear and angular velocity, world axes."""

        def build() -> casadi.Function:
            return self._state_function("frame", [self.assembly.frame(name)])

        return self._compiled(f"frame {name}", build)

    def _rate_of(self, x: casadi.SX) -> casadi.SX:
        return self.assembly.state_rate

    def _state_function(self, name: str, outputs: list[casadi.SX]) -> casadi.Function:
        import casadi

        a = self.assembly
        return casadi.Function(name, [a.t, a.state, a.u, a.p], [casadi.densify(o) for o in outputs])

    def _compiled(self, what: str, build: Any, seldom: bool = False) -> Compiled:
        with making:
            return self._scene.robot.compiled(f"{what} {self._key}", build, seldom, self._facts["sizes"])


@computed_once
def system_parameters(scene: Scene) -> Array:
    """The parameters p of the equations: `Scene.own_parameters`, and with constraints how large their rows usually are and,
    last, their regularisation. Not to be written to.
    """
    own = scene.own_parameters
    found = np.concatenate([own, rows_of(scene).parameters, [REGULARISATION]]) if scene.constraints else own
    found.setflags(write=False)
    return found


@computed_once
def system_of(scene: Scene) -> System:
    """The system of a scene, shared by scenes with the same equations.

    It lives as long as one of them, and those last used a little longer, so that scenes that are read again are warm.
    """
    key = disk.digest(scene.structure_key, rows_of(scene).signature)
    with making:
        system = _systems.get(key)
        if system is None:
            system = _systems[key] = System(scene, key)
        _recent.pop(key, None)
        _recent[key] = system
        if len(_recent) > RECENT:
            del _recent[next(iter(_recent))]
        return system


def _dense(matrix: casadi.SX) -> casadi.SX:
    import casadi

    return casadi.vec(casadi.densify(matrix))
