"""Charts of a run or a motion, with as many samples as a screen can show, and torque-speed plots of motors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, TypeGuard

import numpy as np

from bellcrank.arrays import Array
from bellcrank.motion.sampled.resampling import BETWEEN, SHARE, extreme_rows, ranges
from bellcrank.replays.film.decimation import Rows, line_rows
from bellcrank.replays.film.film import Chart, FilmLine, XYPlot
from bellcrank.simulation.trajectory.plot_panels import Panel, run_panels, shown_unit

if TYPE_CHECKING:
    from bellcrank.actuators.actuator import Actuator
    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.simulation.trajectory.trajectory import Trajectory
    from bellcrank.sizing.joint_sizing import JointSizing


FORCES = ("joint torque", "joint force", "multiplier")
MOST_TIMES = 1000  # of forces, for arrows
MOST_POINTS = 2000  # of lines that are not interpolated between rows: two for each pixel of a wide screen
MOST_NUMBERS = 100_000  # of a chart
BOUND_FACTORS = (1.0, 5.0, 25.0)  # on the bound, if it takes too many numbers
ROUNDING = 0.05  # share of the bound for the rounding of times and values in a page
CHART_ORDER = ("outputs", "position", "velocity", "energy")  # first words of titles
CHART_ORDER_CONSTRAINED = ("position", "velocity", "multiplier", "energy", "outputs")
Limits = tuple[tuple[str, Array], ...]
RPM = 30.0 / math.pi
MOST_RMS_POINTS = 3  # motions with a point each; of more motions, the one with the largest RMS torque has a point


def run_charts(run: Trajectory) -> tuple[tuple[Chart, ...], Array]:
    """The charts of a run, and times (m,) s between which forces change approximately linearly.

    The charts are the panels of `bellcrank plot`, decimated and sorted: the scene's outputs (later if there are
    constraints), positions, velocities, constraint forces, energies, and then all others.
    """
    order = CHART_ORDER_CONSTRAINED if run.scene.constraints else CHART_ORDER
    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        panels = run_panels(run)
        charts = [panel_chart(panel) for panel in panels]

    def rank(each: Chart) -> int:
        word = "repeated" if each.title.startswith("outputs") and each.unit == "J" else each.title.split(" ")[0]
        return order.index(word.rstrip(":,")) if word.rstrip(":,") in order else len(order)

    forces = np.unique(np.concatenate([np.zeros(0), *(each.time for each in charts if each.title.startswith(FORCES))]))
    return tuple(sorted(charts, key=rank)), forces[:: 1 + len(forces) // MOST_TIMES]


def panel_chart(panel: Panel) -> Chart:
    """A panel as a chart, each line with the rows that linear interpolation needs, or with its extremes."""
    table = np.stack([values for _, values in panel.lines], axis=1)
    if panel.logarithmic or panel.extremes:  # residuals jump from row to row: nothing is known between them
        rows = [extreme_rows(table, MOST_POINTS)] * len(panel.lines)
        tolerance = SHARE if len(rows[0]) == len(panel.time) and not panel.extremes else None
    else:
        rows, tolerance = kept_rows(panel.time, table, panel.off)
    lines = tuple(
        FilmLine(name, values[kept], panel.time[kept]) for (name, values), kept in zip(panel.lines, rows, strict=True)
    )
    unit = shown_unit(panel.unit)  # the page shows the unit beside the title
    title, every = panel.title.removesuffix(f", {unit}"), np.unique(np.concatenate(rows))
    return Chart(
        title=title,
        unit=unit,
        time=panel.time[every],
        lines=lines,
        logarithmic=panel.logarithmic,
        tolerance=tolerance,
    )


def kept_rows(time: Array, table: Array, error: float, reach: Array | None = None) -> tuple[list[Rows], float | None]:
    """Rows to keep of each line of a table (n, lines) at times (n,), and the tolerance that they meet.

    Linear interpolation between the rows is within the tolerance, relative to the range of a line (`reach`; default:
    that of the table), of the quantity itself; `error` is that of the table's own rows. The tolerance is SHARE, more if
    that takes too many rows, and None if only extremes are kept.
    """
    reach = ranges(table) if reach is None else reach
    for factor in BOUND_FACTORS:
        bound = SHARE * (factor * (1.0 - ROUNDING) - BETWEEN) * reach
        rows = line_rows(time, table, bound, max(MOST_NUMBERS, MOST_POINTS * table.shape[1] // 10))
        if rows is not None:
            return rows, SHARE * factor + max(error - BETWEEN * SHARE, 0.0) / (1.0 - ROUNDING)
    most = max(MOST_POINTS // 10, min(MOST_POINTS, MOST_NUMBERS // table.shape[1]))
    return [extreme_rows(table[:, [k]], most) for k in range(table.shape[1])], None


def join_with_gaps(parts: Sequence[Array], gap: float = np.nan) -> Array:
    """Arrays one after the other, with a row of `gap` between each two."""
    between = np.full((1, *parts[0].shape[1:]), gap)
    rows = [row for part in parts for row in (between, part)]
    return np.concatenate(rows[1:])


def join_times(parts: Sequence[Array]) -> Array:
    """Times one after the other, with one more between each two parts, for the row that separates them."""
    rows = [parts[0]]
    for before, after in pairwise(parts):
        rows += [np.array([0.5 * (before[-1] + after[0])]), after]
    return np.concatenate(rows)


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
