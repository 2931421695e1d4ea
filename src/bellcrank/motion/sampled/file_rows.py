"""Rows of a motion's file that cannot be meant as they stand: rows so close that rounding decides what lies between
them, and angles that jump by a turn because the program that wrote them keeps angles within one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.errors import InputError
from bellcrank.motion.motion import POSITION_GAP
from bellcrank.motion.sampled.file_precision import rounding_of
from bellcrank.robot.model.joints import JointLike, RobotLike

CLOSE = 1e-3  # of the median step: rows closer than this may be merged
NOISE = 0.01  # of the largest acceleration: merged where rounding may change the acceleration between rows by more
AMPLIFIED = 6.0  # times rounding / step²: what it changes in an acceleration between two rows
EQUAL = 1e-6  # of the largest: speeds and accelerations that differ by less are equal
TURN = 2.0 * np.pi
FAR = 5.0  # times the largest speed elsewhere: the speed that a jump by a turn would need
SIMILAR = 1.5  # times the largest speed elsewhere: at most the speed that is left without the turn
FEW_STEPS = 4  # steps: fewer do not say how fast a joint moves elsewhere
NAMED = 3  # places that a note names


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
