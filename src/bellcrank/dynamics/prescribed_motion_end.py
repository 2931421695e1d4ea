"""Until when the motions of `drive` constraints can be followed: a speed that jumps would take an infinite force.

A motion that ends at rest is held. One that ends moving, whose speed jumps on the way, or that begins moving after the
run does, ends the run there: the joint cannot change its speed at once, and the energy of a jump would be lost without
being counted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.derived import computed_once
from bellcrank.elements.element import joint_unit
from bellcrank.elements.joint_relations import Drive
from bellcrank.elements.signals import Signal
from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

Array = NDArray[np.float64]
AT_START = 1e-12  # s
MOVING = 1e-4  # of a motion's largest speed: jumps up to this are what files round off, and are projected away


@dataclass(frozen=True)
class PrescribedMotionEnd:
    """Where the speed (rad/s or m/s) of a drive's motion jumps, s: from `before` to `after`."""

    drive: Drive
    time: float
    before: float
    after: float
    last: bool  # the motion ends there

    @property
    def sentence(self) -> str:
        """What happens there, and what to do, as a clause."""
        unit = joint_unit(self.drive.joint, "velocity")
        motion = f"the motion '{self.drive.place.raw('motion')}' of drive '{self.drive.name}'"
        if self.last:
            return (
                f"{motion} ends at {self.time:.6g} s while joint '{self.drive.joint.name}' still moves at "
                f"{self.before:.4g} {unit}; let the motion end at rest or later, or shorten the run"
            )
        return (
            f"{motion} jumps at {self.time:.6g} s from {self.before:.4g} to {self.after:.4g} {unit} at joint "
            f"'{self.drive.joint.name}', which no finite force does; let its parts meet at one speed, or shorten "
            "the run"
        )


@computed_once
def prescribed_motion_end(scene: Scene) -> PrescribedMotionEnd | None:
    """The first time after 0 s at which the speed of a drive's motion jumps; None where none does. Raises InputError
    where the motion ends moving at 0 s.
    """
    found = []
    signals = dict(zip(scene.signal_sources, scene.signals, strict=True))
    for drive in scene.constraints:
        if not isinstance(drive, Drive):
            continue
        signal = signals[drive.source]
        before, after = _speeds(signal)
        most = max(np.abs(before).max(), np.abs(after).max())
        jumps = np.abs(after - before) > MOVING * most
        if jumps[-1] and abs(signal.breaks[-1]) < AT_START:
            raise InputError(
                f"{scene.source}: the motion '{drive.place.raw('motion')}' of drive '{drive.name}' ends where the run "
                f"starts, while joint '{drive.joint.name}' still moves at {before[-1]:.4g} "
                f"{joint_unit(drive.joint, 'velocity')}; let the motion go on"
            )
        for k in np.flatnonzero(jumps & (signal.breaks > 0.0))[:1].tolist():
            last = k == len(signal.breaks) - 1
            found.append(PrescribedMotionEnd(drive, float(signal.breaks[k]), float(before[k]), float(after[k]), last))
    return min(found, key=lambda end: end.time, default=None)


def signals_until(scene: Scene, time: float) -> tuple[Signal, ...]:
    """The scene's signals, those of drives cut off at a time (s), at which they then have their limits from before."""
    driven = {drive.source for drive in scene.constraints if isinstance(drive, Drive)}
    return tuple(
        _cut(signal, time) if source in driven else signal
        for source, signal in zip(scene.signal_sources, scene.signals, strict=True)
    )


def _speeds(signal: Signal) -> tuple[Array, Array]:
    """Speeds (m + 1,) before and after each break; a motion stands still outside of its own time."""
    c, h = signal.coefficients[:, :, 0], np.diff(signal.breaks)
    powers = np.arange(1, c.shape[1])
    ends = (c[:, 1:] * powers * h[:, None] ** (powers - 1)).sum(axis=1)
    return np.append(0.0, ends), np.append(c[:, 1], 0.0)


def _cut(signal: Signal, time: float) -> Signal:
    if time >= signal.breaks[-1]:
        return signal
    count = int(np.searchsorted(signal.breaks, time, side="left"))
    if count == 0:  # it stands still until it begins
        held = np.zeros_like(signal.coefficients[:1])
        held[0, 0] = signal.coefficients[0, 0]
        return replace(signal, breaks=np.array([min(0.0, time) - 1.0, time]), coefficients=held)
    return replace(
        signal, breaks=np.append(signal.breaks[:count], time), coefficients=signal.coefficients[:count].copy()
    )
