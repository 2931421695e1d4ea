"""The consistent starts of many designs of a scene at once, and why a design has none.

The rules are those of `consistent_start`, which is this search for one design; src/cpp/integrator/start_search.hpp
carries it out, each design by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank._step import consistent_postures as search_postures
from bellcrank._step import consistent_velocities as search_velocities
from bellcrank.cached_values import computed_once
from bellcrank.dynamics.aligned_constraints import aligned_constraints, sine_rows
from bellcrank.dynamics.system import system_of
from bellcrank.numerics import LARGEST
from bellcrank.robot.joints import lengths_in_velocity
from bellcrank.scene.constraint_conditions import LiesFlat

if TYPE_CHECKING:
    from bellcrank.dynamics.compiled_equations import System
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Codes = NDArray[np.int32]


class StartCode(IntEnum):
    """Why a design has no consistent start."""

    CONSISTENT = 0
    UNDEFINED = 1  # a row of the constraints, or its derivative
    UNSATISFIED = 2
    TURNED_AROUND = 3  # a weld or a hinge
    VIOLATED = 4  # by the given velocities
    FLAT_DISK = 5


@dataclass(frozen=True, eq=False, kw_only=True)
class StartJoint:
    """A joint, and whether its vectors are held or left free along the axes of its parent, not of its body."""

    kind: str
    q: int
    v: int
    position_in_parent: bool
    velocity_in_parent: bool


@dataclass(frozen=True, eq=False, kw_only=True)
class StartEquations:
    """The constraints of a scene as `_step.consistent_postures` and `_step.consistent_velocities` take them.

    Attributes:
        system: The compiled equations.
        heights: The number of rows of φ.
        rows: The number of rows of (φ̇, ψ).
        entry_rows: The row of each entry of J that is not always zero.
        entry_columns: Its column.
        cosine_count: The number of welds and hinges.
        sines: Which rows of φ are sines of angles (heights,).
        lengths_in_velocity: Which entries of v are in m/s (nv,).
        joints: The joints.
        signals: u at time 0.
    """

    system: System
    heights: int
    rows: int
    entry_rows: Sequence[int]
    entry_columns: Sequence[int]
    cosine_count: int
    sines: Sequence[bool]
    lengths_in_velocity: Sequence[bool]
    joints: Sequence[StartJoint]
    signals: Array

    @property
    def nq(self) -> int:
        """The size of the position."""
        return self.system.nq

    @property
    def nv(self) -> int:
        """The size of the velocity."""
        return self.system.nv

    @property
    def size(self) -> int:
        """The size of the state."""
        return self.system.size

    @property
    def linearised(self) -> int:
        """The address of (t, x, u, p) -> φ, (φ̇, ψ), the entries of J."""
        return self.system.linearised.address("scalar")

    @property
    def cosines(self) -> int:
        """The address of (t, x, u, p) -> the cosines of welds and hinges; 0 where there are none."""
        return self.system.alignment_cosines.address("scalar") if self.cosine_count else 0

    @property
    def aligned(self) -> int:
        """The address of (t, x, u, p) -> their alignment residual and its derivative; 0 where there are none."""
        return self.system.alignment_residual.address("scalar") if self.cosine_count else 0

    @property
    def aligned_count(self) -> int:
        """The number of rows of the alignment residual."""
        return self.system.alignment_residual.output_sizes[0] if self.cosine_count else 0


class Verdicts(NamedTuple):
    """For each design a StartCode, and which row, constraint or event is to blame, with its value."""

    code: Codes
    place: Codes
    value: Array


class Constrained(NamedTuple):
    """Designs of a scene: p (n, np), the units of the rows (n or 1, rows) and the characteristic lengths (n or 1,)."""

    parameters: Array
    units: Array
    lengths: Array


@computed_once
def start_equations(scene: Scene) -> StartEquations:
    """The constraints of a scene, for the search for consistent starts."""
    system, free = system_of(scene), scene.initial.free
    system.linearised.address("scalar")  # after this its sizes are checked
    heights, rows, _ = system.linearised.output_sizes
    pattern = system.jacobian_pattern
    sines = {k for listed in sine_rows(scene, system.multiplier_names).values() for k in listed}
    joints = [
        StartJoint(
            kind=joint.kind,
            q=joint.q,
            v=joint.v,
            position_in_parent=joint.name in free,
            velocity_in_parent=joint.name in free and not free[joint.name].in_body,
        )
        for joint in scene.robot.joints
    ]
    return StartEquations(
        system=system,
        heights=heights,
        rows=rows,
        entry_rows=list(pattern.rows),
        entry_columns=list(pattern.columns),
        cosine_count=len(aligned_constraints(scene)),
        sines=[k in sines for k in range(heights)],
        lengths_in_velocity=lengths_in_velocity(scene.robot).tolist(),
        joints=joints,
        signals=scene.signals_at(np.zeros(1))[0],
    )


def consistent_postures(
    scene: Scene, designs: Constrained, q: Array, held: Mask, threads: int = 1
) -> tuple[Array, Verdicts]:
    """The positions (n, nq) that satisfy the constraints of each design and are nearest to q (n, nq).

    `held` (nv) marks the degrees of freedom whose positions are held, those of a free joint along its parent's axes. A
    position whose verdict is not CONSISTENT is where the search ended.
    """
    found, code, place, value = search_postures(
        start_equations(scene), designs.parameters, designs.units, designs.lengths, q, held, threads
    )
    judged = Verdicts(code, place, value)
    _find_flat_disks(scene, designs, found, judged)
    return found, judged


def consistent_velocities(
    scene: Scene, designs: Constrained, q: Array, v: Array, held: Mask, threads: int = 1
) -> tuple[Array, Verdicts]:
    """The velocities (n, nv) that satisfy the constraints at positions (n, nq) and are nearest to v (n, nv).

    `held` (nv) marks the degrees of freedom whose velocities are held, those of a free joint along the axes that its
    velocity is given in.
    """
    found, code, place, value = search_velocities(
        start_equations(scene), designs.parameters, designs.units, designs.lengths, q, v, held, threads
    )
    return found, Verdicts(code, place, value)


def _find_flat_disks(scene: Scene, designs: Constrained, q: Array, verdicts: Verdicts) -> None:
    """Mark designs in which a rolling disk has no lowest point."""
    flat = [k for k, event in enumerate(scene.events) if isinstance(event.when, LiesFlat)]
    rows = np.flatnonzero(verdicts.code == StartCode.CONSISTENT)
    if not flat or not len(rows):
        return
    system = system_of(scene)
    x = np.zeros((len(rows), system.size))
    x[:, : system.nq] = q[rows]
    values = system.events.rows(np.zeros(1), x, scene.signals_at(np.zeros(1))[0], designs.parameters[rows])[0]
    for k in reversed(flat):  # so that the first is named
        lying = rows[~(values[:, k] > 0.0)]
        verdicts.code[lying], verdicts.place[lying] = StartCode.FLAT_DISK, k


def reason(scene: Scene, verdicts: Verdicts, design: int, held: Mask) -> str:
    """Why a design has no consistent start; `held` (nv) marks what the search for its position held."""
    code, index = StartCode(verdicts.code[design]), int(verdicts.place[design])
    value = float(verdicts.value[design])
    if code is StartCode.FLAT_DISK:
        return (
            f"event '{scene.events[index].name}' occurs at the start: a disk that lies flat has no lowest point to "
            "roll on; tilt it less"
        )
    if code is StartCode.TURNED_AROUND:
        return (
            f"constraint '{aligned_constraints(scene)[index]}' can be satisfied only with its sides rotated by "
            f"{np.degrees(np.arccos(np.clip(value, -1.0, 1.0))):.4g} deg relative to each other; write a guess nearer "
            "to the intended branch ({guess: …}), or rotate one of its frames"
        )
    name, label = system_of(scene).multiplier_names[index]
    if code is StartCode.UNDEFINED:
        return (
            f"constraint '{name}' or its derivative is undefined or larger than {LARGEST:g} at the start: row {label} "
            f"has {value:.4g}; start where it is defined, or write it another way"
        )
    if code is StartCode.UNSATISFIED:
        names = [j.name for j in scene.robot.joints if held[j.v : j.v + j.nv].any()]
        return (
            f"the constraints cannot be satisfied with {', '.join(names) or 'nothing'} held: '{name}' keeps a residual "
            f"of {value:.3g} m or rad ({label}); hold fewer joints, write a guess nearer to the intended branch "
            "({guess: …}), or change lengths"
        )
    return (
        f"the given velocities violate constraint '{name}' ({label}) by {value:.3g} m/s or rad/s; give fewer "
        "velocities, the others follow from the constraints"
    )
