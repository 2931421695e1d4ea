"""What motors allow beside what a sizing asks of them: torque-speed planes, and when limits are exceeded."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.replays.charts import joined, joined_times
from bellcrank.replays.film import Plane
from bellcrank.replays.thinning import MOST_POINTS, series_rows
from bellcrank.sizing.history import joint_torques
from bellcrank.sizing.plots import drawn_states

if TYPE_CHECKING:
    from bellcrank.constraints.mechanism import Mechanism
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.sizing.drive import Drive
    from bellcrank.sizing.result import JointSizing, Peak

Array = NDArray[np.float64]
Labels = tuple[str, str, str]
Limits = tuple[tuple[str, Array], ...]
RPM = 30.0 / math.pi


def torque_speed_planes(
    mechanism: Mechanism, motions: Sequence[Motion], drives: Mapping[str, Drive], shifts: Sequence[float]
) -> tuple[Plane, ...]:
    """Each motor's torque against its speed over motions that begin `shifts` s later: at the shaft, times the safety
    factor, with the motor's limits; at the joint, with the URDF's, where there is no drive.
    """
    states = [drawn_states(motion) for motion in motions]
    planes = []
    for joint in mechanism.motors:
        times, speeds, torques = [], [], []
        for (time, q, v, a), shift in zip(states, shifts, strict=True):
            speed, torque = v[:, joint.v], joint_torques(mechanism, [joint], drives, time, q, v, a)[:, 0]
            if drive := drives.get(joint.name):
                torque = drive.safety_factor * drive.shaft_torque(torque, speed, a[:, joint.v])
                speed = drive.ratio * RPM * speed
            rows = series_rows(np.column_stack([speed, torque]), MOST_POINTS // len(motions))
            times.append(time[rows] + shift)
            speeds.append(speed[rows])
            torques.append(torque[rows])
        labels, limits = _of_joint(mechanism.robot, joint) if drive is None else _of_shaft(joint, drive)
        planes.append(Plane(*labels, joined_times(times), joined(speeds), joined(torques), limits))
    return tuple(planes)


def _of_shaft(joint: RobotJoint, drive: Drive) -> tuple[Labels, Limits]:
    factor = f" × {drive.safety_factor:g}" if drive.safety_factor != 1.0 else ""
    labels = (f"{joint.name}: motor, ratio {drive.ratio:g}", "motor speed [rpm]", f"motor torque{factor} [N m]")
    scale = np.array([RPM, 1.0])
    return labels, (
        ("torque-speed curve", drive.outline * scale),
        ("rated torque (for the RMS), largest speed", _box(drive.max_speed, drive.rated_torque) * scale),
    )


def _of_joint(robot: Robot, joint: RobotJoint) -> tuple[Labels, Limits]:
    linear = joint.kind == "prismatic"
    labels = (joint.name, f"speed [{'m/s' if linear else 'rad/s'}]", "force [N]" if linear else "torque [N m]")
    speed, effort = float(robot.velocity_limit[joint.v]), float(robot.effort_limit[joint.v])
    given = math.isfinite(speed) and math.isfinite(effort)
    return labels, ((("URDF limits", _box(speed, effort)),) if given else ())


def _box(x: float, y: float) -> Array:
    return np.array([[x, y], [x, -y], [-x, -y], [-x, y], [x, y]])


def exceeded_peaks(joint: JointSizing) -> list[tuple[Peak, str]]:
    """The peaks at which a limit is exceeded most, with a sentence each."""
    found = []
    for margin, peak, text in (
        (
            joint.effort_margin,
            "peak_torque",
            f"needs {joint.peak_torque:.4g} {joint.torque_unit}, beyond the URDF's limit",
        ),
        (
            joint.velocity_margin,
            "peak_speed",
            f"reaches {joint.peak_speed:.4g} {joint.speed_unit}, beyond the URDF's limit",
        ),
    ):
        if margin is not None and margin < 0.0:
            found.append((joint.peaks[peak], f"{joint.name} {text}"))
    if joint.shaft is not None:
        peaks = {
            "peak torque": joint.shaft.peak_torque, "speed": joint.shaft.peak_speed,
            "torque-speed curve": joint.shaft.curve_use,
        }  # fmt: skip
        for name, margin in joint.shaft.margins.items():
            if margin < 0.0 and name in peaks:
                found.append((peaks[name], f"{joint.name} exceeds its motor's {name} by {-margin:.1%}"))
    return found
