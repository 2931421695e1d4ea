"""Series of a run or a motion as charts of a film, with the points that a screen can show."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.motion.resampling import BETWEEN, SHARE, extreme_rows, ranges
from bellcrank.replays.film.decimation import Rows, line_rows
from bellcrank.replays.film.film import Chart, Line
from bellcrank.simulation.plot_panels import Panel, run_panels, shown_unit

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory import Trajectory

Array = NDArray[np.float64]
FORCES = ("joint torque", "joint force", "multiplier")
MOST_TIMES = 1000  # of forces, for arrows
MOST_POINTS = 2000  # of what is not told between rows: two a pixel on a wide screen
MOST_NUMBERS = 100_000  # of a chart
COARSER = (1.0, 5.0, 25.0)  # times the bound, where it takes too many numbers
ROUNDING = 0.05  # of the bound: times and values are rounded in a page
TELLING = ("outputs", "position", "velocity", "energy")  # the words that titles begin with
TELLING_OF_CLOSED = ("position", "velocity", "multiplier", "energy", "outputs")


def run_charts(run: Trajectory) -> tuple[tuple[Chart, ...], Array]:
    """Charts, and times (m,) s between which forces go about straight.

    The charts are the panels of `bellcrank plot`, thinned, the most telling first: what the scene asks for, unless
    constraints tie it; then positions, velocities, forces of constraints, energies; and what only a closer look needs last.
    """
    order = TELLING_OF_CLOSED if run.scene.constraints else TELLING
    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        panels = run_panels(run)
        charts = [chart(panel) for panel in panels]

    def place(each: Chart) -> int:
        word = "repeated" if each.title.startswith("outputs") and each.unit == "J" else each.title.split(" ")[0]
        return order.index(word.rstrip(":,")) if word.rstrip(":,") in order else len(order)

    forces = np.unique(np.concatenate([np.zeros(0), *(each.time for each in charts if each.title.startswith(FORCES))]))
    return tuple(sorted(charts, key=place)), forces[:: 1 + len(forces) // MOST_TIMES]


def chart(panel: Panel) -> Chart:
    """A panel as a chart; each line has the rows that it takes for it to be right, or its extremes."""
    table = np.stack([values for _, values in panel.lines], axis=1)
    if panel.logarithmic or panel.extremes:  # residuals jump from row to row, and nothing is known between them
        rows = [extreme_rows(table, MOST_POINTS)] * len(panel.lines)
        share = SHARE if len(rows[0]) == len(panel.time) and not panel.extremes else None
    else:
        rows, share = kept_rows(panel.time, table, panel.off)
    lines = tuple(
        Line(name, values[kept], panel.time[kept]) for (name, values), kept in zip(panel.lines, rows, strict=True)
    )
    unit = shown_unit(panel.unit)  # the page shows it beside the title
    title, every = panel.title.removesuffix(f", {unit}"), np.unique(np.concatenate(rows))
    return Chart(title, unit, panel.time[every], lines, panel.logarithmic, share)


def kept_rows(time: Array, table: Array, off: float, reach: Array | None = None) -> tuple[list[Rows], float | None]:
    """Rows of each line of a table (n, lines) at times (n,), and within which share of their range (`reach`, else that
    of the table) straight lines between them are of what the table is of, of which its own rows are `off`: SHARE, or
    more where that takes too many rows; None where only extremes are kept.
    """
    reach = ranges(table) if reach is None else reach
    for coarser in COARSER:
        bound = SHARE * (coarser * (1.0 - ROUNDING) - BETWEEN) * reach
        rows = line_rows(time, table, bound, max(MOST_NUMBERS, MOST_POINTS * table.shape[1] // 10))
        if rows is not None:
            return rows, SHARE * coarser + max(off - BETWEEN * SHARE, 0.0) / (1.0 - ROUNDING)
    most = max(MOST_POINTS // 10, min(MOST_POINTS, MOST_NUMBERS // table.shape[1]))
    return [extreme_rows(table[:, [k]], most) for k in range(table.shape[1])], None


def joined(parts: Sequence[Array], gap: float = np.nan) -> Array:
    """Arrays one after the other, with a row of `gap` between two."""
    between = np.full((1, *parts[0].shape[1:]), gap)
    rows = [row for part in parts for row in (between, part)]
    return np.concatenate(rows[1:])


def joined_times(parts: Sequence[Array]) -> Array:
    """Times one after the other, with one more between two parts, for the row that parts them."""
    rows = [parts[0]]
    for before, after in pairwise(parts):
        rows += [np.array([0.5 * (before[-1] + after[0])]), after]
    return np.concatenate(rows)
