"""The symmetries of a scene's equations: motions of the whole state that turn solutions into solutions.

Candidates are the one-parameter groups

- of every joint of one degree of freedom: its coordinate shifted (a wheel about its axle, a carriage on its rail);
- of every joint of several degrees of freedom: moved on its parent ("left": a free base moved or turned in the world),
  or turned in its own axes ("right": a disk about its own axis), where v turns too.

As fields on the state (q, v), with a displacement a of the position (below) and a change b of v,

    left: a = Ad(q)⁻¹ e, b = 0;     right: a = η, b = ad(v) η;     shift: a = unit vector, b = 0.

A linear combination of them is a symmetry if it is carried along by the linearised equations, v̇ = F(q, v),

    ∂F/∂δ a + ∂F/∂v b = ḃ   (ḃ = ad(v̇) η on the right, else 0),

and keeps the constraints, ∂φ/∂δ a = 0 and ∂w/∂δ a + J b = 0. That is linear in the coefficients and is solved at some
random states that satisfy the constraints. Source: Marsden & Ratiu, Introduction to Mechanics and Symmetry, 2nd ed.,
9.3.

A displacement δ (nv) is a right increment: the position q ⊕ δ is q moved for a unit of time along E(q) δ, so that δ
is in the axes of the velocity v. For a free base that is a translation (m) and a rotation vector (rad) in the base's
own axes, for a joint of one degree of freedom the change of its coordinate.

If q moves with v, and a neighbouring position q ⊕ δ with v + δv, then δ̇ = δv − ad(v) δ: the axes of δ turn with the
body. Source: Murray, Li & Sastry, A Mathematical Introduction to Robotic Manipulation (1994), 2.4; Selig, Geometric
Fundamentals of Robotics (2005), 4.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.dynamics.constraints.constraint_rows import velocity_units
from bellcrank.dynamics.equations.linear_equations import LinearEquations, equation_code
from bellcrank.dynamics.postures.consistent_start import consistent_velocities, displaced
from bellcrank.dynamics.postures.posture_search import PostureSearch, scene_as_design, search_postures
from bellcrank.errors import InputError
from bellcrank.motion.kinematics.rotations import rotate
from bellcrank.numerics import svd
from bellcrank.robot.model.joints import RobotJoint

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene

STATES = 3  # random states in which the conditions must hold
ASIDE = 0.2  # rad or characteristic lengths: how far these are from the given one
ZERO = 1e-9  # of a condition's own terms: less is rounding


def cross(vector: Array) -> Array:
    """The matrix (3, 3) of the cross product with a vector (3,)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def adjoint(robot: Robot, v: Array) -> Array:
    """ad(v) (nv, nv), joint by joint: the Lie bracket [v, δ] = ad(v) δ; 0 for one degree of freedom."""
    matrix = np.zeros((robot.nv, robot.nv))
    for joint in robot.joints:
        part = slice(joint.v, joint.v + joint.nv)
        matrix[part, part] = _joint_adjoint(joint, v[part])
    return matrix


def _joint_adjoint(joint: RobotJoint, v: Array) -> Array:
    if joint.kind == "spherical":
        return cross(v)
    if joint.kind == "floating":
        spin = cross(v[3:])
        return np.block([[spin, cross(v[:3])], [np.zeros((3, 3)), spin]])
    if joint.kind == "planar":  # (x, y, angle): the plane motions among the spatial ones
        x, y, rate = v
        return np.array([[0.0, -rate, y], [rate, 0.0, -x], [0.0, 0.0, 0.0]])
    return np.zeros((joint.nv, joint.nv))


@dataclass(frozen=True, eq=False)
class SymmetryFields:
    """Fields on the state: displacements (nv, k), changes of v (nv, k), and the η (nv, k) of those on the right."""

    displacement: Array
    change: Array
    right: Array

    def combined(self, coefficients: Array) -> SymmetryFields:
        """Linear combinations of the fields; `coefficients` (k, n)."""
        return SymmetryFields(self.displacement @ coefficients, self.change @ coefficients, self.right @ coefficients)


@dataclass(frozen=True, eq=False)
class Symmetries:
    """The symmetries of a scene: an orthonormal basis (candidates, k), and the names of the candidates."""

    scene: Scene
    basis: Array
    candidates: tuple[str, ...]

    @property
    def count(self) -> int:
        """The dimension of the symmetry group."""
        return int(self.basis.shape[1])

    def fields(self, q: Array, v: Array) -> SymmetryFields:
        """The fields of the basis at a state."""
        return candidate_fields(self.scene, q, v).combined(self.basis)

    @property
    def names(self) -> tuple[str, ...]:
        """The candidates that take part in symmetries; combinations are not told apart."""
        part = np.abs(self.basis).max(axis=1, initial=0.0)
        return tuple(name for name, size in zip(self.candidates, part, strict=True) if size > 1e-6)


def candidate_names(robot: Robot) -> tuple[str, ...]:
    """The names of the candidates, joint after joint."""
    names: list[str] = []
    for joint in robot.joints:
        if joint.nv == 1:
            names.append(f"shift of {joint.name}")
            continue
        axes = _axes(joint)
        names += [f"{axis} of {joint.name} in its parent's axes" for axis in axes]
        names += [f"{axis} of {joint.name} in its own axes" for axis in axes]
    return tuple(names)


def candidate_fields(scene: Scene, q: Array, v: Array) -> SymmetryFields:
    """The fields of all candidates at a state; translations by one characteristic length."""
    robot, unit = scene.robot, velocity_units(scene) if scene.constraints else np.ones(scene.robot.nv)
    displacement: list[Array] = []
    right: list[Array] = []
    none = np.zeros(robot.nv)
    for joint in robot.joints:
        part = slice(joint.v, joint.v + joint.nv)
        own = np.eye(robot.nv)[part] * unit
        if joint.nv == 1:
            displacement, right = [*displacement, own[0]], [*right, none]
            continue
        moved = np.zeros((joint.nv, robot.nv))
        moved[:, part] = (_to_body(joint, q) * unit[part]).T
        displacement += [*moved, *own]
        right += [none] * joint.nv + [*own]
    a, eta = np.array(displacement).T, np.array(right).T
    return SymmetryFields(a, adjoint(robot, v) @ eta, eta)


def symmetries_of(scene: Scene, time: float, q: Array, v: Array) -> Symmetries:
    """The symmetries of a scene's equations at a time, found from states near a given one (q, v)."""
    robot = scene.robot
    unit = velocity_units(scene) if scene.constraints else np.ones(robot.nv)
    random = np.random.default_rng(0)
    conditions, values_of = [], []
    for _ in range(STATES):
        there_q, there_v, at = _state_nearby(scene, time, q, v, random)
        fields = candidate_fields(scene, there_q, there_v)
        values_of.append(np.concatenate([fields.displacement, fields.change]) / np.tile(unit, 2)[:, None])
        by_q, by_v = at.solved_by("position")[0], at.solved_by("velocity")[0]
        carried = adjoint(robot, at.acceleration) @ fields.right
        h = len(at.position_residual)
        zero = np.zeros((h, robot.nv))
        parts = (by_q, by_v, -np.eye(robot.nv)), (at.jacobian[:h], zero, zero), (
            at.velocity_by_position, at.jacobian, np.zeros((len(at.jacobian), robot.nv)),
        )  # fmt: skip
        for matrices in parts:
            terms = list(zip(matrices, (fields.displacement, fields.change, carried), strict=True))
            size = sum(np.abs(m) @ np.abs(x).max(axis=1, initial=0.0) + np.abs(m) @ unit for m, x in terms)
            rows = sum(m @ x for m, x in terms)
            conditions.append(np.asarray(rows) / np.where(size > 0.0, size, 1.0)[:, None])
    _, values, vectors = svd(np.concatenate(conditions), "the conditions of symmetry are")
    kept = vectors[np.count_nonzero(values > ZERO) :].T
    # combinations that move nothing, such as a platform that cannot turn, moved in its own axes and back in the world's
    _, values, vectors = svd(np.concatenate(values_of) @ kept, "the fields of the symmetries are", full=False)
    basis = kept @ vectors[: np.count_nonzero(values > ZERO * values.max(initial=1.0))].T
    return Symmetries(scene, np.asarray(basis), candidate_names(robot))


def project(scene: Scene, time: float, q: Array, v: Array) -> tuple[Array, Array, LinearEquations]:
    """The nearest state that satisfies the constraints. Raises InputError where there is none."""
    if scene.constraints:
        one, held = scene_as_design(scene), np.zeros(scene.robot.nv, dtype=bool)
        postures, verdicts = search_postures(scene, one, q[None], PostureSearch(held), time=time)
        if verdicts.code[0]:
            raise InputError(f"{scene.source}: no posture near the operating point satisfies the constraints")
        velocities, _ = consistent_velocities(scene, one, postures, v[None], held, time=time)
        q, v = postures[0], velocities[0]
    return q, v, equation_code(scene).at(time, q, v)


def states_nearby(scene: Scene, time: float, q: Array, v: Array) -> list[LinearEquations]:
    """The equations at some random states near (q, v) that satisfy the constraints."""
    random = np.random.default_rng(1)
    return [_state_nearby(scene, time, q, v, random)[2] for _ in range(STATES if scene.constraints else 1)]


def _state_nearby(
    scene: Scene, time: float, q: Array, v: Array, random: np.random.Generator
) -> tuple[Array, Array, LinearEquations]:
    """A random state near (q, v) that satisfies the constraints, the nearer the harder one is to find."""
    robot = scene.robot
    unit = velocity_units(scene) if scene.constraints else np.ones(robot.nv)
    at = equation_code(scene).at(time, q, v)
    free = at.solver.free if len(at.jacobian) else np.eye(robot.nv)
    for share in (ASIDE, ASIDE / 4.0, ASIDE / 16.0):
        step, speed = (free @ random.normal(size=free.shape[1]) for _ in range(2))
        length = np.linalg.norm(step / unit)
        try:
            there = displaced(scene, q, share * step / (length if length > 0.0 else 1.0))
            return project(scene, time, there, v + speed)
        except InputError:
            continue
    return q, v, at


def _axes(joint: RobotJoint) -> tuple[str, ...]:
    if joint.kind == "spherical":
        return tuple(f"rotation about {axis}" for axis in "xyz")
    if joint.kind == "planar":
        return ("translation along x", "translation along y", "rotation")
    return (*[f"translation along {axis}" for axis in "xyz"], *[f"rotation about {axis}" for axis in "xyz"])


def _to_body(joint: RobotJoint, q: Array) -> Array:
    """Ad(q)⁻¹ (nv, nv) of a joint: the velocity in its own axes of a motion in its parent's axes."""
    own = q[joint.q : joint.q + joint.nq]
    if joint.kind == "planar":
        x, y, c, s = own
        return np.array([[c, s, s * x - c * y], [-s, c, c * x + s * y], [0.0, 0.0, 1.0]])
    turn = rotate(own[-4:], np.eye(3))
    if joint.kind == "spherical":
        return turn
    return np.block([[turn, -turn @ cross(own[:3])], [np.zeros((3, 3)), turn]])
