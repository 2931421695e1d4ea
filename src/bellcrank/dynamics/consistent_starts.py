"""The consistent starts of many designs of a scene at once, and why a design has none.

The rules are those of `consistent_start`, which is this search for one design.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank._step import consistent_velocities as search_velocities
from bellcrank.dynamics.aligned_constraints import aligned_constraints
from bellcrank.dynamics.posture_search import Constrained, Search, StartCode, Verdicts, search_postures
from bellcrank.dynamics.start_equations import start_equations
from bellcrank.dynamics.start_stages import search_further
from bellcrank.dynamics.system import system_of
from bellcrank.numerics import LARGEST
from bellcrank.scene.constraint_conditions import LiesFlat

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
BLOCK = 1000  # designs whose further searches are in memory at a time


def consistent_postures(
    scene: Scene, designs: Constrained, q: Array, held: Mask, threads: int = 1
) -> tuple[Array, Verdicts]:
    """The positions (n, nq) that satisfy the constraints of each design and are nearest to q (n, nq).

    Where Gauss-Newton steps from q reach none, further searches follow (start_stages.py). `held` (nv) marks the degrees
    of freedom whose positions are held, those of a free joint along its parent's axes. A position whose verdict is not
    CONSISTENT is where the first search ended.
    """
    search = Search(held)
    found, judged = search_postures(scene, designs, q, search, threads)
    lost = np.flatnonzero((judged.code == StartCode.UNSATISFIED) | (judged.code == StartCode.TURNED_AROUND))
    for block in np.split(lost, range(BLOCK, len(lost), BLOCK)):
        reached, place = search_further(scene, designs.picked(block), q[block], search, threads)
        found[block[reached]], judged.code[block[reached]] = place[reached], StartCode.CONSISTENT
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


def reason(scene: Scene, verdicts: Verdicts, design: int, held: Mask, diagnosed: bool = False) -> str:
    """Why a design has no consistent start; `held` (nv) marks what the search for its position held.

    Where a diagnosis follows (`diagnosed`), numbers are left to it: it gives the gap of each constraint.
    """
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
        residual = "" if diagnosed else f", {value:.3g} m or rad,"
        return (
            f"the constraints cannot be satisfied with {', '.join(names) or 'nothing'} held: the largest "
            f"residual{residual} is in row {label} of '{name}'; hold fewer joints, write a guess nearer to the "
            "intended branch ({guess: …}), or change lengths"
        )
    return (
        f"the given velocities violate constraint '{name}' ({label}) by {value:.3g} m/s or rad/s; give fewer "
        "velocities, the others follow from the constraints"
    )
