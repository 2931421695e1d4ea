"""Series of a run or a motion as charts of a film, with the points that a screen can show."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bellcrank.replays.film import Chart, Line
from bellcrank.replays.thinning import MOST_POINTS, series_rows
from bellcrank.simulation.run_panels import Panel, run_panels, shown_unit

if TYPE_CHECKING:
    from bellcrank.simulation.trajectory import Trajectory

Array = NDArray[np.float64]
MOST_GAPS = 50
TELLING = ("outputs", "position", "velocity", "energy")  # the words that titles begin with
TELLING_OF_CLOSED = ("position", "velocity", "multiplier", "energy", "outputs")


def run_charts(run: Trajectory) -> tuple[Chart, ...]:
    """The panels of `bellcrank plot`, thinned, the most telling first: what the scene asks for, unless closures tie it;
    then positions, velocities, forces of closures, energies; and what only a closer look needs last.
    """
    order = TELLING_OF_CLOSED if run.scene.closures else TELLING
    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        charts = [chart(panel, run.time) for panel in run_panels(run)]

    def place(each: Chart) -> int:
        word = "repeated" if each.title.startswith("outputs") and each.unit == "J" else each.title.split(" ")[0]
        return order.index(word.rstrip(":,")) if word.rstrip(":,") in order else len(order)

    return tuple(sorted(charts, key=place))


def chart(panel: Panel, time: Array, most: int = MOST_POINTS) -> Chart:
    """A panel over times (n,) s as a chart of at most about `most` points, extremes kept."""
    table = np.stack([values for _, values in panel.lines], axis=1)
    gaps = np.flatnonzero(np.isnan(table).all(axis=1))
    rows = series_rows(table, most)
    if len(gaps) <= MOST_GAPS:  # what parts one motion from the next must stay
        rows = np.union1d(rows, gaps)
    lines = tuple(Line(name, table[rows, k]) for k, (name, _) in enumerate(panel.lines))
    unit = shown_unit(panel.unit)  # the page shows it beside the title
    return Chart(panel.title.removesuffix(f", {unit}"), unit, time[rows], lines, panel.logarithmic)


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
