"""The work-precision diagram of a scene: error to the right falling, time upward, both logarithmic."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank.files import atomic_write
from bellcrank.plot_style import new_figure, save_figure
from bellcrank_bench.bench.bench_problem import problem
from bellcrank_bench.bench.work_precision import HAND, OWN, PROJECTED, Row, pareto

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's colours, told apart by every kind of sight
METHOD = {"RK4": "#E69F00", "RK45": "#0072B2", "DOP853": "#009E73", "Radau": "#CC79A7"}
PEER = {
    "SciPy + pin.aba": ("#56B4E9", "s"), "SciPy + pin.constraintDynamics": ("#56B4E9", "s"),
    "Pinocchio in Python": ("#8C6D31", "P"), "MuJoCo": ("#D55E00", "^"),
    "Drake": ("#555555", "D"), "Exudyn": ("#000000", "o"),
}  # fmt: skip


def write(path: Path, rows: list[Row], machine: str) -> None:
    """Write the PNG. Raises InputError where the folder cannot be written."""
    with atomic_write.writing(path) as temporary:
        save_figure(draw(rows, machine), temporary, "png", dpi=130)


def draw(rows: list[Row], machine: str) -> Figure:
    """One scene's rows: bellcrank bold, C dashed, method by method; of other tools all runs and their Pareto front."""
    chosen = problem(rows[0].scene)
    figure = new_figure(10.0, 6.6)
    axis = figure.subplots()
    reached = [r for r in rows if r.reached and r.error < 1.0]
    for tool, (colour, marker) in PEER.items():
        mine = [r for r in reached if r.tool == tool]
        if mine:
            axis.loglog(*_points(mine), color=colour, marker=marker, markersize=3, linestyle="none", alpha=0.3)
            axis.loglog(*_points(pareto(mine)), color=colour, marker=marker, markersize=4.5, linewidth=1.0, label=tool)
    styles: dict[tuple[str, str], dict[str, Any]] = {
        (HAND, ""): {"linestyle": "--", "linewidth": 1.4}, (OWN, ""): {"linewidth": 2.6, "alpha": 0.85},
        (OWN, PROJECTED): {"linewidth": 1.4, "linestyle": "-."},
    }  # fmt: skip
    for (tool, suffix), style in styles.items():
        for method, colour in METHOD.items():
            mine = [r for r in reached if r.tool == tool and r.method == method + suffix]
            if mine:
                axis.loglog(*_points(mine), color=colour, label=f"{tool}, {method}{suffix}", **style)
    whole = [replace(r, seconds=r.whole) for r in reached if r.whole is not None and r.method == "DOP853"]
    label = f"{OWN}, DOP853, all of simulate()"
    axis.loglog(*_points(whole), color=METHOD["DOP853"], linestyle=":", linewidth=1.4, label=label)
    axis.invert_xaxis()
    axis.set_xlabel(f"largest position error [{chosen.unit}]; more exact to the right")
    axis.set_ylabel("time on the tool's own clock [s]; faster below")
    axis.set_title(
        f"{chosen.title[0].upper()}{chosen.title[1:]}\n{machine}, one thread, best of many", fontsize="medium"
    )
    axis.grid(visible=True, which="major", color="0.9", linewidth=0.6)
    axis.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside right upper", frameon=False, fontsize="small")
    return figure


def _points(rows: list[Row]) -> tuple[list[Any], list[Any]]:
    return [r.error for r in rows], [r.seconds for r in rows]
