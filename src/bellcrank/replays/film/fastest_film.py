"""The film of a fastest motion: the motion, the limit that is active at each time, and the phase plane."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.planning.fastest_motion import FastestMotion
from bellcrank.replays.film.film import ActiveLimit, Film, FilmAxis, XYPlot
from bellcrank.replays.film.motion_film import Progress, film_of_motion
from bellcrank.replays.geometry.meshes import Detail

if TYPE_CHECKING:
    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.robot.robot import Robot
    from bellcrank.scene.scene import Scene

SHORTEST = 1e-3  # of the whole time: a limit that is active for less is not named
DRAWN = 1.6  # times the largest path speed: the largest speeds are drawn up to here
MOST_CORNERS = 2000


def film_of_fastest(
    fastest: FastestMotion,
    robot: Robot | Scene | Mechanism | None = None,
    *,
    trace: Iterable[str] = (),
    detail: Detail = "reduced",
    title: str | None = None,
    progress: Progress = None,
) -> Film:
    """The film of a fastest motion, by default of its own mechanism. Raises InputError as `film_of_motion`."""
    own = fastest.mechanism if robot is None else robot
    if own is None:
        raise InputError(f"motion '{fastest.motion.name}': pass robot=ROBOT, too")
    film = film_of_motion(
        fastest.motion, own, trace=trace, detail=detail, title=title, progress=progress,
        actuators=fastest.actuators if robot is None else None,
    )  # fmt: skip
    costs = [(f"limited by {cost.limit}", f"{100.0 * cost.share:.1f} % of the time") for cost in fastest.costs]
    told = [("lower bound", fastest.bound), *costs, *(("warning", text) for text in fastest.warnings)]
    saved = [] if np.isnan(fastest.original_duration) else [("instead of", f"{fastest.original_duration:.6g} s")]
    return replace(
        film,
        limits=active_limits(fastest, film.axes),
        xy_plots=(_phase_plane(fastest), *film.xy_plots),
        facts=(film.facts[0], *saved, *told, *film.facts[1:]),
    )


def active_limits(fastest: FastestMotion, axes: tuple[FilmAxis, ...]) -> tuple[ActiveLimit, ...]:
    """The active limits in order of time, each from its time on, with the number of the axis of its joint."""
    numbers = {axis.name: k for k, axis in enumerate(axes)}
    long = np.diff(fastest.time) > 0.0
    starts, names = fastest.time[:-1][long], [name for name, kept in zip(fastest.active, long, strict=True) if kept]
    edges = [0, *[k for k in range(1, len(names)) if names[k] != names[k - 1]]]
    ends = [*(float(starts[k]) for k in edges[1:]), float(fastest.time[-1])]
    found: list[ActiveLimit] = []
    for k, end in zip(edges, ends, strict=True):
        name = names[k]
        if end - float(starts[k]) < SHORTEST * fastest.duration or (found and found[-1].text == name):
            continue
        joint = name.rpartition(" of ")[2]
        begin = float(fastest.motion.time[0]) + (float(starts[k]) if found else 0.0)
        found.append(ActiveLimit(begin, name, numbers.get(joint, -1)))
    return tuple(found)


def _phase_plane(fastest: FastestMotion) -> XYPlot:
    top = np.minimum(fastest.largest_speed, DRAWN * float(fastest.speed.max()))
    s = fastest.s
    every = np.unique(np.linspace(0, len(top) - 1, min(len(top), MOST_CORNERS)).astype(int))
    return XYPlot(
        title="path speed over path",
        x_label="path parameter s",
        y_label="ds/dt [1/s]",
        time=float(fastest.motion.time[0]) + fastest.time,
        x=s,
        y=fastest.speed,
        limits=(("largest speed from which the end is reached", _closed(s[every], top[every])),),
    )


def _closed(s: Array, top: Array) -> Array:
    """The curve of the largest speeds (n,) over places s (n,), closed along the speed 0."""
    return np.concatenate([np.column_stack([s, top]), [[s[-1], 0.0], [s[0], 0.0]]])
