"""The pictures of a selection: torque and speed of each chosen motor, utilisation of each criterion, Pareto points."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.errors import InputError
from bellcrank.files import atomic_write
from bellcrank.messages import unknown_name
from bellcrank.plot_style import (
    DPI,
    colour,
    figures_aside,
    heading,
    legend_columns,
    literal,
    new_figure,
    place,
    plain,
    save_figure,
)
from bellcrank.sizing.selection.motor_plots import motors_figure
from bellcrank.sizing.selection.tables import percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bellcrank.sizing.selection.selection import AxisSelection, CriterionResult, ParetoPoint, Selection

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
    if path is not None:
        form = Path(path).suffix.removeprefix(".").lower() or "png"
        known = figure.canvas.get_supported_filetypes()
        if form not in known:
            raise InputError(f"{path}: {unknown_name('picture format', form, sorted(known))}")
        with atomic_write.writing(path) as temporary:
            save_figure(figure, temporary, form, dpi=DPI)
    return figure


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
        axis.set_title(literal(title, 100), fontsize="medium", loc="left")
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
