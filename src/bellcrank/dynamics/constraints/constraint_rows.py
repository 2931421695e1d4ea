"""Which rows of a scene's constraints are kept in the equations at its parameters, and how large they usually are.

Rows that are identically zero are left out. All of this follows from the structure of the equations and the values of
the parameters: J, φ and M are evaluated at random postures. What depends on values enters the key of the equations
(which rows are kept, whether M is singular) or is a parameter of the equations (how large a row usually is), so that no
scene affects another. Lengths are in units of the mechanism's characteristic length L: rows in m are divided by L,
columns of coordinates in m multiplied by it.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.cached_values import computed_once
from bellcrank.codegen import cache as disk
from bellcrank.codegen.locks import making
from bellcrank.dynamics.constraints.constraint_sampling import ConstraintSampler, in_metres
from bellcrank.elements.expression_constraint import ExpressionConstraint
from bellcrank.elements.loop_constraints import WORLD, Loop
from bellcrank.errors import InputError
from bellcrank.numerics import checked, eigenvectors, svd
from bellcrank.robot.model.joints import lengths_in_position, lengths_in_velocity

if TYPE_CHECKING:
    from bellcrank.elements.constraint import Constraint
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene

FACTORISED = 4  # postures in which J M⁻¹ Jᵀ is evaluated
ROUNDING = 1e-13  # of a coordinate's own inertia, or of the largest: a smaller inertia is rounding
FIXED = 1e-9  # of the largest singular value of J: below this a motion is not constrained
DEAD = 1e-5  # of the largest entry of a constraint's J: a smaller row is zero but for rounded angles
RIGID = 1e-8  # entries of a constraint's whole J below this are rounding: its frames cannot move against each other
IMPOSSIBLE = 1e-5  # of the largest residual of a constraint: the largest that a zero row may have
CLOSED = 1e-9  # the largest residual of a constraint whose frames cannot move against each other
SPREAD = 1e3  # bound of a row's J M⁻¹ Jᵀ, which light links raise, relative to its value while the others hold
MEMORY = 4096  # values of parameters remembered
RECENT = 64  # structures remembered
LEAST_POWER = -323
POWERS = np.array([float(f"1e{exponent}") for exponent in range(LEAST_POWER, 309)])  # the same on every processor


@dataclass(frozen=True, eq=False, kw_only=True)
class ConstraintRows:
    """What is known of a scene's constraints and mass matrix at its parameters.

    Attributes:
        kept: The rows that are kept, among all φ and then all ψ.
        scale: The usual J M⁻¹ Jᵀ of each kept row, a power of ten.
        square: The usual sum of squares of each kept row of J, columns of coordinates in m times L; a power of ten.
        unit: L for rows in m, 1 for angles, (rows,).
        length: The characteristic length L, m.
        singular: Whether M is singular, as some joint moves no mass but what constraints attach to it.
        massless: Whether in all postures a motion that the constraints allow moves no mass.
        left_out: (constraint, row, residual in m or rad) of the rows that are left out and are not 0 = 0.
        parametric: Whether any of this depends on parameters of the scene.
    """

    kept: tuple[int, ...]
    scale: Array
    square: Array
    unit: Array
    length: float
    singular: bool
    massless: bool
    left_out: tuple[tuple[str, str, float], ...]
    parametric: bool

    @property
    def signature(self) -> str:
        """What the expressions of the equations depend on, as a text."""
        return json.dumps([self.kept, self.singular])

    @property
    def parameters(self) -> Array:
        """The parameters of the equations: scale, square and unit of each row, and L; none where they are constant."""
        both = np.concatenate([self.scale, self.square, self.unit, [self.length]])
        return both if self.parametric else np.zeros(0)


_STORED = ([int], [float], [float], [float], float, bool, bool, [(str, str, float)])
_samplers: dict[str, ConstraintSampler] = {}
_known: dict[tuple[str, bytes], ConstraintRows] = {}


def characteristic_length(scene: Scene) -> float:
    """The characteristic length L of a scene's mechanism, m."""
    return rows_of(scene).length


def velocity_units(scene: Scene) -> Array:
    """The unit of each degree of freedom (nv,): the characteristic length, m, or 1 rad."""
    return np.where(lengths_in_velocity(scene.robot), characteristic_length(scene), 1.0)


@computed_once
def coordinate_weights(scene: Scene) -> Array | None:
    """The weight of each coordinate (nq,), 1/L for lengths and 1 for others; None where all are angles."""
    far = lengths_in_position(scene.robot)
    return np.where(far, 1.0 / characteristic_length(scene), 1.0) if far.any() else None


@computed_once
def rows_of(scene: Scene) -> ConstraintRows:
    """The kept rows of a scene's constraints at its parameters. Raises InputError where a row can never hold."""
    key = scene.structure_key
    with making:
        sampler = sampler_of(scene)
        values = scene.parameter_values if sampler.parametric else np.zeros(0)
        place = key, values.tobytes()
        if place not in _known:
            if len(_known) >= MEMORY:
                del _known[next(iter(_known))]
            _known[place] = _rows_at(sampler, scene)
        return _known[place]


def sampler_of(scene: Scene) -> ConstraintSampler:
    """What samples a scene's constraints and mass matrix, shared by scenes of one structure."""
    key = scene.structure_key
    with making:
        sampler = _samplers.pop(key, None) or ConstraintSampler(scene, key)
        _samplers[key] = sampler
        if len(_samplers) > RECENT:
            del _samplers[next(iter(_samplers))]
        return sampler


def _rows_at(sampler: ConstraintSampler, scene: Scene) -> ConstraintRows:
    """The kept rows at the scene's parameters; stored on disk where they do not depend on parameters."""
    stored = None if sampler.parametric else disk.load_data("binding-" + sampler.key, _STORED)
    if stored and len(stored[0]) == len(stored[1]) == len(stored[2]) == len(stored[3]):
        kept, scale, square, unit, length, singular, massless, left_out = stored
        return ConstraintRows(
            kept=tuple(kept),
            scale=np.array(scale, dtype=np.float64),
            square=np.array(square, dtype=np.float64),
            unit=np.array(unit, dtype=np.float64),
            length=length,
            singular=singular,
            massless=massless,
            left_out=tuple((constraint, row, residual) for constraint, row, residual in left_out),
            parametric=False,
        )
    found = _evaluated(scene, sampler, sampler.mass_matrices(scene))
    if not sampler.parametric:
        r = found
        parts = [r.kept, r.scale.tolist(), r.square.tolist(), r.unit.tolist(), r.length, r.singular, r.massless]
        disk.store("binding-" + sampler.key, json.dumps([*parts, r.left_out]).encode())
    return found


def _evaluated(scene: Scene, sampler: ConstraintSampler, mass_at: Callable[[Array], Array]) -> ConstraintRows:
    """The kept rows and their sizes, from samples at random postures."""
    names = sampler.names
    samples = sampler.valid_samples(scene)
    length = samples.length
    columns = np.where(lengths_in_velocity(scene.robot), length, 1.0)
    jacobian = samples.jacobian * columns
    size = np.abs(jacobian).max(axis=(0, 2), initial=0.0)
    unit = np.array([_unit(label, length, float(most)) for (_, label), most in zip(names, size, strict=True)])
    jacobian = jacobian / unit[:, None]
    binds, left_out = _binding_rows(scene, names, size / unit, samples.residuals, unit)
    kept = np.flatnonzero(binds)
    jacobian = jacobian[:FACTORISED, kept]
    mass = mass_at(samples.position[:FACTORISED])
    checked(mass, f"{scene.source}: the mass matrix of '{scene.robot.name}' is")
    mass = mass * columns[:, None] * columns
    inverse, singular = _inverse(mass)
    compliance = jacobian @ inverse @ jacobian.transpose(0, 2, 1)
    diagonal = np.einsum("nii->ni", compliance)
    values, vectors = eigenvectors(compliance, f"{scene.source}: J M⁻¹ Jᵀ of the constraints is")
    firm = values > 1e-15 * values.max(axis=1, keepdims=True, initial=0.0)
    stiffness = (vectors**2 / np.where(firm, values, np.inf)[:, None, :]).sum(axis=2)
    usual = np.minimum(diagonal, SPREAD / np.maximum(stiffness, 1e-300)).max(axis=0, initial=0.0)
    square = (jacobian**2).sum(axis=2).max(axis=0, initial=0.0)
    return ConstraintRows(
        kept=tuple(kept.tolist()),
        scale=_power_of_ten(usual * unit[kept] ** 2),
        square=_power_of_ten(square * unit[kept] ** 2),
        unit=unit[kept],
        length=float(length),
        singular=singular.any().item(),
        massless=all(massless_motions(m, j, scene).size > 0 for j, m in zip(jacobian, mass, strict=True)),
        left_out=left_out,
        parametric=sampler.parametric,
    )


def _binding_rows(
    scene: Scene, names: list[tuple[str, str]], size: Array, residuals: Array, unit: Array
) -> tuple[Mask, tuple[tuple[str, str, float], ...]]:
    """Which rows bind, by the size of their J, and those left out that are not 0 = 0.

    Raises InputError where a row that is left out can never hold.
    """
    apart = np.abs(residuals).max(axis=0, initial=0.0)
    binds, left_out = np.zeros(len(names), dtype=bool), []
    for constraint in scene.constraints:
        mine = np.array([name == constraint.name for name, _ in names])
        largest, widest = size[mine].max(initial=0.0), (apart / unit)[mine].max(initial=0.0)
        rigid = largest <= RIGID or on_one_body(scene.robot, constraint)
        if not rigid:
            binds |= mine & (size > DEAD * largest)
        allowed = CLOSED if rigid else max(IMPOSSIBLE * widest, CLOSED)
        for k in np.flatnonzero(mine & ~binds):
            if apart[k] > allowed * unit[k]:
                raise InputError(_impossible(scene, constraint, names[k][1], float(apart[k]), rigid))
            if rigid or apart[k] > CLOSED * unit[k]:
                left_out.append((constraint.name, names[k][1], float(apart[k])))
    return binds, tuple(left_out)


def on_one_body(robot: Robot, constraint: Constraint) -> bool:
    """Whether both frames of a loop are on links with no joint between them."""
    if not isinstance(constraint, Loop):
        return False
    bodies = {frame.name: frame.parent_joint for frame in robot.equations.tree.frames}
    return len({bodies[name] if name != WORLD else 0 for name in (constraint.frame_a, constraint.frame_b)}) == 1


def _impossible(scene: Scene, constraint: Constraint, label: str, gap: float, rigid: bool) -> str:
    why = "at every position of the joints"
    if isinstance(constraint, ExpressionConstraint) and not constraint.moves:
        return (
            f"{scene.source}: constraints: '{constraint.name}' cannot hold: its expression contains no joint and "
            f"differs from 0 by {gap:.6g} in row {label}; write it in positions or velocities of joints"
        )
    if rigid and constraint.frames:
        sides = [f"'{name}'" for name in constraint.frames]
        pair = " and ".join(sides if len(sides) > 1 else [*sides, "the world"])
        why = f"and {pair} cannot move relative to each other"
    return (
        f"{scene.source}: constraints: '{constraint.name}' cannot hold: row {label} has a residual of {gap:.6g} {why}; "
        "move one of its frames, or use a kind of constraint with fewer rows"
    )


def _inverse(mass: Array) -> tuple[Array, Mask]:
    """The pseudo-inverse (n, nv, nv) of mass matrices, and which of them are singular (n,)."""
    own = np.einsum("nii->ni", mass)
    heavy = own > ROUNDING * own.max(axis=1, keepdims=True, initial=0.0)
    size = np.sqrt(np.where(heavy, own, 1.0))
    values, vectors = eigenvectors(
        np.where(heavy[:, :, None] & heavy[:, None, :], mass, 0.0) / _outer(size), "the mass matrix is"
    )
    firm = values > ROUNDING
    inverse = (vectors / np.where(firm, values, np.inf)[:, None, :]) @ vectors.transpose(0, 2, 1)
    return np.asarray(inverse / _outer(size)), np.asarray(~firm.all(axis=1))


def massless_motions(mass: Array, jacobian: Array, scene: Scene) -> Array:
    """Directions (nv, k) in which the constraints allow a motion that moves no mass, in the scaling M = D R D.

    `mass` (nv, nv) and `jacobian` (rows, nv) are in units of the characteristic length, D² is the diagonal of M. With Z
    the null space of J D⁻¹, these are the eigenvectors of Zᵀ R Z whose eigenvalue is 0 but for rounding.
    """
    own = mass.diagonal()
    size = np.sqrt(np.where(own > ROUNDING * own.max(initial=0.0), own, 1.0))
    scaled = mass / np.outer(size, size)
    if np.linalg.eigvalsh(scaled).min(initial=1.0) > 2.0 * ROUNDING:
        return np.zeros((len(mass), 0))
    _, values, vectors = svd(jacobian / size, f"{scene.source}: the derivative of the constraints is")
    free = vectors[np.count_nonzero(values > FIXED * values.max(initial=0.0)) :].T
    values, vectors = eigenvectors(free.T @ scaled @ free, f"{scene.source}: the mass matrix is")
    return np.asarray(free @ vectors[:, values < ROUNDING])


def _outer(size: Array) -> Array:
    return np.asarray(size[:, :, None] * size[:, None, :])


def _power_of_ten(values: Array) -> Array:
    """The nearest powers of ten, so that no rounding of a factorisation enters the equations; 1 where there is no
    mass.
    """
    exponents = np.round(np.log10(np.where(values > 0.0, values, 1.0)))
    return np.asarray(POWERS[np.clip(exponents, LEAST_POWER, 308).astype(np.intp) - LEAST_POWER])


def _unit(label: str, length: float, most: float) -> float:
    """The unit of a row: L for lengths, 1 for angles, and for others the most that a unit of a coordinate changes
    it.
    """
    if in_metres(label):
        return length
    if label.endswith("[N m]"):
        return 1.0
    return float(_power_of_ten(np.array(most))) if most > np.finfo(float).tiny else 1.0
