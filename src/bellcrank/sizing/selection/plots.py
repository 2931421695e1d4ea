"""The pictures of a selection: torque and speed of each chosen motor, utilisation of each criterion, Pareto points."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.arrays import Array
from bellcrank.config.units import RPM
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.present.plot_style import (
    colour,
    figures_aside,
    heading,
    legend_below,
    legend_columns,
    literal,
    new_figure,
    place,
    plain,
    title_above,
    write_figure,
)
from bellcrank.sizing.selection.tables import percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bellcrank.sizing.selection.criteria import CriterionResult
    from bellcrank.sizing.selection.selection import AxisSelection, ParetoPoint, Selection

KINDS = ("motors", "utilisation", "pareto")
COLOURS = {"inside": "#0072B2", "exceeded": "#b30000"}
ESTIMATE = "0.75"
LIMIT = "#1a1a1a"
SHOWN = 1.5  # a bar of a larger utilisation is cut off here, and its number says how large it is


def selection_figures(selection: Selection) -> dict[str, Figure]:
    """All figures of a selection by file name; that of the motors only where one was chosen."""
    return {name: draw() for name, draw in _figures(selection).items()}


def _figures(selection: Selection) -> dict[str, Callable[[], Figure]]:
    figures: dict[str, Callable[[], Figure]] = {}
    if any(one.chosen is not None for one in selection.axes):
        figures["motors.png"] = partial(motors_figure, selection)
        figures["utilisation.png"] = partial(utilisation_figure, selection)
    if selection.pareto:
        figures["pareto.png"] = partial(pareto_figure, selection)
    return figures


def plots_aside(selection: Selection, folder: Path) -> AbstractContextManager[Callable[[], list[Path]]]:
    """Write the figures of a selection as PNG into a folder while a block runs; see `figures_aside`."""
    return figures_aside(_figures(selection), folder)


def plot_selection(selection: Selection, path: str | Path | None, what: str | None) -> Figure:
    """One figure of a selection (see `Selection.plot`), written to `path` where one is given. Raises InputError."""
    kind = what or "motors"
    if kind not in KINDS:
        raise InputError(f"plot of a selection: {unknown_name('picture', kind, KINDS)}")
    figures = _figures(selection)
    if f"{kind}.png" not in figures:
        raise InputError(f"selection for {selection.robot}: nothing fits, so there is nothing to draw as '{kind}'")
    figure = figures[f"{kind}.png"]()
    return write_figure(figure, path)


def utilisation_figure(selection: Selection) -> Figure:
    """A bar of utilisation for each criterion of each chosen pair, and of all axes together."""
    panels = [(_title(one), _judged(one.chosen.criteria)) for one in selection.axes if one.chosen]
    if system := _judged(selection.system):
        panels.append(("all axes together", system))
    heights = [max(2, len(results)) for _, results in panels]
    figure = new_figure(9.0, 0.27 * sum(heights) + 0.75 * len(panels) + 0.8, free=True)
    axes = figure.subplots(len(panels), 1, squeeze=False, sharex=True, height_ratios=heights)[:, 0]
    for axis, (title, results) in zip(axes, panels, strict=True):
        _bars(axis, results)
        title_above(axis, literal(title, 100), fontsize="medium", loc="left")
    axes[-1].set_xlabel("utilisation: 100 % is the limit")
    axes[-1].xaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    top = heading(figure, f"{selection.robot}: utilisation of the chosen motors and gears")
    longest = max(len(each.name) for _, results in panels for each in results)
    place(figure, left=0.2 + 0.075 * longest, top=top + 0.25)
    return figure


def pareto_figure(selection: Selection) -> Figure:
    """Largest utilisation over total mass of the combinations that no other one betters; loss as colour of the points.

    Combinations of unknown mass stand at the right edge.
    """
    points = selection.pareto
    known = [point for point in points if point.mass is not None]
    others = [point for point in points if point.mass is None]
    figure = new_figure(8.5, 5.0)
    axis = figure.subplots()
    _pareto_points(axis, known)
    if others:
        edge = 1.15 * max((point.mass for point in known if point.mass is not None), default=1.0)
        axis.plot(
            [edge] * len(others),
            [point.largest_use for point in others],
            marker="x",
            color="0.45",
            linestyle="none",
            label="mass unknown",
        )
    uses = [one.chosen.largest_use for one in selection.axes if one.chosen]
    if selection.mass is not None and uses:
        axis.plot(
            [selection.mass], [max(uses)], marker="o", markersize=13, markerfacecolor="none", color=LIMIT,
            linestyle="none", label="chosen",
        )  # fmt: skip
    axis.axhline(1.0, color=LIMIT, linestyle="--", linewidth=1.0, label="limit")
    axis.set_xlabel("mass of all motors and gears [kg]")
    axis.set_ylabel("largest known utilisation")
    axis.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
    plain(axis)
    axis.set_axisbelow(True)
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside lower center", ncols=legend_columns(labels, figure), frameon=False,
        fontsize="small",
    )  # fmt: skip
    figure.suptitle(literal(f"{selection.robot}: combinations that no other one betters", 90))
    return figure


def _pareto_points(axis: Axes, points: Sequence[ParetoPoint]) -> None:
    lossy = [point for point in points if point.loss is not None]
    bare = [point for point in points if point.loss is None]
    if lossy:
        drawn = axis.scatter(
            _numbers(point.mass for point in lossy),
            [point.largest_use for point in lossy],
            c=_numbers(point.loss for point in lossy),
            cmap="viridis",
            s=28,
            label="loss as in the scale",
        )
        axis.figure.colorbar(drawn, ax=axis, label="mean loss [W]")
    if bare:
        axis.plot(
            _numbers(point.mass for point in bare),
            [point.largest_use for point in bare],
            marker="o",
            markersize=5,
            color=colour(1),
            linestyle="none",
            label="loss unknown",
        )


def _numbers(values: Iterable[float | None]) -> list[float]:
    """Numbers, NaN where unknown, which is not drawn."""
    return [math.nan if value is None else value for value in values]


def _judged(results: Sequence[CriterionResult]) -> list[CriterionResult]:
    return [each for each in results if each.verdict != "note"]


def _title(one: AxisSelection) -> str:
    return f"{one.axis.name}: {one.chosen.id} ({one.chosen.tier})" if one.chosen else one.axis.name


def _bars(axis: Axes, results: Sequence[CriterionResult]) -> None:
    """Horizontal bars, the first criterion on top; "unknown" beside those without one."""
    for k, each in enumerate(results):
        place = len(results) - 1 - k
        if each.use is None or each.verdict == "unknown":
            estimate = each.estimate if each.use is None else each.use
            text = "unknown"
            if estimate is not None and math.isfinite(estimate):
                axis.barh(place, min(estimate, SHOWN), color="none", edgecolor=ESTIMATE, hatch="////", height=0.66)
                text = f"unknown; {percent(estimate)} without the unknown masses"
            axis.annotate(
                text, (min(estimate or 0.0, SHOWN), place), (4, 0), textcoords="offset points", va="center",
                fontsize="small", color="0.35",
            )  # fmt: skip
            continue
        axis.barh(place, min(each.use, SHOWN), color=COLOURS[each.verdict], height=0.66)
        axis.annotate(
            percent(each.use), (min(each.use, SHOWN), place), (4, 0), textcoords="offset points", va="center",
            fontsize="small", bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.85},
        )  # fmt: skip
    axis.set_yticks(np.arange(len(results))[::-1], [literal(each.name) for each in results], fontsize="small")
    axis.set_ylim(-0.6, max(len(results), 2) - 0.4)
    axis.set_xlim(0.0, SHOWN + 0.15)
    axis.axvline(1.0, color=LIMIT, linestyle="--", linewidth=1.0)
    plain(axis)
    axis.set_axisbelow(True)


# ---- Torque and speed of each chosen motor along the cycles, with what the motor allows.


BOUND, CURVE, VOLTAGE = "#b30000", "#1a1a1a", "#7a5195"
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
    title_above(axis, literal(f"{one.axis.name}: {one.chosen.id}") + unknown, fontsize="small")


def _limits(axis: Axes, actuator: Actuator, reach: Array) -> Array:
    """Draw what the motor allows, and return the half width and height that the plane shows."""
    continuous, outline = actuator.continuous_outline, actuator.outline
    if continuous is not None:
        reach = np.maximum(reach, [0.0, continuous[:, 1].max()])
        for side in (1.0, -1.0):
            for sign in (1.0, -1.0):
                label = "continuous torque (S1)" if side == sign == 1.0 else None
                axis.plot(
                    side * continuous[:, 0] * RPM, sign * continuous[:, 1], color=BOUND, linestyle=":", linewidth=1.2,
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
            axis.axvline(side * actuator.max_speed * RPM, color=BOUND, linestyle="--", linewidth=1.0, label=label)
    return reach
