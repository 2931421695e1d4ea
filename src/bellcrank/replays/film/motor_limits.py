"""What motors allow beside what a sizing asks of them: torque-speed planes, and when limits are exceeded."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.motion.resampling import ranges
from bellcrank.replays.film.charts import kept_rows
from bellcrank.replays.film.film import Plane

if TYPE_CHECKING:
    from bellcrank.actuators.actuator import Drive
    from bellcrank.dynamics.mechanism import Mechanism
    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.sizing.result import JointSizing, Peak

Array = NDArray[np.float64]
Labels = tuple[str, str, str]
Limits = tuple[tuple[str, Array], ...]
RPM = 30.0 / math.pi


def motor_state(joint: RobotJoint, drive: Drive | None, torque: Array, v: Array, a: Array) -> tuple[Array, Array]:
    """Speed and torque (n,), (n,) of a motor by the joint's `torque` (n,): at its shaft, in rpm and in N m times the
    safety factor; at the joint, in rad/s and N m (m/s and N), where there is no drive.
    """
    speed = v[:, joint.v]
    if drive is not None:
        torque = drive.safety_factor * drive.shaft_torque(torque, speed, a[:, joint.v])
        speed = drive.ratio * RPM * speed
    return speed, torque


def torque_speed_planes(
    mechanism: Mechanism, drives: Mapping[str, Drive], off: float, time: Array, speeds: Array, torques: Array
) -> tuple[Plane, ...]:
    """Each motor's torque against its speed over times (n,) s of the film, by the `motor_state` (n, motors) of all,
    with its limits: the motor's, or the URDF's where there is no drive. `off` is as Panel has it.
    """
    planes = []
    reach = np.stack([ranges(speeds), ranges(torques)], axis=1)
    for k, joint in enumerate(mechanism.motors):
        table = np.stack([speeds[:, k], torques[:, k]], axis=1)
        parts, share = kept_rows(time, table, off, reach[k])
        rows = np.unique(np.concatenate(parts))
        drive = drives.get(joint.name)
        labels, limits = _of_joint(mechanism.robot, joint) if drive is None else _of_shaft(joint, drive)
        planes.append(Plane(*labels, time[rows], table[rows, 0], table[rows, 1], limits, share))
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
