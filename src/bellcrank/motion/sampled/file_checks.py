"""Checks of a sampled motion's file: its precision, the consistency of its columns, and rows that cannot be meant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from math import factorial

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.errors import InputError
from bellcrank.motion.coordinates import continuous, rates
from bellcrank.motion.motion import POSITION_GAP, Motion
from bellcrank.robot.model.joints import JointLike, RobotLike

TYPICAL = 8.0  # times the median residual: rounding changes no residual by more
FEW_RESIDUALS = 12  # fewer residuals than this come from jumps, not from rounding
LOOKED_AT = 64  # numbers of a column
EXACT = 12  # significant digits from which numbers count as exact
MOST = 1e-3  # of a column's range: numbers with few digits, typed by hand, are exact though they have few
# Σ|w| of the derivative w · x / h at the end of six samples h apart, which is the quintic spline's there
END_WEIGHTS = 137 / 60 + 5 + 5 + 10 / 3 + 5 / 4 + 1 / 5
SLIGHT = 0.01  # of the largest value: columns may disagree by this
CLOSE = 1e-3  # of the median step: rows closer than this may be merged
NOISE = 0.01  # of the largest acceleration: merged where rounding may change the acceleration between rows by more
AMPLIFIED = 6.0  # times rounding / step²: what it changes in an acceleration between two rows
EQUAL = 1e-6  # of the largest: speeds and accelerations that differ by less are equal
TURN = 2.0 * np.pi
FAR = 5.0  # times the largest speed elsewhere: the speed that a jump by a turn would need
SIMILAR = 1.5  # times the largest speed elsewhere: at most the speed that is left without the turn
FEW_STEPS = 4  # steps: fewer do not say how fast a joint moves elsewhere
NAMED = 3  # places that a note names


def half_unit(column: Array) -> float:
    """What is unknown of the numbers of a column (n,), in its unit; 0.0 where they have 12 significant digits or more.

    Both a fixed number of decimals and a fixed number of significant digits count: the larger of the two for the
    largest number. It is at most a thousandth of the column's range, since numbers typed by hand are exact.
    """
    numbers = np.unique(np.abs(column))
    numbers = np.concatenate([numbers[-LOOKED_AT // 2 :], numbers[:: max(1, 2 * len(numbers) // LOOKED_AT)]])
    largest = float(numbers.max(initial=0.0))
    if largest == 0.0:
        return 0.0
    written = [Decimal(repr(number)).normalize().as_tuple() for number in numbers.tolist() if number]
    digits = max(len(each.digits) for each in written)
    if digits >= EXACT:
        return 0.0
    decimals = max(-int(each.exponent) for each in written)
    unit = max(10.0**-decimals, 10.0 ** (int(np.floor(np.log10(largest))) + 1 - digits))
    return float(min(0.5 * unit, MOST * np.ptp(column)))


def end_speed_noise(time: Array, positions: Sequence[float]) -> list[float]:
    """By how much speeds at the ends may be off that come from positions known to ± `positions`, per s."""
    steps = np.diff(time)
    ends = np.concatenate([steps[:5], steps[-5:]])
    step = float(ends[ends > 0.0].min())
    return [END_WEIGHTS * half / step for half in positions]


def rounding_noise(time: Array, values: Array, order: int, rounding: float) -> bool:
    """Whether rounding shows in differences of samples (n,): exact numbers may have few decimals too."""
    width = order + 2
    if rounding == 0.0 or len(time) < width + FEW_RESIDUALS:
        return False
    most = 2.0**width * rounding / (float(time[-1] - time[0]) / (len(time) - 1)) ** order
    return typical_noise(differences(time, values, width, order), most) > 0.0


def differences(time: Array, values: Array, width: int, order: int) -> Array:
    """Divided differences (n − width,) of samples (n,) over width + 1 of them, as changes of the derivative of this
    order over one step; with width = order the derivative itself.
    """
    table = values
    for level in range(1, width + 1):
        table = np.diff(table) / (time[level:] - time[:-level])
    span = (time[width:] - time[:-width]) / width
    return np.asarray(table * factorial(width) * span ** (width - order))


def typical_noise(residuals: Array, most: float) -> float:
    """By how much rounding changes residuals, at most `most`: exact numbers of few decimals leave few residuals other
    than 0.
    """
    size = np.abs(residuals)
    size = size[size > 1e-3 * most]
    return min(most, TYPICAL * float(np.median(size))) if len(size) >= FEW_RESIDUALS else 0.0


def rounding_of(columns: Sequence[Array]) -> float:
    """Half a unit of the last decimal of the numbers in columns, by which they may be off; 0.0 where they have 12
    significant digits or more. Only the largest numbers of all columns count.
    """
    numbers = np.concatenate([np.unique(np.abs(column))[-32:] for column in columns])
    largest = float(numbers.max(initial=0.0))
    if largest == 0.0:
        return 0.0
    decimals = max(-int(Decimal(repr(number)).normalize().as_tuple().exponent) for number in numbers.tolist())
    unit = 10.0**-decimals
    return 0.0 if unit < 1e-12 * largest else 0.5 * unit


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


@dataclass(frozen=True, eq=False)
class FileRows:
    """The columns of a file: times (n,), s, positions (n, nq), and velocities and accelerations (n, nv) where it has
    them; and notes on what was changed.
    """

    time: Array
    position: Array
    velocity: Array | None
    acceleration: Array | None
    notes: tuple[str, ...] = ()


def repaired(robot: RobotLike, joints: Sequence[JointLike], rows: FileRows, name: str) -> FileRows:
    """The rows, merged where they are too close and with angles that do not jump by turns.

    Raises InputError where an angle jumps by a turn and the joint's limits do not let it pass there.
    """
    rows = _merged(joints, rows, name)
    for joint in joints:
        if joint.kind == "revolute":
            rows = _unwrapped(robot, joint, rows, name)
    return rows


def _merged(joints: Sequence[JointLike], rows: FileRows, name: str) -> FileRows:
    """Rows that rounding does not separate are one; two of one time where speeds or accelerations jump."""
    time, position = rows.time, rows.position
    step = np.diff(time)
    near = step <= CLOSE * float(np.median(step[step > 0.0])) if (step > 0.0).any() else step < 0.0
    near &= _decided_by_rounding(joints, rows, near)
    keep, times, places = np.ones(len(time), dtype=bool), time.copy(), []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
    for first, last in edges.reshape(-1, 2).tolist():  # rows first to last are close to each other
        gap = np.abs(position[last] - position[first]).max()
        if time[last] == time[first] or gap > POSITION_GAP or last - first >= len(time) - 2:
            continue
        places.append((first, last))
        keep[first + 1 : last] = False
        inside = first > 0 and last < len(time) - 1
        if inside and any(_jumps(table, first, last) for table in (rows.velocity, rows.acceleration)):
            times[last] = time[first]
        else:
            keep[first if last == len(time) - 1 else last] = False
    if not places:
        return rows
    told = [f"{a + 1} to {b + 1} at {time[a]:.6g} s ({time[b] - time[a]:.2g} s apart)" for a, b in places[:NAMED]]
    more = f", and {len(places) - NAMED} times more" if len(places) > NAMED else ""
    note = (
        f"motion '{name}': rows {', '.join(told)}{more} are closer in time than the digits of the positions allow; "
        "they were merged"
    )
    velocity, acceleration = (None if table is None else table[keep] for table in (rows.velocity, rows.acceleration))
    return FileRows(times[keep], position[keep], velocity, acceleration, (*rows.notes, note))


def _decided_by_rounding(joints: Sequence[JointLike], rows: FileRows, near: Mask) -> Mask:
    """The steps (n − 1,) in which rounding of positions may change accelerations by NOISE of the largest elsewhere."""
    step, found = np.diff(rows.time), np.zeros(len(near), dtype=bool)
    single = [joint for joint in joints if joint.nq == 1]
    table = rows.position[:, [joint.q for joint in single]]
    rounding = max(rounding_of([*table.T]), np.finfo(float).eps * (1.0 + float(np.abs(table).max()))) if single else 0.0
    apart = np.concatenate([[True], ~near])
    time, speed = rows.time[apart], np.diff(table[apart], axis=0)
    h = np.diff(time)
    if len(h) < 2 or h.min() <= 0.0:
        return near if rounding else found
    with np.errstate(all="ignore"):
        change = np.diff(speed / h[:, None], axis=0) / (0.5 * (h[1:] + h[:-1]))[:, None]
        return np.asarray(AMPLIFIED * rounding > NOISE * np.abs(change).max(initial=0.0) * step**2)


def _jumps(table: Array | None, first: int, last: int) -> bool:
    """Whether a column of a table (n, nv) changes between two rows."""
    if table is None:
        return False
    return bool(np.any(np.abs(table[last] - table[first]) > EQUAL * np.abs(table).max()))


def _unwrapped(robot: RobotLike, joint: JointLike, rows: FileRows, name: str) -> FileRows:
    """Without jumps of an angle by whole turns that no other speed in the file comes close to."""
    angle, step = rows.position[:, joint.q], np.diff(rows.time)
    change = np.diff(angle)
    turns = np.round(change / TURN)
    jump = (turns != 0.0) & (step > 0.0)
    others = (turns == 0.0) & (step > 0.0)
    if not jump.any() or np.count_nonzero(others) < FEW_STEPS:
        return rows
    with np.errstate(all="ignore"):
        fastest = float(np.abs(change[others] / step[others]).max())
        if rows.velocity is not None:
            fastest = max(fastest, float(np.abs(rows.velocity[:, joint.v]).max()))
        jump &= (np.abs(change) > FAR * fastest * step) & (np.abs(change - TURN * turns) <= SIMILAR * fastest * step)
    if not jump.any():
        return rows
    smooth = angle - TURN * np.concatenate([[0.0], np.cumsum(np.where(jump, turns, 0.0))])
    where = np.flatnonzero(jump)
    told = [
        f"{k + 1} and {k + 2} ({np.degrees(angle[k]):.4g}° to {np.degrees(angle[k + 1]):.4g}°)" for k in where[:NAMED]
    ]
    more = f", and {len(where) - NAMED} times more" if len(where) > NAMED else ""
    lower, upper = float(robot.lower[joint.q]), float(robot.upper[joint.q])
    slack = 1e-9 + rounding_of([angle])
    excess, before = (float(np.maximum(x - upper, lower - x).max()) for x in (smooth, angle))
    places = f"joint '{joint.name}' jumps by a turn between rows {', '.join(told)}{more}"
    if excess > slack >= before:
        raise InputError(
            f"{places}, which is {np.abs(change / step)[where[0]]:.3g} rad/s where the rest of the file reaches "
            f"{fastest:.3g} rad/s; without the jumps its angle leaves the joint's limits ({lower:.6g} to {upper:.6g} "
            f"rad) by {excess:.3g} rad: write angles that do not jump, within the limits, or correct the limits"
        )
    note = (
        f"motion '{name}': {places}, far faster than anything else in the file; the angle was taken to be wrapped, "
        "and is continued without the jump"
    )
    position = rows.position.copy()
    position[:, joint.q] = smooth
    return replace(rows, position=position, notes=(*rows.notes, note))
