"""Plots of a run: its quantities over time, one panel a unit, or the path of a frame."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.present.plot_style import (
    DASHES,
    PALETTE,
    colour,
    dash,
    heading,
    literal,
    new_figure,
    place,
    plain,
    powers_of_ten,
    title_above,
    write_figure,
)
from bellcrank.simulation.trajectory.plot_panels import Panel, extremes, run_panels, shown_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bellcrank.simulation.trajectory.trajectory import Trajectory

NAMED = 8  # lines of a panel with a colour and a name; the others, which change less, are thin and grey
CONSTANT = 1e-6  # relative change below which a line is drawn as constant
MOST_MARKS = 2000  # marks of one event that can be told apart along a plot
EVENT_COLOUR = "#7A5195"


@arguments.named
def plot_run(run: Trajectory, path: str | Path | None = None, frame: str | None = None) -> Figure:
    """Draw a run over time, or the path of a frame.

    Args:
        run: A run, as `simulate` and `load_run` return it.
        path: Where the picture is written, in the format of its suffix (PNG without one); None: nowhere.
        frame: A frame whose path is drawn, in the plane of two world axes in which it reaches furthest.

    Returns:
        A matplotlib figure: positions, velocities, energies, torques, constraints and outputs over time, or the path
        (m); SI units on the axes.

    Raises:
        InputError: Unknown frame or picture format, or the file cannot be written.

    Example:
        >>> import bellcrank as bc
        >>> figure = bc.plot(bc.simulate("pendulum", duration=1.0))
        >>> [axis.get_title(loc="left") for axis in figure.axes][:2]
        ['position', 'velocity']
    """
    if not hasattr(run, "state"):
        arguments.refuse("run", "a run, as bc.simulate returns", run)
    path = arguments.picture(path)
    if frame is not None:
        arguments.text("frame", frame, "the name of a frame")
    with np.errstate(all="ignore"):  # numbers may overflow at the end of a run
        figure = _over_time(run, run_panels(run)) if frame is None else _frame_path(run, frame)
    return write_figure(figure, path)


def run_pages(run: Trajectory, most: int = 6) -> list[Figure]:
    """The plots over time as figures for paper, with at most `most` panels each."""
    with np.errstate(all="ignore"):  # numbers may overflow at the end of a run
        panels = run_panels(run)
        count = math.ceil(len(panels) / most)
        cuts = [round(k * len(panels) / count) for k in range(count + 1)]
        return [_over_time(run, panels[a:b]) for a, b in pairwise(cuts)]


# ---- over time


def _over_time(run: Trajectory, panels: Sequence[Panel]) -> Figure:
    figure = new_figure(10.0, 1.0 + 2.05 * len(panels), free=True)
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, panel in zip(axes, panels, strict=True):
        _draw(axis, panel.time, panel)
        _mark_events(axis, run, named=axis is axes[0])
        axis.legend(
            loc="upper left", bbox_to_anchor=(1.005, 1.03), frameon=False, fontsize="small", borderaxespad=0.0,
            handlelength=2.2,
        )  # fmt: skip
    axes[-1].set_xlabel("time [s]")
    if run.time[-1] > run.time[0]:
        axes[-1].set_xlim(run.time[0], run.time[-1])
    remark = ", not all results are finite" if run.non_finite else ""
    top = heading(figure, f"{run.scene.name}: {run.status} at {run.time[-1]:.6g} s{remark}")
    longest = max(len(label) for axis in axes for label in axis.get_legend_handles_labels()[1])
    place(figure, right=0.55 + 0.075 * longest, top=top + 0.3)
    return figure


def _draw(axis: Axes, time: Array, panel: Panel) -> None:
    few = len(time) <= 2
    extent = [np.ptp(values[np.isfinite(values)]) if np.isfinite(values).any() else 0.0 for _, values in panel.lines]
    order = np.argsort(-np.array(extent), kind="stable")
    named = sorted(int(k) for k in order[:NAMED])
    rest = sorted(int(k) for k in order[NAMED:])
    for count, k in enumerate(named):
        name, values = panel.lines[k]
        axis.plot(
            time, values, color=colour(count), linestyle=dash(count), linewidth=1.4,
            marker="o" if few else "", markersize=3.5, label=literal(textwrap.shorten(name, 34, placeholder="…")),
        )  # fmt: skip
    for count, k in enumerate(rest):
        label = None if count else f"{len(rest)} more, which change less"
        axis.plot(time, panel.lines[k][1], color="0.75", linewidth=0.7, zorder=1.9, label=label)
    if panel.logarithmic:
        axis.set_yscale("symlog", linthresh=1e-16)
        powers_of_ten(axis.yaxis)
    else:
        _keep_constants_flat(axis, panel)
    title_above(axis, literal(panel.title), loc="left", fontsize="medium")
    axis.set_ylabel(literal(f"[{shown_unit(panel.unit)}]"))
    plain(axis)


def _keep_constants_flat(axis: Axes, panel: Panel) -> None:
    """What changes by less than CONSTANT of its size is not magnified to its rounding errors."""
    values = np.concatenate([values[np.isfinite(values)] for _, values in panel.lines])
    if len(values) and 0.0 < np.ptp(values) < CONSTANT * np.abs(values).max():
        middle = 0.5 * float(values.min() + values.max())
        axis.set_ylim(middle - 0.05 * abs(middle), middle + 0.05 * abs(middle))


def _mark_events(axis: Axes, run: Trajectory, named: bool) -> None:
    for k, name in enumerate(dict.fromkeys(event.name for event in run.events)):
        times = np.array([event.time for event in run.events if event.name == name])
        count = len(times) + run.statistics.omitted_events.get(name, 0)
        label = f"event {name}" + (f" ({count} times)" if count > 1 else "")
        place = np.floor(times * (MOST_MARKS / max(float(run.time[-1]), np.finfo(float).tiny)))
        axis.vlines(
            times[np.unique(place, return_index=True)[1]], 0.0, 1.0, transform=axis.get_xaxis_transform(),
            color=EVENT_COLOUR, linestyle=DASHES[(k + 1) % 4], linewidth=0.9, zorder=1.8,
            label=literal(textwrap.shorten(label, 34, placeholder="…")) if named else "_",
        )  # fmt: skip


# ---- the path of a frame


def _frame_path(run: Trajectory, frame: str) -> Figure:
    from matplotlib.collections import LineCollection

    run = extremes(run, lambda part: part.frame(frame).position)
    position = run.frame(frame).position
    a, b = sorted(np.argsort(-np.ptp(position, axis=0), kind="stable")[:2])
    flat = position[:, [a, b]]
    figure = new_figure(7.0, 6.2)
    axis = figure.subplots()
    pieces = LineCollection(
        list(np.stack([flat[:-1], flat[1:]], axis=1)), cmap="cividis", array=run.time[:-1], linewidth=1.3
    )
    axis.add_collection(pieces)
    axis.plot(*flat[0], color=PALETTE[1], marker="o", markersize=6, linestyle="none", label="start")
    axis.plot(*flat[-1], color=PALETTE[1], marker="s", markersize=6, linestyle="none", label="end")
    if len(run) > 1:
        figure.colorbar(pieces, ax=axis, label="time [s]", shrink=0.8)
    axis.set_aspect("equal", adjustable="datalim")
    axis.margins(0.06)
    axis.autoscale_view()
    axis.set_xlabel(f"{'xyz'[a]} [m]")
    axis.set_ylabel(f"{'xyz'[b]} [m]")
    plain(axis)
    axis.legend(frameon=False, fontsize="small")
    figure.suptitle(literal(f"{run.scene.name}: path of frame {frame}", 70))
    return figure
