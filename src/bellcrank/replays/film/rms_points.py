"""The RMS torque at mean speed of each motion, as points in a film's torque-speed planes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from bellcrank.replays.film.film import Plane
    from bellcrank.sizing.result import JointSizing

MOST = 3  # motions with a point each; of more, the one of the largest RMS torque has one
RPM = 30.0 / math.pi


def with_rms_points(planes: Sequence[Plane], joints: Sequence[JointSizing]) -> tuple[Plane, ...]:
    """The planes of joints, in their order, with limits of one point (1, 2): at the shaft, in rpm and N m times the
    safety factor, where there is a drive; at the joint where there is none.
    """
    return tuple(_with_points(plane, joint) for plane, joint in zip(planes, joints, strict=True))


def _with_points(plane: Plane, joint: JointSizing) -> Plane:
    drive = None if joint.shaft is None else joint.shaft.drive
    cycles = joint.cycles
    if len(cycles) > MOST:
        cycles = (max(cycles, key=lambda cycle: cycle.rms_torque),)
    points = []
    for cycle in cycles:
        speed, torque = cycle.mean_speed, cycle.rms_torque
        if drive is not None:
            speed, torque = drive.ratio * RPM * speed, drive.safety_factor * (cycle.rms_shaft_torque or 0.0)
        name = "RMS at mean speed" + (f", {cycle.motion}" if len(joint.cycles) > 1 else "")
        points.append((name, np.array([[speed, torque]])))
    return replace(plane, limits=(*plane.limits, *points))
