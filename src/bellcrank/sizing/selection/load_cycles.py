"""The motions and pauses of a cycle, sampled where the loads change fast."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bellcrank.arrays import Array, Indices, Mask
from bellcrank.dynamics.inverse.input_breakpoints import force_breaks
from bellcrank.dynamics.inverse.mechanism import Mechanism, coulomb_widths
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.motion.coordinates import continuous, position_labels, velocity_labels
from bellcrank.motion.motion import AT_REST, NOISE, POSITION_GAP, Motion
from bellcrank.motion.motion_entry import DutyStep
from bellcrank.sizing.loads.motion_grid import coarse_grid_along, reversal_times, with_probes
from bellcrank.sizing.loads.series_maxima import maxima, on_grid
from bellcrank.sizing.selection.mounted_bodies import States

_LEFT_OUT = "the transition is not included in the loads"
Torque = Callable[[Array, Array, Array, Array], Array]  # (t, q, v, a) -> (n, k)
Shafts = Callable[[Array, Array, Array], dict[str, Array]]  # torques, speeds, accelerations (n, k) of joints


def transition_notes(
    mechanism: Mechanism, motions: Sequence[Motion], duty: Sequence[DutyStep] | None
) -> tuple[str, ...]:
    """A sentence for each place where a cycle jumps: where a motion does not start as the one before it ends, or does
    not rest at a pause. The motions are those that the steps of the duty program name.
    """
    unlimited = _unlimited(mechanism)
    if not duty:
        return tuple(note for motion in motions for note in _jumps(motion, motion, unlimited))
    named = {motion.name: motion for motion in motions}
    found: list[str] = []
    before = named[next(step.motion for step in reversed(duty) if step.motion is not None)]
    for step, following in pairwise([*duty, duty[0]]):
        if step.motion is not None:
            before = named[step.motion]
            if step.repeat > 1:
                found += _jumps(before, before, unlimited)
        if following.motion is not None:
            found += _jumps(before, named[following.motion], unlimited, paused=step.motion is None)
        elif step.motion is not None:
            found += _moving_stop(before)
    if len(force_breaks(mechanism)):
        found.append(
            "the tables of the scene's forces are evaluated at the times of each motion, not at those of the duty "
            "program; in a pause they keep the value at the end of the motion before it"
        )
    return tuple(dict.fromkeys(found))


def _unlimited(mechanism: Mechanism) -> Mask:
    """Which positions (nq,) are angles of joints without limits, in which a whole turn changes nothing."""
    robot = mechanism.robot
    unlimited = np.zeros(robot.nq, dtype=bool)
    for joint in robot.joints:
        if joint.kind == "revolute":
            unlimited[joint.q] = bool(np.isinf(robot.lower[joint.q]) and np.isinf(robot.upper[joint.q]))
    return unlimited


def _jumps(before: Motion, after: Motion, unlimited: Mask, paused: bool = False) -> list[str]:
    """Sentences about the largest jump in position, and in velocity, from the end of a motion to the start of one."""
    signs = continuous(before.joints, np.stack([before.position[-1], after.position[0]]))[1]
    gap = after.position[0] * signs - before.position[-1]
    gap = np.where(unlimited, (gap + np.pi) % (2.0 * np.pi) - np.pi, gap)
    unknown = np.array(before.position_noise) + np.array(after.position_noise)
    found = []
    where = "repeats" if after is before else f"is followed by motion '{after.name}'"
    if (wrong := np.abs(gap) > POSITION_GAP + unknown).any():
        column = int(np.argmax(np.where(wrong, np.abs(gap), 0.0)))
        name, unit = position_labels(before.joints)[column]
        others = f" (the largest of {int(wrong.sum())} jumps)" if wrong.sum() > 1 else ""
        found.append(
            f"motion '{before.name}' {where}, which starts elsewhere: {name} jumps by {gap[column]:.4g} {unit}, from "
            f"{before.position[-1, column]:.4g} to {after.position[0, column]:.4g} {unit}{others}; {_LEFT_OUT}"
        )
    start = np.zeros(before.nv) if paused else before.velocity[-1]
    change = after.velocity[0] - start
    if (wrong := np.abs(change) > np.maximum(_rest(before), _rest(after))).any():
        column = int(np.argmax(np.where(wrong, np.abs(change), 0.0)))
        name, unit = velocity_labels(before.joints)[column]
        what = (
            f"starts after a pause with {name}" if paused else f"{where} with a jump of {name} by {change[column]:.4g}"
        )
        who = after.name if paused else before.name
        value = f" {after.velocity[0, column]:.4g}" if paused else ""
        found.append(f"motion '{who}' {what}{value} {unit}; {_LEFT_OUT}")
    return found


def _moving_stop(motion: Motion) -> list[str]:
    """A sentence where a motion before a pause does not end at rest."""
    speed = np.abs(motion.velocity[-1])
    if not (moving := speed > _rest(motion)).any():
        return []
    column = int(np.argmax(np.where(moving, speed, 0.0)))
    name, unit = velocity_labels(motion.joints)[column]
    return [
        f"motion '{motion.name}' ends before a pause with {name} {motion.velocity[-1, column]:.4g} {unit}; {_LEFT_OUT}"
    ]


def _rest(motion: Motion) -> Array:
    """Speeds (nv,) up to which a motion counts as at rest, as in `Motion.warnings`."""
    peak = float(np.max(np.abs(motion.velocity), initial=0.0))
    return np.maximum(AT_REST * peak, np.minimum(motion.speed_noise, NOISE * peak))


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
