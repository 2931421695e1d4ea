"""The worst static gravity torque of each joint over the ranges of all joints: what a brake must hold.

The potential energy is affine in (cos q_i, sin q_i) of every revolute joint and in every prismatic q_i, so a
gravity torque along one coordinate is A + B cos q_i + C sin q_i, or A + B q_i, and its largest magnitude over
a range is known in closed form from three (two) values. Coordinates are maximised in turn, from many seeded
starts at once. Of more than MANY joints each sweep over the coordinates is a pass along the tree (holding_passes.py);
where joints mimic others or parameters set masses, so that it is not, there are fewer starts, which a note says.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from bellcrank.sizing.holding_passes import UNSETTLED, HoldingPasses
from bellcrank.sizing.holding_tolerance import worst_of_masses

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint

Array = NDArray[np.float64]
Torque = Callable[[Array], Array]
Rows = NDArray[np.intp]

STARTS = 24  # postures to start from, for each joint and each sign
SWEEPS = 60  # at most, over all coordinates
ROUGH = 6  # sweeps after which only the best KEPT starts of each joint go on
KEPT = 6
MANY = 40  # joints: of more, passes along the tree are faster than evaluations of all torques
BLOCK_NUMBERS = 1_000_000  # of postures whose torques are in memory at a time
GRID = 49  # points along a coordinate that others follow (mimic), where no closed form holds


class Statics(Protocol):
    """What holds a robot at rest, and each link's share of it: a Robot, or one with parameters."""

    def gravity_torque(self, q: Array) -> Array:
        """The torques (n, nv) that hold the robot at rest at q (n, nq)."""

    def link_gravity_torques(self, q: Array) -> Array:
        """Each link's share of them, (n, links, nv)."""


@dataclass(frozen=True)
class Holding:
    """For each one-degree-of-freedom joint: the largest static |torque| (k,), N m or N, and its posture (k,
    nq)."""

    joints: tuple[str, ...]
    torque: Array
    position: Array
    notes: tuple[str, ...]


def holding_torques(
    robot: Robot, starts: int = STARTS, seed: int = 0, mass_tolerance: float = 0.0, statics: Statics | None = None
) -> Holding:
    """The worst static gravity torque of every joint, without friction.

    Revolute joints without limits range over one turn; prismatic ones without limits are held at 0 and
    `notes` says so; a free base and planar joints keep their neutral posture. With a mass tolerance each link
    or payload as a whole, mass and inertia, is scaled by a factor of its own within 1 ± tolerance, and the worst
    of all factors and postures is found: the largest |τ| + tolerance · Σ|share of a link|. `statics` stands for the
    robot's own masses.
    """
    statics = robot if statics is None else statics
    joints = tuple(joint for joint in robot.joints if joint.nv == 1)
    count = len(joints)
    lower, upper, notes = joint_ranges(robot, joints)
    if count < len(robot.joints):
        notes += ("holding torques are for the neutral posture of the base",)
    if count > MANY and statics is robot and not robot.mimics():
        return _by_passes(robot, joints, (lower, upper), notes, starts, seed, mass_tolerance)
    if count > MANY:
        fewer = max(1, starts * MANY // count)
        notes += (
            f"holding torques of {count} joints, some of which mimic others or have parameters, are searched from "
            f"{2 * fewer} postures a joint instead of {2 * starts}: larger ones may exist",
        )
        starts = fewer
    leaders = {leader for _, leader, _, _ in robot.mimics()}
    generator = np.random.default_rng(seed)
    places = [joint.q for joint in joints]
    columns = np.array([joint.v for joint in joints])

    def torque(postures: Array, rows: Rows) -> Array:
        """Signed gravity torque of each row's own joint; postures (r, m, nq) -> (r, m)."""
        count, m, nq = postures.shape
        own, found, step = columns[target[rows]], np.empty((count, m)), max(1, BLOCK_NUMBERS // (m * nq))
        for first in range(0, count, step):
            block, here = postures[first : first + step], own[first : first + step]
            every = np.asarray(statics.gravity_torque(block.reshape(-1, nq))).reshape(len(block), m, -1)
            found[first : first + step] = every[np.arange(len(block)), :, here]
        return np.asarray(sign[rows, None] * found)

    # One row for each (joint to maximise, sign, start): `target` and `sign` say which.
    target = np.repeat(np.arange(count), 2 * starts)
    sign = np.tile(np.repeat([1.0, -1.0], starts), count)
    random = lower + (upper - lower) * generator.random((len(target), count))
    matters = _dependence(robot, statics, places, random[:: max(1, len(target) // 8)])[columns]
    q = np.tile(np.asarray(robot.neutral, dtype=np.float64), (len(target), 1))
    q[:, places] = np.where(matters[target], random, np.clip(q[:, places], lower, upper))
    value = torque(q[:, None], np.arange(len(q)))[:, 0]
    active = np.ones(len(q), dtype=bool)
    for sweep in range(SWEEPS):
        before = value.copy()
        for k, joint in enumerate(joints):
            rows = np.flatnonzero(active & matters[target, k])
            if lower[k] == upper[k] or not rows.size:
                continue
            at = functools.partial(torque, rows=rows)
            trials = _candidates(at, q[rows], joint, lower[k], upper[k], joint.name in leaders)
            reached = _at(at, q[rows], joint.q, trials)
            each = np.arange(len(rows))
            best = reached.argmax(axis=1)
            better = reached[each, best] > value[rows]
            q[rows[better], joint.q] = trials[each, best][better]
            value[rows[better]] = reached[each, best][better]
        active &= value - before > 1e-13 * np.maximum(1.0, np.abs(value))
        if sweep == ROUGH - 1:  # from here on only the best few of each joint go on
            order = np.argsort(-value.reshape(count, 2 * starts), axis=1)[:, KEPT:]
            active[(order + 2 * starts * np.arange(count)[:, None]).ravel()] = False
        if not active.any():
            break
    table = value.reshape(count, 2 * starts)
    best = table.argmax(axis=1)
    result = np.maximum(table[np.arange(count), best], 0.0)
    posture = q.reshape(count, 2 * starts, -1)[np.arange(count), best]
    if mass_tolerance > 0.0:
        best_few = np.argsort(-table, axis=1)[:, :2]
        starts_of = q.reshape(count, 2 * starts, -1)[np.arange(count)[:, None], best_few]
        result, posture = worst_of_masses(
            robot, statics, joints, leaders, (lower, upper), starts_of, mass_tolerance, generator
        )
    return Holding(tuple(joint.name for joint in joints), result, posture, notes)


def _by_passes(
    robot: Robot,
    joints: tuple[RobotJoint, ...],
    ranges: tuple[Array, Array],
    notes: tuple[str, ...],
    starts: int,
    seed: int,
    mass_tolerance: float,
) -> Holding:
    search = HoldingPasses(robot, joints, *ranges, mass_tolerance)
    found = search.worst(starts, SWEEPS, ROUGH, KEPT, np.random.default_rng(seed))
    names = tuple(joint.name for joint in joints)
    if mass_tolerance > 0.0:
        notes += (
            f"holding torques of {len(joints)} joints within a mass tolerance are searched with masses and coordinates "
            "in turn: larger ones may exist",
        )
    rising = [name for name, share in zip(names, found.rising, strict=True) if share > UNSETTLED]
    if rising:
        notes += (
            f"the search for the holding torques of {len(rising)} joints ('{rising[0]}' among them) ended after "
            f"{SWEEPS} sweeps, the last of which still raised them, by up to {100.0 * found.rising.max():.2g} %",
        )
    return Holding(names, found.torque, found.posture, notes)


def _dependence(robot: Robot, statics: Statics, places: list[int], samples: Array) -> NDArray[np.bool_]:
    """Whether the gravity torque (nv, k) of each velocity coordinate depends on each joint's position."""
    q = np.tile(np.asarray(robot.neutral, dtype=np.float64), (len(samples), 1))
    q[:, places] = samples
    here = np.asarray(statics.gravity_torque(q))
    scale = 1e-12 * max(1e-300, float(np.max(np.abs(here))))
    result = np.zeros((robot.nv, len(places)), dtype=bool)
    for k, place in enumerate(places):
        moved = q.copy()
        moved[:, place] = np.roll(q[:, place], 1)
        result[:, k] = np.max(np.abs(np.asarray(statics.gravity_torque(moved)) - here), axis=0) > scale
    return result


def joint_ranges(robot: Robot, joints: tuple[RobotJoint, ...]) -> tuple[Array, Array, tuple[str, ...]]:
    """Lower and upper ends (k,) within which joints are held, rad or m, and what is said about those without limits."""
    lower, upper, notes = np.zeros(len(joints)), np.zeros(len(joints)), []
    for k, joint in enumerate(joints):
        low, high = float(robot.lower[joint.q]), float(robot.upper[joint.q])
        if joint.kind == "prismatic":
            if not (math.isfinite(low) and math.isfinite(high)):
                notes.append(f"joint '{joint.name}' slides without limits: it is held at 0 for the holding torque")
                low = high = min(max(0.0, low), high)
        else:
            low, high = (
                (low, high)
                if math.isfinite(low) and math.isfinite(high)
                else (
                    (low, low + 2.0 * math.pi)
                    if math.isfinite(low)
                    else (high - 2.0 * math.pi, high)
                    if math.isfinite(high)
                    else (-math.pi, math.pi)
                )
            )
        lower[k], upper[k] = low, max(low, high)
    return lower, upper, tuple(notes)


def _at(torque: Torque, q: Array, place: int, values: Array) -> Array:
    """Torques (r, m) of postures that differ from q (r, nq) in one coordinate, values (r, m)."""
    postures = np.repeat(q[:, None], values.shape[1], axis=1)
    postures[:, :, place] = values
    return np.asarray(torque(postures))


def _candidates(torque: Torque, q: Array, joint: RobotJoint, low: float, high: float, leads: bool) -> Array:
    """Where along one coordinate the largest value can be, (r, m): the ends and, if inside, the crest."""
    ends = np.tile([low, high], (len(q), 1))
    if leads:
        points = np.tile(np.linspace(low, high, GRID), (len(q), 1))
        width = (high - low) / (GRID - 1)
        for _ in range(12):
            best = points[np.arange(len(q)), _at(torque, q, joint.q, points).argmax(axis=1)]
            points = np.clip(best[:, None] + width * np.linspace(-1.0, 1.0, 9), low, high)
            width *= 0.25
        return np.concatenate([ends, points], axis=1)
    if joint.kind == "prismatic":
        return ends
    third = 2.0 * math.pi / 3.0
    # The three values determine B and C of A + B cos(x) + C sin(x), x = q − q0; its crest is at atan2(C, B).
    values = _at(torque, q, joint.q, q[:, joint.q, None] + np.array([0.0, third, -third]))
    cosine = (2.0 * values[:, 0] - values[:, 1] - values[:, 2]) / 3.0
    sine = (values[:, 1] - values[:, 2]) / math.sqrt(3.0)
    crest = q[:, joint.q] + np.arctan2(sine, cosine)
    crest = crest + 2.0 * math.pi * np.ceil((low - crest) / (2.0 * math.pi))
    inside = np.where(crest <= high, crest, q[:, joint.q])
    return np.concatenate([ends, inside[:, None]], axis=1)
