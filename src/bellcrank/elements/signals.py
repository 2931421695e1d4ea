"""Signals u(t): tabulated forces and motions, which the integrator passes to the compiled equations.

A `Signal` is a piecewise polynomial. A `SignalSource` declares the number of its entries in u before its numbers are
computed, so that equations can be built, and found in the cache, without computing any motion.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import Portable, cached_property

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import RobotJoint

SMALL_JUMP = 1e-9  # relative to a signal's largest value; smaller jumps are rounding errors


@dataclass(frozen=True, eq=False)
class Signal:
    """A piecewise polynomial with several columns. Before its first and after its last break the end values are held.

    Attributes:
        breaks: Increasing times (m + 1,), s.
        coefficients: Coefficients (m, degree + 1, width) of ascending powers of t − breaks[i].
        derivatives: How many time derivatives follow the values in u: 0, 1 or 2. Beyond the ends they are 0.
        kinked: Whether value or slope jumps at breaks, so that no integration step may cross one.
    """

    breaks: Array
    coefficients: Array
    derivatives: int
    kinked: bool

    def at(self, t: Array) -> Array:
        """Values and derivatives (n, width (derivatives + 1)) at times (n,), s; at a break the limit from the right."""
        inside = np.clip(t, self.breaks[0], self.breaks[-1])
        k = np.clip(np.searchsorted(self.breaks, inside, side="right") - 1, 0, len(self.breaks) - 2)
        s = (inside - self.breaks[k])[:, None]
        held = ((t < self.breaks[0]) | (t > self.breaks[-1]))[:, None]
        powers = self.coefficients[k]
        blocks = []
        for order in range(self.derivatives + 1):
            value = np.zeros((len(t), powers.shape[2]))
            for degree in range(powers.shape[1] - 1, -1, -1):
                value = value * s + powers[:, degree]
            blocks.append(np.where(held, 0.0, value) if order else value)
            powers = powers[:, 1:] * np.arange(1, powers.shape[1])[None, :, None]
        return np.concatenate(blocks, axis=1)


def values_at(signals: Sequence[Signal], t: Array) -> Array:
    """All signals (n, nu) at times (n,) s."""
    return np.concatenate([np.zeros((len(t), 0)), *[s.at(t) for s in signals]], axis=1)


@dataclass(frozen=True)
class SignalSource(Portable):
    """A signal whose numbers are computed when they are first used.

    It supplies `width` values, and their first `derivatives` (0, 1 or 2) time derivatives. Two sources with equal name,
    width and derivatives are equal. `make` returns the signal and its `stops`; it can be pickled.
    """

    name: str
    width: int
    derivatives: int
    make: Callable[[], tuple[Signal, Array]] = field(repr=False, compare=False)

    @property
    def size(self) -> int:
        """The number of entries of u that it supplies."""
        return self.width * (self.derivatives + 1)

    @property
    def signal(self) -> Signal:
        """The signal with its numbers. Raises BellcrankError where a motion cannot be computed."""
        return self._made[0]

    @property
    def stops(self) -> Array:
        """Times (k,), s, at which the signal is not smooth, apart from the breaks of a kinked signal."""
        return self._made[1]

    @cached_property
    def _made(self) -> tuple[Signal, Array]:
        return self.make()


def signal_after(source: SignalSource, clock: float) -> Signal:
    """The signal of a source as a function of t − clock (s)."""
    signal = source.signal
    return replace(signal, breaks=signal.breaks - clock) if clock else signal


def stops_after(source: SignalSource, clock: float) -> Array:
    """The stops (k,) of a source minus the clock (s); a stop just after the signal's end stays after it."""
    if not clock:
        return source.stops
    last = source.signal.breaks[-1]
    return np.where(source.stops > last, np.nextafter(last - clock, np.inf), source.stops - clock)


def motion_source(
    name: str, motion: Callable[[], Motion], joints: tuple[RobotJoint, ...], derivatives: int
) -> SignalSource:
    """The positions of joints with one degree of freedom along a motion, with that many derivatives."""
    whose = f"motion {name}: {', '.join(joint.name for joint in joints)}"
    return SignalSource(whose, len(joints), derivatives, partial(_signal_of, motion, joints, derivatives))


def _signal_of(motion: Callable[[], Motion], joints: tuple[RobotJoint, ...], derivatives: int) -> tuple[Signal, Array]:
    return motion_signal(motion(), joints, derivatives)


def motion_signal(motion: Motion, joints: tuple[RobotJoint, ...], derivatives: int) -> tuple[Signal, Array]:
    """A motion's quintic Hermite polynomials, one between each two samples, and the times at which the signal jumps.

    Where the acceleration jumps (two samples have one time) one polynomial ends and the next begins. The times include
    the ends of the motion if it does not start or end at rest, since the signal is constant beyond them.
    """
    q, v = [joint.q for joint in joints], [joint.v for joint in joints]
    kept = np.diff(motion.time) > 0.0
    h = np.diff(motion.time)[kept][:, None]
    rows = (motion.position[:, q], motion.velocity[:, v], motion.acceleration[:, v])
    (p0, v0, a0), (p1, v1, a1) = ([x[part][kept] for x in rows] for part in (slice(None, -1), slice(1, None)))
    d, v0h, v1h, a0h, a1h = p1 - p0, v0 * h, v1 * h, a0 * h * h, a1 * h * h
    coefficients = np.stack(
        [
            p0,
            v0,
            0.5 * a0,
            (10.0 * d - 6.0 * v0h - 4.0 * v1h - 1.5 * a0h + 0.5 * a1h) / h**3,
            (-15.0 * d + 8.0 * v0h + 7.0 * v1h + 1.5 * a0h - a1h) / h**4,
            (6.0 * d - 3.0 * v0h - 3.0 * v1h - 0.5 * a0h + 0.5 * a1h) / h**5,
        ],
        axis=1,
    )
    breaks = motion.time[np.append(True, kept)]
    twins = np.flatnonzero(~kept)
    jumps = np.zeros(len(twins), dtype=bool)
    ends = np.zeros(2, dtype=bool)
    for order, x in enumerate(rows[: derivatives + 1]):
        small = SMALL_JUMP * np.abs(x).max(initial=0.0)
        jumps |= np.any(np.abs(x[twins + 1] - x[twins]) > small, axis=1)
        ends |= np.any(np.abs(x[[0, -1]]) > small, axis=1) & (order > 0)
    edges = np.array([motion.time[0], np.nextafter(motion.time[-1], np.inf)])  # at the last time it still moves
    stops = np.sort(np.concatenate([motion.time[twins[jumps]], edges[ends]]))
    return Signal(breaks, coefficients, derivatives, False), stops
