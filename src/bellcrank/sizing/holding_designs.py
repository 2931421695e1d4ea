"""The largest static gravity torque of each joint over the ranges of all joints, of many designs of an open chain.

The search is that of sizing/holding_gravity.py, from the same postures: along one coordinate a gravity torque is
A + B cos q_i + C sin q_i, or A + B q_i, which three (two) values determine; coordinates are maximised in turn. Here the
rows of several designs are improved together, each with the parameters of its design.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bellcrank.robot.robot import Robot
from bellcrank.sizing.holding_gravity import MANY, SETTINGS, STARTS
from bellcrank.sizing.holding_search import THIRD_OF_TURN, at_or_above, dependence, joint_ranges

Array = NDArray[np.float64]
Whole = NDArray[np.intp]


class Gravity(Protocol):
    """The gravity torques (n, nv) of an open chain at q (n, nq), with parameters p (np,) or (n, np)."""

    def __call__(self, q: Array, p: Array) -> Array:
        """The torques."""


class HoldingSearch:
    """The search for the holding torques of many designs.

    Args:
        robot: The robot.
        gravity: Its gravity torques, with parameters of each sample's own.
        representative: Parameters (m, np) of designs that show which torque depends on which joint.
    """

    def __init__(self, robot: Robot, gravity: Gravity, representative: Sequence[Array]) -> None:
        self.gravity = gravity
        self.joints = tuple(joint for joint in robot.joints if joint.nv == 1)
        count, ranges = len(self.joints), joint_ranges(robot, self.joints)
        self.lower, self.upper = ranges.lower, ranges.upper
        self.places = [joint.q for joint in self.joints]
        generator = np.random.default_rng(0)
        self.target = np.repeat(np.arange(count), 2 * STARTS)
        self.sign = np.tile(np.repeat([1.0, -1.0], STARTS), count)
        random = self.lower + (self.upper - self.lower) * generator.random((len(self.target), count))
        samples = np.tile(robot.neutral, (len(range(0, len(self.target), max(1, len(self.target) // 8))), 1))
        samples[:, self.places] = random[:: max(1, len(self.target) // 8)]
        columns = np.array([joint.v for joint in self.joints])
        depend = [
            dependence(functools.partial(gravity, p=p), self.places, samples, 1e-12) for p in representative
        ]  # of the torques of each design
        matters = np.any(depend, axis=0)[columns][self.target]
        self.start = np.tile(np.asarray(robot.neutral, dtype=np.float64), (len(self.target), 1))
        here = np.clip(self.start[:, self.places], self.lower, self.upper)
        self.start[:, self.places] = np.where(matters, random, here)
        self.free = matters & (self.lower != self.upper)
        self.column = columns[self.target]

    @staticmethod
    def covers(robot: Robot) -> bool:
        """Whether the search suits a robot: no joint mimics another or is a screw, and there are not very many."""
        one = [joint for joint in robot.joints if joint.nv == 1]
        return not robot.mimics() and len(one) <= MANY and not any(joint.kind == "screw" for joint in one)

    def torques(self, parameters: Array) -> Array:
        """The holding torques (n, k), N m or N, of designs with parameters (n, np)."""
        designs, rows = len(parameters), len(self.target)
        own = np.repeat(np.arange(designs), rows)
        q, column, sign = np.tile(self.start, (designs, 1)), np.tile(self.column, designs), np.tile(self.sign, designs)
        free = np.tile(self.free, (designs, 1))

        def torque(postures: Array, of: Whole) -> Array:
            found = self.gravity(postures, parameters[own[of]])
            return np.asarray(sign[of] * found[np.arange(len(of)), column[of]])

        value = torque(q, np.arange(len(q)))
        active = np.ones(len(q), dtype=bool)
        for sweep in range(SETTINGS.sweeps):
            before = value.copy()
            for k in range(len(self.joints)):
                of = np.flatnonzero(active & free[:, k])
                if of.size:
                    at = functools.partial(torque, of=of)
                    q[of, self.places[k]], value[of] = self._improved(k, q[of], value[of], at)
            active &= value - before > SETTINGS.settled * np.maximum(1.0, np.abs(value))
            if sweep == SETTINGS.rough - 1:
                order = np.argsort(-value.reshape(-1, 2 * STARTS), axis=1, kind="stable")[:, SETTINGS.kept :]
                active[(order + 2 * STARTS * np.arange(len(order))[:, None]).ravel()] = False
            if not active.any():
                break
        value = torque(q, np.arange(len(q)))
        return np.asarray(np.maximum(value.reshape(designs, len(self.joints), -1).max(axis=2), 0.0))

    def _improved(self, k: int, q: Array, value: Array, torque: Callable[[Array], Array]) -> tuple[Array, Array]:
        """The best position (r,) of joint k for postures q (r, nq) of these values (r,), and the values there."""
        place, low, high = self.places[k], self.lower[k], self.upper[k]
        now = q[:, place].copy()

        def at(x: Array | float) -> Array:
            q[:, place] = x
            return torque(q)

        if self.joints[k].kind == "prismatic":
            ends = np.stack([at(low), at(high)], axis=1)
            trial = np.tile([low, high], (len(q), 1))
        else:
            plus, minus = at(now + THIRD_OF_TURN), at(now - THIRD_OF_TURN)
            cosine, sine = (2.0 * value - plus - minus) / 3.0, (plus - minus) / math.sqrt(3.0)
            mean = (value + plus + minus) / 3.0
            crest = at_or_above(now + np.arctan2(sine, cosine), low)
            trial = np.stack([np.full(len(q), low), np.full(len(q), high), np.where(crest <= high, crest, now)], axis=1)
            turned = trial - now[:, None]
            ends = mean[:, None] + cosine[:, None] * np.cos(turned) + sine[:, None] * np.sin(turned)
            ends[:, 2] = np.where(crest <= high, ends[:, 2], value)
        best = ends.argmax(axis=1)[:, None]
        reached, position = (np.take_along_axis(each, best, axis=1)[:, 0] for each in (ends, trial))
        better = reached > value
        return np.where(better, position, now), np.where(better, reached, value)
