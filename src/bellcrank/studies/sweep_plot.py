"""Pictures of a sweep: one panel a measure, a line over one axis, a map over two."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.files.atomic_write import writing
from bellcrank.plot_style import DPI, literal, new_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bellcrank.studies.axes import Axis
    from bellcrank.studies.sweep_result import Array, Sweep

LINE, FAILED = "#0072B2", "#D55E00"
MOST = 12  # panels


def plot_sweep(sweep: Sweep, measures: Sequence[str], path: str | Path | None = None) -> Figure:
    """Draw measures over the axes: a matplotlib Figure, written to `path` (PNG) where one is given.

    Designs without a finite measure are marked below a line and grey in a map; three axes or more are drawn over the
    number of the design. Raises InputError for an unknown measure, and where the folder cannot be written.
    """
    shown = [(name, sweep.column(name)) for name in list(measures)[:MOST]]
    columns = 1 if len(shown) < 4 else 2
    rows = -(-len(shown) // columns)
    maps = len(sweep.axes) == 2 and min(sweep.shape) > 1 and all(axis.numeric for axis in sweep.axes)
    figure = new_figure((7.5 if columns == 1 else 11.0), 0.8 + (3.4 if maps else 2.6) * rows)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for place, (name, values) in zip(axes, shown, strict=False):
        if maps:
            _map(figure, place, sweep, name)
        else:
            _line(place, sweep, values)
            place.set_ylabel(literal(f"{name}\n[{sweep.units[name]}]"))
    for place in axes[len(shown) :]:
        place.set_visible(False)
    figure.suptitle(literal(f"{sweep.scene.name}: {len(sweep.designs)} designs", 90))
    if path is not None:
        with writing(path) as temporary:
            save_figure(figure, temporary, "png", dpi=DPI)
    return figure


def _line(place: Axes, sweep: Sweep, values: Array) -> None:
    axis = sweep.axes[0]
    one = len(sweep.axes) == 1
    x = sweep.values[:, 0] if one else np.array([float(design.index) for design in sweep.designs])
    order = np.argsort(x, kind="stable")
    x, values = x[order], values[order]
    there = np.isfinite(values)
    marker = "o" if len(x) <= 80 else ""
    place.plot(x, np.where(there, values, np.nan), color=LINE, linewidth=1.3, marker=marker, markersize=3.0)
    if not there.all():
        below: Any = place.get_xaxis_transform()
        none = int(np.count_nonzero(~there))
        place.plot(
            x[~there], np.full(none, 0.02), transform=below, color=FAILED, marker="x", markersize=5.0, linestyle="none",
            clip_on=False, label=f"none, or unknown ({none} of {len(x)})",
        )  # fmt: skip
        place.legend(frameon=False, fontsize="small")
    place.set_xlabel(literal(axis.label) if one else "design")
    if one and not axis.numeric:
        place.set_xticks(axis.numbers, [str(value) for value in axis.values])
    place.grid(visible=True, color="0.9", linewidth=0.6)
    place.spines[["top", "right"]].set_visible(False)


def _map(figure: Figure, place: Axes, sweep: Sweep, name: str) -> None:
    first, second = sweep.axes
    table = np.ma.masked_invalid(sweep.grid(name).T)
    place.set_facecolor("0.8")
    mesh = place.pcolormesh(*_rising(first, second), table[_order(second)][:, _order(first)], cmap="viridis")
    figure.colorbar(mesh, ax=place, label=literal(f"{name} [{sweep.units[name]}]"))
    place.set_xlabel(literal(first.label))
    place.set_ylabel(literal(second.label))


def _rising(*axes: Axis) -> list[Array]:
    return [np.sort(np.array(axis.numbers)) for axis in axes]


def _order(axis: Axis) -> Any:
    return np.argsort(np.array(axis.numbers), kind="stable")
