"""Torque-speed plots of motors: the torque over the speed along motions, with the limits of the motor or the URDF."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeGuard

import numpy as np

from bellcrank.arrays import Array
from bellcrank.motion.sampled.resampling import ranges
from bellcrank.replays.film.charts import kept_rows
from bellcrank.replays.film.film import XYPlot

if TYPE_CHECKING:
    from bellcrank.actuators.actuator import Actuator
    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.sizing.joint_sizing import JointSizing

Limits = tuple[tuple[str, Array], ...]
RPM = 30.0 / math.pi
MOST_RMS_POINTS = 3  # motions with a point each; of more motions, the one with the largest RMS torque has a point


def motor_speed_torque(
    joint: RobotJoint, actuator: Actuator | None, torque: Array, v: Array, a: Array
) -> tuple[Array, Array]:
    """Speeds and torques (n,) of a motor for the torque (n,) at its joint.

    With an actuator they are at the motor shaft, in rpm and N m, the torque times the safety factor. Without one, and
    where the torque at the shaft is unknown, they are at the joint, in rad/s and N m, or m/s and N.
    """
    speed = v[:, joint.v]
    if at_shaft(actuator):
        torque = actuator.safety_factor * actuator.shaft_torque(torque, speed, a[:, joint.v])
        speed = actuator.ratio * RPM * speed
    return speed, torque


def at_shaft(actuator: Actuator | None) -> TypeGuard[Actuator]:
    """Whether there is an actuator whose torque at the shaft is known."""
    return actuator is not None and not actuator.unknown_of_torque


def torque_speed_plots(
    mechanism: Mechanism, actuators: Mapping[str, Actuator], error: float, time: Array, speeds: Array, torques: Array
) -> tuple[XYPlot, ...]:
    """A plot for each motor over times (n,) s of the film, from the `motor_speed_torque` (n, motors) of all.

    Limits are those of the actuator, or of the URDF if there is none. `error` is that of the rows, as in MotionSeries.
    """
    plots = []
    reach = np.stack([ranges(speeds), ranges(torques)], axis=1)
    for k, joint in enumerate(mechanism.motors):
        table = np.stack([speeds[:, k], torques[:, k]], axis=1)
        columns, tolerance = kept_rows(time, table, error, reach[k])
        rows = np.unique(np.concatenate(columns))
        actuator = actuators.get(joint.name)
        plot = shaft_plot(joint, actuator) if at_shaft(actuator) else _joint_plot(mechanism.robot, joint)
        plots.append(replace(plot, time=time[rows], x=table[rows, 0], y=table[rows, 1], tolerance=tolerance))
    return tuple(plots)


def shaft_plot(joint: RobotJoint, actuator: Actuator) -> XYPlot:
    """The plot of a motor shaft, without data."""
    factor = f" × {actuator.safety_factor:g}" if actuator.safety_factor != 1.0 else ""
    scale = np.array([RPM, 1.0])
    limits: list[tuple[str, Array]] = []
    if (outline := actuator.outline) is not None:
        name = "torque-speed curve, as far as known" if actuator.unknown_limits else "torque-speed curve"
        limits.append((name, outline * scale))
    if (continuous := actuator.continuous_outline) is not None:
        name = "rated torque (for the RMS)" + (", largest speed" if actuator.max_speed is not None else "")
        limits.append((name, _continuous_box(continuous) * scale))
    return _empty_plot(
        f"{joint.name}: motor, ratio {actuator.ratio:g}",
        "motor speed [rpm]",
        f"motor torque{factor} [N m]",
        tuple(limits),
    )


def _joint_plot(robot: Robot, joint: RobotJoint) -> XYPlot:
    """The plot of a joint without an actuator, without data."""
    linear = joint.kind == "prismatic"
    speed, effort = float(robot.velocity_limit[joint.v]), float(robot.effort_limit[joint.v])
    limits: Limits = ()
    if math.isfinite(speed) and math.isfinite(effort):
        limits = (("URDF limits", _box(speed, effort)),)
    return _empty_plot(
        joint.name, f"speed [{'m/s' if linear else 'rad/s'}]", "force [N]" if linear else "torque [N m]", limits
    )


def _empty_plot(title: str, x_label: str, y_label: str, limits: Limits) -> XYPlot:
    none = np.zeros(0)
    return XYPlot(title=title, x_label=x_label, y_label=y_label, time=none, x=none, y=none, limits=limits)


def _box(x: float, y: float) -> Array:
    return np.array([[x, y], [x, -y], [-x, -y], [-x, y], [x, y]])


def _continuous_box(curve: Array) -> Array:
    """The outline (k, 2) of the region below a curve (k, 2) of continuous torque, in all four quadrants."""
    if np.ptp(curve[:, 1]) == 0.0:
        return _box(curve[-1, 0], curve[0, 1])
    upper = np.concatenate([curve[::-1] * [-1.0, 1.0], curve])
    return np.concatenate([upper, upper[::-1] * [1.0, -1.0], upper[:1]])


def with_rms_points(plots: Sequence[XYPlot], joints: Sequence[JointSizing]) -> tuple[XYPlot, ...]:
    """The plots of joints, in their order, with the RMS torque at the mean speed of each motion as points (1, 2).

    A point is at the shaft, in rpm and N m times the safety factor, if there is an actuator, else at the joint.
    """
    return tuple(_with_rms_points(plot, joint) for plot, joint in zip(plots, joints, strict=True))


def _with_rms_points(plot: XYPlot, joint: JointSizing) -> XYPlot:
    actuator = None if joint.shaft is None else joint.shaft.actuator
    cycles = joint.cycles
    if len(cycles) > MOST_RMS_POINTS:
        cycles = (max(cycles, key=lambda cycle: cycle.rms_torque),)
    points = []
    for cycle in cycles:
        speed, torque = cycle.mean_speed, cycle.rms_torque
        if at_shaft(actuator):
            speed, torque = actuator.ratio * RPM * speed, actuator.safety_factor * (cycle.rms_shaft_torque or 0.0)
        name = "RMS at mean speed" + (f", {cycle.motion}" if len(joint.cycles) > 1 else "")
        points.append((name, np.array([[speed, torque]])))
    return replace(plot, limits=(*plot.limits, *points))
