"""The largest static gravity torque of each joint over the ranges of all joints.

The potential energy is affine in (cos q_i, sin q_i) of every revolute joint and in q_i of every prismatic one, so a
gravity torque along one coordinate is A + B cos q_i + C sin q_i, or A + B q_i, and its largest magnitude over a range
is known in closed form from three (two) values. Coordinates are maximised in turn, from many seeded starts at once.

With more than MANY joints each sweep over the coordinates is a pass along the tree (holding_gravity_tree.py). Where
joints mimic others or parameters set masses, that is not possible, and there are fewer starts, which a note says.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.sizing.holding_gravity_tree import UNSETTLED, TreeSearch
from bellcrank.sizing.holding_mass_tolerance import worst_masses
from bellcrank.sizing.holding_search import (
    THIRD_OF_TURN,
    AscentSettings,
    CoordinateAscent,
    Holding,
    JointRanges,
    Rows,
    Statics,
    at_or_above,
    dependence,
    grid_points,
    joint_ranges,
)

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint

Array = NDArray[np.float64]
Torque = Callable[[Array], Array]  # postures (r, m, nq) -> (r, m)

STARTS = 24  # postures to start from, for each joint and each sign
SETTINGS = AscentSettings(sweeps=60, rough=6, kept=6, settled=1e-13)
MANY = 40  # joints: with more, passes along the tree are faster than evaluations of all torques
BLOCK_NUMBERS = 1_000_000  # of postures whose torques are in memory at a time
GRID = 49  # points along a coordinate that other joints mimic, where no closed form holds


def gravity_holding_torques(
    robot: Robot, starts: int = STARTS, seed: int = 0, mass_tolerance: float = 0.0, statics: Statics | None = None
) -> Holding:
    """The largest static gravity torque of every joint with one degree of freedom, without friction.

    Revolute joints without limits range over one turn; others without limits stay at 0, and `notes` says so; a
    free base and planar joints keep their neutral posture. With a mass tolerance each link and payload as a whole, mass
    and inertia, is scaled by one factor within 1 ± tolerance, and the torque is the largest over all factors and
    postures: |τ| + tolerance · Σ|share of a link|. `statics` stands for the robot's own masses.
    """
    statics = robot if statics is None else statics
    joints = tuple(joint for joint in robot.joints if joint.nv == 1)
    names, count, ranges = tuple(joint.name for joint in joints), len(joints), joint_ranges(robot, joints)
    notes = ranges.notes
    if count > MANY:
        if statics is robot and not robot.mimics() and not any(joint.kind == "screw" for joint in joints):
            return _tree_search(robot, joints, ranges, starts, seed, mass_tolerance)
        fewer = max(1, starts * MANY // count)
        notes += (
            f"holding torques of {count} joints, some of which mimic others, are screws or have parameters, are "
            f"searched from {2 * fewer} postures a joint instead of {2 * starts}: larger ones may exist",
        )
        starts = fewer
    generator = np.random.default_rng(seed)
    ascent = _ascend(robot, statics, joints, ranges, starts, generator)
    row = ascent.best()
    result, posture = np.maximum(ascent.value[row], 0.0), ascent.q[row]
    if mass_tolerance > 0.0:
        table, postures = ascent.value.reshape(count, -1), ascent.q.reshape(count, 2 * starts, -1)
        best_two = np.argsort(-table, axis=1)[:, :2]
        first = postures[np.arange(count)[:, None], best_two]
        result, posture = worst_masses(robot, statics, ranges, first, mass_tolerance, generator)
    return Holding(names, result, posture, notes)


def _ascend(
    robot: Robot,
    statics: Statics,
    joints: tuple[RobotJoint, ...],
    ranges: JointRanges,
    starts: int,
    generator: np.random.Generator,
) -> CoordinateAscent:
    """Postures improved for the torque of each joint, in both directions, from `starts` random ones each."""
    count, lower, upper = len(joints), ranges.lower, ranges.upper
    leaders = {leader for _, leader, _, _ in robot.mimics()}
    places, columns = [joint.q for joint in joints], np.array([joint.v for joint in joints])

    def torque(postures: Array, rows: Rows) -> Array:
        """Signed gravity torque of each row's own joint; postures (r, m, nq) -> (r, m)."""
        count, m, nq = postures.shape
        own, found, step = columns[target[rows]], np.empty((count, m)), max(1, BLOCK_NUMBERS // (m * nq))
        for first in range(0, count, step):
            block, here = postures[first : first + step], own[first : first + step]
            every = np.asarray(statics.gravity_torque(block.reshape(-1, nq))).reshape(len(block), m, -1)
            found[first : first + step] = every[np.arange(len(block)), :, here]
        return np.asarray(sign[rows, None] * found)

    def improve(k: int, rows: Rows) -> tuple[Array, Array]:
        at = functools.partial(torque, rows=rows)
        trials = _candidates(at, ascent.q[rows], joints[k], (lower[k], upper[k]), joints[k].name in leaders)
        reached = _along(at, ascent.q[rows], joints[k].q, trials)
        each, best = np.arange(len(rows)), reached.argmax(axis=1)
        return trials[each, best], reached[each, best]

    # One row for each (joint to maximise, sign, start): `target` and `sign` say which.
    target = np.repeat(np.arange(count), 2 * starts)
    sign = np.tile(np.repeat([1.0, -1.0], starts), count)
    random = lower + (upper - lower) * generator.random((len(target), count))
    samples = np.tile(
        np.asarray(robot.neutral, dtype=np.float64), (len(range(0, len(target), max(1, len(target) // 8))), 1)
    )
    samples[:, places] = random[:: max(1, len(target) // 8)]
    matters = dependence(statics.gravity_torque, places, samples, 1e-12)[columns]
    q = np.tile(np.asarray(robot.neutral, dtype=np.float64), (len(target), 1))
    q[:, places] = np.where(matters[target], random, np.clip(q[:, places], lower, upper))
    value = torque(q[:, None], np.arange(len(q)))[:, 0]
    free = matters[target] & (lower != upper)
    ascent = CoordinateAscent(q=q, value=value, matters=free, places=places, starts=2 * starts)
    ascent.run(improve, SETTINGS)
    return ascent


def _tree_search(
    robot: Robot,
    joints: tuple[RobotJoint, ...],
    ranges: JointRanges,
    starts: int,
    seed: int,
    mass_tolerance: float,
) -> Holding:
    """The search by passes along the tree, with notes about what it leaves open."""
    found = TreeSearch(robot, joints, ranges, mass_tolerance).worst(starts, SETTINGS, np.random.default_rng(seed))
    names, notes = tuple(joint.name for joint in joints), ranges.notes
    if mass_tolerance > 0.0:
        notes += (
            f"holding torques of {len(joints)} joints within a mass tolerance are searched with masses and coordinates "
            "in turn: larger ones may exist",
        )
    rising = [name for name, share in zip(names, found.rising, strict=True) if share > UNSETTLED]
    if rising:
        notes += (
            f"the search for the holding torques of {len(rising)} joints (such as '{rising[0]}') ended after "
            f"{SETTINGS.sweeps} sweeps, the last of which still raised them, by up to "
            f"{100.0 * found.rising.max():.2g} %",
        )
    return Holding(names, found.torque, found.posture, notes)


def _along(torque: Torque, q: Array, place: int, values: Array) -> Array:
    """Torques (r, m) of postures that differ from q (r, nq) in one coordinate, values (r, m)."""
    postures = np.repeat(q[:, None], values.shape[1], axis=1)
    postures[:, :, place] = values
    return np.asarray(torque(postures))


def _candidates(torque: Torque, q: Array, joint: RobotJoint, ends: tuple[float, float], leads: bool) -> Array:
    """Where along one coordinate the largest value can be, (r, m): the ends of its range, and the crest where it lies
    inside. `leads` says that other joints mimic this one.
    """
    low, high = ends
    at_ends = np.tile([low, high], (len(q), 1))
    if leads or joint.kind == "screw":
        grid = grid_points(joint, low, high, GRID)
        points, width = np.tile(grid, (len(q), 1)), abs(float(grid[1] - grid[0]))
        for _ in range(12):
            best = points[np.arange(len(q)), _along(torque, q, joint.q, points).argmax(axis=1)]
            points = np.clip(best[:, None] + width * np.linspace(-1.0, 1.0, 9), low, high)
            width *= 0.25
        return np.concatenate([at_ends, points], axis=1)
    if joint.kind == "prismatic":
        return at_ends
    # The three values determine B and C of A + B cos(x) + C sin(x), x = q − q0; its crest is at atan2(C, B).
    turned = q[:, joint.q, None] + np.array([0.0, THIRD_OF_TURN, -THIRD_OF_TURN])
    values = _along(torque, q, joint.q, turned)
    cosine = (2.0 * values[:, 0] - values[:, 1] - values[:, 2]) / 3.0
    sine = (values[:, 1] - values[:, 2]) / math.sqrt(3.0)
    crest = at_or_above(q[:, joint.q] + np.arctan2(sine, cosine), low)
    inside = np.where(crest <= high, crest, q[:, joint.q])
    return np.concatenate([at_ends, inside[:, None]], axis=1)
