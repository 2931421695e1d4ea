"""J, φ and M of a scene sampled at random postures, before the equations of motion are assembled."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.codegen import cache as disk
from bellcrank.dynamics.constraints.constraint_derivatives import differentiate_constraints, row_names
from bellcrank.elements.expression_constraint import ExpressionConstraint
from bellcrank.elements.rolling_constraint import RollingDisk
from bellcrank.elements.symbols import Symbols
from bellcrank.errors import InputError
from bellcrank.numerics import LARGEST, SMALLEST
from bellcrank.robot.model.joints import lengths_in_position, lengths_in_velocity, postures

if TYPE_CHECKING:
    import casadi

    from bellcrank.codegen.compile import Compiled
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene

POSTURES = 8  # in which J and φ are evaluated
MORE_POSTURES = 512  # tried where constraints have no value in all of the first ones
MEANT = 1e-7  # of the robot's largest dimension: shorter lever arms are rounding
_FUNCTIONS = ("rows", "inertia")
_FACTS = {"parametric": bool, "names": [(str, str)], "places": ([int], [int]), "signals": int}


@dataclass(frozen=True, eq=False)
class Samples:
    """Values at random postures: q (n, nq), J (n, rows, nv), the residuals (φ, ψ) at rest (n, rows), and L, m."""

    position: Array
    jacobian: Array
    residuals: Array
    length: float


class ConstraintSampler:
    """J, φ and M of a scene as functions of postures and parameters.

    `key` identifies the structure of the scene's equations. What does not depend on numbers is stored on disk.
    """

    def __init__(self, scene: Scene, key: str) -> None:
        self.key, self.name = key, "structure-" + key
        self._made: tuple[casadi.Function, casadi.Function] | None = None
        self._codes: dict[str, Compiled] = {}
        self._draws: tuple[Array, Array, Array] | None = None
        facts: dict[str, Any] = disk.load_data(self.name, _FACTS) or self._find_facts(scene)
        self.parametric: bool = facts["parametric"]  # whether J, φ or M depends on parameters
        self.names = [(str(name), str(label)) for name, label in facts["names"]]  # of all rows
        self.places, self._inputs = facts["places"], facts["signals"]

    def _find_facts(self, scene: Scene) -> dict[str, Any]:
        import casadi

        depends = False
        for f in self._functions(scene):
            given = f.sx_in()
            depends |= bool(given[-1].numel() and casadi.depends_on(f(*given), given[-1]))
        facts = {"parametric": depends, **self.json_layout}
        disk.store(self.name, json.dumps(facts).encode())
        return facts

    def _functions(self, scene: Scene) -> tuple[casadi.Function, casadi.Function]:
        """(q, t, u, p) -> entries of J, then (φ, ψ), then lever arms and lengths; and (q, a, p) -> M a."""
        if self._made is None:
            import casadi

            s = Symbols(scene.robot, scene.parameters, scene.frames, scene.initial.clock)
            at_rest = casadi.SX.zeros(scene.robot.nv, 1)
            whole = differentiate_constraints(scene.constraints, None, s)
            jacobian = casadi.sparsify(casadi.substitute(whole.jacobian, s.v, at_rest))
            arms = [casadi.jacobian(constraint.lever_velocities(s), s.v) for constraint in scene.constraints]
            rotations = [k for k, far in enumerate(lengths_in_velocity(scene.robot)) if not far]
            lengths = [casadi.vec(casadi.densify(casadi.sparsify(arm[:, rotations]))) for arm in arms if arm.numel()]
            lengths += [constraint.lengths(s) for constraint in scene.constraints]
            velocity = casadi.substitute(whole.nonholonomic_residual, s.v, at_rest)
            residuals = casadi.vertcat(whole.position_residual, velocity)
            entries = casadi.reshape(jacobian.nz[:], jacobian.nnz(), 1)
            every = casadi.vertcat(entries, residuals, *lengths)
            places = [list(place) for place in jacobian.sparsity().get_triplet()]
            self.json_layout = {"names": row_names(scene.constraints, s), "places": places, "signals": s.u.numel()}
            rows = casadi.Function("rows", [s.q, s.t, s.u, s.p], [casadi.densify(every)])
            self._made = rows, s.inertia()
        return self._made

    def samples(self, scene: Scene, count: int = POSTURES) -> Samples:
        """Values in `count` postures with coordinates in m at most 1.5 L from 0, angles at most 1.5 rad.

        L is the characteristic length, which follows from values at the same postures with coordinates in m at 0.
        """
        robot, names, (down, across) = scene.robot, self.names, self.places
        many = len(down)
        units = np.array([in_metres(label) for _, label in names], dtype=bool)
        far = lengths_in_velocity(robot)
        turns = units[down] & ~far[across] if names else np.zeros(0, dtype=bool)
        moves, t, u = self.drawn(robot, count)
        length, entries, q = 0.0, np.zeros((count, 0)), postures(robot, moves, 0.0)
        for first in (True, False):  # with every coordinate in m at 0, which gives L, then with them within 1.5 L
            if names and (first or lengths_in_position(robot).any()):
                entries = self._called(scene, 0)(q, t, u, scene.parameter_values)
            if first:
                found = np.hstack([entries[:, :many][:, turns], entries[:, many + len(names) :]])
                length = _characteristic_length(scene, found, self.parametric)
                q = postures(robot, moves, length)
        jacobian = np.zeros((count, len(names), robot.nv))
        jacobian[:, down, across] = entries[:, :many]
        return Samples(q, jacobian, entries[:, many : many + len(names)], length)

    def valid_samples(self, scene: Scene) -> Samples:
        """At most POSTURES samples, in postures where all values are defined and at most LARGEST.

        Raises InputError for a constraint that has such values in no posture.
        """
        names = self.names
        for count in (POSTURES, MORE_POSTURES):
            found = self.samples(scene, count)
            jacobian, residuals = found.jacobian, found.residuals
            there = (np.abs(jacobian) <= LARGEST).all(axis=2) & (np.abs(residuals) <= LARGEST)  # NaN is not
            good = there.all(axis=1)
            if good.any() or not len(names):
                first = np.flatnonzero(good)[:POSTURES]
                return Samples(found.position[first], jacobian[first], residuals[first], found.length)
        k = int(there.sum(axis=0).argmin())
        name, label = names[k]
        constraint = next(constraint for constraint in scene.constraints if constraint.name == name)
        values = np.append(jacobian[~there[:, k], k].ravel(), residuals[~there[:, k], k])
        value = values[~(np.abs(values) <= LARGEST)][-1]
        if isinstance(constraint, ExpressionConstraint) and not constraint.moves:
            raise InputError(
                f"{scene.source}: constraints: '{name}' cannot hold: its expression contains no joint and is "
                f"{value:.6g} in row {label}; write it in positions or velocities of joints"
            )
        if isinstance(constraint, RollingDisk) and constraint.radius <= LARGEST and abs(constraint.height) <= LARGEST:
            raise InputError(
                f"{scene.source}: constraints: '{name}' has no lowest point to roll on: its disk lies flat on the "
                f"plane "
                f"at every position of the joints (row {label} is {value:.4g}); turn its axis or the plane's normal"
            )
        raise InputError(
            f"{scene.source}: constraints: '{name}' cannot be evaluated: in {count} random postures, at times up to 1 "
            f"s, row "
            f"{label} or its derivative is undefined or larger than {LARGEST:g} ({value:.4g} in one posture); write "
            f"it so "
            "that it is defined there, and divide it by a constant where it is too large"
        )

    def drawn(self, robot: Robot, count: int) -> tuple[Array, Array, Array]:
        """The random displacements, times and signals (count, …), the same at all parameters."""
        if self._draws is None or len(self._draws[0]) != count:
            random = np.random.default_rng(0)
            moves, t = random.uniform(-1.5, 1.5, (count, robot.nq)), random.uniform(0.0, 1.0, (count, 1))
            self._draws = moves, t, random.normal(size=(count, self._inputs))
        return self._draws

    def mass_matrices(self, scene: Scene) -> Callable[[Array], Array]:
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

    def code(self, scene: Scene, what: str) -> Compiled:
        """One of the functions, "rows" or "inertia", compiled."""
        if what not in self._codes:
            made = scene.robot.compiled(f"{what} {self.key}", lambda: self._functions(scene)[_FUNCTIONS.index(what)])
            self._codes[what] = made
        return self._codes[what]

    def _called(self, scene: Scene, which: int) -> Callable[..., Array]:
        """One of the functions on rows of arguments; compiled where parameters change its values."""
        if self.parametric:
            return self.code(scene, _FUNCTIONS[which])
        f = self._functions(scene)[which]

        def call(*given: Array) -> Array:
            columns = [x.T if x.ndim == 2 else np.tile(x[:, None], len(given[0])) for x in given]
            return np.asarray(f(*columns)).T

        return call


def _characteristic_length(scene: Scene, found: Array, parametric: bool) -> float:
    """The root mean square of the lengths found, m; where these are rounding, the largest dimension, or 1 m."""
    set_here = [abs(p.value) for p in scene.parameters.values() if p.unit == "m" and parametric]
    longest = max(largest_dimension(scene.robot), *set_here, 0.0)
    if longest > LARGEST:
        raise InputError(
            f"{scene.source}: '{scene.robot.name}' has lengths of {longest:.3g} m; expected at most {LARGEST:g} m, so "
            "that their squares do not overflow"
        )
    found = found[np.abs(found) <= LARGEST]
    meant = found[np.abs(found) > MEANT * longest]
    if meant.size and np.abs(meant).max() < SMALLEST:
        raise InputError(
            f"{scene.source}: the lengths of '{scene.robot.name}' and its constraints are at most "
            f"{np.abs(meant).max():.3g} m; expected some of {SMALLEST:g} m or more, so that their squares do not "
            f"underflow"
        )
    return float(np.sqrt((meant * meant).mean())) if meant.size else float(longest) or 1.0


def largest_dimension(robot: Robot) -> float:
    """The largest coordinate, m, of a joint or frame of the robot in the frame before it."""
    tree = robot.equations.tree
    placed = [joint.placement.translation for joint in tree.joints] + [f.in_parent.translation for f in tree.frames]
    return float(np.abs(np.ravel(placed)).max(initial=0.0))


def in_metres(label: str) -> bool:
    """Whether a row is a length, because its multiplier is a force."""
    return label.endswith("[N]")
