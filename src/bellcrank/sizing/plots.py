"""The pictures of a sizing: every joint over time, and its torque and speed at the joint and at the motor shaft."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.config.units import RPM
from bellcrank.dynamics.inverse.input_breakpoints import force_times
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.present.plot_style import (
    colour,
    dash,
    heading,
    legend_below,
    literal,
    new_figure,
    place,
    plain,
    title_above,
    write_figure,
    write_figures,
)
from bellcrank.sizing.loads.joint_histories import SampledStates, joint_torques, sizing_inputs
from bellcrank.sizing.loads.motion_grid import motion_sides
from bellcrank.sizing.sizing_files import file_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bellcrank.actuators.actuator import Actuator
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import RobotJoint
    from bellcrank.sizing.loads.joint_histories import SizingInputs
    from bellcrank.sizing.result import Sizing


# ---- A motion as it is drawn: dense states, and the torques of all joints at them.


POINTS = 1001  # a motion with fewer rows is drawn with this many points besides them
LEAST_WIDTH = 8.5  # inches: title and legend need it where there is one panel only
LIMIT = "#b30000"
CURVE = "#1a1a1a"
KINDS = ("motors", "joints", "time")
OVER_TIME = {
    "revolute": ("angle [rad]", "speed [rad/s]", "acceleration [rad/s²]", "joint torque [N m]"),
    "prismatic": ("position [m]", "speed [m/s]", "acceleration [m/s²]", "joint force [N]"),
    "screw": ("screw angle [rad]", "speed [rad/s]", "acceleration [rad/s²]", "joint torque [N m]"),
}


@dataclass(frozen=True, eq=False)
class DrawnMotion:
    """States of a motion, and the torques (n, len(joints)), N m or N, of the joints with one degree of freedom.

    `sided` are the velocities (n, nv) with the signs of their sides (sizing/loads/motion_grid.py).
    """

    name: str
    joints: tuple[RobotJoint, ...]
    states: SampledStates
    torque: Array
    sided: Array

    def torque_of(self, joint: str) -> Array:
        """The torque (n,) of one joint."""
        return self.torque[:, [each.name for each in self.joints].index(joint)]


def drawn_motions(inputs: SizingInputs) -> list[DrawnMotion]:
    """The motions of a sizing as they are drawn."""
    mechanism, motions, actuators = inputs
    joints = tuple(joint for joint in mechanism.robot.joints if joint.nv == 1)
    drawn = []
    for motion in motions:
        states = drawn_states(motion)
        end = float(states.time[-1])
        torque = joint_torques(mechanism, joints, actuators, states, end)
        sided = motion_sides(motion).of_velocity(force_times(states.time, end), states.velocity)
        drawn.append(DrawnMotion(motion.name, joints, states, torque, sided))
    return drawn


def drawn_states(motion: Motion) -> SampledStates:
    """The rows of a motion, and points between them where there are few."""
    rows = SampledStates(motion.time, motion.position, motion.velocity, motion.acceleration)
    if len(motion.time) >= POINTS:
        return rows
    between = np.setdiff1d(np.linspace(motion.time[0], motion.time[-1], POINTS), motion.time)
    at = np.searchsorted(motion.time, between)
    values = (between, *motion.at(between))
    return SampledStates(*(np.insert(old, at, new, axis=0) for old, new in zip(rows, values, strict=True)))


def joint_figure(sizing: Sizing, motions: Sequence[DrawnMotion]) -> Figure:
    """Torque over speed of each motor's joint, with the RMS torque of each motion and the URDF's limits."""
    robot, joints = sizing_inputs(sizing).mechanism.robot, sizing_inputs(sizing).mechanism.motors
    cycles = {joint.name: joint.cycles for joint in sizing.joints}
    figure, axes = _panels(len(joints))
    for axis, joint in zip(axes, joints, strict=False):
        for k, motion in enumerate(motions):
            _trace(axis, motion.states.velocity[:, joint.v], motion.torque_of(joint.name), k, motion.name)
        for k, cycle in enumerate(cycles[joint.name]):
            _rms_point(axis, cycle.mean_speed, cycle.rms_torque, k, _bound(sizing))
        effort, speed = float(robot.effort_limit[joint.v]), float(robot.velocity_limit[joint.v])
        _limit_box(axis, speed, effort)
        linear = joint.kind == "prismatic"
        axis.set_xlabel(f"speed [{'m/s' if linear else 'rad/s'}]")
        axis.set_ylabel("force [N]" if linear else "torque [N m]")
        missing = [what for what, limit in (("effort", effort), ("speed", speed)) if not math.isfinite(limit)]
        given = f" (no {' and '.join(missing)} limit given)" if missing else ""
        title_above(axis, literal(joint.name + given), fontsize="medium")
    title = f"{sizing.robot}: torque and speed at the joints, with the URDF's limits{_note(sizing)}"
    return _finish(figure, axes, len(joints), title)


def shaft_figure(sizing: Sizing, motions: Sequence[DrawnMotion]) -> Figure:
    """Torque, with the safety factor, over speed of each motor's shaft, with its RMS torques and its limits."""
    mechanism, _, actuators = sizing_inputs(sizing)
    joints = [joint for joint in mechanism.motors if joint.name in actuators]
    cycles = {joint.name: joint.cycles for joint in sizing.joints}
    figure, axes = _panels(len(joints))
    for axis, joint in zip(axes, joints, strict=False):
        actuator = actuators[joint.name]
        known = not actuator.unknown_of_torque
        for k, motion in enumerate(motions):
            _, _, v, a = motion.states
            torque = actuator.shaft_torque(motion.torque_of(joint.name), motion.sided[:, joint.v], a[:, joint.v])
            speed = actuator.ratio * v[:, joint.v] * RPM
            if known:
                _trace(axis, speed, actuator.safety_factor * torque, k, motion.name)
        for k, cycle in enumerate(cycles[joint.name]):
            if cycle.rms_shaft_torque is not None:
                rms = actuator.safety_factor * cycle.rms_shaft_torque
                _rms_point(axis, actuator.ratio * cycle.mean_speed * RPM, rms, k, _bound(sizing))
        _limits(axis, actuator)
        axis.set_xlabel("motor speed [rpm]")
        factor = f" × {actuator.safety_factor:g}" if actuator.safety_factor != 1.0 else ""
        axis.set_ylabel(f"motor torque{factor} [N m]")
        missing = "" if known else ", torque unknown"
        title_above(axis, literal(f"{joint.name} (ratio {actuator.ratio:g}{missing})"), fontsize="medium")
    title = f"{sizing.robot}: torque and speed at the motor shafts{_note(sizing)}"
    return _finish(figure, axes, len(joints), title)


def _limits(axis: Axes, actuator: Actuator) -> None:
    """The limits of a motor that are known."""
    outline, speed = actuator.outline, actuator.max_speed
    if outline is not None:
        axis.plot(
            outline[:, 0] * RPM,
            outline[:, 1],
            color=CURVE,
            linewidth=1.2,
            solid_capstyle="projecting",
            label="torque-speed curve" + (", as far as known" if actuator.unknown_limits else ""),
        )
    _continuous(axis, actuator)
    for sign in (1.0, -1.0):
        if speed is not None:
            label = "largest speed" if sign > 0.0 else None
            axis.axvline(sign * speed * RPM, color=LIMIT, linestyle="--", linewidth=1.0, label=label)


def _continuous(axis: Axes, actuator: Actuator) -> None:
    """The continuous torque, which bounds the RMS torque at the mean speed; a line across where it is constant."""
    curve = actuator.continuous_outline
    if curve is None:
        return
    for sign, label in ((1.0, "rated torque (for the RMS)"), (-1.0, None)):
        if np.ptp(curve[:, 1]) == 0.0:
            axis.axhline(sign * curve[0, 1], color=LIMIT, linestyle=":", linewidth=1.0, label=label)
        else:
            for side in (1.0, -1.0):
                axis.plot(
                    side * curve[:, 0] * RPM,
                    sign * curve[:, 1],
                    color=LIMIT,
                    linestyle=":",
                    linewidth=1.0,
                    label=label if side > 0.0 else None,
                )


def _note(sizing: Sizing) -> str:
    return " (nominal masses)" if sizing.mass_tolerance else ""


def _bound(sizing: Sizing) -> str:
    return " (largest within the mass tolerance)" if sizing.mass_tolerance else ""


def _panels(count: int) -> tuple[Figure, list[Axes]]:
    columns = min(count, 3 if count > 4 else 2)
    rows = math.ceil(count / columns)
    figure = new_figure(max(LEAST_WIDTH, 4.6 * columns), 3.7 * rows + 0.9, free=True)
    return figure, list(figure.subplots(rows, columns, squeeze=False).ravel())


def _finish(figure: Figure, axes: list[Axes], count: int, title: str) -> Figure:
    """The figure with axes through the origin, a title and a legend; axes beyond the first `count` are hidden."""
    from matplotlib.lines import Line2D

    for axis in axes[count:]:
        axis.set_visible(False)
    for axis in axes[:count]:
        plain(axis)
        axis.locator_params(axis="x", nbins=7)
        axis.axhline(0.0, color="0.6", linewidth=0.7, zorder=0)
        axis.axvline(0.0, color="0.6", linewidth=0.7, zorder=0)
    entries: dict[str, Any] = {}
    for axis in axes[:count]:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    entries["start"] = Line2D([], [], color="0.35", marker="o", markersize=3.5, linestyle="none")
    place(figure, top=heading(figure, title) + 0.25, bottom=legend_below(figure, entries) + 0.45, between=0.75)
    return figure


def _trace(axis: Axes, speed: Array, torque: Array, k: int, name: str) -> None:
    """One motion in a torque-speed plane; its start is marked, so that a joint at rest can be seen too."""
    axis.plot(speed, torque, color=colour(k), linewidth=1.3, label=literal(name))
    axis.plot(speed[:1], torque[:1], color=colour(k), marker="o", markersize=3.5, linestyle="none")


def _rms_point(axis: Axes, speed: float, torque: float, k: int, bound: str) -> None:
    """The RMS torque of one motion at its mean speed."""
    axis.plot(
        [speed], [torque], color=colour(k), marker="D", markersize=5.5, markeredgecolor="white", markeredgewidth=0.8,
        linestyle="none", zorder=4,
    )  # fmt: skip
    axis.plot([], [], color="0.35", marker="D", markersize=5.5, linestyle="none", label=f"RMS at mean speed{bound}")


def _limit_box(axis: Axes, speed: float, effort: float) -> None:
    label: str | None = "URDF limits"
    for sign in (1.0, -1.0):
        if math.isfinite(effort):
            axis.axhline(sign * effort, color=LIMIT, linestyle="--", linewidth=1.0, label=label)
            label = None
        if math.isfinite(speed):
            axis.axvline(sign * speed, color=LIMIT, linestyle="--", linewidth=1.0, label=label)
            label = None


def write_plots(sizing: Sizing, folder: str | Path) -> list[Path]:
    """Write the figures of a sizing as PNG into a folder, and return their paths.

    Raises InputError where a file cannot be written.
    """
    return write_figures(_figures(sizing), Path(folder))


def sizing_figures(sizing: Sizing) -> dict[str, Figure]:
    """All figures of a sizing by file name: over_time_<motion>.png for each motion, torque_speed.png and, with
    actuators, motor_torque_speed.png.

    They are for the nominal masses, which the titles say where the sizing has a mass tolerance.
    """
    return {name: draw() for name, draw in _figures(sizing).items()}


def _figures(sizing: Sizing) -> dict[str, Callable[[], Figure]]:
    inputs = sizing_inputs(sizing)
    drawn = drawn_motions(inputs)
    names = file_names(inputs.motions)
    figures: dict[str, Callable[[], Figure]] = {
        f"over_time_{name}.png": partial(_over_time_figure, sizing, motion)
        for motion, name in zip(drawn, names, strict=True)
    }
    figures["torque_speed.png"] = partial(joint_figure, sizing, drawn)
    if any(joint.shaft for joint in sizing.joints):
        figures["motor_torque_speed.png"] = partial(shaft_figure, sizing, drawn)
    return figures


def plot_sizing(sizing: Sizing, path: str | Path | None, what: str | None, motion: str | None) -> Figure:
    """One figure of a sizing (see `Sizing.plot`), written to `path` where one is given."""
    inputs = sizing_inputs(sizing)
    kind = what or ("motors" if inputs.actuators else "joints")
    if kind not in KINDS:
        raise InputError(f"plot of a sizing: {unknown_name('picture', kind, KINDS)}")
    if kind == "motors" and not inputs.actuators:
        raise InputError(
            f"sizing of {sizing.robot}: no joint has an actuator, so there is nothing to draw at motor shafts"
        )
    if motion is not None and kind != "time":
        raise InputError(f"plot of a sizing: 'motion' is for the picture 'time'; '{kind}' shows all motions")
    names = [each.name for each in inputs.motions]
    if motion is not None and motion not in names:
        raise InputError(f"sizing of {sizing.robot}: {unknown_name('motion', motion, names)}")
    if kind == "time":
        one = inputs.motions[names.index(motion) if motion else 0]
        figure = _over_time_figure(sizing, drawn_motions(inputs._replace(motions=(one,)))[0])
    else:
        figure = (shaft_figure if kind == "motors" else joint_figure)(sizing, drawn_motions(inputs))
    return write_figure(figure, path)


def _over_time_figure(sizing: Sizing, motion: DrawnMotion) -> Figure:
    """Position, speed, acceleration and torque of all joints over a motion, those of each kind on axes of their own."""
    joints = motion.joints
    time, q, v, a = motion.states
    kinds = [kind for kind in OVER_TIME if any(joint.kind == kind for joint in joints)]
    rows = [(row, kind) for row in range(4) for kind in kinds]
    figure = new_figure(9.5, 2.5 * len(rows) + 0.5, free=True)
    axes: list[Axes] = list(figure.subplots(len(rows), 1, squeeze=False)[:, 0])
    for axis, (row, kind) in zip(axes, rows, strict=True):
        for k, joint in enumerate(joints):
            if joint.kind == kind:
                values = (q[:, joint.q], v[:, joint.v], a[:, joint.v], motion.torque[:, k])[row]
                axis.plot(time, values, color=colour(k), linestyle=dash(k), linewidth=1.3, label=literal(joint.name))
        axis.set_ylabel(OVER_TIME[kind][row])
        axis.margins(x=0.0)
        plain(axis)
    axes[-1].set_xlabel("time [s]")
    note = " (nominal masses)" if sizing.mass_tolerance else ""
    entries = [axis.get_legend_handles_labels() for axis in axes[: len(kinds)]]
    below = legend_below(figure, {label: handle for pair in entries for handle, label in zip(*pair, strict=True)})
    place(figure, top=heading(figure, f"{sizing.robot}: {motion.name}{note}"), bottom=below + 0.45)
    return figure
