"""Which rows of a scene's constraints bind at its parameters, and how large they usually are.

All of it follows from the structure of the equations and the values of the parameters: J, φ and M are evaluated at
random postures. What depends on values enters the key of the equations (which rows are kept, whether M is singular) or
is a parameter of theirs (how large a row usually is), so that no scene decides for another. Lengths are compared with
the mechanism's own length L: rows in m are divided by L, columns of coordinates in m multiplied by it.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.codegen import cache as disk
from bellcrank.codegen.locks import making
from bellcrank.derived import computed_once
from bellcrank.dynamics.constraint_sampling import POSTURES, RowFunctions, in_metres
from bellcrank.elements.expression_constraint import Formula
from bellcrank.elements.loops import WORLD, Loop
from bellcrank.elements.rolling import RollingDisk
from bellcrank.errors import InputError
from bellcrank.numerics import LARGEST, checked, eigenvectors, svd
from bellcrank.robot.joints import lengths_in_position, lengths_in_velocity

if TYPE_CHECKING:
    from bellcrank.elements.constraint import Constraint
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
MORE_POSTURES = 512  # that are tried where constraints have no value in all of the first ones
FACTORISED = 4  # postures, in which J M⁻¹ Jᵀ is looked at
DEAD = 1e-5  # of the largest entry of a constraint's J: a row below it is dead, or alive by rounded angles alone
RIGID = 1e-8  # entries of a constraint's whole J below it are rounding: its frames cannot move against each other
IMPOSSIBLE = 1e-5  # of the largest gap of a constraint, that a dead row may be apart
CLOSED = 1e-9  # what a constraint whose frames are rigid to each other may be apart
SPREAD = 1e3  # a row's J M⁻¹ Jᵀ, which light links raise, counts up to so many times what it is while the others hold
ROUNDING = 1e-13  # of a coordinate's own inertia, or of the largest: below it nothing is left but rounding
FIXED = 1e-9  # of the largest singular value of J: below it a motion is free
MEMORY = 4096  # values of parameters remembered


@dataclass(frozen=True, eq=False)
class ConstraintRows:
    """What is so at a scene's parameters: the rows that bind (`kept`, among all φ and then all ψ), for each the usual
    J M⁻¹ Jᵀ (`scale`) and square of J (`square`, columns of coordinates in m times L) as powers of ten, and L or 1
    (`unit`): how large 1 is in it.

    `length` is L, m. `singular`: M is, as some joint moves nothing but what constraints hold. `massless`: in all postures
    something can move without mass. `left_out`: (constraint, row, gap in m or rad) of the rows that do not bind and are
    not 0 = 0.
    """

    kept: tuple[int, ...]
    scale: Array
    square: Array
    unit: Array
    length: float
    singular: bool
    massless: bool
    left_out: tuple[tuple[str, str, float], ...]
    parametric: bool  # whether any of it depends on parameters of the scene

    @property
    def signature(self) -> str:
        """What the equations themselves depend on, as a text."""
        return json.dumps([self.kept, self.singular])

    @property
    def parameters(self) -> Array:
        """What the equations take as parameters where it is not constant: scale, square and unit of each row, and L."""
        both = np.concatenate([self.scale, self.square, self.unit, [self.length]])
        return both if self.parametric else np.zeros(0)


RECENT = 64  # structures remembered
_STORED = ([int], [float], [float], [float], float, bool, bool, [(str, str, float)])
_structures: dict[str, RowFunctions] = {}
_known: dict[tuple[str, bytes], ConstraintRows] = {}


@computed_once
def coordinate_weights(scene: Scene) -> Array | None:
    """How much 1 is in each coordinate (nq), lengths told in the mechanism's own; None where all are angles."""
    far = lengths_in_position(scene.robot)
    return np.where(far, 1.0 / rows_of(scene).length, 1.0) if far.any() else None


@computed_once
def rows_of(scene: Scene) -> ConstraintRows:
    """The binding rows of a scene at its parameters. Raises InputError where a row cannot hold whatever joints do."""
    key = scene.structure_key
    with making:
        structure = _structures.pop(key, None) or RowFunctions(scene, key)
        _structures[key] = structure
        if len(_structures) > RECENT:
            del _structures[next(iter(_structures))]
        values = scene.parameter_values if structure.parametric else np.zeros(0)
        place = key, values.tobytes()
        if place not in _known:
            if len(_known) >= MEMORY:
                del _known[next(iter(_known))]
            _known[place] = _rows_at(structure, scene)
        return _known[place]


def _rows_at(functions: RowFunctions, scene: Scene) -> ConstraintRows:
    """What is so at the scene's parameters; kept on disk where it is so at any."""
    stored = None if functions.parametric else disk.load_data("binding-" + functions.key, _STORED)
    if stored and len(stored[0]) == len(stored[1]) == len(stored[2]) == len(stored[3]):
        kept, scale, square, unit, length, singular, massless, left_out = stored
        return ConstraintRows(
            tuple(kept), np.array(scale, dtype=np.float64), np.array(square, dtype=np.float64),
            np.array(unit, dtype=np.float64), length, singular, massless,
            tuple((constraint, row, gap) for constraint, row, gap in left_out), False,
        )  # fmt: skip
    found = _judged(scene, functions, functions.inertias(scene))
    if not functions.parametric:
        b = found
        parts = [b.kept, b.scale.tolist(), b.square.tolist(), b.unit.tolist(), b.length, b.singular, b.massless]
        disk.store("binding-" + functions.key, json.dumps([*parts, b.left_out]).encode())
    return found


def _judged(scene: Scene, functions: RowFunctions, inertias: Callable[[Array], Array]) -> ConstraintRows:
    names = [(str(name), str(label)) for name, label in functions.facts["names"]]
    q, jacobian, gaps, length = _with_values(scene, names, functions)
    columns = np.where(lengths_in_velocity(scene.robot), length, 1.0)
    jacobian = jacobian * columns
    size = np.abs(jacobian).max(axis=(0, 2), initial=0.0)
    unit = np.array([_unit(label, length, float(most)) for (_, label), most in zip(names, size, strict=True)])
    jacobian = jacobian / unit[:, None]
    binds, left_out = _alive(scene, names, size / unit, gaps, unit)
    kept = np.flatnonzero(binds)
    jacobian = jacobian[:FACTORISED, kept]
    mass = inertias(q[:FACTORISED])
    checked(mass, f"{scene.source}: the mass matrix of '{scene.robot.name}' is")
    mass = mass * columns[:, None] * columns
    inverse, singular = _inverse(mass)
    compliance = jacobian @ inverse @ jacobian.transpose(0, 2, 1)
    diagonal = np.einsum("nii->ni", compliance)
    values, vectors = eigenvectors(compliance, f"{scene.source}: what the constraints give to a force, J M⁻¹ Jᵀ, is")
    firm = values > 1e-15 * values.max(axis=1, keepdims=True, initial=0.0)
    stiffness = (vectors**2 / np.where(firm, values, np.inf)[:, None, :]).sum(axis=2)
    usual = np.minimum(diagonal, SPREAD / np.maximum(stiffness, 1e-300)).max(axis=0, initial=0.0)
    square = (jacobian**2).sum(axis=2).max(axis=0, initial=0.0)
    return ConstraintRows(
        tuple(kept.tolist()), _power_of_ten(usual * unit[kept] ** 2), _power_of_ten(square * unit[kept] ** 2),
        unit[kept], float(length), singular.any().item(), _moves_without_mass(jacobian, mass), left_out,
        functions.parametric,
    )  # fmt: skip


def _with_values(
    scene: Scene, names: list[tuple[str, str]], functions: RowFunctions
) -> tuple[Array, Array, Array, float]:
    """q, J, (φ, ψ) and L as `RowFunctions.jacobians`, in postures and at times where all of these are numbers of at
    most LARGEST. Raises InputError for a constraint that has such values in none.
    """
    for count in (POSTURES, MORE_POSTURES):
        q, jacobian, gaps, length = functions.jacobians(scene, count)
        there = (np.abs(jacobian) <= LARGEST).all(axis=2) & (np.abs(gaps) <= LARGEST)  # NaN is not
        good = there.all(axis=1)
        if good.any() or not len(names):
            return q[good][:POSTURES], jacobian[good][:POSTURES], gaps[good][:POSTURES], length
    k = int(there.sum(axis=0).argmin())
    name, label = names[k]
    constraint = next(constraint for constraint in scene.constraints if constraint.name == name)
    found = np.append(jacobian[~there[:, k], k].ravel(), gaps[~there[:, k], k])
    value = found[~(np.abs(found) <= LARGEST)][-1]
    if isinstance(constraint, Formula) and not constraint.moves:
        raise InputError(
            f"{scene.source}: constraints: '{name}' cannot close: no joint stands in its expression, which is {value:.6g} "
            f"in its row {label}; write it in positions or velocities of joints"
        )
    if isinstance(constraint, RollingDisk) and constraint.radius <= LARGEST and abs(constraint.height) <= LARGEST:
        raise InputError(
            f"{scene.source}: constraints: '{name}' has no lowest point to roll on: its disk lies flat on the plane "
            f"whatever the joints do (row {label} is {value:.4g}); turn its axis, or the normal of the plane"
        )
    raise InputError(
        f"{scene.source}: constraints: '{name}' cannot be judged: in {count} random postures, at times up to 1 s, its row "
        f"{label} or its derivative is no number of at most {LARGEST:g} ({value:.4g} in one); write it so that it has "
        "values there, and divide it by a constant where they are too large"
    )


def _alive(
    scene: Scene, names: list[tuple[str, str]], size: Array, gaps: Array, unit: Array
) -> tuple[Mask, tuple[tuple[str, str, float], ...]]:
    """Which rows bind, by the size of their J, and those left out that are not 0 = 0. Raises InputError where one of
    these cannot hold.
    """
    apart = np.abs(gaps).max(axis=0, initial=0.0)
    binds, left_out = np.zeros(len(names), dtype=bool), []
    for constraint in scene.constraints:
        mine = np.array([name == constraint.name for name, _ in names])
        largest, widest = size[mine].max(initial=0.0), (apart / unit)[mine].max(initial=0.0)
        rigid = largest <= RIGID or _on_one_body(scene.robot, constraint)
        if not rigid:
            binds |= mine & (size > DEAD * largest)
        allowed = CLOSED if rigid else max(IMPOSSIBLE * widest, CLOSED)
        for k in np.flatnonzero(mine & ~binds):
            if apart[k] > allowed * unit[k]:
                raise InputError(_impossible(scene, constraint, names[k][1], float(apart[k]), rigid))
            if rigid or apart[k] > CLOSED * unit[k]:
                left_out.append((constraint.name, names[k][1], float(apart[k])))
    return binds, tuple(left_out)


def _on_one_body(robot: Robot, constraint: Constraint) -> bool:
    """Whether a loop's sides are on links that no joint lies between."""
    if not isinstance(constraint, Loop):
        return False
    bodies = {frame.name: frame.parent_joint for frame in robot.equations.tree.frames}
    return len({bodies[name] if name != WORLD else 0 for name in (constraint.frame_a, constraint.frame_b)}) == 1


def _impossible(scene: Scene, constraint: Constraint, label: str, gap: float, rigid: bool) -> str:
    why = "whatever the joints do"
    if isinstance(constraint, Formula) and not constraint.moves:
        return (
            f"{scene.source}: constraints: '{constraint.name}' cannot close: no joint stands in its expression, which is "
            f"{gap:.6g} away from 0 in its row {label}; write it in positions or velocities of joints"
        )
    if rigid and constraint.frames:
        sides = [f"'{name}'" for name in constraint.frames]
        why = f"and {' and '.join(sides if len(sides) > 1 else [*sides, 'the world'])} cannot move against each other"
    return (
        f"{scene.source}: constraints: '{constraint.name}' cannot close: its row {label} is {gap:.6g} apart {why}; move one "
        "of its frames, or take a kind of constraint with fewer rows"
    )


def _inverse(mass: Array) -> tuple[Array, Mask]:
    """M⁻¹ (n, nv, nv) without the directions in which M is singular, and whether there are any (n,)."""
    own = np.einsum("nii->ni", mass)
    heavy = own > ROUNDING * own.max(axis=1, keepdims=True, initial=0.0)
    size = np.sqrt(np.where(heavy, own, 1.0))
    values, vectors = eigenvectors(
        np.where(heavy[:, :, None] & heavy[:, None, :], mass, 0.0) / _outer(size), "the mass matrix is"
    )
    firm = values > ROUNDING
    inverse = (vectors / np.where(firm, values, np.inf)[:, None, :]) @ vectors.transpose(0, 2, 1)
    return np.asarray(inverse / _outer(size)), np.asarray(~firm.all(axis=1))


def _moves_without_mass(jacobian: Array, mass: Array) -> bool:
    """Whether in all postures the constraints leave a motion that moves no mass."""
    for j, m in zip(jacobian, mass, strict=True):
        own = m.diagonal()
        size = np.sqrt(np.where(own > ROUNDING * own.max(initial=0.0), own, 1.0))
        if np.linalg.eigvalsh(m / np.outer(size, size)).min(initial=1.0) > 2.0 * ROUNDING:
            return False
        _, values, vectors = svd(j / size, "the closures' derivative is")
        free = vectors[np.count_nonzero(values > FIXED * values.max(initial=0.0)) :].T
        if np.linalg.eigvalsh(free.T @ (m / np.outer(size, size)) @ free).min(initial=1.0) >= ROUNDING:
            return False
    return True


def _outer(size: Array) -> Array:
    return np.asarray(size[:, :, None] * size[:, None, :])


def _power_of_ten(values: Array) -> Array:
    """Rounded, so that no last digit of a factorisation enters the equations; 1 where there is no mass at all."""
    return np.asarray(10.0 ** np.round(np.log10(np.where(values > 0.0, values, 1.0))))


def _unit(label: str, length: float, most: float) -> float:
    """How large 1 is in a row: L of lengths, 1 of angles, and what a coordinate can change it by of any other."""
    if in_metres(label):
        return length
    if label.endswith("[N m]"):
        return 1.0
    return float(_power_of_ten(np.array(most))) if most > np.finfo(float).tiny else 1.0
