"""The pictures of a sizing: every joint over time, and its torque and speed at the joint and at the motor shaft."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.plot_style import (
    colour,
    dash,
    heading,
    legend_below,
    literal,
    new_figure,
    place,
    plain,
    write_figure,
    write_figures,
)
from bellcrank.sizing.loads.joint_histories import sizing_inputs
from bellcrank.sizing.sizing_files import file_names
from bellcrank.sizing.torque_speed_plots import DrawnMotion, drawn_motions, joint_figure, shaft_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bellcrank.sizing.result import Sizing

KINDS = ("motors", "joints", "time")
OVER_TIME = {
    "revolute": ("angle [rad]", "speed [rad/s]", "acceleration [rad/s²]", "joint torque [N m]"),
    "prismatic": ("position [m]", "speed [m/s]", "acceleration [m/s²]", "joint force [N]"),
    "screw": ("screw angle [rad]", "speed [rad/s]", "acceleration [rad/s²]", "joint torque [N m]"),
}


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
