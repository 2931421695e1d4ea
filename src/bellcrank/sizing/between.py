"""Peak torques at the rows of a motion, beside those between them, which interpolation makes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bellcrank.dynamics.mechanism import force_times
from bellcrank.motion.motion import Motion
from bellcrank.sizing.loads import Loads
from bellcrank.sizing.result import JointSizing, Peak

APART = 0.02  # of the peak: rows and what lies between them may differ by this without a warning


def peaks_at_rows(loads: Loads, motion: Motion) -> list[Peak]:
    """The largest |torque| of each joint at the rows of a motion."""
    low, high = loads.torque(
        force_times(motion.time, motion.time[-1]), motion.position, motion.velocity, motion.acceleration
    )
    torque = np.maximum(np.abs(low), np.abs(high))
    rows = torque.argmax(axis=0)
    return [
        Peak(float(torque[row, k]), float(motion.time[row]), motion.name, tuple(map(float, motion.position[row])))
        for k, row in enumerate(rows.tolist())
    ]


def between_warnings(joints: Sequence[JointSizing]) -> list[str]:
    """A sentence for each joint whose torque between rows exceeds that at the rows by more than 2 %."""
    found = []
    for joint in joints:
        peak, unit = joint.peaks["peak_torque"], joint.torque_unit
        if joint.peak_torque - joint.sampled_torque > APART * joint.peak_torque:
            found.append(
                f"joint '{joint.name}': its peak of {joint.peak_torque:.4g} {unit} lies between two rows of motion "
                f"'{peak.motion}' (at {peak.time:.4g} s), where it rests on interpolation; at the rows it is "
                f"{joint.sampled_torque:.4g} {unit}; give more rows, and accelerations where the motion has none"
            )
    return found
