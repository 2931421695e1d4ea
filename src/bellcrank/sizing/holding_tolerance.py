"""The worst static gravity torque when every link's mass is known only within a tolerance.

A link or payload as a whole, mass and inertia, may be off by a factor within 1 ± tolerance, so the torque wanted
is the largest |τ| + tolerance · Σ|share| over all postures, with τ = Σ share. For given signs of the shares that
is a weighted sum of them, affine in (cos q_i, sin q_i) of each coordinate as τ itself; its maximum over all signs
and one coordinate is therefore the crest of one choice of signs, or an end of the range. Coordinates are
maximised in turn, from several starts at once: the value never falls.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from collections.abc import Set as AbstractSet
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.sizing.holding import Statics

Array = NDArray[np.float64]

RANDOM = 8  # postures to start from besides the nominal worst ones, for each joint and each sign
SWEEPS = 40  # at most, over all coordinates
ROUGH = 3  # sweeps after which only the best KEPT starts of each joint go on
KEPT = 4
GRID = 64  # points along one coordinate at which the shares, known in closed form, are compared
LEADER_GRID = 33  # points along a coordinate that others follow (mimic), where no closed form holds
BATCH = 4096  # postures whose shares are evaluated at once, at most
BLOCK_NUMBERS = 4_000_000  # shares in memory at a time


def worst_of_masses(
    robot: Robot,
    statics: Statics,
    joints: tuple[RobotJoint, ...],
    leaders: AbstractSet[str],
    ranges: tuple[Array, Array],
    starts: Array,
    tolerance: float,
    generator: np.random.Generator,
) -> tuple[Array, Array]:
    """Largest static |torque| (k,), N m or N, of each joint within the mass tolerance, and its posture (k, nq).

    `ranges` are the lower and upper ends (k,) to keep, `starts` (k, m, nq) postures to start from besides random
    ones, `leaders` the names of joints that others follow.
    """
    count, (lower, upper) = len(joints), ranges
    places = [joint.q for joint in joints]
    random = np.tile(np.asarray(robot.neutral, dtype=np.float64), (count, RANDOM, 1))
    random[:, :, places] = lower + (upper - lower) * generator.random((count, RANDOM, count))
    q = np.tile(np.concatenate([starts, random], axis=1), (1, 2, 1))  # (k, 2 signs × starts, nq)
    each = q.shape[1]
    sign = np.tile(np.repeat([1.0, -1.0], each // 2), count)
    target = np.repeat([joint.v for joint in joints], each)
    q = q.reshape(count * each, -1)

    batch = max(1, min(BATCH, BLOCK_NUMBERS // max(1, np.size(statics.link_gravity_torques(q[:1])))))

    def shares(postures: Array, rows: NDArray[np.intp]) -> Array:
        """Shares (r, links) of the rows' own joints' torques at postures (r, nq), times the rows' signs."""
        parts = []
        for k in range(0, len(rows), batch):
            some = slice(k, k + batch)
            every = np.asarray(statics.link_gravity_torques(postures[some]))
            parts.append(every[np.arange(len(every)), :, target[rows[some]]])
        return sign[rows, None] * np.concatenate(parts)

    def worth(parts: Array) -> Array:
        return np.asarray(parts.sum(axis=-1) + tolerance * np.abs(parts).sum(axis=-1))

    def value_of(postures: Array, rows: NDArray[np.intp]) -> Array:
        return worth(shares(postures, rows))

    matters = _dependence(statics, places, random[0])
    every_row = np.arange(len(q))
    value = worth(shares(q, every_row))
    active = np.ones(len(q), dtype=bool)
    for sweep in range(SWEEPS):
        before = value.copy()
        for k, joint in enumerate(joints):
            rows = np.flatnonzero(active & matters[target, k])
            if lower[k] == upper[k] or not rows.size:
                continue
            points = np.linspace(lower[k], upper[k], LEADER_GRID if joint.name in leaders else GRID)
            if joint.name in leaders:
                trial = _searched(q[rows], joint.q, points, functools.partial(value_of, rows=rows))
            elif joint.kind == "prismatic":
                trial = q[rows]
                ends = [worth(shares(_moved(trial, joint.q, end), rows)) for end in (lower[k], upper[k])]
                trial = _moved(trial, joint.q, np.where(ends[0] > ends[1], lower[k], upper[k]))
            else:
                trial = q[rows]
                third = 2.0 * math.pi / 3.0
                turned = np.concatenate([_moved(trial, joint.q, trial[:, joint.q] + x) for x in (0.0, third, -third)])
                turns = shares(turned, np.tile(rows, 3)).reshape(3, len(rows), -1)
                best = _crest(turns, points - trial[:, joint.q, None], tolerance)
                trial = _moved(trial, joint.q, np.clip(trial[:, joint.q] + best, lower[k], upper[k]))
            reached = worth(shares(trial, rows))
            better = reached > value[rows]
            q[rows[better]], value[rows[better]] = trial[better], reached[better]
        active &= value - before > 1e-12 * np.maximum(1.0, np.abs(value))
        if sweep == ROUGH - 1:
            order = np.argsort(-value.reshape(count, each), axis=1)[:, KEPT:]
            active[(order + each * np.arange(count)[:, None]).ravel()] = False
        if not active.any():
            break
    best_start = value.reshape(count, each).argmax(axis=1)
    row = best_start + each * np.arange(count)
    return np.maximum(value[row], 0.0), q[row]


def _dependence(statics: Statics, places: list[int], postures: Array) -> NDArray[np.bool_]:
    """Whether any link's share of the torque of each velocity coordinate depends on each joint's position, (nv, k)."""
    here = np.asarray(statics.link_gravity_torques(postures))
    scale = 1e-13 * max(1e-300, float(np.max(np.abs(here), initial=0.0)))
    columns = []
    for place in places:
        there = statics.link_gravity_torques(_moved(postures, place, np.roll(postures[:, place], 1)))
        columns.append(np.max(np.abs(np.asarray(there) - here), axis=(0, 1), initial=0.0) > scale)
    return np.stack(columns, axis=1)


def _moved(q: Array, place: int, values: float | Array) -> Array:
    moved = q.copy()
    moved[:, place] = values
    return moved


def _crest(turns: Array, points: Array, tolerance: float) -> Array:
    """Where along one angle the worst is largest, (r,), within points (r, g) that rise from one end to the other.

    `turns` (3, r, links) are shares at 0 and a third of a turn to either side, which determine them everywhere.
    """
    zero, ahead, behind = turns
    mean = (zero + ahead + behind) / 3.0
    cosine, sine = (2.0 * zero - ahead - behind) / 3.0, (ahead - behind) / math.sqrt(3.0)

    def worth(x: Array) -> Array:
        parts = mean[:, None] + np.cos(x)[..., None] * cosine[:, None] + np.sin(x)[..., None] * sine[:, None]
        return np.asarray(parts.sum(axis=-1) + tolerance * np.abs(parts).sum(axis=-1))

    best = np.take_along_axis(points, worth(points).argmax(axis=1)[:, None], axis=1)[:, 0]
    for _ in range(3):  # signs at the best point so far, then the crest that belongs to them
        parts = mean + np.cos(best)[:, None] * cosine + np.sin(best)[:, None] * sine
        weight = 1.0 + tolerance * np.sign(parts)
        crest = np.arctan2((weight * sine).sum(axis=1), (weight * cosine).sum(axis=1))
        low, high = points[:, 0], points[:, -1]
        crest = crest + 2.0 * math.pi * np.ceil((low - crest) / (2.0 * math.pi))
        trials = np.stack([best, np.where(crest <= high, crest, best)], axis=1)
        best = trials[np.arange(len(best)), worth(trials).argmax(axis=1)]
    return best


def _searched(q: Array, place: int, points: Array, value: Callable[[Array], Array]) -> Array:
    """Postures (r, nq) with the best of one coordinate that others follow: a grid, refined."""
    width = points[1] - points[0]
    trials = np.tile(points, (len(q), 1))
    for _ in range(7):
        reached = np.stack([value(_moved(q, place, column)) for column in trials.T], axis=1)
        best = trials[np.arange(len(q)), reached.argmax(axis=1)]
        trials = np.clip(best[:, None] + width * np.linspace(-1.0, 1.0, 9), points[0], points[-1])
        width *= 0.25
    return _moved(q, place, best)
