"""A start that satisfies the constraints: given values are held, guesses and velocities are projected onto them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank._step import consistent_velocities as search_velocities
from bellcrank.arrays import Array, Mask
from bellcrank.cached_values import computed_once
from bellcrank.dynamics.constraints.constraint_derivatives import aligned_constraints
from bellcrank.dynamics.constraints.constraint_rows import rows_of
from bellcrank.dynamics.equations.system import system_of
from bellcrank.dynamics.postures.posture_search import (
    Constrained,
    PostureSearch,
    SearchVerdicts,
    StartCode,
    scene_as_design,
    search_further,
    search_postures,
)
from bellcrank.dynamics.postures.start_diagnosis import StartFailure, diagnose_start
from bellcrank.dynamics.postures.start_equations import equations_at
from bellcrank.elements.joint_constraints import PrescribedMotion
from bellcrank.errors import InputError
from bellcrank.numerics import LARGEST
from bellcrank.robot.model.joints import RobotJoint, unit_vector
from bellcrank.scene.events import LiesFlat

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

MOVED = 1e-6  # rad, m or relative: by so much constraints may change a start without a note


class NoConsistentStart(InputError):
    """No posture with the held values satisfies the constraints.

    Attributes:
        brief: The message that a study writes into its rows: with the largest residual instead of the diagnosis.
    """

    def __init__(self, brief: str, sentences: Sequence[str]) -> None:
        super().__init__("; ".join(sentences))
        self.brief = brief


@computed_once
def consistent_start(scene: Scene) -> tuple[Array, Array]:
    """The position and velocity of a scene's start, which satisfy its constraints at time 0.

    Values that the scene gives are held; values that it marks as guesses, and those it leaves out, are the nearest that
    satisfy the constraints, lengths in units of the characteristic length.

    Args:
        scene: The scene, as `bellcrank.load_scene` reads it.

    Returns:
        The position q (nq,), rad or m, and the velocity v (nv,), rad/s or m/s; that of a free base in its own frame.

    Raises:
        InputError: No posture, or no velocity, with the held values satisfies the constraints.

    Example:
        >>> import bellcrank as bc
        >>> from bellcrank.dynamics.postures.consistent_start import consistent_start
        >>> q, v = consistent_start(bc.load_scene("four_bar"))
        >>> q.shape, v.shape
        ((3,), (3,))
    """
    name = scene.initial.motion
    motion = None if name is None else scene.motion(name)
    q = scene.initial.posture(scene.robot, motion)
    if not scene.constraints:
        return q, scene.initial.rates(scene.robot, q, motion)
    held_q, held_v = scene.initial.held(scene.robot)
    there = consistent_posture(scene, q, held_q)
    _refuse_correction(scene, q, there)
    return there, consistent_velocity(scene, there, scene.initial.rates(scene.robot, there, motion), held_v)


@dataclass(frozen=True)
class Correction:
    """A joint that constraints move from where a saved run, a motion or a keyframe (`by`) places it.

    `before` and `after` are the coordinate (rad or m) that moves most.
    """

    joint: RobotJoint
    by: str
    before: float
    after: float

    @property
    def size(self) -> float:
        """By how much it moves, rad or m."""
        return abs(self.after - self.before)


def corrections(scene: Scene, before: Array, after: Array) -> list[Correction]:
    """The joints that constraints move from the given posture (nq,) to the start (nq,), largest first."""
    found = []
    for name, by in _placed_by(scene).items():
        j = scene.robot.joint(name)
        k = j.q + int(np.abs(after - before)[j.q : j.q + j.nq].argmax())
        found.append(Correction(j, by, float(before[k]), float(after[k])))
    moved = [one for one in found if one.size > MOVED * max(1.0, abs(one.before))]
    return sorted(moved, key=lambda one: -one.size)


def _placed_by(scene: Scene) -> dict[str, str]:
    """The joints that a saved run, a motion that is also prescribed, or a keyframe places at the start, and which."""
    initial, file = scene.initial, scene.config.file
    by = dict[str, str]()
    if initial.saved is not None:
        by = dict.fromkeys((j.name for j in initial.saved.joints), f"the run {initial.saved.name}")
    elif initial.motion is not None:
        prescribed = [part.joint.name for part in scene.constraints if isinstance(part, PrescribedMotion)]
        by = dict.fromkeys(prescribed, f"motion '{initial.motion}'")
    if file is not None and file.keyframe and file.start is not None:
        for name in initial.guesses:
            if file.start.get(name) == initial.position[name]:
                by[name] = file.keyframe
    mine = {name for name in initial.position if by.get(name) != (file.keyframe if file else "")} | {*initial.free}
    return {name: one for name, one in by.items() if name not in mine}


def _refuse_correction(scene: Scene, before: Array, after: Array) -> None:
    """Refuse a start in which constraints move a joint further than is allowed (InputError)."""
    allowed = scene.initial.largest_correction
    length = rows_of(scene).length
    for one in corrections(scene, before, after):
        unit, scale = ("m", length) if one.joint.kind == "prismatic" else ("rad", 1.0)
        if one.size > allowed * scale:
            raise InputError(
                f"{scene.source}: initial: {one.by} places joint '{one.joint.name}' at {one.before:.6g} {unit}, and "
                f"the constraints move it to {one.after:.6g} {unit}, by more than {allowed * scale:.3g} {unit}; write "
                f"initial: {{largest_correction: {1.1 * one.size / scale:.2g}}} to allow that, or give another start"
            )


def consistent_posture(scene: Scene, q: Array, held: Mask) -> Array:
    """The position (nq,) that satisfies the constraints and is nearest to q (nq,).

    `held` (nv) marks the degrees of freedom whose positions are held, those of a free joint along its parent's axes.
    Raises InputError with the smallest residual found where no posture with the held values satisfies the constraints.
    """
    found, verdicts = consistent_postures(scene, scene_as_design(scene), q[None], held)
    code = verdicts.code[0]
    if code:
        place, more = f"{scene.source}: initial", tuple[str, ...]()
        brief = f"{place}: {reason(scene, verdicts, 0, held)}"
        if code in (StartCode.UNSATISFIED, StartCode.TURNED_AROUND):
            more = diagnose_start(scene, scene_as_design(scene), q, held).sentences()
        raise NoConsistentStart(brief, (f"{place}: {reason(scene, verdicts, 0, held, diagnosed=bool(more))}", *more))
    return np.asarray(found[0])


def given_posture(scene: Scene) -> Array:
    """The position (nq,) that a scene gives for its start, before constraints change it."""
    name = scene.initial.motion
    return scene.initial.posture(scene.robot, None if name is None else scene.motion(name))


def start_failure(scene: Scene) -> StartFailure | None:
    """Why a scene has no consistent posture at its start; None where it has one."""
    q, held = given_posture(scene), scene.initial.held(scene.robot)[0]
    if not scene.constraints or not consistent_postures(scene, scene_as_design(scene), q[None], held)[1].code[0]:
        return None
    return diagnose_start(scene, scene_as_design(scene), q, held)


def starts_further_away(scene: Scene) -> bool:
    """Whether the start of a scene that has one was found by the further searches, away from the given posture."""
    if not scene.constraints:
        return False
    search = PostureSearch(scene.initial.held(scene.robot)[0])
    return bool(search_postures(scene, scene_as_design(scene), given_posture(scene)[None], search)[1].code[0])


def consistent_velocity(scene: Scene, q: Array, v: Array, held: Mask) -> Array:
    """The velocity (nv,) that satisfies the constraints at the position q (nq,) and is nearest to v (nv,).

    `held` (nv) marks the degrees of freedom whose velocities are held, those of a free joint along the axes that its
    velocity is given in. Raises InputError where no velocity with the held values satisfies the constraints.
    """
    found, verdicts = consistent_velocities(scene, scene_as_design(scene), q[None], v[None], held)
    if verdicts.code[0]:
        raise InputError(f"{scene.source}: initial: {reason(scene, verdicts, 0, held)}")
    return np.asarray(found[0])


def displaced(scene: Scene, q: Array, step: Array) -> Array:
    """The posture (nq,) after a small displacement `step` (nv,): q + E(q) step, with rotations normalised."""
    there = q + scene.robot.configuration_rate(q, step)
    for j in scene.robot.joints:
        if (part := unit_vector(j)) is not None:
            there[part] /= np.linalg.norm(there[part])
    return np.asarray(there, dtype=np.float64)


# ---- The consistent starts of many designs of a scene at once, and why a design has none.
#
# The rules are those of `consistent_start`, which is this search for one design.


BLOCK = 1000  # designs whose further searches are in memory at a time


def consistent_postures(
    scene: Scene, designs: Constrained, q: Array, held: Mask, threads: int = 1
) -> tuple[Array, SearchVerdicts]:
    """The positions (n, nq) that satisfy the constraints of each design and are nearest to q (n, nq).

    Where Gauss-Newton steps from q reach none, further searches follow (posture_search.py). `held` (nv) marks the
    degrees of freedom whose positions are held, those of a free joint along its parent's axes. A position whose verdict
    is not CONSISTENT is where the first search ended.
    """
    search = PostureSearch(held)
    found, judged = search_postures(scene, designs, q, search, threads)
    lost = np.flatnonzero((judged.code == StartCode.UNSATISFIED) | (judged.code == StartCode.TURNED_AROUND))
    for block in np.split(lost, range(BLOCK, len(lost), BLOCK)):
        reached, place = search_further(scene, designs.picked(block), q[block], search, threads)
        found[block[reached]], judged.code[block[reached]] = place[reached], StartCode.CONSISTENT
    _find_flat_disks(scene, designs, found, judged)
    return found, judged


def consistent_velocities(
    scene: Scene, designs: Constrained, q: Array, v: Array, held: Mask, threads: int = 1, time: float = 0.0
) -> tuple[Array, SearchVerdicts]:
    """The velocities (n, nv) that satisfy the constraints at positions (n, nq), at a time (s), nearest to v (n, nv).

    `held` (nv) marks the degrees of freedom whose velocities are held, those of a free joint along the axes that its
    velocity is given in.
    """
    found, code, place, value = search_velocities(
        equations_at(scene, time), designs.parameters, designs.units, designs.lengths, q, v, held, threads
    )
    return found, SearchVerdicts(code, place, value)


def _find_flat_disks(scene: Scene, designs: Constrained, q: Array, verdicts: SearchVerdicts) -> None:
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


def reason(scene: Scene, verdicts: SearchVerdicts, design: int, held: Mask, diagnosed: bool = False) -> str:
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
