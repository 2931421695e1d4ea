"""Pictures of a run: every quantity over time, one panel a unit; or the path of a frame."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.atomic import writing
from bellcrank.errors import InputError, among
from bellcrank.motion.coordinates import position_labels, velocity_labels
from bellcrank.simulation.run_csv import output_labels, titled, torque_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bellcrank.simulation.trajectory import Array, Trajectory

# Eight colours that people with any kind of colour vision tell apart: M. Okabe, K. Ito, Color Universal Design (2008).
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8A8A00")
DASHES = ("-", "--", "-.", ":")
NAMED = 8  # lines with a colour and a name in one panel; the others, which move less, are thin and grey
DPI = 110
FLAT = 1e-6
EVENT_COLOUR = "#7A5195"


@dataclass
class _Panel:
    """What one panel shows: a quantity, its unit, and the lines (n,) by name."""

    title: str
    unit: str
    lines: list[tuple[str, Array]]
    logarithmic: bool = False

    @property
    def moves(self) -> bool:
        """Whether anything in it changes."""
        return any(np.any(values != values[0]) for _, values in self.lines)


def plot_run(run: Trajectory, path: str | Path | None = None, frame: str | None = None) -> Figure:
    """Draw a run: a matplotlib Figure, written to `path` in the format of its suffix (PNG without one).

    Positions, velocities, energies, torques and outputs over time, SI units on the axes; or, with `frame`, the path of
    that frame in the world's plane in which it reaches furthest (m). Raises InputError for an unknown frame or format,
    and where the folder cannot be written.
    """
    with np.errstate(all="ignore"):  # a run may end where numbers overflow
        figure = _over_time(run) if frame is None else _frame_path(run, frame)
    if path is not None:
        kind = Path(path).suffix.removeprefix(".").lower() or "png"
        known = figure.canvas.get_supported_filetypes()
        if kind not in known:
            raise InputError(f"{path}: {among('picture format', kind, sorted(known))}")
        with writing(path) as temporary:
            figure.savefig(temporary, format=kind, dpi=DPI)
    return figure


# ---- over time


def _over_time(run: Trajectory) -> Figure:
    panels = _panels(run)
    figure = _new(10.0, 1.0 + 2.05 * len(panels))
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, panel in zip(axes, panels, strict=True):
        _draw(axis, run.time, panel)
        _mark_events(axis, run, named=axis is axes[0])
        axis.legend(
            loc="upper left", bbox_to_anchor=(1.005, 1.03), frameon=False, fontsize="small", borderaxespad=0.0,
            handlelength=2.2,
        )  # fmt: skip
    axes[-1].set_xlabel("time [s]")
    if run.time[-1] > run.time[0]:
        axes[-1].set_xlim(run.time[0], run.time[-1])
    figure.suptitle(textwrap.fill(f"{run.scene.name}: {run.status} at {run.time[-1]:.6g} s", 90))
    return figure


def _panels(run: Trajectory) -> list[_Panel]:
    joints = run.robot.joints
    one = [joint for joint in joints if joint.nv == 1]
    panels = _by_unit("position", position_labels(joints), run.position)
    panels = panels[:1] + [panel for panel in panels[1:] if panel.moves]
    panels += [panel for panel in _by_unit("velocity", velocity_labels(joints), run.velocity) if panel.moves]
    energies = [("kinetic T", run.kinetic_energy), ("potential V", run.potential_energy), ("T + V", run.total_energy)]
    if np.any(run.work):
        energies.append(("work W", run.work))
    panels.append(_Panel(f"energy (drift {run.energy_drift():.1e})", "J", energies))
    labels = [(joint.name, torque_unit(joint.kind)) for joint in one]
    torques = _by_unit("joint torque", labels, run.torque[:, [joint.v for joint in one]])
    panels += [panel for panel in torques if any(np.any(values) for _, values in panel.lines)]
    panels += _closure_panels(run)
    outputs = [(label, unit, column) for name in run.outputs for label, unit, column in _output_columns(run, name)]
    for unit in dict.fromkeys(unit for _, unit, _ in outputs):
        lines = [(label, column) for label, u, column in outputs if u == unit]
        names = ", ".join(n for n, output in run.scene.outputs.items() if unit in [titled(x)[1] for x in output.labels])
        panels.append(_Panel(f"outputs: {textwrap.shorten(names, 60, placeholder='…')}", unit, lines))
    titles = [panel.title for panel in panels]
    for panel in panels:
        if titles.count(panel.title) > 1:
            panel.title += f", {_shown(panel.unit)}"
    return panels


def _closure_panels(run: Trajectory) -> list[_Panel]:
    """The multipliers of closures, one panel a unit, and how far they are apart."""
    if not run.scene.closures:
        return []
    names = [titled(f"{owner} {label}") for owner, label in run.scene.system.multiplier_names]
    panels = _by_unit("multiplier", names, run.multipliers)
    apart = [run.closure(closure.name) for closure in run.scene.closures]
    lines = [
        ("position [m or rad]", np.max([each.residual for each in apart], axis=0)),
        ("velocity [m/s or rad/s]", np.max([each.velocity_residual for each in apart], axis=0)),
    ]
    return [*panels, _Panel("closures apart", "m or rad, and /s", lines, logarithmic=True)]


def _output_columns(run: Trajectory, name: str) -> list[tuple[str, str, Array]]:
    values = run.output(name).reshape(len(run), -1)
    return [(label, unit, column) for (label, unit), column in zip(output_labels(run, name), values.T, strict=True)]


def _by_unit(title: str, labels: Sequence[tuple[str, str]], table: Array) -> list[_Panel]:
    """One panel a unit; the word for the quantity is in its title, and need not stand in every line's name."""
    panels = []
    for unit in dict.fromkeys(unit for _, unit in labels):
        lines = [
            (name.replace(f" {title}", ""), table[:, k]) for k, (name, own) in enumerate(labels) if own == unit
        ]  # fmt: skip
        what = "orientation" if unit == "1" else "joint force" if unit == "N" and title == "joint torque" else title
        panels.append(_Panel(what, unit, lines))
    return panels


def _draw(axis: Axes, time: Array, panel: _Panel) -> None:
    few = len(time) <= 2
    extent = [np.ptp(values[np.isfinite(values)]) if np.isfinite(values).any() else 0.0 for _, values in panel.lines]
    order = np.argsort(-np.array(extent), kind="stable")
    named = sorted(int(k) for k in order[:NAMED])
    rest = sorted(int(k) for k in order[NAMED:])
    for count, k in enumerate(named):
        name, values = panel.lines[k]
        axis.plot(
            time, values, color=PALETTE[count % len(PALETTE)], linestyle=DASHES[count % len(DASHES)], linewidth=1.4,
            marker="o" if few else "", markersize=3.5, label=textwrap.shorten(name, 34, placeholder="…"),
        )  # fmt: skip
    for count, k in enumerate(rest):
        label = None if count else f"{len(rest)} more, which change less"
        axis.plot(time, panel.lines[k][1], color="0.75", linewidth=0.7, zorder=1.9, label=label)
    if panel.logarithmic:
        axis.set_yscale("symlog", linthresh=1e-16)
    else:
        _keep_constants_flat(axis, panel)
    axis.set_title(panel.title, loc="left", fontsize="medium")
    axis.set_ylabel(f"[{_shown(panel.unit)}]")
    axis.grid(visible=True, color="0.9", linewidth=0.6)
    axis.spines[["top", "right"]].set_visible(False)


def _keep_constants_flat(axis: Axes, panel: _Panel) -> None:
    """What changes by less than FLAT of its size is not magnified until its rounding looks like a signal."""
    values = np.concatenate([values[np.isfinite(values)] for _, values in panel.lines])
    if len(values) and 0.0 < np.ptp(values) < FLAT * np.abs(values).max():
        middle = 0.5 * float(values.min() + values.max())
        axis.set_ylim(middle - 0.05 * abs(middle), middle + 0.05 * abs(middle))


def _mark_events(axis: Axes, run: Trajectory, named: bool) -> None:
    for k, name in enumerate(dict.fromkeys(event.name for event in run.events)):
        times = [event.time for event in run.events if event.name == name]
        label = f"event {name}" + (f" ({len(times)} times)" if len(times) > 1 else "")
        axis.vlines(
            times, 0.0, 1.0, transform=axis.get_xaxis_transform(), color=EVENT_COLOUR, linestyle=DASHES[(k + 1) % 4],
            linewidth=0.9, zorder=1.8, label=textwrap.shorten(label, 34, placeholder="…") if named else "_",
        )  # fmt: skip


# ---- the path of a frame


def _frame_path(run: Trajectory, frame: str) -> Figure:
    from matplotlib.collections import LineCollection

    position = run.frame(frame).position
    a, b = sorted(np.argsort(-np.ptp(position, axis=0), kind="stable")[:2])
    flat = position[:, [a, b]]
    figure = _new(7.0, 6.2)
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
    axis.grid(visible=True, color="0.9", linewidth=0.6)
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(frameon=False, fontsize="small")
    figure.suptitle(textwrap.fill(f"{run.scene.name}: path of frame {frame}", 70))
    return figure


def _new(width: float, height: float) -> Figure:
    """A figure that no window system knows of, so that drawing works anywhere and nothing is left open."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _shown(unit: str) -> str:
    return unit.replace("^2", "²") or "1"
