"""Operating points: equilibria, also of a moving frame (steady motions), and independent coordinates near them.

With f the equations' field on the state (q, v) and X = Σ yₖ Xₖ a symmetry (symmetries.py), a state with f = X moves
along the symmetry: the wheels of a bicycle that rides straight turn and its frame travels, while the equations stay
the same. Seen in the frame that moves along, it is an equilibrium of f − X, and its stability is that of the
linearisation of f − X, not of f alone. With y = 0 it is an equilibrium. Source: Marsden & Ratiu, Introduction to
Mechanics and Symmetry, 2nd ed., 1.9; J. Ostrowski & J. Burdick, IEEE Conf. Robotics and Automation 1996.

Displacements that satisfy the holonomic rows are δ = T δ_I, changes of velocity that satisfy all rows are
v = N v_I + W δ_I: the dependent velocities also depend on the position, W being the solution of J W = −∂w/∂δ T.
Positions are reduced by holonomic rows only, velocities by all of them: a rolling wheel has more positions than
velocities. A linear field on all (δ, v) that keeps the constraints is then S A [T 0; W N], S being the independent
rows.

Which coordinates are independent follows from QR factorisations with pivoting. Sources: D. L. Peterson, G. Gede & M.
Hubbard, Symbolic linearization of equations of motion of constrained multibody systems, Multibody System Dynamics 33
(2015); Golub & Van Loan, Matrix Computations, 4th ed., 5.4.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import qr

from bellcrank.analysis.symmetries import Symmetries, SymmetryFields, adjoint, project
from bellcrank.arrays import Array
from bellcrank.dynamics.constraints.constraint_rows import velocity_units
from bellcrank.dynamics.equations.kkt import SINGULAR
from bellcrank.dynamics.equations.linear_equations import LinearEquations, equation_code
from bellcrank.dynamics.postures.consistent_start import displaced
from bellcrank.numerics import least_squares
from bellcrank.robot.model.joints import lengths_in_velocity

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene


STEADY = 1e-9  # of the terms of the equations: a smaller residual is that of a steady state
CLOSED = 1e-7  # characteristic lengths or rad: constraints that are violated by more are not satisfied
PASSES = 60
LARGEST_STEP = 0.5  # rad or characteristic lengths
HALVINGS = 12
DESCENT = 0.1  # rad or characteristic lengths: the first step of a descent
DESCENTS = 400
SMALLEST = 1e-4  # of it: a shorter step is left to Newton's method
RANK = 1e-9  # of the largest singular value: a direction that changes less is neutral
PREFERRED = 0.1  # factor by which the columns of joints of one degree of freedom are less likely to be dependent


@dataclass(frozen=True, eq=False, kw_only=True)
class OperatingPoint:
    """A state of a scene, and what is steady about it.

    Attributes:
        time: s.
        position: q (nq,).
        velocity: v (nv,).
        equations: The equations and their derivatives at this state.
        symmetries: The symmetries of the equations.
        coefficients: y (k,), of the symmetry along which the state moves; 0 for an equilibrium.
        residual: The largest of |f − X|, as a share of the terms of the equations; it is steady below 1e-9.
    """

    time: float
    position: Array
    velocity: Array
    equations: LinearEquations
    symmetries: Symmetries
    coefficients: Array
    residual: float

    @property
    def steady(self) -> bool:
        """Whether it is an equilibrium or a relative equilibrium."""
        return self.residual < STEADY

    @property
    def at_rest(self) -> bool:
        """Whether the velocity is 0."""
        return not self.velocity.any()

    @property
    def fields(self) -> SymmetryFields:
        """The fields of the symmetries at this state."""
        return self.symmetries.fields(self.position, self.velocity)

    @property
    def linear_field(self) -> Array:
        """The derivative (2 nv, 2 nv) of f − X by (δ, v), constraints not eliminated."""
        nv, robot = len(self.velocity), self.symmetries.scene.robot
        at = self.equations
        turn = adjoint(robot, self.fields.right @ self.coefficients)
        return np.block(
            [
                [turn - adjoint(robot, self.velocity), np.eye(nv)],
                [at.solved_by("position")[0], at.solved_by("velocity")[0] + turn],
            ]
        )


def operating_point(scene: Scene, time: float, q: Array, v: Array, symmetries: Symmetries) -> OperatingPoint:
    """The state (q, v) as it is, with the symmetry along which it moves, if any."""
    at = equation_code(scene).at(time, q, v)
    y = np.zeros(symmetries.count)
    if v.any() and symmetries.count:
        fields, unit = symmetries.fields(q, v), np.tile(state_units(scene), 2)
        field = np.concatenate([fields.displacement, fields.change]) / unit[:, None]
        y = least_squares(field, np.concatenate([v, at.acceleration]) / unit, "the velocity is", 1e-9)
    return _point(symmetries, time, q, v, at, y)


def steady_point(start: OperatingPoint) -> OperatingPoint:
    """The equilibrium, or steady motion, nearest to a state, by Newton's method with steps of least norm.

    A state at rest stays at rest. The result is not steady where none was found. The search for postures on constraints
    (dynamics/postures/posture_search.py) does not serve: accelerations have to vanish too, and v and y are unknown with
    q.
    """
    scene, best = start.symmetries.scene, start
    for _ in range(PASSES):
        step = _newton_step(best)
        size = np.abs(step[: len(best.velocity)] / state_units(scene)).max(initial=0.0)
        share = min(1.0, LARGEST_STEP / size) if size > 0.0 else 1.0
        for _ in range(HALVINGS):
            tried = _moved(best, share * step)
            if _norm(tried) < _norm(best):
                break
            share *= 0.5
        else:
            return best
        best = tried
    return best


def relaxed_point(start: OperatingPoint) -> OperatingPoint:
    """A state at rest nearer to a stable equilibrium: short steps along the accelerations from rest.

    They are steps of steepest descent of the potential energy in the metric of the mass matrix, as far as the forces
    have one. A step is halved where the direction turns back. The constraints are kept.
    """
    scene, point, length, last = start.symmetries.scene, start, DESCENT, None
    unit = state_units(scene)
    for _ in range(DESCENTS):
        direction = point.equations.acceleration / unit
        size = float(np.abs(direction).max(initial=0.0))
        if size == 0.0 or length < DESCENT * SMALLEST:
            break
        if last is not None and float(direction @ last) < 0.0:
            length *= 0.5
        there = displaced(scene, point.position, length / size * direction * unit)
        q, v, at = project(scene, point.time, there, point.velocity)
        point, last = _point(point.symmetries, point.time, q, v, at, point.coefficients), direction
    return point


def state_units(scene: Scene) -> Array:
    """The unit of each velocity (nv,): the characteristic length of a closed mechanism, m, or 1."""
    return velocity_units(scene) if scene.constraints else np.ones(scene.robot.nv)


def _point(symmetries: Symmetries, time: float, q: Array, v: Array, at: LinearEquations, y: Array) -> OperatingPoint:
    unit = state_units(symmetries.scene)
    fields = symmetries.fields(q, v)
    drift, push = v - fields.displacement @ y, at.acceleration - fields.change @ y
    by_q, by_v = at.solved_by("position")[0], at.solved_by("velocity")[0]
    terms = np.abs(by_q) @ unit + np.abs(by_v) @ np.abs(v) + np.abs(at.acceleration)
    explicit = at.solved_by("time")[0][:, 0]
    share = max(
        _ratio(push / unit, terms / unit),
        _ratio(drift / unit, np.abs(v) / unit),
        _ratio(explicit / unit, terms / unit),
        float(np.abs(at.position_residual).max(initial=0.0)) / unit.max(initial=1.0) * STEADY / CLOSED,
    )
    return OperatingPoint(
        time=time, position=q, velocity=v, equations=at, symmetries=symmetries, coefficients=y, residual=share
    )


def _ratio(part: Array, whole: Array) -> float:
    size = float(whole.max(initial=0.0))
    return float(np.abs(part).max(initial=0.0)) / size if size > 0.0 else 0.0


def _residual(point: OperatingPoint) -> Array:
    """φ, w, v − A y and v̇ − B y, lengths in units of the characteristic length."""
    at, fields, unit = point.equations, point.fields, state_units(point.symmetries.scene)
    length = unit.max(initial=1.0)
    moving = point.velocity - fields.displacement @ point.coefficients
    pushed = at.acceleration - fields.change @ point.coefficients
    return np.concatenate([at.position_residual / length, at.velocity_residual / length, moving / unit, pushed / unit])


def _norm(point: OperatingPoint) -> float:
    return float(np.linalg.norm(_residual(point)))


def _newton_step(point: OperatingPoint) -> Array:
    """The least change of (δ, v, y), in units, that takes the residual to 0 to first order; of δ alone at rest."""
    at, fields, scene = point.equations, point.fields, point.symmetries.scene
    nv, h, unit = len(point.velocity), len(at.position_residual), state_units(scene)
    length, k = unit.max(initial=1.0), point.symmetries.count
    slope = np.block(
        [
            [at.jacobian[:h] / length, np.zeros((h, nv + k))],
            [at.velocity_by_position / length, at.jacobian / length, np.zeros((len(at.jacobian), k))],
            [point.linear_field / np.tile(unit, 2)[:, None], np.zeros((2 * nv, k))],
        ]
    )
    slope[-2 * nv :, 2 * nv :] = -np.concatenate([fields.displacement, fields.change]) / np.tile(unit, 2)[:, None]
    slope[:, : 2 * nv] *= np.tile(unit, 2)
    unknown = slice(0, nv if point.at_rest else None)
    step = np.zeros(2 * nv + k)
    step[unknown] = least_squares(slope[:, unknown], -_residual(point), "the linear equations are", RANK)
    step[: 2 * nv] *= np.tile(unit, 2)
    return step


def _moved(point: OperatingPoint, step: Array) -> OperatingPoint:
    scene, nv = point.symmetries.scene, len(point.velocity)
    q, v = displaced(scene, point.position, step[:nv]), point.velocity + step[nv : 2 * nv]
    at = equation_code(scene).at(point.time, q, v)
    return _point(point.symmetries, point.time, q, v, at, point.coefficients + step[2 * nv :])


@dataclass(frozen=True, eq=False, kw_only=True)
class IndependentStates:
    """The independent states of an operating point.

    Attributes:
        positions: The independent displacements among δ (nv,).
        velocities: The independent velocities among v (nv,).
        embedding: [T 0; W N] (2 nv, n): all displacements and velocities of the independent ones.
    """

    positions: tuple[int, ...]
    velocities: tuple[int, ...]
    embedding: Array

    @property
    def rows(self) -> list[int]:
        """The independent ones among all (δ, v)."""
        nv = len(self.embedding) // 2
        return [*self.positions, *(nv + k for k in self.velocities)]


def independent_states(point: OperatingPoint) -> IndependentStates:
    """Choose the independent states at an operating point."""
    at, scene = point.equations, point.symmetries.scene
    nv, h, unit = len(point.velocity), len(at.position_residual), state_units(scene)
    likely = np.ones(nv)
    for joint in scene.robot.joints:
        if joint.nv == 1:
            likely[joint.v] = PREFERRED
    scaled = at.jacobian * unit
    holonomic = _dependent(scaled[:h] * likely)
    rest = [k for k in range(nv) if k not in holonomic]
    basis = np.linalg.svd(scaled[:, holonomic], full_matrices=True)[0][:, len(holonomic) :]
    both = [*holonomic, *(rest[k] for k in _dependent(basis.T @ scaled[:, rest] * likely[rest], scaled))]
    positions = tuple(rest)
    velocities = tuple(k for k in rest if k not in both)
    t = _completed(scaled[:h], holonomic, positions, unit)
    n = _completed(scaled, both, velocities, unit)
    w = np.zeros((nv, len(positions)))
    if both:
        w[both] = np.linalg.lstsq(scaled[:, both], -at.velocity_by_position @ t, rcond=None)[0] * unit[both, None]
    embedding = np.block([[t, np.zeros((nv, len(velocities)))], [w, n]])
    return IndependentStates(positions=positions, velocities=velocities, embedding=embedding)


def _dependent(matrix: Array, whole: Array | None = None) -> list[int]:
    """As many columns of a matrix as its rank, chosen by pivoting; small is what is small in `whole`."""
    if not matrix.size:
        return []
    _, r, order = qr(matrix, mode="economic", pivoting=True)
    size = np.abs(np.diagonal(r))
    largest = np.linalg.norm(matrix if whole is None else whole, 2)
    return [int(k) for k in order[: np.count_nonzero(size > SINGULAR * largest * PREFERRED)]]


def _completed(matrix: Array, dependent: list[int], independent: tuple[int, ...], unit: Array) -> Array:
    """The null space (nv, k) of a matrix that is the identity on the independent columns."""
    found = np.zeros((len(unit), len(independent)))
    found[list(independent), range(len(independent))] = 1.0
    if dependent:
        right = -matrix[:, list(independent)] / unit[list(independent)]
        found[dependent] = np.linalg.lstsq(matrix[:, dependent], right, rcond=None)[0] * unit[dependent, None]
    return found


def coordinate_names(robot: Robot) -> tuple[tuple[str, str], ...]:
    """(name, unit) of each degree of freedom (nv), those of a free joint in the axes of its own body."""
    names: list[tuple[str, str]] = []
    for joint in robot.joints:
        if joint.nv == 1:
            names.append((joint.name, "m" if lengths_in_velocity(robot)[joint.v] else "rad"))
            continue
        if joint.kind == "planar":
            names += [(f"{joint.name} x", "m"), (f"{joint.name} y", "m"), (f"{joint.name} angle", "rad")]
            continue
        if joint.kind == "floating":
            names += [(f"{joint.name} {axis}", "m") for axis in "xyz"]
        names += [(f"{joint.name} rotation {axis}", "rad") for axis in "xyz"]
    return tuple(names)


def state_names(scene: Scene, states: IndependentStates) -> tuple[tuple[str, str], ...]:
    """(name, unit) of each independent state: displacements, then velocities."""
    names = coordinate_names(scene.robot)
    rates = [(f"{names[k][0]} rate", f"{names[k][1]}/s") for k in states.velocities]
    return (*(names[k] for k in states.positions), *rates)
