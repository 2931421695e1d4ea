"""The largest static gravity torque of each joint over the ranges of all joints, of one design or many.

The potential energy is affine in (cos q_i, sin q_i) of every revolute joint and in q_i of every prismatic one, so a
gravity torque along one coordinate is A + B cos q_i + C sin q_i, or A + B q_i, and its largest magnitude over a range
is known in closed form from three (two) values. Coordinates are maximised in turn, from many seeded starts at once,
those of several designs together.

A link or payload as a whole, mass and inertia, may be off by a factor within 1 ± tolerance; then the torque wanted is
the largest |τ| + tolerance · Σ|share| over all postures, with τ = Σ share over the links. For given signs of the shares
that is a weighted sum of them, of the form of τ itself; its maximum over all signs and one coordinate is therefore the
crest for one choice of signs, or an end of the range.

With more than MANY joints each sweep over the coordinates is a pass along the tree (holding_gravity_tree.py). Where
joints mimic others or parameters set masses, that is not possible, and there are fewer starts, which a note says.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from bellcrank.arrays import Array, Indices, Mask
from bellcrank.sizing.holding_gravity_tree import UNSETTLED, TreeSearch
from bellcrank.sizing.holding_search import (
    AscentSettings,
    CoordinateAscent,
    Holding,
    JointRanges,
    Rows,
    at_or_above,
    dependence,
    grid_points,
    joint_ranges,
    refined,
    worst,
)

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint

Shares = Callable[[Array, Rows], Array]  # postures (n, nq) of these rows (n,) -> shares of their torques (n, s, nv)

STARTS = 24  # postures to start from, for each joint and each sign
SETTINGS = AscentSettings(sweeps=60, rough=6, kept=6, settled=1e-13)
NOISE = 1e-12  # of the largest torque: less is rounding
MANY = 40  # joints: with more, passes along the tree are faster than evaluations of all torques
BLOCK_NUMBERS = 4_000_000  # torques in memory at a time
GRID = 49, 12  # points along a coordinate that other joints mimic, where no closed form holds; refinements of them
THIRD_OF_TURN = 2.0 * math.pi / 3.0
# within a mass tolerance
NOMINAL, RANDOM = 2, 8  # nominal worst and random postures to start from, for each joint and each sign
TOLERANT = AscentSettings(sweeps=40, rough=3, kept=4, settled=1e-12)
TOLERANT_GRID = 33, 6  # as GRID
SIGNS = 64  # points along one coordinate at which the signs of the shares are compared


class Statics(Protocol):
    """The gravity torques of a robot at rest: a Robot, or an open chain whose parameters set masses."""

    def gravity_torque(self, q: Array) -> Array:
        """The torques (n, nv) that hold the robot at rest at q (n, nq)."""

    def link_gravity_torques(self, q: Array) -> Array:
        """Each link's share of them, (n, links, nv)."""


class Gravity(Protocol):
    """The gravity torques (n, nv) of an open chain at q (n, nq), with parameters p (n, np) or (np,)."""

    def __call__(self, q: Array, p: Array) -> Array:
        """The torques."""


def gravity_holding_torques(robot: Robot, mass_tolerance: float = 0.0, statics: Statics | None = None) -> Holding:
    """The largest static gravity torque of every joint with one degree of freedom, without friction.

    Revolute joints without limits range over one turn; others without limits stay at 0, and `notes` says so; a
    free base and planar joints keep their neutral posture. With a mass tolerance each link and payload as a whole, mass
    and inertia, is scaled by one factor within 1 ± tolerance, and the torque is the largest over all factors and
    postures: |τ| + tolerance · Σ|share of a link|. `statics` stands for the robot's own masses.
    """
    masses = robot if statics is None else statics
    joints = one_degree_joints(robot)
    names, count, ranges = tuple(joint.name for joint in joints), len(joints), joint_ranges(robot, joints)
    starts, notes = STARTS, ranges.notes
    if count > MANY:
        if masses is robot and not robot.mimics() and not any(joint.kind == "screw" for joint in joints):
            return _tree_search(robot, joints, ranges, mass_tolerance)
        fewer = max(1, starts * MANY // count)
        notes += (
            f"holding torques of {count} joints, some of which mimic others, are screws or have parameters, are "
            f"searched from {2 * fewer} postures a joint instead of {2 * starts}: larger ones may exist",
        )
        starts = fewer
    generator = np.random.default_rng(0)
    search = HoldingSearch(robot, lambda q, p: masses.gravity_torque(q), [np.zeros(0)], starts, generator)
    found = search.ascent(np.zeros((1, 0)))
    if mass_tolerance > 0.0:
        first = found.q[found.best(NOMINAL)]
        found = _within_tolerance(robot, masses, joints, ranges, first, mass_tolerance, generator)
    row = found.best()[:, 0]
    return Holding(names, np.maximum(found.value[row], 0.0), found.q[row], notes)


def one_degree_joints(robot: Robot) -> tuple[RobotJoint, ...]:
    """The joints that have a holding torque."""
    return tuple(joint for joint in robot.joints if joint.nv == 1)


class HoldingSearch:
    """The search for the holding torques of many designs, all from the same postures.

    Args:
        robot: The robot.
        gravity: Its gravity torques, with parameters of each sample's own.
        representative: Parameters (m, np) of designs that show which torque depends on which joint.
        starts: Postures to start from, for each joint and each sign.
        generator: What these postures are drawn by.
    """

    def __init__(
        self,
        robot: Robot,
        gravity: Gravity,
        representative: Sequence[Array],
        starts: int = STARTS,
        generator: np.random.Generator | None = None,
    ) -> None:
        self.robot, self.gravity, self.joints = robot, gravity, one_degree_joints(robot)
        self.ranges, self.starts = joint_ranges(robot, self.joints), starts
        lower, upper, count = self.ranges.lower, self.ranges.upper, len(self.joints)
        places, columns = [joint.q for joint in self.joints], np.array([joint.v for joint in self.joints])
        target = np.repeat(np.arange(count), 2 * starts)  # one row for each (joint to maximise, sign, start)
        self.sign, self.column = np.tile(np.repeat([1.0, -1.0], starts), count), columns[target]
        draw = np.random.default_rng(0) if generator is None else generator
        random = lower + (upper - lower) * draw.random((len(target), count))
        self.start = np.tile(np.asarray(robot.neutral, dtype=np.float64), (len(target), 1))
        samples = self.start[:: max(1, len(target) // 8)].copy()
        samples[:, places] = random[:: max(1, len(target) // 8)]
        depend = [dependence(functools.partial(gravity, p=p), places, samples, NOISE) for p in representative]
        matters: Mask = np.any(depend, axis=0)[columns][target]
        self.start[:, places] = np.where(matters, random, np.clip(self.start[:, places], lower, upper))
        self.free = matters & (lower != upper)

    @staticmethod
    def covers(robot: Robot) -> bool:
        """Whether the search suits many designs of a robot: no joint mimics another or is a screw, and there are not
        very many.
        """
        joints = one_degree_joints(robot)
        return not robot.mimics() and len(joints) <= MANY and not any(joint.kind == "screw" for joint in joints)

    def torques(self, parameters: Array) -> Array:
        """The holding torques (n, k), N m or N, of designs with parameters (n, np)."""
        found = self.ascent(parameters)
        return np.asarray(np.maximum(found.value[found.best()[:, 0]], 0.0).reshape(len(parameters), -1))

    def ascent(self, parameters: Array) -> CoordinateAscent:
        """The postures of designs with parameters (n, np), improved; groups of rows are joints of designs."""
        designs, rows = len(parameters), len(self.sign)

        def shares(postures: Array, of: Rows) -> Array:
            return self.gravity(postures, parameters[of // rows])[:, None]

        ascent = CoordinateAscent(
            q=np.tile(self.start, (designs, 1)),
            shares=np.zeros((designs * rows, 1)),
            matters=np.tile(self.free, (designs, 1)),
            places=[joint.q for joint in self.joints],
            starts=2 * self.starts,
        )
        own = np.tile(self.column, designs), np.tile(self.sign, designs)
        _Climb(self.robot, self.joints, self.ranges, shares, own, ascent).run(SETTINGS)
        return ascent


class _Climb:
    """Coordinate ascent of the torques of joints, `own` = (columns of v, signs) of each row."""

    def __init__(
        self,
        robot: Robot,
        joints: tuple[RobotJoint, ...],
        ranges: JointRanges,
        shares: Shares,
        own: tuple[Indices, Array],
        ascent: CoordinateAscent,
    ) -> None:
        self.joints, self.ranges, self.own, self.ascent = joints, ranges, own, ascent
        self.leaders = {leader for _, leader, _, _ in robot.mimics()}
        self.every, self.block = shares, max(1, BLOCK_NUMBERS // max(1, ascent.shares.shape[1] * robot.nv))

    def run(self, settings: AscentSettings) -> None:
        """Improve the rows; at the end their shares are evaluated, not extrapolated."""
        rows = np.arange(len(self.ascent.q))
        self.ascent.shares = self.shares(self.ascent.q, rows)
        self.ascent.run(self._improved, settings)
        self.ascent.shares = self.shares(self.ascent.q, rows)

    def shares(self, postures: Array, rows: Rows) -> Array:
        """Shares (r, s) of the rows' own torques at postures (r, nq), times the rows' signs."""
        column, sign = self.own
        found = np.empty((len(rows), self.ascent.shares.shape[1]))
        for first in range(0, len(rows), self.block):
            some = rows[first : first + self.block]
            every = self.every(postures[first : first + self.block], some)
            found[first : first + self.block] = every[np.arange(len(some)), :, column[some]]
        return sign[rows, None] * found

    def _improved(self, k: int, rows: Rows) -> tuple[Array, Array]:
        """The best positions (r,) of joint k for these rows, and the shares there (r, s)."""
        joint, low, high = self.joints[k], float(self.ranges.lower[k]), float(self.ranges.upper[k])
        here, tolerance = self.ascent.q[rows], self.ascent.tolerance

        def at(positions: Array) -> Array:  # (m, r) -> (m, r, s)
            each = len(positions)
            trial = np.tile(here, (each, 1))
            trial[:, joint.q] = positions.ravel()
            return self.shares(trial, np.tile(rows, each)).reshape(*positions.shape, -1)

        if joint.name in self.leaders or joint.kind == "screw":
            count, rounds = TOLERANT_GRID if tolerance else GRID
            points = grid_points(joint, low, high, count)
            best = refined(lambda trials: worst(at(trials.T), tolerance).T, points, len(rows), rounds)
            return best, at(best[None])[0]
        if joint.kind == "prismatic":
            first, last = at(np.repeat([[low], [high]], len(rows), axis=1))
            lower = worst(first, tolerance) > worst(last, tolerance)
            return np.where(lower, low, high), np.where(lower[:, None], first, last)
        now = here[:, joint.q]
        ahead, behind = at(np.stack([now + THIRD_OF_TURN, now - THIRD_OF_TURN]))
        points = np.linspace(low, high, SIGNS if tolerance else 2)
        return _crest((self.ascent.shares[rows], ahead, behind), now, points, tolerance)


def _crest(turns: tuple[Array, Array, Array], now: Array, points: Array, tolerance: float) -> tuple[Array, Array]:
    """Where along one angle the value is largest, (r,), between the first and the last of some points (g,); the shares
    there (r, s).

    `turns` are shares at `now` (r,) and a third of a turn to either side, which determine them everywhere.
    """
    zero, ahead, behind = turns
    mean = (zero + ahead + behind) / 3.0
    cosine, sine = (2.0 * zero - ahead - behind) / 3.0, (ahead - behind) / math.sqrt(3.0)

    def best_of(angles: Array) -> tuple[Array, Array]:  # of (m, r)
        x = (angles - now)[:, :, None]
        found = mean + np.cos(x) * cosine + np.sin(x) * sine
        each, rows = worst(found, tolerance).argmax(axis=0), np.arange(len(now))
        return angles[each, rows], found[each, rows]

    def with_crest(weight: float | Array, angles: Array) -> Array:  # its crest, where it is in the range, and others
        crest = now + np.arctan2((weight * sine).sum(axis=1), (weight * cosine).sum(axis=1))
        crest = at_or_above(crest, points[0])
        return np.concatenate([angles, np.where(crest <= points[-1], crest, angles[0])[None]])

    best, found = best_of(with_crest(1.0, np.repeat(points[:, None], len(now), axis=1)))
    for _ in range(3 if tolerance else 0):  # the crest that belongs to the signs at the best angle so far
        best, found = best_of(with_crest(1.0 + tolerance * np.sign(found), best[None]))
    return best, found


def _within_tolerance(
    robot: Robot,
    statics: Statics,
    joints: tuple[RobotJoint, ...],
    ranges: JointRanges,
    starts: Array,
    tolerance: float,
    generator: np.random.Generator,
) -> CoordinateAscent:
    """Postures improved for the largest torques within a mass tolerance, from `starts` (k, m, nq) and random ones."""
    count, lower, upper = len(joints), ranges.lower, ranges.upper
    places = [joint.q for joint in joints]
    random = np.tile(np.asarray(robot.neutral, dtype=np.float64), (count, RANDOM, 1))
    random[:, :, places] = lower + (upper - lower) * generator.random((count, RANDOM, count))
    q = np.tile(np.concatenate([starts, random], axis=1), (1, 2, 1))  # (k, 2 signs × starts, nq)
    each = q.shape[1]
    column = np.repeat([joint.v for joint in joints], each)
    depend = dependence(statics.link_gravity_torques, places, random[0], 0.1 * NOISE)[column]
    links = np.shape(statics.link_gravity_torques(random[0, :1]))[1]
    ascent = CoordinateAscent(
        q=q.reshape(count * each, -1),
        shares=np.zeros((count * each, links)),
        matters=depend & (lower != upper),
        places=places,
        starts=each,
        tolerance=tolerance,
    )
    own = column, np.tile(np.repeat([1.0, -1.0], each // 2), count)
    _Climb(robot, joints, ranges, lambda q, _: statics.link_gravity_torques(q), own, ascent).run(TOLERANT)
    return ascent


def _tree_search(
    robot: Robot,
    joints: tuple[RobotJoint, ...],
    ranges: JointRanges,
    mass_tolerance: float,
) -> Holding:
    """The search by passes along the tree, with notes about what it leaves open."""
    found = TreeSearch(robot, joints, ranges, mass_tolerance).worst(STARTS, SETTINGS, np.random.default_rng(0))
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
