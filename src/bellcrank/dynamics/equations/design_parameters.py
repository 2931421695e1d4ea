"""The parameters p of the equations for many designs of a scene, each as `system_parameters` gives them.

With constraints, p contains the usual sizes of their rows (constraint_rows.py), which may depend on parameters such as
lengths. src/cpp/integrator/row_sizes.hpp computes them where the mass matrix and the constraints are clearly regular;
`rows_of` computes them for the other designs one by one. A design whose equations are others than the scene's, or that
has none, is marked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank._step import row_sizes
from bellcrank.arrays import Array, Mask
from bellcrank.cached_values import computed_once
from bellcrank.codegen import llvm as machine
from bellcrank.dynamics.constraints.constraint_rows import (
    FACTORISED,
    LEAST_POWER,
    POWERS,
    ConstraintRows,
    on_one_body,
    rows_of,
    sampler_of,
)
from bellcrank.dynamics.constraints.constraint_sampling import POSTURES, in_metres, largest_dimension
from bellcrank.dynamics.equations.kkt import REGULARISATION
from bellcrank.dynamics.postures.posture_search import Constrained
from bellcrank.errors import InputError
from bellcrank.robot.model.joints import lengths_in_position, lengths_in_velocity, postures

if TYPE_CHECKING:
    from bellcrank.codegen.compile import Compiled
    from bellcrank.scene.scene import Scene

LENGTH, ANGLE, OTHER = range(3)  # units of rows, as in row_sizes.hpp


class DesignParameters(NamedTuple):
    """p of designs with the units of their constraints' rows, and which designs (n,) have the scene's equations.

    A design whose mass matrix may be singular along a motion that the constraints allow is not among these.
    """

    constrained: Constrained
    alike: Mask


def design_parameters(scene: Scene, own: Array, threads: int = 1) -> DesignParameters:
    """The parameters of designs of a scene from `Scene.own_parameters` of each (n, …)."""
    rows, count = rows_of(scene), len(own)
    if not rows.parametric:
        parts = [own, np.full((count, 1), REGULARISATION)] if scene.constraints else [own]
        constrained = Constrained(np.hstack(parts), rows.unit[None], np.array([rows.length]))
        return DesignParameters(constrained, np.full(count, not rows.massless))
    sizes, alike = row_sizes(row_sampling(scene), np.ascontiguousarray(own), threads)
    if rows.singular:
        alike[:] = False
    for design in np.flatnonzero(~alike).tolist():
        other = _other_rows(scene, own[design])
        if other is not None and other.signature == rows.signature and not other.massless:
            sizes[design], alike[design] = other.parameters, True
    kept = len(rows.kept)
    parts = [own, sizes, np.full((count, 1), REGULARISATION)] if scene.constraints else [own]
    units, lengths = sizes[:, 2 * kept : 3 * kept].copy(), sizes[:, -1].copy()
    return DesignParameters(Constrained(np.hstack(parts), units, lengths), alike)


def _other_rows(scene: Scene, own: Array) -> ConstraintRows | None:
    """The rows of the scene at other parameters; None where a row can never hold."""
    given = zip(scene.parameters.items(), own.tolist(), strict=False)
    other = replace(scene, parameters={name: replace(parameter, value=value) for (name, parameter), value in given})
    vars(other)["structure_key"] = scene.structure_key  # in which values of parameters have no part
    try:
        return rows_of(other)
    except InputError:
        return None


@dataclass(frozen=True, eq=False, kw_only=True)
class RowSampling:
    """How a scene's constraints and mass matrix are sampled, as `_step.row_sizes` takes it.

    Attributes:
        rows_code: (q, t, u, p) -> the entries of J, the residuals, lever arms and lengths; None without constraints.
        inertia_code: (q, a, p) -> M a.
        nq: The size of q.
        nv: The size of v.
        q: Postures (POSTURES, nq) with coordinates in m at 0.
        moves: What times L is added to them (POSTURES, nq).
        times: t (POSTURES, 1).
        signals: u (POSTURES, nu).
        directions: The accelerations a (samples, nv) of the samples of M.
        inertia_postures: The posture of each of them.
        factorised: In how many postures M is sampled.
        entry_rows: The row of each entry of J.
        entry_columns: Its column.
        levers: Whether it is a length.
        lengths_in_position: Whether any coordinate is in m.
        lengths_in_velocity: Which degrees of freedom are (nv,).
        unit_kinds: LENGTH, ANGLE or OTHER for each row.
        constraint: The number of the constraint of each row.
        rigid: Whether both frames of each constraint are on one body.
        kept: The rows that are kept.
        longest: The robot's largest dimension, m.
        length_parameters: The parameters in m.
    """

    rows_code: Compiled | None
    inertia_code: Compiled
    nq: int
    nv: int
    q: Array
    moves: Array
    times: Array
    signals: Array
    directions: Array
    inertia_postures: Sequence[int]
    factorised: int
    entry_rows: Sequence[int]
    entry_columns: Sequence[int]
    levers: Sequence[bool]
    lengths_in_position: bool
    lengths_in_velocity: Sequence[bool]
    unit_kinds: Sequence[int]
    constraint: Sequence[int]
    rigid: Sequence[bool]
    kept: Sequence[int]
    longest: float
    length_parameters: Sequence[int]

    @property
    def sampled(self) -> int:
        """The address of the code of rows for batches; 0 without constraints."""
        return 0 if self.rows_code is None else self.rows_code.address("batch")

    @property
    def sample_size(self) -> int:
        """The number of its results."""
        return 0 if self.rows_code is None else self.rows_code.output_sizes[0]

    @property
    def inertia(self) -> int:
        """The address of the code of M a for batches."""
        return self.inertia_code.address("batch")

    @property
    def powers(self) -> list[float]:
        """The powers of ten from `least_power` on."""
        powers: list[float] = POWERS.tolist()
        return powers

    @property
    def least_power(self) -> int:
        """The exponent of the first of them."""
        return LEAST_POWER


@computed_once
def row_sampling(scene: Scene) -> RowSampling:
    """How the constraints and the mass matrix of a scene are sampled."""
    sampler, robot = sampler_of(scene), scene.robot
    moves, times, signals = sampler.drawn(robot, POSTURES)
    far = lengths_in_velocity(robot)
    down, across = sampler.places
    metres = [in_metres(label) for _, label in sampler.names]
    numbers = {constraint.name: k for k, constraint in enumerate(scene.constraints)}
    samples = max(FACTORISED * robot.nv, machine.target().lanes)  # a batch has at least one sample a lane
    places = np.minimum(np.arange(samples), FACTORISED * robot.nv - 1)
    return RowSampling(
        rows_code=sampler.code(scene, "rows") if sampler.names else None,
        inertia_code=sampler.code(scene, "inertia"),
        nq=robot.nq,
        nv=robot.nv,
        q=postures(robot, moves, 0.0),
        moves=np.where(lengths_in_position(robot), moves, 0.0),
        times=times,
        signals=signals,
        directions=np.eye(robot.nv)[places % robot.nv],
        inertia_postures=(places // robot.nv).tolist(),
        factorised=FACTORISED,
        entry_rows=down,
        entry_columns=across,
        levers=[metres[row] and not far[column] for row, column in zip(down, across, strict=True)],
        lengths_in_position=bool(lengths_in_position(robot).any()),
        lengths_in_velocity=far.tolist(),
        unit_kinds=[_unit_kind(label) for _, label in sampler.names],
        constraint=[numbers[name] for name, _ in sampler.names],
        rigid=[on_one_body(robot, constraint) for constraint in scene.constraints],
        kept=rows_of(scene).kept,
        longest=largest_dimension(robot),
        length_parameters=[k for k, p in enumerate(scene.parameters.values()) if p.unit == "m"],
    )


def _unit_kind(label: str) -> int:
    if in_metres(label):
        return LENGTH
    return ANGLE if label.endswith("[N m]") else OTHER
