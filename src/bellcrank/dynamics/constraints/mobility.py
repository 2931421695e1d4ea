"""The mobility of a mechanism: its freedoms at a posture, redundant conditions, and which freedoms motors actuate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array, Mask
from bellcrank.dynamics.constraints.constraint_rows import rows_of, velocity_units
from bellcrank.dynamics.equations.system import system_of, system_parameters
from bellcrank.dynamics.postures.consistent_start import consistent_start
from bellcrank.dynamics.postures.posture_search import (
    PostureSearch,
    StartCode,
    motors_of,
    scene_as_design,
    search_postures,
)
from bellcrank.errors import InputError
from bellcrank.files.access import Trust
from bellcrank.notes import Note, ranked
from bellcrank.numerics import checked, eigenvectors, singular_values, svd
from bellcrank.present.results import Result

if TYPE_CHECKING:
    from pathlib import Path

    from bellcrank.dynamics.equations.compiled_equations import System
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene


MASSLESS = 1e-6  # of a coordinate's own inertia: the least that a motion counts with
LOST = 1e-8  # of the largest singular value: smaller ones count as 0
SINGULAR = 1e-8  # of the largest singular value of J: a smaller one counts as 0
MOVING = 1e-6  # of the largest rate: a joint that moves less in a freedom is at rest
ASIDE = 0.02  # rad or characteristic lengths: how far away the mobility of neighbouring postures is looked at


@dataclass(frozen=True, eq=False)
class ConstraintRank:
    """The rank of the constraints in one configuration.

    Attributes:
        singular_values: Singular values (rows,), largest first, of J M⁻¹ᐟ² with rows of length 1, so that units do not
            matter.
        rank: The number of independent rows.
        unique: Which multipliers (rows,) are determined by the motion.
    """

    singular_values: Array
    rank: int
    unique: Mask

    @classmethod
    def of_none(cls) -> ConstraintRank:
        """That of a scene without constraints."""
        return cls(np.zeros(0), 0, np.zeros(0, dtype=np.bool_))


def rank_of(system: System, t: Array, x: Array, u: Array, p: Array) -> ConstraintRank:
    """The rank of a system's constraints at a time (1) s, state, signals and parameters.

    Raises InputError where a number is not finite or an inertia negative.
    """
    with np.errstate(all="ignore"):
        jacobian, mass = system.constraint_metric(t, x, u, p)
        checked(mass, "the mass matrix at this row of the run is")
        try:
            weighted = np.linalg.solve(np.linalg.cholesky(mass), jacobian.T).T
        except np.linalg.LinAlgError:  # massless links: the rank of J is the same in any metric
            weighted = jacobian @ _whitening(mass)
        length = np.linalg.norm(weighted, axis=1, keepdims=True)
    weighted = weighted / np.where(length > 0.0, length, 1.0)
    left, values, _ = svd(weighted, "the constraint Jacobian at this row of the run is")
    rank = int(np.sum(values > LOST * values.max(initial=0.0)))
    idle = left[:, rank:]  # combinations of multipliers without effect
    return ConstraintRank(values, rank, np.linalg.norm(idle, axis=1) < 1e-6)


def _whitening(mass: Array) -> Array:
    """W with Wᵀ M W = 1 (nv, nv), of M with MASSLESS of a coordinate's own inertia where it has less.

    Raises InputError where an inertia is negative by more than that.
    """
    own = mass.diagonal()
    size = np.sqrt(np.where(own > MASSLESS * own.max(initial=0.0), own, own.max(initial=0.0) or 1.0))
    values, vectors = eigenvectors(mass / np.outer(size, size), "the mass matrix at this row of the run is")
    if values.min(initial=0.0) < -MASSLESS:
        raise InputError(
            "the rank of the constraints cannot be computed, because the mass matrix is not positive: check masses "
            "and inertias"
        )
    return np.asarray(vectors / np.sqrt(np.maximum(values, MASSLESS)) / size[:, None])


@dataclass(frozen=True, eq=False, kw_only=True)
class Mobility(Result):
    """The mobility of a mechanism at its start.

    Attributes:
        freedoms: The number of independent velocities that the constraints allow: nv − rank J.
        joint_freedoms: The number of degrees of freedom of the joints without constraints, nv.
        conditions: The number of rows of J.
        rank: The rank of J; conditions − rank rows are redundant.
        redundant: (constraint, rows) of constraints with rows that depend on those of the constraints before them.
        motors: The joints with motors.
        independent_motors: Those whose velocities are independent of each other, chosen in this order.
        passive_freedoms: The number of freedoms that remain while all motors are at rest.
        passive_joints: The joints that move in these.
        nearby_freedoms: The number of freedoms at consistent postures near the start, which is smaller where the start
            is singular.
        notes: What the scene's files say and is not modelled, such as a loop.

    Example:
        >>> import bellcrank as bc
        >>> found = bc.mobility(bc.load_scene("four_bar"))
        >>> found.freedoms, found.joint_freedoms, found.rank
        (1, 3, 2)
    """

    freedoms: int
    joint_freedoms: int
    conditions: int
    rank: int
    redundant: tuple[tuple[str, int], ...]
    motors: tuple[str, ...]
    independent_motors: tuple[str, ...]
    passive_freedoms: int
    passive_joints: tuple[str, ...]
    nearby_freedoms: int
    notes: tuple[Note, ...] = field(default=(), repr=False)

    @property
    def dependent_motors(self) -> tuple[str, ...]:
        """The motors whose velocities depend on those of the independent ones."""
        return tuple(name for name in self.motors if name not in self.independent_motors)

    def table(self) -> str:
        """The freedoms, redundant conditions and motors in words.

        Returns:
            Lines of text.

        Example:
            >>> import bellcrank as bc
            >>> print(bc.mobility("four_bar").table().splitlines()[0])
            1 degree of freedom: 3 of the joints less 2 independent conditions of 2
        """
        return "\n".join([*self.sentences, *(f"{note.label}: {note}" for note in self.notes)])

    def as_dict(self) -> dict[str, Any]:
        """The mobility as data for JSON.

        Returns:
            Its attributes by name.

        Example:
            >>> import bellcrank as bc
            >>> bc.mobility("four_bar").as_dict()["freedoms"]
            1
        """
        return asdict(self) | {"notes": [note.as_dict() for note in self.notes]}

    def _rows(self) -> list[Sequence[object]]:
        facts = {name: value for name, value in vars(self).items() if name != "notes"}
        return [["quantity", "value"], *([name, _words(value)] for name, value in facts.items())]

    @property
    def sentences(self) -> list[str]:
        """The freedoms, redundant conditions and motors, a sentence each."""
        found = [
            f"{_count(self.freedoms, 'degree')} of freedom: {self.joint_freedoms} of the joints less "
            f"{_count(self.rank, 'independent condition')} of {self.conditions}"
        ]
        if self.redundant:
            named = ", ".join(f"{name} ({count})" for name, count in self.redundant)
            found.append(
                f"{_count(self.conditions - self.rank, 'redundant condition')}: {named}; their multipliers are not "
                "unique, and minimum-norm multipliers are reported"
            )
        if self.nearby_freedoms != self.freedoms:
            found.append(
                f"the start is singular: postures near it have {_count(self.nearby_freedoms, 'degree')} of freedom"
            )
        if not self.motors:
            found.append("no joint has a motor (actuated: [JOINT, …] names them)")
            return found
        actuated = self.freedoms - self.passive_freedoms
        found.append(
            f"{_count(len(self.motors), 'motor')} ({', '.join(self.motors)}) "
            f"actuate{'s' * (len(self.motors) == 1)} {actuated} of {_count(self.freedoms, 'degree')} of freedom"
        )
        if self.dependent_motors:
            found.append(f"motors whose motion depends on the others: {', '.join(self.dependent_motors)}")
        if self.passive_freedoms:
            found.append(
                f"{_count(self.passive_freedoms, 'degree')} of freedom without a motor; joints that move in "
                f"{'it' if self.passive_freedoms == 1 else 'them'}: {', '.join(self.passive_joints)}"
            )
        return found


@arguments.named
def mobility(
    scene: Scene | Robot | str | Path,
    *,
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
) -> Mobility:
    """The mobility of a scene's mechanism at its start.

    The freedoms are the null space of J, the derivative of the constraints' velocity residuals by v, in units of rad
    and characteristic lengths; singular values below 1e-8 of the largest count as 0. Prescribed motions count as
    constraints.

    Args:
        scene: A scene or robot, or the path or name of its file.
        overrides: Changes of the scene by dotted path, such as {"initial.crank": "1.5 deg"}.
        trust: Where `scene` is a file, folders whose files it may name, besides those near it.

    Returns:
        The freedoms, redundant conditions and actuated freedoms.

    Raises:
        InputError: There is no consistent start.

    Example:
        >>> import bellcrank as bc
        >>> found = bc.mobility(bc.load_scene("five_bar"))
        >>> found.freedoms, found.rank, found.passive_freedoms
        (2, 2, 0)
    """
    from bellcrank.scene.load import given_scene

    scene = given_scene(scene, overrides, trust)
    q, v = consistent_start(scene)
    jacobian = _jacobian(scene, q, v)
    free = _null_space(jacobian)
    motors = motors_of(scene)
    joints = {joint.name: joint for joint in scene.robot.joints}
    chosen = _independent(free, [(name, range(joints[name].v, joints[name].v + joints[name].nv)) for name in motors])
    driven = [k for name in motors for k in range(joints[name].v, joints[name].v + joints[name].nv)]
    passive = free @ _null_space(free[driven])
    size = np.abs(passive).max(axis=1, initial=0.0)
    moving = size > MOVING * size.max(initial=0.0)
    return Mobility(
        freedoms=free.shape[1],
        joint_freedoms=scene.robot.nv,
        conditions=len(jacobian),
        rank=scene.robot.nv - free.shape[1],
        redundant=_redundant(scene, jacobian),
        motors=motors,
        independent_motors=chosen,
        passive_freedoms=passive.shape[1],
        passive_joints=tuple(joint.name for joint in scene.robot.joints if moving[joint.v : joint.v + joint.nv].any()),
        nearby_freedoms=_nearby_freedoms(scene, q, v, free),
        notes=ranked(scene.notes),
    )


def _jacobian(scene: Scene, q: Array, v: Array) -> Array:
    """J (rows, nv) at a state, in units of rad and characteristic lengths."""
    if not scene.constraints:
        return np.zeros((0, scene.robot.nv))
    system = system_of(scene)
    x = np.concatenate([q, v, np.zeros(system.size - len(q) - len(v))])
    inputs = scene.signals_at(np.zeros(1))[0]
    jacobian = system.linearised_constraints(np.zeros(1), x, inputs, system_parameters(scene))[2]
    return np.asarray(jacobian / rows_of(scene).unit[:, None] * velocity_units(scene))


def _rank(matrix: Array) -> int:
    if not matrix.size:
        return 0
    singular = singular_values(matrix, "the derivative of the constraints is")
    return int(np.count_nonzero(singular > SINGULAR * singular.max(initial=0.0)))


def _null_space(matrix: Array) -> Array:
    """An orthonormal basis (columns, k) of the null space of a matrix (rows, columns)."""
    if not matrix.size:
        return np.eye(matrix.shape[1])
    vectors = svd(matrix, "the derivative of the constraints is")[2]
    return np.asarray(vectors[_rank(matrix) :].T)


def _independent(free: Array, motors: Sequence[tuple[str, Sequence[int]]]) -> tuple[str, ...]:
    """The motors, in order, whose rates in the freedoms `free` (nv, k) are independent of those before them."""
    chosen, columns = list[str](), list[int]()
    for name, own in motors:
        rates = free[[*columns, *own]]
        if rates.size and np.linalg.matrix_rank(rates, tol=SINGULAR) == len(rates):
            chosen, columns = [*chosen, name], [*columns, *own]
    return tuple(chosen)


def _redundant(scene: Scene, jacobian: Array) -> tuple[tuple[str, int], ...]:
    """The number of rows of each constraint that depend on those before."""
    names = [name for name, _ in system_of(scene).multiplier_names] if len(jacobian) else []
    found, before, first = [], 0, 0
    for name in dict.fromkeys(names):
        last = first + names.count(name)
        now = _rank(jacobian[:last])
        if now - before < last - first:
            found.append((name, last - first - (now - before)))
        before, first = now, last
    return tuple(found)


def _nearby_freedoms(scene: Scene, q: Array, v: Array, free: Array) -> int:
    """The number of freedoms at a consistent posture near q; that at q where no other one is near."""
    from bellcrank.dynamics.postures.consistent_start import displaced

    if not scene.constraints or not free.shape[1]:
        return int(free.shape[1])
    random = np.random.default_rng(0).normal(size=(free.shape[1], 4))
    found = [int(free.shape[1])]
    for direction in (free @ random).T:
        step = ASIDE * direction / np.linalg.norm(direction) * velocity_units(scene)
        search = PostureSearch(np.zeros(scene.robot.nv, dtype=bool))
        there, verdicts = search_postures(scene, scene_as_design(scene), displaced(scene, q, step)[None], search)
        if verdicts.code[0] == StartCode.CONSISTENT:
            found.append(scene.robot.nv - _rank(_jacobian(scene, there[0], v)))
    return min(found)


def _words(value: object) -> object:
    """A number, or names with a blank between them."""
    if not isinstance(value, tuple):
        return value
    return " ".join(f"{one[0]} ({one[1]})" if isinstance(one, tuple) else str(one) for one in value)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
