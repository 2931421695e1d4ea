"""Times at which tabulated forces or prescribed motions are not smooth, and up to which one a motion can be followed.

A prescribed motion that ends at rest is held. A motion that ends with a velocity, whose velocity jumps, or that starts
with a velocity after the run has started, ends the run there: a joint cannot change its velocity at once, and the
energy of the jump would be missing from the balance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.cached_values import computed_once
from bellcrank.elements.element import joint_unit
from bellcrank.elements.joint_constraints import PrescribedMotion
from bellcrank.elements.signals import SMALL_JUMP, Signal
from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.motion.motion import Motion
    from bellcrank.scene.scene import Scene


SAME_TIME = 1e-12  # s, or of a time beyond 1 s: the rounding between a row of a motion and one of a table
LEAST_APART = 1e-9  # the same, between a row of a motion and a row of a table that is added to it
AT_START = 1e-12  # s
MOVING = 1e-4  # of a motion's largest speed: smaller jumps are rounding of files, and are removed by projection


def force_times(time: Array, end: float | None = None) -> Array:
    """Times (n,) s at which tables are evaluated for the rows of a motion with times `time` (n,).

    Where a time occurs twice, tables are evaluated before their jump for the first row and after it for the second. A
    table that jumps at the end of the motion, at `end` s, is evaluated before its jump.
    """
    repeated = np.diff(time) == 0.0
    width = SAME_TIME * np.maximum(1.0, np.abs(time))
    sided = time - width * np.append(repeated, False) + width * np.insert(repeated, 0, False)
    return np.asarray(sided if end is None else np.minimum(sided, end - SAME_TIME * max(1.0, abs(end))))


def force_breaks(mechanism: Mechanism) -> Array:
    """Times (m,) s at which a table of the scene has a row, where its value or a derivative may jump."""
    sources = [force.source for force in mechanism.equations.forces if force.source is not None]
    return np.unique(np.concatenate([np.zeros(0), *[source.signal.breaks for source in sources]]))


def with_force_rows(mechanism: Mechanism, motion: Motion) -> Motion:
    """The motion with additional rows at the rows of the scene's tables; two rows where a table jumps.

    Files and plots of the motion's rows then show the effect of these forces. A row whose time differs from a table's
    only by rounding gets the table's time, so that their jumps coincide.
    """
    breaks = force_breaks(mechanism)
    motion = _at_table_times(motion, breaks)
    breaks = breaks[(breaks > motion.time[0]) & (breaks < motion.time[-1])]
    row = np.searchsorted(motion.time, breaks)
    near = np.where(
        breaks - motion.time[np.maximum(row - 1, 0)] < motion.time[row] - breaks, np.maximum(row - 1, 0), row
    )
    apart = np.abs(motion.time[near] - breaks) / np.maximum(1.0, breaks)
    there, jumps = apart <= SAME_TIME, _jumps(mechanism, breaks)
    rows = np.unique(near[there & jumps])  # to be repeated
    rows = rows[(rows > 0) & (rows < len(motion) - 1) & ~np.isin(motion.time[rows], _repeated_times(motion))]
    new = apart > LEAST_APART
    added = np.concatenate([motion.time[rows], breaks[new], breaks[new & jumps]])
    if not len(added):
        return motion
    added = np.sort(added)
    at = np.searchsorted(motion.time, added, side="right")
    time = np.insert(motion.time, at, added)
    states = zip((motion.position, motion.velocity, motion.acceleration), motion.at(added), strict=True)
    q, v, a = (np.insert(old, at, more, axis=0) for old, more in states)
    return replace(motion, time=time, position=q, velocity=v, acceleration=a)


def _at_table_times(motion: Motion, breaks: Array) -> Motion:
    """The motion, times of its rows that differ from breaks (s) only by rounding set to these."""
    if not len(breaks):
        return motion
    after = np.clip(np.searchsorted(breaks, motion.time), 1, len(breaks) - 1)
    low, high = breaks[after - 1], breaks[after]
    nearest = np.where(motion.time - low < high - motion.time, low, high)
    apart = np.abs(nearest - motion.time)
    time = np.where(apart <= SAME_TIME * np.maximum(1.0, np.abs(motion.time)), nearest, motion.time)
    return motion if np.array_equal(time, motion.time) else replace(motion, time=time)


def _repeated_times(motion: Motion) -> Array:
    """The times that occur twice."""
    return np.asarray(motion.time[1:][np.diff(motion.time) == 0.0])


def _jumps(mechanism: Mechanism, times: Array) -> Mask:
    """Whether a table jumps at each of these times."""
    found = np.zeros(len(times), dtype=bool)
    for force in mechanism.equations.forces:
        if force.source is not None:
            signal = force.source.signal
            before, after = signal.at(np.nextafter(times, -np.inf)), signal.at(times)
            scale = np.abs(signal.at(signal.breaks)).max(initial=0.0)
            found |= (np.abs(after - before) > SMALL_JUMP * scale).any(axis=1)
    return found


@dataclass(frozen=True)
class PrescribedMotionEnd:
    """The time (s) at which the velocity of a prescribed motion jumps from `before` to `after`, rad/s or m/s."""

    drive: PrescribedMotion
    time: float
    before: float
    after: float
    last: bool  # the motion ends there

    @property
    def sentence(self) -> str:
        """What happens there, with a remedy, as a clause."""
        unit = joint_unit(self.drive.joint, "velocity")
        motion = f"motion '{self.drive.place.raw('motion')}' of constraint '{self.drive.name}'"
        if self.last:
            return (
                f"{motion} ends at {self.time:.6g} s while joint '{self.drive.joint.name}' still moves at "
                f"{self.before:.4g} {unit}; end the motion at rest or later, or shorten the run"
            )
        return (
            f"{motion} jumps at {self.time:.6g} s from {self.before:.4g} to {self.after:.4g} {unit} at joint "
            f"'{self.drive.joint.name}', which needs an infinite force; join its parts at equal velocities, or shorten "
            "the run"
        )


@computed_once
def prescribed_motion_end(scene: Scene) -> PrescribedMotionEnd | None:
    """The first jump of a prescribed velocity after 0 s; None where there is none.

    Raises InputError where a motion ends at 0 s with a velocity.
    """
    found = []
    signals = dict(zip(scene.signal_sources, scene.signals, strict=True))
    for drive in scene.constraints:
        if not isinstance(drive, PrescribedMotion):
            continue
        signal = signals[drive.source]
        before, after = _speeds(signal)
        most = max(np.abs(before).max(), np.abs(after).max())
        jumps = np.abs(after - before) > MOVING * most
        if jumps[-1] and abs(signal.breaks[-1]) < AT_START:
            raise InputError(
                f"{scene.source}: motion '{drive.place.raw('motion')}' of constraint '{drive.name}' ends when the "
                f"run starts, while joint '{drive.joint.name}' still moves at {before[-1]:.4g} "
                f"{joint_unit(drive.joint, 'velocity')}; prescribe a longer motion"
            )
        for k in np.flatnonzero(jumps & (signal.breaks > 0.0))[:1].tolist():
            last = k == len(signal.breaks) - 1
            found.append(PrescribedMotionEnd(drive, float(signal.breaks[k]), float(before[k]), float(after[k]), last))
    return min(found, key=lambda end: end.time, default=None)


def signals_until(scene: Scene, time: float) -> tuple[Signal, ...]:
    """The scene's signals, those of prescribed motions cut off at a time (s), where they keep their limits from
    before.
    """
    driven = {drive.source for drive in scene.constraints if isinstance(drive, PrescribedMotion)}
    return tuple(
        _cut(signal, time) if source in driven else signal
        for source, signal in zip(scene.signal_sources, scene.signals, strict=True)
    )


def _speeds(signal: Signal) -> tuple[Array, Array]:
    """Velocities (m + 1,) before and after each break; a motion is at rest outside its own time."""
    c, h = signal.coefficients[:, :, 0], np.diff(signal.breaks)
    powers = np.arange(1, c.shape[1])
    ends = (c[:, 1:] * powers * h[:, None] ** (powers - 1)).sum(axis=1)
    return np.append(0.0, ends), np.append(c[:, 1], 0.0)


def _cut(signal: Signal, time: float) -> Signal:
    if time >= signal.breaks[-1]:
        return signal
    count = int(np.searchsorted(signal.breaks, time, side="left"))
    if count == 0:  # it is at rest until it begins
        held = np.zeros_like(signal.coefficients[:1])
        held[0, 0] = signal.coefficients[0, 0]
        return replace(signal, breaks=np.array([min(0.0, time) - 1.0, time]), coefficients=held)
    return replace(
        signal, breaks=np.append(signal.breaks[:count], time), coefficients=signal.coefficients[:count].copy()
    )
