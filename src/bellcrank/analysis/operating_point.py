"""Operating points: equilibria, and steady motions, which are equilibria of a moving frame (relative equilibria).

With f the equations' field on the state (q, v) and X = Σ yₖ Xₖ a symmetry (symmetries.py), a state with f = X moves
along the symmetry: the wheels of a bicycle that rides straight turn and its frame travels, while the equations stay
the same. Seen in the frame that moves along, it is an equilibrium of f − X, and its stability is that of the
linearisation of f − X, not of f alone. With y = 0 it is an equilibrium. Source: Marsden & Ratiu, Introduction to
Mechanics and Symmetry, 2nd ed., 1.9; J. Ostrowski & J. Burdick, IEEE Conf. Robotics and Automation 1996.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.analysis.symmetries import Symmetries, SymmetryFields, project
from bellcrank.arrays import Array
from bellcrank.dynamics.constraints.constraint_rows import velocity_units
from bellcrank.dynamics.equations.linear_equations import LinearEquations, equation_code
from bellcrank.dynamics.equations.tangent_space import adjoint
from bellcrank.dynamics.postures.consistent_start import displaced
from bellcrank.numerics import least_squares

if TYPE_CHECKING:
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
