"""Plots of the gain maps: error and work over (α, β), and slices along α = β."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.files import atomic_write
from bellcrank.present.plot_style import new_figure, save_figure
from bellcrank.simulation.integration.automatic_gains import drift_bound
from bellcrank_bench.measurements import gain_map
from bellcrank_bench.measurements.gain_map import (
    ADAPTIVE,
    FIXED_DECAY,
    MOST_WORK,
    SOLVERS,
    TOLERANCE,
    GainMap,
    GainPoint,
)
from bellcrank_bench.plots.work_precision import METHOD

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS = ("residual", "error", "evaluations")
LINE = {1e-6: ":", 1e-9: "--", 1e-12: "-"}
KINDS = {"none": "none", "automatic": "baumgarte", "projection": "projection"}
AUTOMATIC = "#D55E00"
STAR: dict[str, Any] = {
    "marker": "*", "markersize": 15, "color": AUTOMATIC, "markeredgecolor": "white", "linestyle": "none"
}  # fmt: skip
DIAMOND: dict[str, Any] = {
    "marker": "D", "markersize": 8, "color": "#56B4E9", "markeredgecolor": "black", "linestyle": "none"
}  # fmt: skip


def write(path: Path, figure: Figure) -> None:
    """Write the PNG. Raises InputError if the folder cannot be written."""
    with atomic_write.writing(path) as temporary:
        save_figure(figure, temporary, "png", dpi=110)


def draw_map(report: GainMap) -> Figure:
    """A row a solver: largest |φ| at step ends, error of the motion, and work (for RK4 |φ| against the step)."""
    figure = new_figure(15.0, 12.0)
    axes = figure.subplots(3, 3)
    for row, solver in zip(axes, SOLVERS, strict=True):
        for axis, column in zip(row, COLUMNS, strict=True):
            if solver == "RK4" and column == "evaluations":
                _orders(axis, report)
            else:
                _panel(axis, report, solver, column)
    from matplotlib.lines import Line2D

    c, g = report.case, report.automatic
    figure.suptitle(
        f"Baumgarte's gains on {c.scene}, {c.duration:g} s; yellow is better; "
        f"white: diverged, or took more than {MOST_WORK} times the evaluations"
    )
    handles = [
        Line2D([], [], label=f"automatic gains, α = β = {g.alpha:.2g} /s", **STAR),
        Line2D([], [], color="black", linewidth=2.5, label="on the colour bars: without stabilisation"),
        Line2D([], [], label="on the colour bars, or at their ends: projection", **DIAMOND),
        Line2D([], [], color=AUTOMATIC, label="|φ| of 10 tolerances; twice the evaluations"),
        Line2D([], [], color="0.5", linestyle=":", label="α = β"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    return figure


def draw_slices(report: GainMap) -> Figure:
    """Work and largest |φ| along α = β at several tolerances: they bend at the same gains."""
    figure = new_figure(13.0, 5.4)
    work, residual = figure.subplots(1, 2)
    for solver in ADAPTIVE:
        for tolerance, line in LINE.items():
            plain = report.plain(solver, "none", tolerance).evaluations
            mine = [p for p in report.slices if p.solver == solver and p.setting == tolerance]
            mine = [p for p in mine if math.isfinite(p.residual)]
            style: dict[str, Any] = {"color": METHOD[solver], "linestyle": line}
            alpha = [p.alpha for p in mine]
            work.loglog(alpha, [p.evaluations / plain for p in mine], label=f"{solver}, {tolerance:.0e}", **style)
            residual.loglog(alpha, [p.residual / tolerance for p in mine], **style)
            unstabilised = report.plain(solver, "none", tolerance).residual / tolerance
            residual.plot(
                0.0, unstabilised, "<", color=METHOD[solver], clip_on=False, transform=residual.get_yaxis_transform(),
                label=f"{solver}, none" if tolerance == TOLERANCE else "_",
            )  # fmt: skip
            if tolerance == TOLERANCE:
                bound = [drift_bound(p.alpha, p.beta, 1.0, p.step) for p in mine]
                residual.loglog(alpha, bound, linewidth=0.8, color=METHOD[solver], label=f"{solver}, bound at 1e-09")
    for axis, level, name in ((work, 2.0, "2 x"), (residual, 10.0, "10 atol")):
        axis.axhline(level, color="0.5", linewidth=0.8)
        axis.text(0.01, level, name, transform=axis.get_yaxis_transform(), va="bottom", color="0.3")
        axis.axvline(report.automatic.alpha, color=AUTOMATIC, linewidth=1.2, label="automatic")
        axis.set_xlabel("α = β [1/s]")
        axis.grid(visible=True, which="major", color="0.9", linewidth=0.6)
        axis.legend(frameon=False, fontsize="small", loc="upper left" if axis is work else "best")
    work.set_ylabel("evaluations, relative to no stabilisation")
    residual.set_ylabel("largest |φ| at step ends / tolerance")
    projected = max(report.plain(v, "projection", t).residual for v in ADAPTIVE for t in LINE)
    residual.set_title(f"projection: |φ| ≤ {projected:.0e} m or rad at every tolerance", fontsize="medium")
    work.set_title(
        "projection: not more than without stabilisation" if _projection_costs_nothing(report) else "",
        fontsize="medium",
    )
    figure.suptitle(f"Along α = β on {report.case.scene}: the bend lies at the rate of the motion, not at a given α h")
    return figure


def _projection_costs_nothing(report: GainMap) -> bool:
    """Whether projection takes at most 2 % more evaluations than a run without stabilisation."""
    places = [(v, t) for v in ADAPTIVE for t in LINE]
    return all(
        report.plain(v, "projection", t).evaluations <= 1.02 * report.plain(v, "none", t).evaluations for v, t in places
    )


def _panel(axis: Axes, report: GainMap, solver: str, column: str) -> None:
    from matplotlib.colors import LogNorm

    points = [p for p in report.grid if p.solver == solver]
    beside = {name: report.plain(solver, kind) for name, kind in KINDS.items()}
    scale = beside["none"].evaluations if column == "evaluations" else 1.0
    n = len(gain_map.FACTORS)
    values = np.array([_value(p, column) for p in points]).reshape(n, n) / scale
    alpha, beta = np.array([p.alpha for p in points[:n]]), np.array([p.beta for p in points[::n]])
    visible = np.ma.masked_invalid(np.where(np.isfinite(values), values, np.nan))
    mesh = axis.pcolormesh(
        alpha, beta, visible, norm=LogNorm(visible.min(), visible.max()), cmap="viridis_r", shading="nearest"
    )
    _scale(axis.figure.colorbar(mesh, ax=axis).ax, visible, {k: _value(p, column) / scale for k, p in beside.items()})
    bar = 2.0 if column == "evaluations" else 10 * TOLERANCE
    if solver != "RK4" and column != "error" and visible.min() < bar < visible.max():
        axis.contour(alpha, beta, visible, [bar], colors=AUTOMATIC, linewidths=1.5)
    axis.plot(alpha, alpha, color="white", linewidth=0.8, linestyle=":")
    axis.plot(report.automatic.alpha, report.automatic.beta, **STAR)
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xlabel("α [1/s]")
    axis.set_ylabel("β [1/s]")
    where = f"{solver}, step {report.case.step:g} s" if solver == "RK4" else f"{solver}, {TOLERANCE:.0e}"
    titles = {
        "residual": "largest |φ| at step ends [m or rad]", "error": "error of the motion [m or rad]",
        "evaluations": "evaluations, relative to none",
    }  # fmt: skip
    form = ".2f" if column == "evaluations" else ".1e"
    told = ", ".join(f"{name} {_value(p, column) / scale:{form}}" for name, p in beside.items())
    axis.set_title(f"{where}: {titles[column]}\n{told}", fontsize="medium")


def _scale(axis: Axes, visible: Any, beside: dict[str, float]) -> None:
    """Mark no stabilisation, the automatic gains and projection on a panel's colour bar, or at its end."""
    low, high = float(visible.min()), float(visible.max())
    at = {name: min(max(value, low), high) for name, value in beside.items()}
    axis.plot([0.0, 1.0], [at["none"]] * 2, color="black", linewidth=2.5)
    axis.plot(0.5, at["automatic"], clip_on=False, **STAR)
    axis.plot(0.5, at["projection"], clip_on=False, **DIAMOND)


def _value(point: GainPoint, column: str) -> float:
    return math.inf if math.isinf(point.residual) else float(getattr(point, column))


def _orders(axis: Axes, report: GainMap) -> None:
    """RK4's position residual against the step: order 4 with fixed gains, order 2 with gains of the step."""
    ways = {"none": [], "automatic gains": [], f"α = β = {FIXED_DECAY:g}/h": []}  # type: dict[str, list[GainPoint]]
    for k, p in enumerate(report.halvings):
        list(ways.values())[k % 3].append(p)
    for (name, mine), colour in zip(ways.items(), ("0.4", AUTOMATIC, "#0072B2"), strict=True):
        mine = [p for p in mine if math.isfinite(p.residual)]
        axis.loglog([p.setting for p in mine], [p.residual for p in mine], "o-", color=colour, label=name)
    h = np.array([p.setting for p in report.halvings])
    last = report.halvings[-2:]
    for order, p in ((4, last[0]), (2, last[1])):
        line = 0.4 * p.residual * (h / p.setting) ** order
        axis.loglog(h, line, ":", color="0.4", linewidth=1.2)
        axis.text(h[-1], line[-1], f"  order {order}", ha="left", va="top", color="0.3", fontsize="small")
    axis.set_xlabel("step h [s]")
    axis.xaxis.set_major_formatter("{x:.3g}")
    axis.set_xticks(sorted(set(h.tolist())), minor=False)
    axis.minorticks_off()
    axis.set_ylabel("largest |φ| at step ends [m or rad]")
    axis.set_title("RK4: |φ| against the step", fontsize="medium")
    axis.grid(visible=True, which="major", color="0.9", linewidth=0.6)
    axis.legend(frameon=False, fontsize="small")
