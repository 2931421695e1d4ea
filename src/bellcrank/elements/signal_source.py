"""Where a signal u(t) comes from: a motion that a controller follows, or a table of torques.

A source says how many entries of u it has without making its numbers, so that equations can be built, and found in the
cache, before any motion is computed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.derived import Portable, cached_property
from bellcrank.elements.signals import Signal

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import RobotJoint

Array = NDArray[np.float64]
SMALL_JUMP = 1e-9  # of a signal's largest value: what rounding leaves between two rows of one time


@dataclass(frozen=True)
class SignalSource(Portable):
    """A signal before its numbers are made; two sources are one if `name`, `width` and `derivatives` agree.

    It supplies `width` values and as many of each of `derivatives` (0, 1 or 2) time derivatives. `make` can be pickled.
    """

    name: str
    width: int
    derivatives: int
    make: Callable[[], tuple[Signal, Array]] = field(repr=False, compare=False)

    @property
    def size(self) -> int:
        """How many entries of u it supplies."""
        return self.width * (self.derivatives + 1)

    @property
    def signal(self) -> Signal:
        """The signal with its numbers. Raises BellcrankError where a motion cannot be made."""
        return self._made[0]

    @property
    def stops(self) -> Array:
        """Times (k,) s, besides the breaks of a kinked signal, at which it is not smooth: no step should cross them."""
        return self._made[1]

    @cached_property
    def _made(self) -> tuple[Signal, Array]:
        return self.make()


def later_signal(source: SignalSource, clock: float) -> Signal:
    """A source's signal over a time that is 0 where the signal's own is `clock` (s)."""
    signal = source.signal
    return replace(signal, breaks=signal.breaks - clock) if clock else signal


def later_stops(source: SignalSource, clock: float) -> Array:
    """A source's stops (k,) over that time; one that lies just behind the signal's end still does."""
    if not clock:
        return source.stops
    last = source.signal.breaks[-1]
    return np.where(source.stops > last, np.nextafter(last - clock, np.inf), source.stops - clock)


def motion_source(
    name: str, motion: Callable[[], Motion], joints: tuple[RobotJoint, ...], derivatives: int
) -> SignalSource:
    """The positions of these one-degree-of-freedom joints along a motion, with that many derivatives."""
    whose = f"motion {name}: {', '.join(joint.name for joint in joints)}"
    return SignalSource(whose, len(joints), derivatives, partial(_signal_of, motion, joints, derivatives))


def _signal_of(motion: Callable[[], Motion], joints: tuple[RobotJoint, ...], derivatives: int) -> tuple[Signal, Array]:
    return motion_signal(motion(), joints, derivatives)


def motion_signal(motion: Motion, joints: tuple[RobotJoint, ...], derivatives: int) -> tuple[Signal, Array]:
    """A motion's quintic Hermite polynomials as they are, one a step between its samples.

    Where the acceleration jumps (a time stands twice) one polynomial ends and the next begins. The times of jumps in
    what the signal supplies come with it, those at its ends among them: beyond the end it stands still.
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
    edges = np.array([motion.time[0], np.nextafter(motion.time[-1], np.inf)])  # at its last time it still moves
    stops = np.sort(np.concatenate([motion.time[twins[jumps]], edges[ends]]))
    return Signal(breaks, coefficients, derivatives, False), stops
