"""Whether the motions of a cycle meet: the transition between two that do not is not part of the loads."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.dynamics.inverse.force_table_breakpoints import force_breaks
from bellcrank.motion.coordinates import continuous, position_labels, velocity_labels
from bellcrank.motion.duty_program import DutyStep
from bellcrank.motion.motion import AT_REST, NOISE, POSITION_GAP, Motion

if TYPE_CHECKING:
    from bellcrank.dynamics.inverse.mechanism import Mechanism

_LEFT_OUT = "the transition is not included in the loads"


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
