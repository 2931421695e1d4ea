"""J, φ and M of a scene as functions of postures and parameters, to judge its rows by before anything is assembled."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen import cache as disk
from bellcrank.errors import InputError
from bellcrank.numerics import LARGEST, SMALLEST
from bellcrank.robot.joints import lengths_in_position, lengths_in_velocity, postures

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
POSTURES = 8  # in which J and φ are looked at
MEANT = 1e-7  # of the robot's longest placement: lever arms below it are rounding


_FACTS = {"parametric": bool, "names": [(str, str)], "places": ([int], [int]), "signals": int}


class RowFunctions:
    """J, φ and M of a scene as functions of postures and parameters."""

    def __init__(self, scene: Scene, key: str) -> None:
        self.key, self.name = key, "structure-" + key
        self._made: tuple[casadi.Function, casadi.Function] | None = None
        self._codes: dict[str, Compiled] = {}
        self._draws: tuple[Array, Array, Array] | None = None
        self.facts: dict[str, Any] = disk.load_data(self.name, _FACTS) or self._find(scene)

    @property
    def parametric(self) -> bool:
        """Whether anything here depends on parameters."""
        return bool(self.facts["parametric"])

    # ---- functions

    def _find(self, scene: Scene) -> dict[str, Any]:
        import casadi

        depends = False
        for f in self._functions(scene):
            given = f.sx_in()
            depends |= bool(given[-1].numel() and casadi.depends_on(f(*given), given[-1]))
        facts = {"parametric": depends, **self._layout}
        disk.store(self.name, json.dumps(facts).encode())
        return facts

    def _functions(self, scene: Scene) -> tuple[casadi.Function, casadi.Function]:
        """(q, t, u, p) -> entries of J, (φ, ψ) and lengths in a column; and (q, a, p) -> M a."""
        if self._made is None:
            import casadi

            from bellcrank.dynamics.constraint_derivatives import close, row_names
            from bellcrank.elements.symbols import Symbols

            s = Symbols(scene.robot, scene.parameters, scene.frames, scene.initial.clock)
            at_rest = casadi.SX.zeros(scene.robot.nv, 1)
            whole = close(scene.constraints, None, s)
            jacobian = casadi.sparsify(casadi.substitute(whole.jacobian, s.v, at_rest))
            arms = [casadi.jacobian(constraint.reach(s), s.v) for constraint in scene.constraints]
            turning = [k for k, far in enumerate(lengths_in_velocity(scene.robot)) if not far]
            lengths = [casadi.vec(casadi.densify(casadi.sparsify(arm[:, turning]))) for arm in arms if arm.numel()]
            lengths += [constraint.lengths(s) for constraint in scene.constraints]
            gaps = casadi.vertcat(whole.position, casadi.substitute(whole.velocity, s.v, at_rest))
            entries = casadi.reshape(jacobian.nz[:], jacobian.nnz(), 1)
            every = casadi.vertcat(entries, gaps, *lengths)
            places = [list(place) for place in jacobian.sparsity().get_triplet()]
            self._layout = {"names": row_names(scene.constraints, s), "places": places, "signals": s.u.numel()}
            rows = casadi.Function("rows", [s.q, s.t, s.u, s.p], [casadi.densify(every)])
            self._made = rows, s.inertia()
        return self._made

    def jacobians(self, scene: Scene, count: int = POSTURES) -> tuple[Array, Array, Array, float]:
        """q (n, nq), J (n, rows, nv), (φ, ψ) at rest (n, rows) and L in `count` postures that are at most L from 0."""
        robot, facts = scene.robot, self.facts
        names, (down, across) = facts["names"], facts["places"]
        many = len(down)
        units = np.array([in_metres(label) for _, label in names], dtype=bool)
        far = lengths_in_velocity(robot)
        turns = units[down] & ~far[across] if names else np.zeros(0, dtype=bool)
        moves, t, u = self._drawn(robot, count)
        length, entries, q = 0.0, np.zeros((count, 0)), postures(robot, moves, 0.0)
        for first in (True, False):  # with every coordinate in m at 0, which gives L, then with them within 1.5 L
            if names and (first or lengths_in_position(robot).any()):
                entries = self._called(scene, 0)(q, t, u, scene.parameter_values)
            if first:
                found = np.hstack([entries[:, :many][:, turns], entries[:, many + len(names) :]])
                length = _length(scene, found, self.parametric)
                q = postures(robot, moves, length)
        jacobian = np.zeros((count, len(names), robot.nv))
        jacobian[:, down, across] = entries[:, :many]
        return q, jacobian, entries[:, many : many + len(names)], length

    def _drawn(self, robot: Robot, count: int) -> tuple[Array, Array, Array]:
        """The random moves, times and signals (count, …) that all parameters are judged by."""
        if self._draws is None or len(self._draws[0]) != count:
            random = np.random.default_rng(0)
            moves, t = random.uniform(-1.5, 1.5, (count, robot.nq)), random.uniform(0.0, 1.0, (count, 1))
            self._draws = moves, t, random.normal(size=(count, self.facts["signals"]))
        return self._draws

    def inertias(self, scene: Scene) -> Callable[[Array], Array]:
        """q (n, nq) -> M (n, nv, nv)."""
        call, nv = self._called(scene, 1), scene.robot.nv
        given = scene.parameter_values[: 0 if self._tree_is_constant(scene) else None]

        def at(q: Array) -> Array:
            columns = call(np.repeat(q, nv, axis=0), np.tile(np.eye(nv), (len(q), 1)), given)
            mass = columns.reshape(len(q), nv, nv)
            return np.asarray(0.5 * (mass + mass.transpose(0, 2, 1)))

        return at

    @staticmethod
    def _tree_is_constant(scene: Scene) -> bool:
        return not any(parameter.places for parameter in scene.parameters.values())

    def _called(self, scene: Scene, which: int) -> Callable[..., Array]:
        """One of the functions on rows of arguments: compiled where its values are asked for again and again."""
        if self.parametric:
            what = ("rows", "inertia")[which]
            if what not in self._codes:
                made = scene.robot.compiled(f"{what} {self.key}", lambda: self._functions(scene)[which])
                self._codes[what] = made
            return self._codes[what]
        f = self._functions(scene)[which]

        def call(*given: Array) -> Array:
            columns = [x.T if x.ndim == 2 else np.tile(x[:, None], len(given[0])) for x in given]
            return np.asarray(f(*columns)).T

        return call


def _length(scene: Scene, found: Array, parametric: bool) -> float:
    """L: the root mean square of the lengths found, m; where they are but rounding, the longest placement, or 1."""
    tree = scene.robot.equations.tree
    placed = [joint.placement.translation for joint in tree.joints] + [f.in_parent.translation for f in tree.frames]
    set_here = [p.value for p in scene.parameters.values() if p.unit == "m" and parametric]
    longest = max((abs(x) for x in (*np.ravel(placed), *set_here)), default=0.0)
    if longest > LARGEST:
        raise InputError(
            f"{scene.source}: '{scene.robot.name}' has lengths of {longest:.3g} m; expected at most {LARGEST:g} m, so "
            "that their squares are numbers"
        )
    found = found[np.abs(found) <= LARGEST]
    meant = found[np.abs(found) > MEANT * longest]
    if meant.size and np.abs(meant).max() < SMALLEST:
        raise InputError(
            f"{scene.source}: the lengths of '{scene.robot.name}' and its constraints are at most "
            f"{np.abs(meant).max():.3g} m; expected some of {SMALLEST:g} m or more, so that their squares are numbers"
        )
    return float(np.sqrt((meant * meant).mean())) if meant.size else float(longest) or 1.0


def in_metres(label: str) -> bool:
    """Whether a row is a length, as its multiplier is a force."""
    return label.endswith("[N]")
