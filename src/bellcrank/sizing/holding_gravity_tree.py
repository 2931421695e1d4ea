"""Holding torques of trees of many joints: a sweep over all coordinates takes work proportional to their number.

The gravity torque at joint i, about its axis w, is (w × g) · s, up to its sign, with the first moment of mass s, about
its origin, of what i moves (statics of rigid bodies; derived here). It has the form a · R(q_k) b for every revolute
joint k on the way: at or below i, b is the moment of mass of what k moves and a the vector w × g; above i, b is s × w
and a is gravity. A pass from the tips to the base gives all b. A pass from the base to the tips gives all a, and sets
each coordinate to its best value as it reaches it: the crest of A + B cos q_k + C sin q_k in its range, or an end. What
is above and below is fixed meanwhile, so the value never falls. Within a mass tolerance the masses are set to their
worst in turn with the coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Indices, Mask
from bellcrank.sizing.holding_search import AscentSettings, JointRanges, at_or_above

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint

Rows = Indices | slice

STRETCHED = 4  # one in so many of the starts has what its joint moves stretched out
BLOCK_NUMBERS = 1_000_000  # coordinates of all postures that are improved together
UNSETTLED = 1e-6  # of a torque: a note tells of one that the last sweep still raised by more


@dataclass(frozen=True)
class TreeLink:
    """A joint of the tree: its placement in the parent, its axis, and the masses that move with it."""

    parent: int  # -1: the world
    turn: Array
    shift: Array
    axis: Array
    kind: str
    column: int  # among the joints with one degree of freedom; -1: another, which stays at its neutral posture
    mass: Array  # (bodies,)
    lever: Array  # (bodies, 3), in the joint's frame


def tree_links(robot: Robot, joints: tuple[RobotJoint, ...]) -> list[TreeLink]:
    """The joints of the tree in its order, parents first; `joints` are those with one degree of freedom."""
    tree, columns = robot.equations.tree, {joint.name: k for k, joint in enumerate(joints)}
    bodies: list[list[tuple[float, Array]]] = [[] for _ in tree.joints]
    for frame in (tree.frames[k] for k in tree.massive_frames()):
        turn = np.array(frame.placement.rotation).reshape(3, 3)
        lever = turn @ np.array(frame.lever) + np.array(frame.placement.translation)
        bodies[frame.parent_joint - 1].append((frame.mass, lever))
    return [
        TreeLink(
            joint.parent - 1,
            np.array(joint.placement.rotation).reshape(3, 3),
            np.array(joint.placement.translation),
            np.array(joint.axis),
            joint.kind if joint.name in columns else "held",
            columns.get(joint.name, -1),
            np.array([mass for mass, _ in carried]),
            np.array([lever for _, lever in carried]).reshape(-1, 3),
        )
        for joint, carried in zip(tree.joints, bodies, strict=True)
    ]


def cross(axis: Array, vectors: Array) -> Array:
    """axis (3,) × vectors (3, r)."""
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ vectors


def rotated(axis: Array, vectors: Array, cosine: Array, sine: Array) -> Array:
    """Vectors (3, r) rotated about an axis by angles of these cosines and sines (r,) (Rodrigues' formula)."""
    along = np.outer(axis, (axis @ vectors) * (1.0 - cosine))
    return np.asarray(vectors * cosine + cross(axis, vectors) * sine + along)


@dataclass(frozen=True)
class Worst:
    """Largest |torque| (k,), N m or N, its posture (k, nq), and the share (k,) by which the last sweep raised it."""

    torque: Array
    posture: Array
    rising: Array


class TreeSearch:
    """The search for a robot without mimicking joints, over the ranges of its joints and within a mass tolerance."""

    def __init__(
        self, robot: Robot, joints: tuple[RobotJoint, ...], ranges: JointRanges, mass_tolerance: float
    ) -> None:
        self.robot, self.joints, self.tolerance = robot, joints, mass_tolerance
        self.lower, self.upper = ranges.lower, ranges.upper
        self.links = tree_links(robot, joints)
        count = len(self.links)
        self.within = np.eye(count, dtype=bool)  # [k, i]: joint k is i, or below it
        for k, link in enumerate(self.links):
            if link.parent >= 0:
                self.within[k] |= self.within[link.parent]
        self.index = np.empty(len(joints), dtype=np.intp)  # of each joint in the tree
        for k, link in enumerate(self.links):
            if link.column >= 0:
                self.index[link.column] = k

    def worst(self, starts: int, settings: AscentSettings, generator: np.random.Generator) -> Worst:
        """The largest torque of every joint, from `starts` postures for each direction."""
        count, found, stretched = len(self.joints), [], self._stretched()
        step = max(1, BLOCK_NUMBERS // (2 * starts * len(self.links)))
        for first in range(0, count, step):
            some = np.arange(first, min(count, first + step))
            rows = np.repeat(some, 2 * starts)
            sign = np.tile(np.repeat([1.0, -1.0], starts), len(some))
            random = self.lower + (self.upper - self.lower) * generator.random((len(rows), count))
            chosen = np.tile(np.arange(starts) < max(1, starts // STRETCHED), 2 * len(some))
            random = np.where(chosen[:, None] & self.within[self.index][:, self.index[rows]].T, stretched, random)
            postures = _Postures(self, self.index[rows], sign, np.ascontiguousarray(random.T))
            found.append(postures.climb(len(some), settings))
        torque, angles, rising = (np.concatenate(parts) for parts in zip(*found, strict=True))
        posture = np.tile(np.asarray(self.robot.neutral, dtype=np.float64), (count, 1))
        posture[:, [joint.q for joint in self.joints]] = angles
        if self.tolerance == 0.0:  # evaluated by inverse dynamics, which the search does not use
            held = np.asarray(self.robot.gravity_torque(posture))
            torque = np.abs(held[np.arange(count), [joint.v for joint in self.joints]])
        return Worst(torque, posture, rising)

    def _stretched(self) -> Array:
        """Joint positions (k,) at which the tree is stretched out: each joint, from the tips on, aligns what it moves
        with the mass nearer to the base. The worst postures of long chains are close to this, and coordinate ascent
        gets there only slowly from elsewhere.
        """
        q = np.clip(self.robot.neutral[[joint.q for joint in self.joints]], self.lower, self.upper)
        moments = [link.lever.T @ link.mass for link in self.links]
        masses = self.within.T @ np.array([link.mass.sum() for link in self.links])
        for k, link in enumerate(self.links):  # what is carried counts at the place where it is joined
            if link.parent >= 0:
                moments[link.parent] = moments[link.parent] + masses[k] * link.shift
        for k in range(len(self.links) - 1, -1, -1):
            link, moment = self.links[k], moments[k]
            if link.parent < 0:
                continue
            if link.kind == "revolute":
                low, high = self.lower[link.column], self.upper[link.column]
                a = link.turn.T @ moments[link.parent]
                b = float(a @ moment - (link.axis @ a) * (link.axis @ moment))
                c = float(a @ cross(link.axis, moment))
                if b or c:
                    q[link.column] = float(_crest(np.array(b), np.array(c), low, high))
                angle = q[link.column, None]
                moment = rotated(link.axis, moment[:, None], np.cos(angle), np.sin(angle))[:, 0]
            moments[link.parent] = moments[link.parent] + link.turn @ moment
        return q


class _Postures:
    """Postures (joints, r) that are improved together, each for the torque of its own joint, times a sign (r,)."""

    def __init__(self, search: TreeSearch, target: Indices, sign: Array, q: Array) -> None:
        self.search, self.links = search, search.links
        self.target, self.sign, self.q = target, sign, q
        self.factor: list[Array | float] = [1.0] * len(self.links)  # of each joint's bodies (bodies, rows)
        self.moments, self.masses = ([np.zeros(0)] * len(self.links) for _ in range(2))
        self._relate()
        neutral = np.clip(search.robot.neutral[[joint.q for joint in search.joints]], search.lower, search.upper)
        for k, link in enumerate(self.links):
            if link.column >= 0:
                idle = ~self.matters[k]
                self.q[link.column, idle] = neutral[link.column]

    def _relate(self) -> None:
        """Which postures (r,) each joint of the tree matters to, and which of these have it at or below their own."""
        sliding = np.array([link.kind == "prismatic" for link in self.links])[self.target]
        self.rows: list[Rows] = []
        self.below: list[Mask] = []
        self.own: list[Mask] = []
        self.matters = np.zeros((len(self.links), len(self.target)), dtype=bool)
        for k in range(len(self.links)):
            below, above = self.search.within[k, self.target], self.search.within[self.target, k]
            related = below | above
            rows: Rows = slice(None) if related.all() else np.flatnonzero(related)
            self.rows.append(rows)
            self.below.append(below[rows])
            self.own.append((self.target == k)[rows])
            self.matters[k] = related & ~(below & sliding)

    def climb(self, count: int, settings: AscentSettings) -> tuple[Array, Array, Array]:
        """Largest torque (k,), its joint positions (k, n), and the share (k,) by which the last sweep raised it."""
        rough, kept = settings.rough, settings.kept
        each = len(self.target) // count
        value, before = self._inward(), np.full(len(self.target), -np.inf)
        for sweep in range(settings.sweeps):
            if sweep == rough:
                best = np.argsort(-value.reshape(count, each), axis=1, kind="stable")[:, :kept]
                best = (best + each * np.arange(count)[:, None]).ravel()
                self.target, self.sign, self.q = self.target[best], self.sign[best], self.q[:, best].copy()
                each = min(each, kept)
                self._relate()
                self.factor = [1.0] * len(self.links)
                self._inward()
                value = self._sweep()
            before, value = value, self._sweep()
            if sweep < rough:
                continue
            if not np.any(value - before > settings.settled * np.maximum(1.0, np.abs(value))):
                break
        row = value.reshape(count, each).argmax(axis=1) + each * np.arange(count)
        rising = (value - before)[row] / np.maximum(np.abs(value[row]), 1e-300)
        return np.maximum(value[row], 0.0), self.q[:, row].T, rising

    def _sweep(self) -> Array:
        """A pass to the tips, which sets every coordinate to its best, and one to the base; the values (r,)."""
        self._outward()
        return self._inward()

    def _outward(self) -> None:
        """Set each coordinate, and within the tolerance each mass, to its best for the vectors b of the last pass."""
        r, tolerance = len(self.target), self.search.tolerance
        gravity = np.tile(self.search.robot.gravity[:, None], (1, r))
        ahead: list[Array] = []  # a (3, r), after the joint's turn
        arms: list[Array] = []  # (r,): a · (the joint's origin − the target's)
        for k, link in enumerate(self.links):
            rows, own, below = self.rows[k], self.own[k], self.below[k] & ~self.own[k]
            before = gravity if link.parent < 0 else ahead[link.parent]
            a, arm = link.turn.T @ before[:, rows], np.zeros(r)
            if link.parent >= 0:
                arm[rows] = (arms[link.parent][rows] + link.shift @ before[:, rows]) * below
            if own.any():
                sign = self.sign[rows][own]
                if link.kind == "prismatic":
                    arm[np.arange(r)[rows][own]] = -sign * (link.axis @ a[:, own])
                    a[:, own] = 0.0
                else:
                    a[:, own] = sign * cross(link.axis, a[:, own])
            if link.kind == "revolute":
                angle = self._set_angle(link, rows, a, self.moments[k])
                a = rotated(link.axis, a, np.cos(angle), -np.sin(angle))
            elif link.kind == "prismatic":
                self._set_slide(link, rows, a, self.masses[k] * below)
                arm[rows] += (link.axis @ a) * self.q[link.column, rows] * below
            after = np.zeros((3, r))
            after[:, rows] = a
            ahead.append(after)
            arms.append(arm)
            if tolerance:
                self.factor[k] = 1.0 + tolerance * np.sign(arm[rows] + link.lever @ a)

    def _inward(self) -> Array:
        """The vectors b and the masses at these coordinates, from the tips to the base, and the values (r,)."""
        r, count = len(self.target), len(self.links)
        value, cosine, sine = np.zeros(r), np.cos(self.q), np.sin(self.q)
        carried: dict[int, Array] = {}  # (3, r): moments of mass below the postures' own joints, or what turns gravity
        heavier: dict[int, Array] = {}  # (r,): masses
        for k in range(count - 1, -1, -1):
            link, rows, own, below = self.links[k], self.rows[k], self.own[k], self.below[k]
            weights = link.mass[:, None] * self.factor[k]  # (bodies, rows or 1)
            moment, mass = (link.lever.T @ weights) * below, weights.sum(axis=0) * below
            if k in carried:
                moment, mass = moment + carried.pop(k)[:, rows], mass + heavier.pop(k)[rows]
            self.moments[k], self.masses[k] = moment, mass
            if link.kind == "revolute":
                moment = rotated(link.axis, moment, cosine[link.column, rows], sine[link.column, rows])
            elif link.kind == "prismatic":
                moment = moment + link.axis[:, None] * (mass * self.q[link.column, rows])
            if own.any():
                lever = link.axis[:, None] * mass[own] if link.kind == "prismatic" else cross(link.axis, moment[:, own])
                moment = moment.copy()
                moment[:, own] = -self.sign[rows][own] * lever
            moment = link.turn @ moment
            passed = below & ~own  # a joint above a posture's own one moves no mass that is counted
            if link.parent < 0:
                value[rows] += (self.search.robot.gravity @ moment) * ~passed
                continue
            mass = mass * passed
            if link.parent not in carried:
                carried[link.parent], heavier[link.parent] = np.zeros((3, r)), np.zeros(r)
            carried[link.parent][:, rows] += moment + link.shift[:, None] * mass
            heavier[link.parent][rows] += mass
        return value

    def _set_angle(self, link: TreeLink, rows: Rows, a: Array, b: Array) -> Array:
        """Set the angle, and return it, at which a · R(angle) b = A + B cos + C sin is largest in the joint's range."""
        low, high = self.search.lower[link.column], self.search.upper[link.column]
        here = self.q[link.column, rows]
        c = (a * cross(link.axis, b)).sum(axis=0)
        b = (a * b).sum(axis=0) - (link.axis @ a) * (link.axis @ b)
        best = _crest(b, c, low, high)
        better = b * np.cos(best) + c * np.sin(best) > b * np.cos(here) + c * np.sin(here)
        best = np.where(better, best, here)
        self.q[link.column, rows] = best
        return np.asarray(best)

    def _set_slide(self, link: TreeLink, rows: Rows, a: Array, mass: Array) -> None:
        """Set a prismatic joint to the end of its range at which what it carries raises the torque of a joint above."""
        slope = (link.axis @ a) * mass
        ends = np.where(slope > 0.0, self.search.upper[link.column], self.search.lower[link.column])
        self.q[link.column, rows] = np.where(slope != 0.0, ends, self.q[link.column, rows])


def _crest(b: Array, c: Array, low: float, high: float) -> Array:
    """Where B cos x + C sin x is largest in a range, for each of (r,) pairs."""
    crest = at_or_above(np.arctan2(c, b), low)
    end = np.where(b * np.cos(low) + c * np.sin(low) > b * np.cos(high) + c * np.sin(high), low, high)
    return np.asarray(np.where(crest <= high, crest, end))
