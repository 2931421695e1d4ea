"""The work-precision diagram of a scene: error falls to the right, time grows upwards, both logarithmic."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank.files import atomic_write
from bellcrank.present.plot_style import new_figure, save_figure
from bellcrank_bench.c_baseline.baseline import NAME as C_BASELINE
from bellcrank_bench.measurements.row import Row
from bellcrank_bench.measurements.scene_benchmark import SceneReport
from bellcrank_bench.measurements.work_precision import BELLCRANK, PROJECTED, pareto

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's colours, which people with colour blindness can distinguish
METHOD = {"RK4": "#E69F00", "RK45": "#0072B2", "DOP853": "#009E73", "Radau": "#CC79A7"}
PEER = {
    "SciPy + pin.aba": ("#56B4E9", "s"), "SciPy + pin.constraintDynamics": ("#56B4E9", "s"),
    "Pinocchio in Python": ("#8C6D31", "P"), "MuJoCo": ("#D55E00", "^"),
    "Drake": ("#555555", "D"), "Exudyn": ("#000000", "o"),
}  # fmt: skip


def write(path: Path, report: SceneReport, machine: str) -> None:
    """Write the PNG. Raises InputError if the folder cannot be written."""
    with atomic_write.writing(path) as temporary:
        save_figure(draw(report, machine), temporary, "png", dpi=130)


def draw(report: SceneReport, machine: str) -> Figure:
    """bellcrank bold and the C baseline dashed, method by method; of the peers all runs and their Pareto fronts."""
    title = report.problem.title
    figure = new_figure(10.0, 6.6)
    axis = figure.subplots()
    reached = [r for r in report.rows if r.reached and r.error < 1.0]
    for tool, (colour, marker) in PEER.items():
        mine = [r for r in reached if r.tool == tool]
        if mine:
            axis.loglog(*_points(mine), color=colour, marker=marker, markersize=3, linestyle="none", alpha=0.3)
            axis.loglog(*_points(pareto(mine)), color=colour, marker=marker, markersize=4.5, linewidth=1.0, label=tool)
    styles: dict[tuple[str, str], dict[str, Any]] = {
        (C_BASELINE, ""): {"linestyle": "--", "linewidth": 1.4}, (BELLCRANK, ""): {"linewidth": 2.6, "alpha": 0.85},
        (BELLCRANK, PROJECTED): {"linewidth": 1.4, "linestyle": "-."},
    }  # fmt: skip
    for (tool, suffix), style in styles.items():
        for method, colour in METHOD.items():
            mine = [r for r in reached if r.tool == tool and r.method == method + suffix]
            if mine:
                axis.loglog(*_points(mine), color=colour, label=f"{tool}, {method}{suffix}", **style)
    whole = [replace(r, seconds=r.whole) for r in reached if r.whole is not None and r.method == "DOP853"]
    label = f"{BELLCRANK}, DOP853, all of simulate()"
    axis.loglog(*_points(whole), color=METHOD["DOP853"], linestyle=":", linewidth=1.4, label=label)
    axis.invert_xaxis()
    axis.set_xlabel(f"largest position error [{report.reference.benchmark.unit}]; more accurate to the right")
    axis.set_ylabel("time on the tool's own clock [s]; faster downwards")
    axis.set_title(f"{title[0].upper()}{title[1:]}\n{machine}, one thread, best of many", fontsize="medium")
    axis.grid(visible=True, which="major", color="0.9", linewidth=0.6)
    axis.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside right upper", frameon=False, fontsize="small")
    return figure


def _points(rows: list[Row]) -> tuple[list[Any], list[Any]]:
    return [r.error for r in rows], [r.seconds for r in rows]
