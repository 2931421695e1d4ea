"""The largest static gravity torque when the mass of every link is known only within a tolerance.

A link or payload as a whole, mass and inertia, may be off by a factor within 1 ± tolerance, so the torque wanted is the
largest |τ| + tolerance · Σ|share| over all postures, with τ = Σ share. For given signs of the shares that is a weighted
sum of them, affine in (cos q_i, sin q_i) of each coordinate as τ itself; its maximum over all signs and one coordinate
is therefore the crest for one choice of signs, or an end of the range. Coordinates are maximised in turn, from several
starts at once.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.sizing.holding_search import (
    THIRD_OF_TURN,
    AscentSettings,
    CoordinateAscent,
    JointRanges,
    Rows,
    Statics,
    at_or_above,
    dependence,
    grid_points,
    moved,
)

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot

Array = NDArray[np.float64]

RANDOM = 8  # postures to start from besides the nominal worst ones, for each joint and each sign
SETTINGS = AscentSettings(sweeps=40, rough=3, kept=4, settled=1e-12)
GRID = 64  # points along one coordinate at which the shares, known in closed form, are compared
LEADER_GRID = 33  # points along a coordinate that other joints mimic, where no closed form holds
BATCH = 4096  # postures whose shares are evaluated at once, at most
BLOCK_NUMBERS = 4_000_000  # shares in memory at a time


def worst_masses(
    robot: Robot,
    statics: Statics,
    ranges: JointRanges,
    starts: Array,
    tolerance: float,
    generator: np.random.Generator,
) -> tuple[Array, Array]:
    """Largest static |torque| (k,), N m or N, of each joint within the mass tolerance, and its posture (k, nq).

    `starts` (k, m, nq) are postures to start from besides random ones.
    """
    joints = tuple(joint for joint in robot.joints if joint.nv == 1)
    count, lower, upper = len(joints), ranges.lower, ranges.upper
    leaders = {leader for _, leader, _, _ in robot.mimics()}
    places = [joint.q for joint in joints]
    random = np.tile(np.asarray(robot.neutral, dtype=np.float64), (count, RANDOM, 1))
    random[:, :, places] = lower + (upper - lower) * generator.random((count, RANDOM, count))
    q = np.tile(np.concatenate([starts, random], axis=1), (1, 2, 1))  # (k, 2 signs × starts, nq)
    each = q.shape[1]
    sign = np.tile(np.repeat([1.0, -1.0], each // 2), count)
    target = np.repeat([joint.v for joint in joints], each)
    q = q.reshape(count * each, -1)
    batch = max(1, min(BATCH, BLOCK_NUMBERS // max(1, np.size(statics.link_gravity_torques(q[:1])))))

    def shares(postures: Array, rows: Rows) -> Array:
        """Shares (r, links) of the rows' own joints' torques at postures (r, nq), times the rows' signs."""
        parts = []
        for k in range(0, len(rows), batch):
            some = slice(k, k + batch)
            every = np.asarray(statics.link_gravity_torques(postures[some]))
            parts.append(every[np.arange(len(every)), :, target[rows[some]]])
        return sign[rows, None] * np.concatenate(parts)

    def value_of(postures: Array, rows: Rows) -> Array:
        return _worst(shares(postures, rows), tolerance)

    def improve(k: int, rows: Rows) -> tuple[Array, Array]:
        joint, here = joints[k], ascent.q[rows]
        if joint.name in leaders or joint.kind == "screw":
            points = grid_points(joint, lower[k], upper[k], LEADER_GRID)
            position = _grid_search(here, joint.q, points, functools.partial(value_of, rows=rows))
        elif joint.kind == "prismatic":
            ends = [value_of(moved(here, joint.q, end), rows) for end in (lower[k], upper[k])]
            position = np.where(ends[0] > ends[1], lower[k], upper[k])
        else:
            points = np.linspace(lower[k], upper[k], GRID)
            turns = [here[:, joint.q] + angle for angle in (0.0, THIRD_OF_TURN, -THIRD_OF_TURN)]
            turned = np.concatenate([moved(here, joint.q, angle) for angle in turns])
            found = shares(turned, np.tile(rows, 3)).reshape(3, len(rows), -1)
            best = _crest(found, points - here[:, joint.q, None], tolerance)
            position = np.clip(here[:, joint.q] + best, lower[k], upper[k])
        return position, value_of(moved(here, joint.q, position), rows)

    matters = dependence(statics.link_gravity_torques, places, random[0], 1e-13)[target] & (lower != upper)
    value = value_of(q, np.arange(len(q)))
    ascent = CoordinateAscent(q=q, value=value, matters=matters, places=places, starts=each)
    ascent.run(improve, SETTINGS)
    row = ascent.best()
    return np.maximum(ascent.value[row], 0.0), ascent.q[row]


def _worst(shares: Array, tolerance: float) -> Array:
    """The largest sum of shares (…, links) when each is scaled by a factor within 1 ± tolerance."""
    return np.asarray(shares.sum(axis=-1) + tolerance * np.abs(shares).sum(axis=-1))


def _crest(turns: Array, points: Array, tolerance: float) -> Array:
    """Where along one angle the value is largest, (r,), within points (r, g) that rise from one end to the other.

    `turns` (3, r, links) are shares at 0 and a third of a turn to either side, which determine them everywhere.
    """
    zero, ahead, behind = turns
    mean = (zero + ahead + behind) / 3.0
    cosine, sine = (2.0 * zero - ahead - behind) / 3.0, (ahead - behind) / math.sqrt(3.0)

    def value_at(x: Array) -> Array:
        shares = mean[:, None] + np.cos(x)[..., None] * cosine[:, None] + np.sin(x)[..., None] * sine[:, None]
        return _worst(shares, tolerance)

    best = np.take_along_axis(points, value_at(points).argmax(axis=1)[:, None], axis=1)[:, 0]
    for _ in range(3):  # signs at the best point so far, then the crest that belongs to them
        shares = mean + np.cos(best)[:, None] * cosine + np.sin(best)[:, None] * sine
        weight = 1.0 + tolerance * np.sign(shares)
        low, high = points[:, 0], points[:, -1]
        crest = at_or_above(np.arctan2((weight * sine).sum(axis=1), (weight * cosine).sum(axis=1)), low)
        trials = np.stack([best, np.where(crest <= high, crest, best)], axis=1)
        best = trials[np.arange(len(best)), value_at(trials).argmax(axis=1)]
    return best


def _grid_search(q: Array, place: int, points: Array, value: Callable[[Array], Array]) -> Array:
    """The best positions (r,) of one coordinate that other joints mimic, by a grid that is refined."""
    width = points[1] - points[0]
    trials = np.tile(points, (len(q), 1))
    for _ in range(7):
        reached = np.stack([value(moved(q, place, column)) for column in trials.T], axis=1)
        best = trials[np.arange(len(q)), reached.argmax(axis=1)]
        trials = np.clip(best[:, None] + width * np.linspace(-1.0, 1.0, 9), points[0], points[-1])
        width *= 0.25
    return np.asarray(best)
