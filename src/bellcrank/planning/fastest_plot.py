"""The pictures of fastest motions: the path speed with the active limit, and the use of limits over a speed factor."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.present.plot_style import colour, dash, literal, new_figure, place, write_figure

if TYPE_CHECKING:
    from bellcrank.planning.fastest_motion import FastestMotion
    from bellcrank.planning.speed_scaling import SpeedFactor


def plot_fastest(result: FastestMotion, path: Path) -> Path:
    """Write the picture in the format of its suffix. Raises InputError where the file cannot be written."""
    figure = new_figure(9.0, 7.0, free=True)
    phase, times = figure.subplots(2, 1, height_ratios=(3, 2))
    s, speed = result.s, result.speed
    phase.plot(s, np.minimum(result.largest_speed, 1.6 * speed.max()), color="0.6", lw=1.0,
               label="largest speed from which the end is reached")  # fmt: skip
    listed = [cost.limit for cost in result.costs]
    names = list(dict.fromkeys([*listed, *sorted(result.active, key=lambda name: name == "")]))
    for number, name in enumerate(names):
        cells = np.array([own == name for own in result.active])
        drawn = np.full(len(s), np.nan)
        lines = np.column_stack([speed[:-1], speed[1:]])
        drawn[:-1][cells] = lines[cells, 0]
        drawn[1:][cells] = lines[cells, 1]
        phase.plot(s, drawn, color="0.3" if name == "" else colour(number), lw=2.0,
                   label=None if name in listed else literal(name or "no limit active"))  # fmt: skip
    phase.set_ylim(0.0, 1.1 * float(speed.max()))
    phase.set_xlabel("path parameter s")
    phase.set_ylabel("path speed ds/dt [1/s]")
    title = literal(f"{result.robot} along {result.path}: {result.duration:.4g} s", 90)
    phase.set_title(title)
    phase.legend(loc="lower center", fontsize=8)
    phase.grid(True, alpha=0.3)
    for number, cost in enumerate(result.costs):
        times.barh(number, 100.0 * cost.share, color=colour(number))
    times.invert_yaxis()
    times.set_yticks(range(len(listed)), [literal(name) for name in listed], fontsize=8)
    times.set_xlabel("active during [% of the time]")
    times.grid(True, axis="x", alpha=0.3)
    longest = max(map(len, listed), default=0)
    place(figure, left=max(0.95, 0.2 + 0.07 * longest), top=0.3 + 0.2 * title.count("\n"), between=0.6)
    write_figure(figure, path)
    return path


def plot_factor(result: SpeedFactor, path: Path) -> Path:
    """Write the use of each limit over the factor in the format of its suffix. Raises InputError where it cannot be."""
    figure = new_figure(9.0, 5.0)
    axes = figure.subplots()
    highest = sorted(result.uses, key=lambda name: -float(result.uses[name][-1]))
    for number, name in enumerate(highest):
        axes.plot(result.factors, 100.0 * result.uses[name], color=colour(number), ls=dash(number), label=literal(name))
    axes.axhline(100.0, color="0.3", lw=0.8)
    axes.axvline(1.0, color="0.6", lw=0.8)
    if result.factor > 0.0:
        axes.axvline(result.factor, color="0.3", lw=0.8, ls="--")
    axes.set_ylim(0.0, 150.0)
    axes.set_xlim(0.0, float(result.factors[-1]))
    axes.set_xlabel("speed factor")
    axes.set_ylabel("largest use of the limit [%]")
    axes.set_title(literal(result.table().splitlines()[0]))
    axes.legend(loc="upper left", fontsize=8)
    axes.grid(True, alpha=0.3)
    write_figure(figure, path)
    return path
