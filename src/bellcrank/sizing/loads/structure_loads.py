"""The largest forces and moments in the structure of a closed linkage: in its constraints and joints without a motor.

The force in a rod is that in the joints and constraints at its ends. Loads are those at the rows of the motions and at
the points between them at which torques are integrated, with the nominal masses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.sizing.joint_sizing import Peak, largest_peak
from bellcrank.sizing.loads.motion_grid import Grid, blocks

if TYPE_CHECKING:
    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.motion.motion import Motion


@dataclass(frozen=True, kw_only=True)
class StructureLoad:
    """The largest load of a constraint, or of a joint without a motor.

    Attributes:
        name: Name of the constraint or joint.
        kind: What it is, such as "weld constraint" or "revolute joint".
        peak_force: The largest force that it transmits, N; None for a constraint without force components.
        peak_moment: The largest moment that it transmits, N m; None for a constraint without moment components.

    Example:
        >>> import bellcrank as bc
        >>> apex = bc.size("five_bar").structure[0]
        >>> apex.name, apex.kind, apex.peak_moment
        ('apex', 'point constraint', None)
    """

    name: str
    kind: str
    peak_force: Peak | None
    peak_moment: Peak | None


def structure_loads(mechanism: Mechanism, motion: Motion, grid: Grid) -> tuple[StructureLoad, ...]:
    """The largest loads along a motion; none of an open chain."""
    if not mechanism.closed or mechanism.scene is None:
        return ()
    kinds = {part.name: f"{part.kind} constraint" for part in mechanism.scene.constraints}
    names = mechanism.multiplier_names
    constraints = list(dict.fromkeys(name for name, _ in names))
    motors = {joint.name for joint in mechanism.motors}
    of = {joint.name: joint.kind for joint in mechanism.robot.joints}
    joints = [(k, name) for k, name in enumerate(mechanism.robot.all_joint_names) if name not in motors]
    sizes: list[Array] = []
    for part in blocks(motion, len(grid.time)):
        state = grid.force_time[part], grid.position[part], grid.velocity[part], grid.acceleration[part]
        multipliers, wrenches = mechanism.torques(*state)[1], mechanism.reactions(*state)
        columns = [
            np.linalg.norm(multipliers[:, _rows(names, name, unit)], axis=1)
            for name in constraints
            for unit in ("[N]", "[N m]")
        ]
        for k, _ in joints:
            columns += [np.linalg.norm(wrenches[:, k, :3], axis=1), np.linalg.norm(wrenches[:, k, 3:], axis=1)]
        sizes.append(np.column_stack(columns))
    peaks: list[Peak | None] = [*peaks_on_grid(motion, grid, np.concatenate(sizes))]
    found = []
    for k, name in enumerate(constraints):
        force, moment = (
            peaks[2 * k + n] if _rows(names, name, unit) else None for n, unit in enumerate(("[N]", "[N m]"))
        )
        found.append(StructureLoad(name=name, kind=kinds[name], peak_force=force, peak_moment=moment))
    for n, (_, name) in enumerate(joints, len(constraints)):
        kind = f"{of.get(name, 'mimicking')} joint"
        found.append(StructureLoad(name=name, kind=kind, peak_force=peaks[2 * n], peak_moment=peaks[2 * n + 1]))
    return tuple(found)


def peaks_on_grid(motion: Motion, grid: Grid, table: Array) -> list[Peak]:
    """The largest values of the columns of a table (n, k) at the points of the grid."""
    return [
        Peak(float(table[row, k]), float(grid.time[row]), motion.name, tuple(map(float, grid.position[row])))
        for k, row in enumerate(table.argmax(axis=0).tolist())
    ]


def worst_loads(each: Sequence[tuple[StructureLoad, ...]]) -> tuple[StructureLoad, ...]:
    """The largest of the loads over several motions."""
    return tuple(
        StructureLoad(
            name=same[0].name,
            kind=same[0].kind,
            peak_force=largest_peak(load.peak_force for load in same),
            peak_moment=largest_peak(load.peak_moment for load in same),
        )
        for same in zip(*each, strict=True)
    )


def _rows(names: Sequence[tuple[str, str]], constraint: str, unit: str) -> list[int]:
    """The multipliers of a constraint that have a unit."""
    return [k for k, (name, label) in enumerate(names) if name == constraint and label.endswith(unit)]
