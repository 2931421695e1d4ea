"""Plots of a sweep: one panel a measure; a line over one axis, a map over two."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.arrays import Array
from bellcrank.present.plot_style import PALETTE, literal, new_figure, plain, write_figure
from bellcrank.studies.results.study_columns import varies

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bellcrank.studies.designs.axes import StudyAxis
    from bellcrank.studies.results.sweep_result import Sweep


LINE, FAILED = PALETTE[0], PALETTE[1]
MOST = 12  # panels
MOST_POINTS = 4000  # of a line; of more, the least and the largest of equal parts are drawn
MOST_MARKS = 400  # designs without a value
MOST_CELLS = 1000  # of a map, along an axis


def plot_sweep(sweep: Sweep, measures: Sequence[str], path: str | Path | None = None) -> Figure:
    """Draw measures over the axes; the figure is written to `path` (PNG) where one is given.

    Designs without a finite measure are marked at the lower edge of a line plot, and grey in a map. With three axes or
    more the horizontal axis is the number of the design. Raises InputError for an unknown measure, and where the file
    cannot be written.
    """
    for name in measures:
        sweep.column(name)  # refuses an unknown one
    figure = plot_sample(sweep, measures) if sweep.space.sample is not None else _plot_grid(sweep, measures)
    figure.suptitle(literal(f"{sweep.scene.name}: {len(sweep)} designs", 90))
    return write_figure(figure, path)


def _plot_grid(sweep: Sweep, measures: Sequence[str]) -> Figure:
    shown = [(name, sweep.column(name)) for name in list(measures)[:MOST]]
    columns = 1 if len(shown) < 4 else 2
    rows = -(-len(shown) // columns)
    maps = len(sweep.axes) == 2 and min(sweep.shape) > 1 and all(axis.numeric for axis in sweep.axes)
    figure = new_figure((7.5 if columns == 1 else 11.0), 0.8 + (3.4 if maps else 2.6) * rows)
    places = figure.subplots(rows, columns, squeeze=False).ravel()
    for place, (name, values) in zip(places, shown, strict=False):
        if maps:
            _map(figure, place, sweep, name)
        else:
            _line(place, sweep, values)
            place.set_ylabel(literal(f"{name}\n[{sweep.units[name]}]"))
    for place in places[len(shown) :]:
        place.set_visible(False)
    return figure


def _line(place: Axes, sweep: Sweep, values: Array) -> None:
    axis = sweep.axes[0]
    one = len(sweep.axes) == 1
    x = sweep.values[:, 0] if one else sweep.index.astype(np.float64)
    order = np.argsort(x, kind="stable")
    x, values = x[order], values[order]
    there = np.isfinite(values)
    drawn = _extremes(values) if len(x) > MOST_POINTS else np.arange(len(x))
    shown = np.where(there, values, np.nan)[drawn]
    place.plot(x[drawn], shown, color=LINE, linewidth=1.3, marker="o" if len(x) <= 80 else "", markersize=3.0)
    if there.any() and not varies(values, sweep.noise):
        _show_as_constant(place, values[there])
    if not there.all():
        absent = np.flatnonzero(~there)
        marks = absent[:: -(-len(absent) // MOST_MARKS)]
        below: Any = place.get_xaxis_transform()
        place.plot(
            x[marks], np.full(len(marks), 0.02), transform=below, color=FAILED, marker="x", markersize=5.0,
            linestyle="none", clip_on=False, label=f"none, or unknown ({len(absent)} of {len(x)})",
        )  # fmt: skip
        place.legend(frameon=False, fontsize="small")
    place.set_xlabel(literal(axis.label) if one else "design")
    if one and not axis.numeric:
        place.set_xticks(axis.numbers.tolist(), [literal(str(value)) for value in axis.choices])
    plain(place)


def _extremes(values: Array) -> Any:
    """The numbers of the least and the largest value in each of equal parts, in order; absent values between them."""
    parts = np.array_split(np.arange(len(values)), MOST_POINTS // 4)
    found = []
    for part in parts:
        known = part[np.isfinite(values[part])]
        if len(known):
            found += [known[np.argmin(values[known])], known[np.argmax(values[known])]]
        if len(known) < len(part):  # one of those that are absent, so that the line is broken there
            found.append(part[~np.isfinite(values[part])][0])
    return np.unique(found)


def _show_as_constant(place: Axes, known: Array) -> None:
    """Choose limits in which differences within the errors of the runs are not seen as a trend."""
    place.set_ylim(*constant_limits(known))
    place.ticklabel_format(axis="y", useOffset=False)
    place.set_title(CONSTANT, fontsize="small")


def _map(figure: Figure, place: Axes, sweep: Sweep, name: str) -> None:
    first, second = sweep.axes
    (x, across), (y, along) = _rising(first), _rising(second)
    values = sweep.grid(name).T[np.ix_(along, across)]
    place.set_facecolor("0.8")
    mesh = place.pcolormesh(x, y, np.ma.masked_invalid(values), cmap="viridis", rasterized=True)
    if values.size and np.isfinite(values).any() and not varies(values, sweep.noise):
        mesh.set_clim(*constant_limits(values[np.isfinite(values)]))
    figure.colorbar(mesh, ax=place, label=literal(f"{name} [{sweep.units[name]}]"))
    place.set_xlabel(literal(first.label))
    place.set_ylabel(literal(second.label))
    left_out = max(-(-len(axis) // MOST_CELLS) for axis in sweep.axes)
    if left_out > 1:
        place.set_title(f"every {left_out}th value is drawn", fontsize="small")


def _rising(axis: StudyAxis) -> tuple[Array, Any]:
    """The values of an axis in rising order and their numbers, of very many every k-th."""
    order = np.argsort(axis.numbers, kind="stable")[:: -(-len(axis) // MOST_CELLS)]
    return axis.numbers[order], order


# ---- The plot of a sample: for each measure a histogram, and the measure against each parameter.

MOST_MEASURES, MOST_AXES = 8, 4
MOST_DOTS = 3000  # designs; more are drawn as their number in cells
CELLS = 120  # along an edge
MOST_BINS = 60
CONSTANT = "constant within the errors of the runs"
RANKED = 20_000  # designs that decide which parameters are drawn


def plot_sample(sweep: Sweep, measures: Sequence[str]) -> Figure:
    """One line of panels a measure: how it is distributed, and how it depends on each parameter.

    Of more than `MOST_AXES` parameters those are drawn whose ranks are most correlated with the measure.
    """
    shown = list(measures)[:MOST_MEASURES]
    across = min(len(sweep.axes), MOST_AXES)
    figure = new_figure(max(3.2 * (across + 1), 6.4), 0.8 + 2.6 * len(shown))
    places = figure.subplots(max(len(shown), 1), across + 1, squeeze=False)
    for line, name in zip(places, shown, strict=False):
        values = sweep.column(name)
        there = np.isfinite(values)
        label = literal(f"{name} [{sweep.units[name]}]")
        _histogram(line[0], values[there], sweep.noise)
        line[0].set_xlabel(label)
        titles = [CONSTANT] if there.any() and not varies(values, sweep.noise) else []
        titles += [] if there.all() else [f"none, or unknown: {int((~there).sum())} of {len(values)}"]
        line[0].set_title("\n".join(titles), fontsize="small", color="black" if there.all() else PALETTE[1])
        for place, k in zip(line[1:], _most_correlated(sweep, values, there, across), strict=True):
            axis = sweep.axes[k]
            _against(place, sweep.values[there, k], values[there], "loguniform" in str(axis.distribution))
            place.set_xlabel(literal(axis.label))
            place.set_ylabel(label)
            if axis.choices:
                place.set_xticks(axis.numbers.tolist(), [literal(str(choice)) for choice in axis.choices])
            if len(values[there]) and not varies(values, sweep.noise):
                place.set_ylim(*constant_limits(values[there]))
    return figure


def _histogram(place: Axes, known: Array, noise: tuple[float, float]) -> None:
    if len(known):
        constant = not varies(known, noise)
        edges = np.array(constant_limits(known)) if constant else np.histogram_bin_edges(known, _bins(known))
        counts, edges = np.histogram(known, edges)
        place.stairs(100.0 * counts / len(known), edges, fill=True, color=PALETTE[5], edgecolor=PALETTE[0])
        if constant:
            place.ticklabel_format(axis="x", useOffset=False)
    place.set_ylabel("% of designs")
    place.locator_params(axis="x", nbins=5)
    place.set_axisbelow(True)
    plain(place)


def _bins(known: Array) -> int:
    """The number of bins by Freedman and Diaconis (Z. Wahrscheinlichkeitstheorie verw. Geb. 57 (1981) 453-476)."""
    low, high = np.quantile(known, [0.25, 0.75])
    width = 2.0 * float(high - low) * len(known) ** (-1.0 / 3.0)
    return MOST_BINS if width <= 0.0 else int(np.clip(np.ceil(np.ptp(known) / width), 4, MOST_BINS))


def _against(place: Axes, x: Array, y: Array, logarithmic: bool) -> None:
    """Designs as dots, or as their number in the cells of a grid."""
    if len(x) <= MOST_DOTS:
        size = 5.0 if len(x) <= MOST_DOTS // 5 else 3.0
        place.plot(x, y, linestyle="none", marker=".", markersize=size, color=PALETTE[0], alpha=0.6, markeredgewidth=0)
        plain(place)
    else:
        place.pcolormesh(*_cells(x, y, logarithmic), cmap="viridis", norm="log", rasterized=True)
    if logarithmic:
        place.set_xscale("log")
    else:
        place.locator_params(axis="x", nbins=4)


def _cells(x: Array, y: Array, logarithmic: bool) -> tuple[Array, Array, Any]:
    """The edges of a grid of cells and the number of designs in each, masked where there is none."""
    places, edges = [], []
    for values in (np.log(x) if logarithmic else x, y):
        least, largest = float(values.min()), float(values.max())
        width = max(largest - least, 1e-12 * max(abs(least), abs(largest), 1e-290))
        edges.append(np.linspace(least, least + width, CELLS + 1))
        places.append(np.minimum((values - least) * (CELLS / width), CELLS - 1).astype(np.int64))
    counts = np.bincount(places[1] * CELLS + places[0], minlength=CELLS * CELLS).reshape(CELLS, CELLS)
    return np.exp(edges[0]) if logarithmic else edges[0], edges[1], np.ma.masked_equal(counts, 0)


def constant_limits(known: Array) -> tuple[float, float]:
    """Limits in which differences within the errors of the runs are not seen."""
    middle = 0.5 * (float(known.min()) + float(known.max()))
    half = max(0.05 * abs(middle), 1e3 * float(np.ptp(known)), 1e-12)
    return middle - half, middle + half


def _most_correlated(sweep: Sweep, values: Array, there: Any, count: int) -> list[int]:
    """The numbers of the axes that are drawn, in their order."""
    if len(sweep.axes) <= count:
        return list(range(count))
    some = np.flatnonzero(there)[:RANKED]
    target = _ranks(values[some])
    strength = [abs(float(np.mean(_ranks(sweep.values[some, k]) * target))) for k in range(len(sweep.axes))]
    return sorted(np.argsort(strength)[::-1][:count].tolist())


def _ranks(values: Array) -> Array:
    """Ranks with mean 0 and standard deviation 1."""
    ranks = np.argsort(np.argsort(values, kind="stable"), kind="stable").astype(np.float64)
    ranks -= ranks.mean() if len(ranks) else 0.0
    return ranks / max(float(ranks.std()), 1.0) if len(ranks) else ranks
