"""Torque and speed of each chosen motor along the cycles, with what the motor allows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bellcrank.actuators.actuator import Actuator
from bellcrank.plot_style import colour, heading, legend_below, literal, new_figure, place, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bellcrank.sizing.selection.selection import AxisSelection, Selection

Array = NDArray[np.float64]
RPM = 30.0 / math.pi  # of 1 rad/s
LIMIT, CURVE, VOLTAGE = "#b30000", "#1a1a1a", "#7a5195"
MARGIN = 1.35  # of the loads and the continuous torque: so much of the plane is shown at least


def motors_figure(selection: Selection) -> Figure:
    """The torque-speed plane of each axis with a chosen pair: load points with the safety factor, RMS torque at the
    mean speed, continuous torque (S1), short-time region and voltage limit.
    """
    axes_of = [(k, one) for k, one in enumerate(selection.axes) if one.chosen is not None]
    columns = min(len(axes_of), 3 if len(axes_of) > 4 else 2)
    rows = math.ceil(len(axes_of) / columns)
    figure = new_figure(max(8.5, 4.6 * columns), 3.7 * rows + 0.9, free=True)
    axes = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for axis, (k, one) in zip(axes, axes_of, strict=False):
        _panel(axis, selection, k, one)
    for axis in axes[len(axes_of) :]:
        axis.set_visible(False)
    entries: dict[str, Any] = {}
    for axis in axes[: len(axes_of)]:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    top = heading(figure, f"{selection.robot}: torque and speed of the chosen motors")
    place(figure, top=top + 0.4, bottom=legend_below(figure, entries) + 0.45, between=0.9)
    return figure


def actuator_of(selection: Selection, one: AxisSelection) -> Actuator:
    """The actuator that was chosen for an axis, under the conditions of the axis."""
    assert one.chosen is not None
    return Actuator.of(one.chosen.motor, one.chosen.gear, one.conditions)


def _panel(axis: Axes, selection: Selection, k: int, one: AxisSelection) -> None:
    """One axis's plane."""
    actuator = actuator_of(selection, one)
    factor = one.conditions.safety_factor
    reach = np.zeros(2)
    for number, cycle in enumerate(selection.cycles):
        speed = actuator.ratio * cycle.speed[:, k]
        torque = factor * actuator.shaft_torque(cycle.torque[:, k], cycle.speed[:, k], cycle.acceleration[:, k])
        if not np.isfinite(torque).all():
            continue
        reach = np.maximum(reach, [np.abs(speed).max(), np.abs(torque).max()])
        axis.plot(
            speed * RPM, torque, color=colour(number), marker=".", markersize=2.0, linestyle="none",
            label=literal(cycle.name),
        )  # fmt: skip
        weight = cycle.weight / cycle.duration
        mean, rms = float(weight @ np.abs(speed)), float(np.sqrt(weight @ torque**2))
        axis.plot(
            [mean * RPM], [rms], color=colour(number), marker="D", markersize=6, markeredgecolor="white", zorder=4,
            linestyle="none",
        )  # fmt: skip
    axis.plot([], [], color="0.35", marker="D", markersize=5.5, linestyle="none", label="RMS at mean speed")
    reach = _limits(axis, actuator, reach)
    axis.set_xlim(-reach[0] * RPM, reach[0] * RPM)
    axis.set_ylim(-reach[1], reach[1])
    axis.locator_params(axis="x", nbins=7)
    plain(axis)
    for line in (axis.axhline, axis.axvline):
        line(0.0, color="0.6", linewidth=0.7, zorder=0)
    axis.set_xlabel("motor speed [rpm]")
    axis.set_ylabel(f"motor torque{f' × {factor:g}' if factor != 1.0 else ''} [N m]")
    unknown = "\ntorque unknown" if actuator.unknown_of_torque else ""
    assert one.chosen is not None
    axis.set_title(literal(f"{one.axis.name}: {one.chosen.id}") + unknown, fontsize="small")


def _limits(axis: Axes, actuator: Actuator, reach: Array) -> Array:
    """Draw what the motor allows, and return the half width and height that the plane shows."""
    continuous, outline = actuator.continuous_outline, actuator.outline
    if continuous is not None:
        reach = np.maximum(reach, [0.0, continuous[:, 1].max()])
        for side in (1.0, -1.0):
            for sign in (1.0, -1.0):
                label = "continuous torque (S1)" if side == sign == 1.0 else None
                axis.plot(
                    side * continuous[:, 0] * RPM, sign * continuous[:, 1], color=LIMIT, linestyle=":", linewidth=1.2,
                    label=label,
                )  # fmt: skip
    if outline is not None:
        reach = np.maximum(reach, [np.abs(outline[:, 0]).max(), min(np.abs(outline[:, 1]).max(), 3.0 * reach[1])])
        label = "short-time limits" + (", as far as known" if actuator.unknown_limits else "")
        axis.plot(outline[:, 0] * RPM, outline[:, 1], color=CURVE, linewidth=1.2, label=label)
    reach = np.where(reach > 0.0, MARGIN * reach, 1.0)
    speed = np.linspace(-reach[0], reach[0], 201)
    if (lines := actuator.short_time_region.voltage_torques(speed)) is not None:
        for torque, label in zip(lines, ("voltage limit", None), strict=True):
            axis.plot(speed * RPM, torque, color=VOLTAGE, linestyle="-.", linewidth=1.0, label=label)
    if actuator.max_speed is not None:
        for side, label in ((1.0, "largest speed"), (-1.0, None)):
            axis.axvline(side * actuator.max_speed * RPM, color=LIMIT, linestyle="--", linewidth=1.0, label=label)
    return reach
