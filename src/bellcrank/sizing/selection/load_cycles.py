"""The motions and pauses of a cycle, sampled where the loads change fast."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bellcrank.arrays import Array, Indices
from bellcrank.dynamics.inverse.force_table_breakpoints import force_breaks
from bellcrank.dynamics.inverse.mechanism import Mechanism, coulomb_widths
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.motion.duty_program import DutyStep
from bellcrank.motion.motion import Motion
from bellcrank.sizing.loads.motion_grid import coarse_grid_along, reversal_times, with_probes
from bellcrank.sizing.loads.series_maxima import maxima, on_grid
from bellcrank.sizing.selection.mounted_bodies import States

Torque = Callable[[Array, Array, Array, Array], Array]  # (t, q, v, a) -> (n, k)
Shafts = Callable[[Array, Array, Array], dict[str, Array]]  # torques, speeds, accelerations (n, k) of joints


@dataclass(frozen=True, eq=False)
class CyclePart:
    """A motion or a pause, sampled once.

    Attributes:
        duration: Of one pass, s.
        states: The states at its n samples.
        time: Times (n,), s, from its start.
        weight: Integration weights (n,), s, of one pass.
        interval: Number (n,) of the interval of each sample, from 0.
    """

    duration: float
    states: States
    time: Array
    weight: Array
    interval: Indices

    @property
    def intervals(self) -> int:
        """The number of its intervals."""
        return int(self.interval[-1]) + 1


@dataclass(frozen=True, eq=False)
class PlannedCycle:
    """A cycle: its name, its different parts, and (number of the part, passes) in the order of the cycle."""

    name: str
    parts: tuple[CyclePart, ...]
    order: tuple[tuple[int, int], ...]


def planned_cycles(
    mechanism: Mechanism,
    motions: Sequence[Motion],
    duty: Sequence[DutyStep] | None,
    torque: Torque,
    shafts: Shafts | None = None,
) -> tuple[PlannedCycle, ...]:
    """The one cycle of a duty program, or without one each motion as a cycle. Parts are divided where `torque` changes
    fast; the times of the largest values of what `shafts` gives are among the samples.

    Raises InputError where a step names an unknown motion, or there is no motion.
    """
    if not motions:
        raise InputError(f"loads of {mechanism.robot.name}: there is no motion; give at least one")
    if not duty:
        return tuple(
            PlannedCycle(motion.name, (motion_part(mechanism, motion, torque, shafts),), ((0, 1),))
            for motion in motions
        )
    named = {motion.name: motion for motion in motions}
    for step in duty:
        if step.motion is not None and step.motion not in named:
            raise InputError(f"duty: {unknown_name('motion', step.motion, named)}")
    if all(step.motion is None for step in duty):
        raise InputError("duty: there is no motion, only pauses; a pause holds the posture of the motion before it")
    parts: dict[tuple[str | None, float], CyclePart] = {}
    order: list[tuple[int, int]] = []
    before = next(step.motion for step in reversed(duty) if step.motion is not None)  # the cycle repeats
    for step in duty:
        key = (step.motion or before, step.pause)
        if step.motion is not None:
            before = step.motion
        if key not in parts:
            motion = named[key[0] or ""]
            parts[key] = (
                pause_part(motion, step.pause) if step.pause else motion_part(mechanism, motion, torque, shafts)
            )
        number = list(parts).index(key)
        if order and order[-1][0] == number:
            order[-1] = (number, order[-1][1] + step.repeat)
        else:
            order.append((number, step.repeat))
    return (PlannedCycle("duty", tuple(parts.values()), tuple(order)),)


def motion_part(mechanism: Mechanism, motion: Motion, torque: Torque, shafts: Shafts | None = None) -> CyclePart:
    """A motion on the grid of sizing/loads/motion_grid.py, with the times of its largest torques, speeds and powers."""
    columns = [joint.v for joint in mechanism.motors]

    def squared(t: Array, q: Array, v: Array, a: Array) -> Array:
        return np.hstack([torque(t, q, v, a), v[:, columns], a[:, columns]])

    def largest(t: Array, q: Array, v: Array, a: Array) -> dict[str, Array]:
        load, speed = torque(t, q, v, a), v[:, columns]
        found = {"load": np.abs(load), "speed": np.abs(speed), "motoring": load * speed, "generating": -load * speed}
        return found if shafts is None else found | shafts(load, speed, a[:, columns])

    grid = coarse_grid_along(motion, force_breaks(mechanism), squared, torque)
    grid = with_probes(motion, grid, reversal_times(motion, coulomb_widths(mechanism)))
    peaks = maxima(motion, grid, on_grid(motion, grid, largest), largest)
    grid = with_probes(motion, grid, np.concatenate([peak.time for peak in peaks.values()]))
    states = States(grid.force_time, grid.position, grid.velocity, grid.acceleration)
    return CyclePart(motion.duration, states, grid.time - motion.time[0], grid.weight, grid.part)


def pause_part(motion: Motion, duration: float) -> CyclePart:
    """The posture at the end of a motion, held for a time under the forces that act there at that moment."""
    rest = np.zeros((1, motion.nv))
    moment = np.nextafter(motion.time[-1:], -np.inf)
    states = States(moment, np.array(motion.position[-1:]), rest, rest)
    return CyclePart(duration, states, np.zeros(1), np.array([duration]), np.zeros(1, dtype=np.intp))
