"""The searches that follow where Gauss-Newton steps from the given posture reach no consistent start.

In this order, until one succeeds: the motors' joints are held, then freed; in each case damped steps from the given
posture, and a continuation that closes the gaps of the given posture and of the tree's neutral posture gradually. Then
the same, motors held and freed, from random postures around the given one within the joints' ranges, at first near and
then further away. The random postures are the same in every run. Of several starts that are found together, the nearest
within the joints' ranges is taken, and brought as near to the given posture as its branch allows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.dynamics.constraints.constraint_rows import characteristic_length
from bellcrank.dynamics.postures.posture_search import Constrained, PostureSearch, StartCode, search_postures
from bellcrank.robot.model.joints import lengths_in_position, unit_vectors

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene

Restarts = Sequence[tuple[int, float]]
RESTARTS = ((8, 0.2), (16, 0.5), (40, 1.0))  # how many random postures, in which share of the joints' ranges
SEED = 15
TOUCHING = 1e-9  # rad or m: by so much a start within a joint's range may be outside
APPROACHES = 40  # attempts to move a start towards the given posture
NEAR = 1e-6  # of the distance: approaches that gain less end


class Stage(NamedTuple):
    """A search from several postures (n, guesses, nq) of each design."""

    search: PostureSearch
    guesses: Array


def search_further(
    scene: Scene, designs: Constrained, q: Array, search: PostureSearch, threads: int = 1, restarts: Restarts = RESTARTS
) -> tuple[Mask, Array]:
    """Starts of designs that have none near q (n, nq): which designs have one (n,), and the positions (n, nq).

    `search` says what is held and satisfied; its method is that of each stage.
    """
    reached, place = np.zeros(len(q), dtype=bool), q.copy()
    for stage in _stages(scene, q, search, restarts):
        todo = np.flatnonzero(~reached)
        if not len(todo):
            break
        count = stage.guesses.shape[1]
        trials = designs.picked(np.repeat(todo, count))
        guesses = stage.guesses[todo].reshape(-1, q.shape[1])
        found, verdicts = search_postures(scene, trials, guesses, stage.search, threads)
        consistent = (verdicts.code == StartCode.CONSISTENT).reshape(-1, count)
        found = found.reshape(-1, count, q.shape[1])
        good = np.flatnonzero(consistent.any(axis=1))
        best = _nearest(scene, found[good], consistent[good], q[todo[good]])
        nearest = stage.search._replace(method="nearest")
        place[todo[good]] = _approached(scene, designs.picked(todo[good]), best, q[todo[good]], nearest, threads)
        reached[todo[good]] = True
    return reached, place


def motors_of(scene: Scene) -> tuple[str, ...]:
    """The joints with motors: those named by `actuated` or by the file of the loops, or else those with actuators."""
    return scene.config.actuated or scene.config.joints_with_actuators


def motor_columns(scene: Scene) -> Mask:
    """Which degrees of freedom (nv,) have motors."""
    columns = np.zeros(scene.robot.nv, dtype=bool)
    for name in motors_of(scene):
        joint = scene.robot.joint(name)
        columns[joint.v : joint.v + joint.nv] = True
    return columns


def _stages(scene: Scene, q: Array, search: PostureSearch, restarts: Restarts) -> Iterator[Stage]:
    held = search.held
    with_motors = held | motor_columns(scene)
    masks = [held] if (with_motors == held).all() or with_motors.all() else [with_motors, held]
    for mask in masks:
        tree = _with_held(scene.robot, scene.robot.neutral, q, mask)
        yield Stage(search._replace(held=mask, method="damped"), q[:, None])
        yield Stage(search._replace(held=mask, method="continued"), np.stack([q, tree], axis=1))
    random = np.random.default_rng(SEED)
    for count, share in restarts:
        drawn = random.uniform(-1.0, 1.0, (count, scene.robot.nq))
        for mask in masks:
            guesses = scattered(scene, q, drawn, share, mask)
            yield Stage(search._replace(held=mask, method="damped"), guesses)


def scattered(scene: Scene, q: Array, drawn: Array, share: float, held: Mask) -> Array:
    """Postures (n, count, nq) around q (n, nq), from numbers `drawn` (count, nq) in ±1; a share of the ranges."""
    robot = scene.robot
    reach = np.where(lengths_in_position(robot), characteristic_length(scene), np.pi)
    low, high = q - reach, q + reach
    limited = robot.lower < robot.upper
    inside = limited & (robot.lower < high) & (robot.upper > low)
    low = np.where(inside, np.maximum(low, robot.lower), np.where(limited & np.isfinite(robot.lower), robot.lower, low))
    high = np.where(
        inside, np.minimum(high, robot.upper), np.where(limited & np.isfinite(robot.upper), robot.upper, high)
    )
    moved = np.where(drawn > 0.0, drawn * (high - q)[:, None], -drawn * (low - q)[:, None])
    there = q[:, None] + share * moved
    for part in unit_vectors(robot.joints):
        there[:, :, part] = q[:, None, part] + share * drawn[:, part]
        there[:, :, part] /= np.maximum(np.linalg.norm(there[:, :, part], axis=2, keepdims=True), 1e-12)
    return _with_held(robot, there, q[:, None], held)


def _with_held(robot: Robot, there: Array, q: Array, held: Mask) -> Array:
    """Postures with the coordinates of q where a joint is held, if only in part."""
    kept = np.zeros(robot.nq, dtype=bool)
    for joint in robot.joints:
        kept[joint.q : joint.q + joint.nq] = held[joint.v : joint.v + joint.nv].any()
    return np.where(kept, q, there)


def _distances(scene: Scene, there: Array, q: Array) -> Array:
    """The distance (…) between postures (…, nq), lengths in units of the characteristic length."""
    unit = np.where(lengths_in_position(scene.robot), characteristic_length(scene), 1.0)
    return np.asarray(np.linalg.norm((there - q) / unit, axis=-1))


def _nearest(scene: Scene, found: Array, consistent: Mask, q: Array) -> Array:
    """For each design the posture (nq,) of `found` (n, guesses, nq) nearest to q, within the ranges if one is."""
    robot = scene.robot
    limited = robot.lower < robot.upper
    outside = limited & ((found < robot.lower - TOUCHING) | (found > robot.upper + TOUCHING))
    distance = _distances(scene, found, q[:, None])
    rank = np.where(outside.any(axis=2), 1e6, 0.0) + np.minimum(distance, 1e5)
    best = np.where(consistent, rank, np.inf).argmin(axis=1)
    return np.asarray(found[np.arange(len(found)), best])


def _approached(
    scene: Scene, designs: Constrained, found: Array, q: Array, search: PostureSearch, threads: int
) -> Array:
    """Consistent postures (n, nq) moved along their branch as near to q (n, nq) as steps of bounded length lead."""
    share = np.full(len(q), 0.5)
    distance = _distances(scene, found, q)
    for _ in range(APPROACHES):
        active = np.flatnonzero((share > 1e-3) & (distance > NEAR))
        if not len(active):
            break
        trial = found[active] + share[active, None] * (q[active] - found[active])
        for part in unit_vectors(scene.robot.joints):
            trial[:, part] /= np.maximum(np.linalg.norm(trial[:, part], axis=1, keepdims=True), 1e-12)
        there, verdicts = search_postures(scene, designs.picked(active), trial, search, threads)
        new = _distances(scene, there, q[active])
        better = (verdicts.code == StartCode.CONSISTENT) & (new < (1.0 - NEAR) * distance[active])
        found[active[better]], distance[active[better]] = there[better], new[better]
        share[active[~better]] *= 0.25
    return found
