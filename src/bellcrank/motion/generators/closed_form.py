"""Closed forms of the motions that bellcrank makes: their states at any time, from the polynomials that make them.

A motion holds the closed forms of its stretches, beside the rows that are samples of them, so that what is between two
rows does not depend on how far apart these lie. Where polynomials meet, a closed form has the limits from both sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np

from bellcrank.arrays import Array, Indices
from bellcrank.motion.generators.blends import BlendedPath
from bellcrank.motion.generators.profile import Profile

Side = Literal["after", "before"]
States = tuple[Array, Array, Array]  # positions (m, nq), velocities (m, nv), accelerations (m, nv)
NEXT = 1e-12  # of the time: a row this close to where polynomials meet may have the limit from either side
ROUNDED = (1e-9, 1e-9, 1e-7)  # of 1 and the largest position, velocity, acceleration: by this a row may be off


class Curve(Protocol):
    """States over a time that begins with 0 s."""

    @property
    def duration(self) -> float:
        """The time of the curve, s."""

    def at(self, time: Array, side: Side) -> States:
        """The states at times (m,), s, within the duration; `side` picks the limit where they jump."""


@dataclass(frozen=True, eq=False)
class TimedPath:
    """A path of joints of one degree of freedom, followed with a profile of its parameter.

    Attributes:
        path: Positions (m, nq) over a parameter, with two derivatives.
        timing: The parameter over time.
        positions: The columns of the joints in the position.
        velocities: Their columns in the velocity.
        nv: Number of velocity coordinates.
    """

    path: BlendedPath
    timing: Profile
    positions: tuple[int, ...]
    velocities: tuple[int, ...]
    nv: int

    @property
    def duration(self) -> float:
        """As in `Curve`."""
        return self.timing.duration

    def at(self, time: Array, side: Side) -> States:
        """As in `Curve`."""
        s, speed, growth = self.timing.at(time, side)
        return self.states(np.clip(s, 0.0, self.timing.distance), speed, growth)

    def states(self, s: Array, speed: Array, growth: Array) -> States:
        """The states at path parameters (m,) with their first and second derivatives by time."""
        q, first, second = self.path(s)
        v, a = np.zeros((len(s), self.nv)), np.zeros((len(s), self.nv))
        columns = list(self.positions)
        v[:, list(self.velocities)] = (first * speed[:, None])[:, columns]
        a[:, list(self.velocities)] = (first * growth[:, None] + second * (speed * speed)[:, None])[:, columns]
        return q, v, a


@dataclass(frozen=True, eq=False)
class Rest:
    """Rest at a position (nq,) for a duration, s."""

    position: Array
    duration: float
    nv: int

    def at(self, time: Array, side: Side) -> States:
        """As in `Curve`."""
        still = np.zeros((len(time), self.nv))
        return np.tile(self.position, (len(time), 1)), still, still.copy()


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """A stretch of a motion from `begin` to `end`, s, that is a curve in `factor` times the curve's own time."""

    begin: float
    end: float
    curve: Curve
    factor: float = 1.0

    def at(self, time: Array, side: Side) -> States:
        """The states at times (m,), s, of the motion."""
        own = np.clip((time - self.begin) / self.factor, 0.0, self.curve.duration)
        q, v, a = self.curve.at(own, side)
        return q, v / self.factor, a / self.factor**2

    def moved(self, shift: float) -> ClosedForm:
        """The same stretch `shift` s later."""
        return replace(self, begin=self.begin + shift, end=self.end + shift)

    def stretched(self, origin: float, factor: float) -> ClosedForm:
        """The stretch with all times after `origin`, s, `factor` times as long."""
        begin, end = (origin + factor * (time - origin) for time in (self.begin, self.end))
        return replace(self, begin=begin, end=end, factor=self.factor * factor)

    def holds(self, time: Array, states: Sequence[Array]) -> bool:
        """Whether rows, times (n,) with their states, are samples of it; beside a jump, of either side."""
        slack = NEXT * max(abs(self.begin), abs(self.end))
        before, after = self.at(time - slack, "before"), self.at(time + slack, "after")
        for one, other, given, share in zip(before, after, states, ROUNDED, strict=True):
            off = np.minimum(np.abs(one - given), np.abs(other - given))
            if off.max(initial=0.0) > share * (1.0 + float(np.abs(given).max(initial=0.0))):
                return False
        return True


def covering(forms: Sequence[ClosedForm], time: Array, side: Side) -> Indices:
    """The number of the stretch (m,) that holds each time (m,), s; -1 where none does."""
    begin, end = (np.array([getattr(form, key) for form in forms]) for key in ("begin", "end"))
    k = np.searchsorted(begin, time, side="right" if side == "after" else "left") - 1
    k = np.where((k < 0) & (time == begin[0]), 0, k)
    last = end[k] if side == "before" else np.where(time == end[-1], np.inf, end[k])
    inside = (time <= last) if side == "before" else (time < last)
    return np.where((k >= 0) & inside, k, -1)
