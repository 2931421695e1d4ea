"""One-sided limits of the speeds at samples of a motion, by which the loss of a gear is judged.

The efficiency of a gear depends on the direction of power, τ q̇ at its output, so the shaft torque jumps where q̇ passes
through zero: there its two limits count, each with the sign that q̇ has on its side and the acceleration of that side.
A sample's speed is therefore 0 only where the joint rests for a finite time. At any other zero the speed is a share
`ONE_SIDE` of that elsewhere in the part of the motion to which the sample belongs; the first sample of a motion belongs
to the part after it, the last one to the part before it. Whoever asks for the direction of power takes the sign of τ q̇
and needs no tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from bellcrank.arrays import Array, Indices

STILL = 1e-9  # rad/s or m/s: the sign of a slower speed is rounding, unless it comes to rest steadily
LASTING = 1e-6  # of a motion's duration: shorter stretches of slower speeds are reversals, not rest
ONE_SIDE = 1e-30  # so small that neither forces nor powers change


@dataclass(frozen=True, eq=False)
class Sides:
    """The parts of a motion in which no speed changes its sign.

    Attributes:
        end: Ends (m,) of the parts, s.
        velocity: The velocity of largest size (m, nv) of each coordinate in each part; 0 where it rests.
    """

    end: Array
    velocity: Array

    @classmethod
    def of(cls, begin: float, end: Array, first: Indices, velocity: Array) -> Self:
        """Parts between times `begin` and `end` (m,), s, from velocities (n, nv) of which those of a part begin at
        `first` (m,). A joint rests where all of its speeds in parts of a finite time are below `STILL`; a shorter
        stretch belongs to the part before it, at the start of the motion to the one after it. A joint that comes to
        rest softly, or sets off so, has smaller speeds with a direction for some time: it moves as long as its speeds
        fall from part to part and keep their sign.
        """
        most, least = (pick.reduceat(velocity, first, axis=0) for pick in (np.maximum, np.minimum))
        found = np.where(most >= -least, most, least)
        still = np.abs(found) <= STILL
        raw = found.copy()
        found[still] = 0.0
        edges = np.concatenate([[begin], end])
        for column in np.flatnonzero(still.any(axis=0) & ~still.all(axis=0)):
            change = np.diff(still[:, column].astype(int), prepend=0, append=0)
            for low, high in zip(np.flatnonzero(change > 0), np.flatnonzero(change < 0), strict=True):
                if edges[high] - edges[low] <= LASTING * (edges[-1] - edges[0]):
                    found[low:high, column] = found[low - 1 if low else high, column]
                    continue
                before = _soft(raw[low - 1 : high, column]) if low else 0
                after = _soft(raw[low : high + 1, column][::-1]) if high < len(found) else 0
                found[low : low + before, column] = raw[low : low + before, column]
                found[high - after : high, column] = raw[high - after : high, column]
        return cls(end, found)

    def of_velocity(self, time: Array, velocity: Array) -> Array:
        """Velocities (n, nv) at times (n,), s, with the sign of their side; the part after a time counts, so a limit
        from before belongs to a time just before.
        """
        if not (small := np.abs(velocity) <= STILL).any():
            return velocity
        part = np.minimum(np.searchsorted(self.end, time, side="right"), len(self.end) - 1)
        return np.where(small, ONE_SIDE * self.velocity[part], velocity)


def _soft(speed: Array) -> int:
    """How many of the speeds after the first one fall steadily and keep its sign."""
    steady = (speed[1:] * speed[:-1] > 0.0) & (np.abs(speed[1:]) < np.abs(speed[:-1]))
    return int(len(steady) if steady.all() else np.argmin(steady))
