"""What the searches for holding torques share: joint ranges, the result, and coordinate ascent from many postures."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Indices, Mask

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint

Rows = Indices


@dataclass(frozen=True)
class Holding:
    """For each joint: the largest static |torque| (k,), N m or N, and the position q (k, nq) where it is needed."""

    joints: tuple[str, ...]
    torque: Array
    position: Array
    notes: tuple[str, ...]


@dataclass(frozen=True)
class JointRanges:
    """Lower and upper ends (k,) of the positions searched, rad or m, and notes about joints without limits."""

    lower: Array
    upper: Array
    notes: tuple[str, ...]


def joint_ranges(robot: Robot, joints: tuple[RobotJoint, ...]) -> JointRanges:
    """The position limits. Without them, a revolute joint ranges over one turn; any other one is held at 0."""
    lower, upper, notes = np.zeros(len(joints)), np.zeros(len(joints)), []
    for k, joint in enumerate(joints):
        low, high = float(robot.lower[joint.q]), float(robot.upper[joint.q])
        bounded_below, bounded_above = math.isfinite(low), math.isfinite(high)
        if joint.kind != "revolute":
            if not (bounded_below and bounded_above):
                low = high = min(max(0.0, low), high)
                moves, unit = ("slides", "m") if joint.kind == "prismatic" else ("screws", "rad")
                notes.append(
                    f"joint '{joint.name}' {moves} without limits: it is held at {low:g} {unit} for the holding torques"
                )
        elif not bounded_below and not bounded_above:
            low, high = -math.pi, math.pi
        elif not bounded_above:
            high = low + 2.0 * math.pi
        elif not bounded_below:
            low = high - 2.0 * math.pi
        lower[k], upper[k] = low, max(low, high)
    if len(joints) < len(robot.joints):
        notes.append("holding torques are for the neutral posture of the base")
    return JointRanges(lower, upper, tuple(notes))


def grid_points(joint: RobotJoint, low: float, high: float, count: int) -> Array:
    """Points of a joint's range, for torques of which no closed form along its coordinate is known.

    Along a screw a torque changes by the same amount with every turn, so that it is largest in the first or last one.
    """
    if joint.kind != "screw" or high - low <= 4.0 * math.pi:
        return np.linspace(low, high, count)
    turn = np.linspace(0.0, 2.0 * math.pi, count)
    return np.concatenate([low + turn, high - turn[::-1]])


@dataclass(frozen=True)
class AscentSettings:
    """When coordinate ascent stops: after `sweeps` over all coordinates, or where one sweep raises a value by less than
    `settled` of it. After `rough` sweeps only the `kept` best starts of each joint go on.
    """

    sweeps: int
    rough: int
    kept: int
    settled: float


@dataclass(eq=False, kw_only=True)
class CoordinateAscent:
    """Postures that are improved one coordinate after the other; their values never fall.

    A value is the largest sum of shares that are scaled by factors within 1 ± tolerance each. Rows are grouped by the
    joint whose torque is maximised, `starts` rows a joint.

    Attributes:
        q: Postures (rows, nq), improved in place.
        shares: The shares of their values (rows, s), likewise.
        matters: Whether a row's value depends on each joint (rows, k).
        places: Index in q of each joint's coordinate.
        starts: Number of rows a joint.
        tolerance: The tolerance of the factors.
    """

    q: Array
    shares: Array
    matters: Mask
    places: list[int]
    starts: int
    tolerance: float = 0.0

    def run(self, improve: Callable[[int, Rows], tuple[Array, Array]], settings: AscentSettings) -> None:
        """Sweep over the coordinates; `improve(k, rows)` gives the best positions (r,) of joint k for these rows, the
        other joints fixed, and the shares (r, s) there.
        """
        value = self.value
        count = len(value) // self.starts
        active = np.ones(len(value), dtype=bool)
        for sweep in range(settings.sweeps):
            before = value.copy()
            for k, place in enumerate(self.places):
                rows = np.flatnonzero(active & self.matters[:, k])
                if not rows.size:
                    continue
                position, shares = improve(k, rows)
                reached = worst(shares, self.tolerance)
                better = reached > value[rows]
                self.q[rows[better], place] = position[better]
                self.shares[rows[better]], value[rows[better]] = shares[better], reached[better]
            active &= value - before > settings.settled * np.maximum(1.0, np.abs(value))
            if sweep == settings.rough - 1:
                dropped = np.argsort(-value.reshape(count, self.starts), axis=1, kind="stable")[:, settings.kept :]
                active[(dropped + self.starts * np.arange(count)[:, None]).ravel()] = False
            if not active.any():
                break

    @property
    def value(self) -> Array:
        """The value of each row (rows,)."""
        return worst(self.shares, self.tolerance)

    def best(self, count: int = 1) -> Rows:
        """The rows of the largest values of each joint, (joints, count)."""
        table = self.value.reshape(-1, self.starts)
        found = np.argsort(-table, axis=1, kind="stable")[:, :count]
        return np.asarray(found + self.starts * np.arange(len(table))[:, None])


def worst(shares: Array, tolerance: float) -> Array:
    """The largest sum of shares (…, s) when each is scaled by a factor within 1 ± tolerance."""
    total = shares[..., 0] if shares.shape[-1] == 1 else shares.sum(axis=-1)
    return np.asarray(total + tolerance * np.abs(shares).sum(axis=-1) if tolerance else total)


def refined(value: Callable[[Array], Array], points: Array, count: int, rounds: int) -> Array:
    """Where along one coordinate `value` (r, m) -> (r, m) is largest, for each of `count` rows (r,).

    The points (m,), which rise, are compared first; then, `rounds` times, closer ones around the best.
    """
    trials, width = np.tile(points, (count, 1)), points[1] - points[0]
    best, reached = np.full(count, points[0]), np.full(count, -np.inf)
    for _ in range(rounds + 1):
        found = value(trials)
        each = found.argmax(axis=1)[:, None]
        here, most = (np.take_along_axis(a, each, axis=1)[:, 0] for a in (trials, found))
        best, reached = np.where(most > reached, here, best), np.maximum(reached, most)
        trials = np.clip(here[:, None] + width * np.linspace(-1.0, 1.0, 9), points[0], points[-1])
        width *= 0.25
    return best


def dependence(torques: Callable[[Array], Array], places: list[int], postures: Array, noise: float) -> Mask:
    """Whether each velocity coordinate's torque depends on each joint's position, (nv, k).

    `torques` gives (n, …, nv) at postures (n, nq); changes below `noise` of the largest torque do not count.
    """
    here = np.asarray(torques(postures))
    threshold = noise * max(1e-300, float(np.max(np.abs(here), initial=0.0)))
    result = np.zeros((here.shape[-1], len(places)), dtype=bool)
    for k, place in enumerate(places):
        there = np.asarray(torques(moved(postures, place, np.roll(postures[:, place], 1))))
        changes = np.abs(there - here)
        result[:, k] = np.max(changes, axis=tuple(range(changes.ndim - 1)), initial=0.0) > threshold
    return result


def moved(q: Array, place: int, values: float | Array) -> Array:
    """Postures q (n, nq) with one coordinate changed."""
    changed = q.copy()
    changed[:, place] = values
    return changed


def at_or_above(angle: Array, low: Array | float) -> Array:
    """Angles plus the whole turns that bring them to the first such angle at or above `low`."""
    return np.asarray(angle + 2.0 * math.pi * np.ceil((low - angle) / (2.0 * math.pi)))
