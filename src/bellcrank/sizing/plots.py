"""Pictures of a sizing: what every joint does over time, and where it works in the torque-speed plane."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.actuator import Drive
from bellcrank.dynamics.mechanism import Mechanism, mechanism_of
from bellcrank.errors import InputError
from bellcrank.files import atomic_write
from bellcrank.messages import unknown_name
from bellcrank.motion.motion import Motion
from bellcrank.plot_style import DPI, colour, dash, literal, new_figure, plain, save_figure
from bellcrank.sizing.history import file_names, joint_torques

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bellcrank.robot.robot import Robot, RobotJoint
    from bellcrank.sizing.result import Cycle, JointSizing, Sizing

Array = NDArray[np.float64]
POINTS = 1001  # a motion with fewer rows is drawn from this many points besides them
LEAST_WIDTH = 8.5  # inches: title and legend need it where there is one panel only
LIMIT = "#b30000"
CURVE = "#1a1a1a"
KINDS = ("motors", "joints", "time")
OVER_TIME = {
    "revolute": ("angle [rad]", "speed [rad/s]", "acceleration [rad/s²]", "joint torque [N m]"),
    "prismatic": ("position [m]", "speed [m/s]", "acceleration [m/s²]", "joint force [N]"),
}


def write_plots(
    robot: Robot | Mechanism,
    motions: Sequence[Motion],
    folder: str | Path,
    drives: Mapping[str, Drive] | None = None,
    title: str | None = None,
    mass_tolerance: float = 0.0,
    lines: Sequence[JointSizing] = (),
) -> list[Path]:
    """Write PNGs: over_time_<motion>.png, torque_speed.png and, with drives, motor_torque_speed.png; their
    paths.

    Angles in rad (m), speeds rad/s (m/s), accelerations rad/s² (m/s²), torques N m (N). All are for the
    nominal masses, and with a mass tolerance the titles say so. `lines`, a sizing's joints, give the RMS torques at
    mean speed. InputError where the folder cannot be written.
    """
    folder = Path(folder)
    figures = draw(robot, motions, drives, title, mass_tolerance, lines)
    for name, figure in figures.items():
        with atomic_write.writing(folder / name) as temporary:
            save_figure(figure, temporary, "png", dpi=DPI)
    return [folder / name for name in figures]


def draw(
    robot: Robot | Mechanism,
    motions: Sequence[Motion],
    drives: Mapping[str, Drive] | None = None,
    title: str | None = None,
    mass_tolerance: float = 0.0,
    lines: Sequence[JointSizing] = (),
) -> dict[str, Figure]:
    """The figures that `write_plots` writes, by file name."""
    mechanism = mechanism_of(robot)
    drives, title = dict(drives or {}), title or mechanism.robot.name
    note = " (nominal masses)" if mass_tolerance else ""
    joints, motors = [joint for joint in mechanism.robot.joints if joint.nv == 1], mechanism.motors
    figures: dict[str, Figure] = {}
    for motion, name in zip(motions, file_names(motions), strict=True):
        figures[f"over_time_{name}.png"] = _over_time(mechanism, joints, motion, drives, title, note)
    cycles = {line.name: line.cycles for line in lines}
    bound = " (largest within the mass tolerance)" if mass_tolerance else ""
    figures["torque_speed.png"] = _joint_plane(mechanism, motors, motions, drives, title, note, cycles, bound)
    if driven := [joint for joint in motors if joint.name in drives]:
        figures["motor_torque_speed.png"] = _shaft_plane(mechanism, driven, motions, drives, title, note, cycles, bound)
    return figures


def plot_sizing(sizing: Sizing, path: str | Path | None, what: str | None, motion: str | None) -> Figure:
    """One figure of a sizing (see `Sizing.plot`), written to `path` where one is given."""
    if sizing.study is None:
        raise InputError(f"sizing of {sizing.robot}: it does not hold its motions; make it with bellcrank.size")
    mechanism, motions, drives = sizing.study
    kind = what or ("motors" if drives else "joints")
    if kind not in KINDS:
        raise InputError(f"plot of a sizing: {unknown_name('picture', kind, KINDS)}")
    if kind == "motors" and not drives:
        raise InputError(f"sizing of {sizing.robot}: no joint has a drive, so there is nothing to draw at motor shafts")
    if motion is not None and kind != "time":
        raise InputError(f"plot of a sizing: 'motion' is for the picture 'time'; '{kind}' shows all motions")
    names = [each.name for each in motions]
    if motion is not None and motion not in names:
        raise InputError(f"sizing of {sizing.robot}: {unknown_name('motion', motion, names)}")
    shown = [motions[names.index(motion)] if motion else motions[0]] if kind == "time" else motions
    figures = draw(
        mechanism, shown, drives, sizing.robot, sizing.mass_tolerance, () if kind == "time" else sizing.joints
    )
    figure = {"motors": figures.get("motor_torque_speed.png"), "joints": figures["torque_speed.png"]}.get(kind)
    figure = next(iter(figures.values())) if figure is None else figure
    if path is not None:
        form = Path(path).suffix.removeprefix(".").lower() or "png"
        known = figure.canvas.get_supported_filetypes()
        if form not in known:
            raise InputError(f"{path}: {unknown_name('picture format', form, sorted(known))}")
        with atomic_write.writing(path) as temporary:
            save_figure(figure, temporary, form, dpi=DPI)
    return figure


def _new(columns: int, rows: int, width: float, height: float) -> tuple[Figure, Any]:
    figure = new_figure(width, height)
    return figure, figure.subplots(rows, columns, squeeze=False)


def drawn_states(motion: Motion) -> tuple[Array, Array, Array, Array]:
    """Times and states of a motion for drawing: its rows, and points between them where they are few."""
    if len(motion.time) >= POINTS:
        return motion.time, motion.position, motion.velocity, motion.acceleration
    between = np.setdiff1d(np.linspace(motion.time[0], motion.time[-1], POINTS), motion.time)
    at = np.searchsorted(motion.time, between)
    q, v, a = motion.at(between)
    return (
        np.insert(motion.time, at, between),
        np.insert(motion.position, at, q, axis=0),
        np.insert(motion.velocity, at, v, axis=0),
        np.insert(motion.acceleration, at, a, axis=0),
    )


def _over_time(
    mechanism: Mechanism,
    joints: Sequence[RobotJoint],
    motion: Motion,
    drives: Mapping[str, Drive],
    title: str,
    note: str,
) -> Figure:
    time, q, v, a = drawn_states(motion)
    torque = joint_torques(mechanism, joints, drives, time, q, v, a, float(time[-1]))
    kinds = [kind for kind in ("revolute", "prismatic") if any(joint.kind == kind for joint in joints)]
    rows = [(row, kind) for row in range(4) for kind in kinds]  # an axis each: rad and m do not share one
    figure, axes = _new(1, len(rows), 9.5, 2.5 * len(rows) + 0.5)
    for axis, (row, kind) in zip(axes[:, 0], rows, strict=True):
        for k, joint in enumerate(joints):
            if joint.kind == kind:
                values = (q[:, joint.q], v[:, joint.v], a[:, joint.v], torque[:, k])[row]
                axis.plot(time, values, color=colour(k), linestyle=dash(k), linewidth=1.3, label=literal(joint.name))
        axis.set_ylabel(OVER_TIME[kind][row])
        axis.margins(x=0.0)
        plain(axis)
    axes[-1, 0].set_xlabel("time [s]")
    figure.suptitle(literal(f"{title}: {motion.name}{note}", 90))
    columns = _columns([joint.name for joint in joints], figure)
    found = [axis.get_legend_handles_labels() for axis in axes[: len(kinds), 0]]
    figure.legend(
        [handle for handles, _ in found for handle in handles],
        [label for _, labels in found for label in labels],
        loc="outside lower center",
        ncols=columns,
        frameon=False,
        fontsize="small",
    )
    return figure


def _joint_plane(
    mechanism: Mechanism,
    joints: Sequence[RobotJoint],
    motions: Sequence[Motion],
    drives: Mapping[str, Drive],
    title: str,
    note: str,
    cycles: Mapping[str, Sequence[Cycle]],
    bound: str,
) -> Figure:
    figure, axes = _panels(len(joints))
    for axis, joint in zip(axes, joints, strict=False):
        for k, motion in enumerate(motions):
            states = drawn_states(motion)
            torque = joint_torques(mechanism, [joint], drives, *states, float(states[0][-1]))[:, 0]
            _trace(axis, states[2][:, joint.v], torque, k, motion.name)
        for k, cycle in enumerate(cycles.get(joint.name, ())):
            _rms_point(axis, cycle.mean_speed, cycle.rms_torque, k, bound)
        robot = mechanism.robot
        effort, speed = float(robot.effort_limit[joint.v]), float(robot.velocity_limit[joint.v])
        _limit_box(axis, speed, effort)
        linear = joint.kind == "prismatic"
        axis.set_xlabel(f"speed [{'m/s' if linear else 'rad/s'}]")
        axis.set_ylabel(f"{'force [N]' if linear else 'torque [N m]'}")
        missing = [what for what, limit in (("effort", effort), ("speed", speed)) if not math.isfinite(limit)]
        axis.set_title(
            literal(joint.name + (f" (no {' and '.join(missing)} limit given)" if missing else "")), fontsize="medium"
        )
    return _finish(figure, axes, len(joints), f"{title}: torque and speed at the joints, with the URDF's limits{note}")


def _shaft_plane(
    mechanism: Mechanism,
    joints: Sequence[RobotJoint],
    motions: Sequence[Motion],
    drives: Mapping[str, Drive],
    title: str,
    note: str,
    cycles: Mapping[str, Sequence[Cycle]],
    bound: str,
) -> Figure:
    figure, axes = _panels(len(joints))
    rpm = 30.0 / math.pi
    for axis, joint in zip(axes, joints, strict=False):
        drive = drives[joint.name]
        for k, motion in enumerate(motions):
            time, q, v, a = drawn_states(motion)
            load = joint_torques(mechanism, [joint], drives, time, q, v, a, float(time[-1]))[:, 0]
            torque = drive.shaft_torque(load, v[:, joint.v], a[:, joint.v])
            _trace(axis, drive.ratio * v[:, joint.v] * rpm, drive.safety_factor * torque, k, motion.name)
        for k, cycle in enumerate(cycles.get(joint.name, ())):
            speed = drive.ratio * cycle.mean_speed * rpm
            _rms_point(axis, speed, drive.safety_factor * (cycle.rms_shaft_torque or 0.0), k, bound)
        axis.plot(
            drive.outline[:, 0] * rpm,
            drive.outline[:, 1],
            color=CURVE,
            linewidth=1.2,
            solid_capstyle="projecting",
            label="torque-speed curve",
        )
        for sign in (1.0, -1.0):
            axis.axhline(
                sign * drive.rated_torque,
                color=LIMIT,
                linestyle=":",
                linewidth=1.0,
                label="rated torque (for the RMS)" if sign > 0 else None,
            )
            axis.axvline(
                sign * drive.max_speed * rpm,
                color=LIMIT,
                linestyle="--",
                linewidth=1.0,
                label="largest speed" if sign > 0 else None,
            )
        axis.set_xlabel("motor speed [rpm]")
        factor = f" × {drive.safety_factor:g}" if drive.safety_factor != 1.0 else ""
        axis.set_ylabel(f"motor torque{factor} [N m]")
        axis.set_title(literal(f"{joint.name} (ratio {drive.ratio:g})"), fontsize="medium")
    return _finish(figure, axes, len(joints), f"{title}: torque and speed at the motor shafts{note}")


def _panels(count: int) -> tuple[Figure, list[Axes]]:
    columns = min(count, 3 if count > 4 else 2)
    rows = math.ceil(count / columns)
    figure, axes = _new(columns, rows, max(LEAST_WIDTH, 4.6 * columns), 3.7 * rows + 0.9)
    return figure, list(axes.ravel())


def _finish(figure: Figure, axes: list[Axes], count: int, title: str) -> Figure:
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
    figure.suptitle(literal(title, 90))
    figure.legend(
        list(entries.values()),
        list(entries),
        loc="outside lower center",
        ncols=_columns(list(entries), figure),
        frameon=False,
        fontsize="small",
    )
    return figure


def _columns(labels: list[str], figure: Figure) -> int:
    """As many legend columns as the figure is wide enough for, about 0.085 inches a character and its key."""
    width = 0.085 * max(map(len, labels)) + 0.65
    return max(1, min(6, len(labels), int(figure.get_figwidth() / width)))


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
