"""The constraints of a scene as the search for consistent starts takes them (src/cpp/integrator/start_search.hpp)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import computed_once
from bellcrank.dynamics.constraints.constraint_derivatives import aligned_constraints, alignment_owners, sine_rows
from bellcrank.dynamics.equations.system import system_of
from bellcrank.robot.model.joints import lengths_in_velocity

if TYPE_CHECKING:
    from bellcrank.codegen.compile import Compiled
    from bellcrank.dynamics.equations.compiled_equations import System
    from bellcrank.scene.scene import Scene


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
        code: (t, x, u, p) -> φ, (φ̇, ψ), the entries of J.
        heights: The number of rows of φ.
        rows: The number of rows of (φ̇, ψ).
        entry_rows: The row of each entry of J that is not always zero.
        entry_columns: Its column.
        cosine_count: The number of welds and hinges.
        alignment_owners: Which of them each row of the alignment residual belongs to.
        sines: Which rows of φ are sines of angles (heights,).
        lengths_in_velocity: Which entries of v are in m/s (nv,).
        joints: The joints.
        time: The time at which the constraints are to be satisfied, s.
        signals: u at that time.
    """

    system: System
    code: Compiled
    heights: int
    rows: int
    entry_rows: Sequence[int]
    entry_columns: Sequence[int]
    cosine_count: int
    alignment_owners: Sequence[int]
    sines: Sequence[bool]
    lengths_in_velocity: Sequence[bool]
    joints: Sequence[StartJoint]
    time: float
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
        """The address of `code`."""
        return self.code.address("scalar")

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


def equations_at(scene: Scene, time: float) -> StartEquations:
    """The constraints of a scene at a time (s)."""
    equations = start_equations(scene)
    if time == 0.0:
        return equations
    return replace(equations, time=time, signals=scene.signals_at(np.array([time]))[0])


@computed_once
def start_equations(scene: Scene) -> StartEquations:
    """The constraints of a scene at the start, for the search for consistent postures."""
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
        code=system.linearised,
        heights=heights,
        rows=rows,
        entry_rows=list(pattern.rows),
        entry_columns=list(pattern.columns),
        cosine_count=len(aligned_constraints(scene)),
        alignment_owners=alignment_owners(scene),
        sines=[k in sines for k in range(heights)],
        lengths_in_velocity=lengths_in_velocity(scene.robot).tolist(),
        joints=joints,
        time=0.0,
        signals=scene.signals_at(np.zeros(1))[0],
    )
