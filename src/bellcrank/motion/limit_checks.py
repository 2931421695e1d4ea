"""Limits of motions: notes on positions outside a URDF's limits, and magnitudes beyond which nothing is computed.

Interpolation of motions divides changes by times up to the fifth power, and squares the result. Within these limits all
of that lies between 1e-300 and 1e300; the motion of any machine is far within them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.robot.model.joints import RobotLike

MOST_TURNED = 4.0 * np.pi  # rad: a joint that turns further than this from 0 may be in degrees
FAR_OUT = 6.0  # rad: and so may one that leaves its range by more than this
LONGEST = 1e30  # s, from 0
SHORTEST = 1e-20  # s, between rows
LARGEST = (1e30, 1e50, 1e70)  # of positions and of their first and second derivatives, in SI units


def limit_notes(
    robot: RobotLike,
    name: str,
    time: Array,
    position: Array,
    remedy: str = "write '45 deg'",
    noise: Sequence[float] | None = None,
) -> tuple[str, ...]:
    """A sentence for each one-degree-of-freedom joint whose position (n, nq) leaves the URDF's range, and one where
    it is so far out, or so many turns, that degrees may have been meant; `remedy` says how to write them. `noise` (nq,)
    is unknown of the positions.
    """
    notes = []
    for joint in robot.joints:
        if joint.nq != 1:
            continue
        column, lower, upper = position[:, joint.q], float(robot.lower[joint.q]), float(robot.upper[joint.q])
        excess = np.maximum(column - upper, lower - column)
        row = int(np.argmax(excess))
        if excess[row] > 1e-9 + (noise[joint.q] if noise else 0.0):
            unit = "m" if joint.kind == "prismatic" else "rad"
            notes.append(
                f"motion '{name}' leaves the range of joint '{joint.name}' ({lower:.6g} to {upper:.6g} "
                f"{unit}): it reaches {column[row]:.6g} {unit} at {time[row]:g} s"
            )
        far = int(np.argmax(np.abs(column)))
        if joint.kind == "revolute" and (abs(column[far]) > MOST_TURNED or excess[row] > FAR_OUT):
            worst = row if excess[row] > FAR_OUT else far
            notes.append(
                f"motion '{name}': joint '{joint.name}' reaches {column[worst]:.6g} rad "
                f"({np.degrees(column[worst]):.0f}°); were degrees meant? {remedy}"
            )
    return tuple(notes)


def check_times(title: str, time: Array) -> None:
    """Refuse times (n,) in s beyond LONGEST, and different ones closer than SHORTEST (InputError)."""
    if not len(time):
        return
    k = int(np.argmax(np.abs(time)))
    if abs(time[k]) > LONGEST:
        raise InputError(f"{title}: time {time[k]:g} s in row {k + 1}: expected at most {LONGEST:g} s")
    step = np.diff(time)
    close = np.flatnonzero((step > 0.0) & (step < SHORTEST))
    if len(close):
        k = int(close[0])
        raise InputError(
            f"{title}: rows {k + 1} and {k + 2} are {step[k]:.3g} s apart; use equal times for a jump, or at least "
            f"{SHORTEST:g} s"
        )


def check_size(title: str, what: str, values: Array, order: int = 0) -> None:
    """Refuse positions (n, k), or their derivatives of an order up to 2, beyond LARGEST (InputError)."""
    if not values.size or np.abs(values).max() <= LARGEST[order]:
        return
    rows = np.abs(values.reshape(len(values), -1)).max(axis=1)
    k = int(np.argmax(rows))
    raise InputError(f"{title}: {what} {rows[k]:g} in row {k + 1}: expected at most {LARGEST[order]:g}")
