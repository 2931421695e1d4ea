"""Charts of a run or a motion, with as many samples as a screen can show."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.motion.sampled.resampling import BETWEEN, SHARE, extreme_rows, ranges
from bellcrank.replays.film.decimation import Rows, line_rows
from bellcrank.replays.film.film import Chart, FilmLine
from bellcrank.simulation.trajectory.plot_panels import Panel, run_panels, shown_unit

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory.trajectory import Trajectory

FORCES = ("joint torque", "joint force", "multiplier")
MOST_TIMES = 1000  # of forces, for arrows
MOST_POINTS = 2000  # of lines that are not interpolated between rows: two for each pixel of a wide screen
MOST_NUMBERS = 100_000  # of a chart
BOUND_FACTORS = (1.0, 5.0, 25.0)  # on the bound, if it takes too many numbers
ROUNDING = 0.05  # share of the bound for the rounding of times and values in a page
CHART_ORDER = ("outputs", "position", "velocity", "energy")  # first words of titles
CHART_ORDER_CONSTRAINED = ("position", "velocity", "multiplier", "energy", "outputs")


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
