"""Notes about positions outside the URDF's limits, and about positions that may be in degrees."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bellcrank.arrays import Array
from bellcrank.robot.model.joints import RobotLike

MOST_TURNED = 4.0 * np.pi  # rad: a joint that turns further than this from 0 may be in degrees
FAR_OUT = 6.0  # rad: and so may one that leaves its range by more than this


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
