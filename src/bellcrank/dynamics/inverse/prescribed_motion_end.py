"""How long prescribed motions can be followed: up to the first jump of a velocity, which would need infinite force.

A motion that ends at rest is held. A motion that ends with a velocity, whose velocity jumps, or that starts with a
velocity after the run has started, ends the run there: a joint cannot change its velocity at once, and the energy of
the jump would be missing from the balance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.cached_values import computed_once
from bellcrank.elements.element import joint_unit
from bellcrank.elements.joint_constraints import PrescribedMotion
from bellcrank.elements.signals import Signal
from bellcrank.errors import InputError

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene

AT_START = 1e-12  # s
MOVING = 1e-4  # of a motion's largest speed: smaller jumps are rounding of files, and are removed by projection


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
