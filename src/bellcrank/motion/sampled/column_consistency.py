"""Consistency of the columns of a sampled motion: velocities with positions, accelerations with velocities."""

from __future__ import annotations

import numpy as np

from bellcrank.arrays import Array
from bellcrank.motion.coordinates import continuous, rates
from bellcrank.motion.motion import POSITION_GAP, Motion
from bellcrank.motion.sampled.file_precision import rounding_of

SLIGHT = 0.01  # of the largest value: columns may disagree by this


def inconsistencies(
    motion: Motion, time: Array, position: Array, velocity: Array, acceleration: Array | None
) -> tuple[str, ...]:
    """A sentence where the velocities (n, nv) do not integrate to the positions (n, nq), and where the accelerations
    (n, nv), if given, do not integrate to the velocities; `motion` is what was made of them.
    """
    rows = acceleration
    if rows is None:
        rows = motion.acceleration[np.searchsorted(motion.time, time)]
    found = _of_velocity(motion, time, position, velocity, rows)
    return found if acceleration is None else found + _of_acceleration(motion, time, velocity, acceleration)


def _of_velocity(motion: Motion, time: Array, position: Array, velocity: Array, acceleration: Array) -> tuple[str, ...]:
    """By the Hermite rule of order 4 a step; a jump of acceleration may change it by an eighth of jump h²."""
    joints = motion.joints
    smooth = position * continuous(joints, position)
    qd, qdd = rates(joints, smooth, velocity, acceleration)
    h = np.diff(time)[:, None]
    change = 0.5 * h * (qd[1:] + qd[:-1]) - h * h / 12.0 * (qdd[1:] - qdd[:-1])
    wrong = np.abs(np.diff(smooth, axis=0) - change)
    size = np.max(np.abs(h * qd[1:]), axis=0, initial=0.0)
    excess = wrong - SLIGHT * size - POSITION_GAP - h * h / 8.0 * np.abs(qdd[1:] - qdd[:-1])
    if position.shape[1] == velocity.shape[1]:  # one coordinate a joint
        excess -= 2.0 * np.array(motion.position_noise) + h * np.array(motion.speed_noise)
    if excess.size == 0 or np.max(excess) <= 0.0:
        return ()
    row, column = np.unravel_index(int(np.argmax(excess)), excess.shape)
    joint = next(joint for joint in joints if joint.q <= column < joint.q + joint.nq)
    return (
        f"motion '{motion.name}': the velocity of joint '{joint.name}' does not agree with its position: between "
        f"{time[row]:g} s and {time[row + 1]:g} s the position changes by "
        f"{smooth[row + 1, column] - smooth[row, column]:.4g}, the velocity says {change[row, column]:.4g}",
    )


def _of_acceleration(motion: Motion, time: Array, velocity: Array, acceleration: Array) -> tuple[str, ...]:
    """The mean acceleration of a step lies within the samples around it, or a little outside where they bend."""
    h = np.diff(time)
    there = h > 0.0
    if not there.any():
        return ()
    slight = 4.0 * POSITION_GAP / float(np.sum(h)) ** 2  # over the whole time it moves a joint by twice the gap
    found = []
    for joint in motion.joints:
        if joint.nv != 1:
            continue
        v, a = velocity[:, joint.v], acceleration[:, joint.v]
        around = np.stack([np.roll(a, 1)[:-1], a[:-1], a[1:], np.roll(a, -1)[1:]])
        around[0, 0], around[3, -1] = a[0], a[-1]
        low, high = around.min(axis=0), around.max(axis=0)
        mean = np.diff(v)[there] / h[there]
        doubt = SLIGHT * np.abs(a).max() + slight + 0.25 * (high - low)[there] + 2.0 * rounding_of([v]) / h[there]
        excess = np.maximum(mean - high[there], low[there] - mean) - doubt
        if excess.max() <= SLIGHT * np.abs(mean).max():
            continue
        step = int(np.argmax(excess))
        row = int(np.flatnonzero(there)[step])
        unit = "m/s²" if joint.kind == "prismatic" else "rad/s²"
        found.append(
            f"motion '{motion.name}': the acceleration of joint '{joint.name}' does not agree with its velocity: "
            f"between {time[row]:g} s and {time[row + 1]:g} s the velocity says {mean[step]:.4g} {unit}, the "
            f"acceleration {low[row]:.4g} to {high[row]:.4g} {unit}; check the units of its columns"
        )
    return tuple(found)
