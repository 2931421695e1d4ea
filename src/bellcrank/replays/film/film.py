"""A film: everything that a replay page shows, as plain data, independent of what it was made from.

Lengths in m, times in s, angles in rad; positions and directions are in the world frame unless stated otherwise. A pose
is seven numbers: position x y z and unit quaternion x y z w.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.motion.sampled.resampling import SHARE
from bellcrank.replays.geometry.shapes import DrawnBody, Triple

if TYPE_CHECKING:
    from bellcrank.replays.film.live_film import LiveFilm


@dataclass(frozen=True, eq=False)
class Trace:
    """A curve that is drawn up to the current time: points (m, 3) at times (m,), such as the path of a frame."""

    name: str
    time: Array
    points: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Arrow:
    """A force or torque, in `unit`, that acts at points (n, 3): vectors (n, 3), one for each frame of the film.

    `is_torque` draws a ring around the arrow. With `time` (n,), which does not decrease, there is one point and vector
    for each of these times instead.
    """

    name: str
    unit: str
    points: Array
    vectors: Array
    is_torque: bool = False
    time: Array | None = None


@dataclass(frozen=True, eq=False)
class FilmSpring:
    """A spring between two points: ends (n, 2, 3), one pair for each frame of the film."""

    name: str
    ends: Array


@dataclass(frozen=True, eq=False)
class Rod:
    """A thin rod between two points: ends (n, 2, 3), one pair for each frame of the film."""

    name: str
    ends: Array


@dataclass(frozen=True, kw_only=True)
class FilmAxis:
    """A joint's axis: a point and a unit direction in the frame of body number `body`.

    `torsion_spring` draws a spiral around it.
    """

    name: str
    body: int
    point: Triple
    direction: Triple
    torsion_spring: bool = False


@dataclass(frozen=True)
class BodyLayer:
    """Bodies, by number, that are shown and hidden together, under a name in a group of such."""

    group: str
    name: str
    bodies: tuple[int, ...]


@dataclass(frozen=True)
class TimelineEvent:
    """An event at a time, marked on the time line with a text."""

    time: float
    text: str


@dataclass(frozen=True)
class ActiveLimit:
    """The limit that is active from a time until the next one's, and the number of the axis of its joint; -1: none."""

    time: float
    text: str
    axis: int


@dataclass(frozen=True, eq=False)
class FilmLine:
    """Values (m,) of one quantity at its own times (m,), which do not decrease (a jump has its time twice).

    Without `time` the values are at the times of the chart.
    """

    name: str
    values: Array
    time: Array | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Chart:
    """Lines of one unit over times (m,) that do not decrease.

    `tolerance` is the largest error of straight lines between the samples, relative to the range of a line; None if
    only extremes are kept, so that nothing is known between them.
    """

    title: str
    unit: str
    time: Array
    lines: tuple[FilmLine, ...]
    logarithmic: bool = False
    tolerance: float | None = SHARE


@dataclass(frozen=True, eq=False, kw_only=True)
class XYPlot:
    """One quantity over another at times (m,), such as torque over speed; `limits` are names and closed curves (k, 2).

    Times and `tolerance` as in a chart.
    """

    title: str
    x_label: str
    y_label: str
    time: Array
    x: Array
    y: Array
    limits: tuple[tuple[str, Array], ...] = ()
    tolerance: float | None = SHARE


@dataclass(frozen=True)
class Ground:
    """A plane to draw: its unit normal, and its distance from the origin along the normal (m)."""

    normal: Triple
    height: float


@dataclass(frozen=True)
class Camera:
    """The camera's position, the point it looks at, and its up direction; its vertical field of view is 40 degrees."""

    position: Triple
    target: Triple
    up: Triple


@dataclass(frozen=True, eq=False, kw_only=True)
class Film:
    """Poses (n, bodies, 7) at increasing times (n,), and everything else that the page shows.

    Between frames positions are interpolated linearly and orientations at a constant rate; no point of a body is off by
    more than `error_bound` (m) from the smooth curve through the known rows. `facts` are (name, value) for the header,
    the result first, and `success` says whether that result is good. `notes` say what to know about the picture, such
    as simplified meshes. `live` is what the page computes.
    """

    title: str
    time: Array
    poses: Array
    bodies: tuple[DrawnBody, ...]
    camera: Camera
    error_bound: float
    ground: Ground | None = None
    traces: tuple[Trace, ...] = ()
    arrows: tuple[Arrow, ...] = ()
    springs: tuple[FilmSpring, ...] = ()
    rods: tuple[Rod, ...] = ()
    axes: tuple[FilmAxis, ...] = ()
    layers: tuple[BodyLayer, ...] = ()
    events: tuple[TimelineEvent, ...] = ()
    limits: tuple[ActiveLimit, ...] = ()
    charts: tuple[Chart, ...] = ()
    xy_plots: tuple[XYPlot, ...] = ()
    facts: tuple[tuple[str, str], ...] = ()
    success: bool = True
    notes: tuple[str, ...] = ()
    live: LiveFilm | None = None


def check_film(film: Film) -> None:
    """Raise InputError, naming what is wrong, if the parts of a film do not fit together or are not finite."""
    n, names = len(film.time), [body.name for body in film.bodies]
    if film.time.shape != (n,) or n == 0:
        raise _inconsistent(film, "it has no frame", "give it at least one time")
    if film.poses.shape != (n, len(names), 7):
        raise _inconsistent(film, f"poses are {film.poses.shape}", f"expected {(n, len(names), 7)}: frames, bodies, 7")
    if not (np.isfinite(film.time).all() and np.all(np.diff(film.time) > 0.0)):
        raise _inconsistent(film, "its times do not increase", "give finite, increasing times")
    bad = np.argwhere(~np.isfinite(film.poses).all(axis=2))
    if len(bad):
        frame, body = (int(k) for k in bad[0])
        what = f"the pose of body '{names[body]}' at {film.time[frame]:g} s is not a finite number"
        raise _inconsistent(film, what, "end the film before it")
    if np.any(np.linalg.norm(film.poses[:, :, 3:], axis=2) < 1e-6):
        raise _inconsistent(film, "a quaternion of its poses is zero", "give unit quaternions x y z w")
    camera = np.array([film.camera.position, film.camera.target, film.camera.up])
    if not np.isfinite(camera).all() or not np.linalg.norm(np.cross(camera[0] - camera[1], camera[2])) > 0.0:
        remedy = "give a target other than the position, and an up direction across the view direction"
        raise _inconsistent(film, "its camera has no view direction", remedy)
    if not film.error_bound >= 0.0:
        raise _inconsistent(
            film, f"its error_bound is {film.error_bound}", "give the largest error of the frames, in m"
        )
    for kind, name, ends in (
        *(("spring", spring.name, spring.ends) for spring in film.springs),
        *(("rod", rod.name, rod.ends) for rod in film.rods),
    ):
        if ends.shape != (n, 2, 3) or not np.isfinite(ends).all():
            raise _inconsistent(film, f"{kind} '{name}' has no finite ends", f"expected {(n, 2, 3)} numbers")
    for arrow in film.arrows:
        rows = n if arrow.time is None else len(arrow.time)
        if arrow.points.shape != (rows, 3) or arrow.vectors.shape != (rows, 3) or not rows:
            what = f"arrow '{arrow.name}' has another number of frames"
            raise _inconsistent(film, what, f"expected {(rows, 3)} numbers")
        if arrow.time is not None:
            _check_times(film, f"arrow '{arrow.name}'", arrow.time)
    for axis in film.axes:
        if not 0 <= axis.body < len(names):
            raise _inconsistent(film, f"axis '{axis.name}' is of body {axis.body}", f"there are {len(names)} bodies")
    for limit in film.limits:
        if not -1 <= limit.axis < len(film.axes):
            raise _inconsistent(film, f"a limit is at axis {limit.axis}", f"there are {len(film.axes)} axes")
    for layer in film.layers:
        if not all(0 <= body < len(names) for body in layer.bodies):
            raise _inconsistent(film, f"layer '{layer.name}' has bodies {layer.bodies}", f"there are {len(names)}")
    for chart in film.charts:
        for line in chart.lines:
            time = chart.time if line.time is None else line.time
            _check_times(film, f"line '{line.name}' of chart '{chart.title}'", time, line.values)
    for plot in film.xy_plots:
        _check_times(film, f"plot '{plot.title}'", plot.time, plot.x, plot.y)
    for trace in film.traces:
        if trace.points.shape != (len(trace.time), 3):
            what = f"trace '{trace.name}' has points {trace.points.shape}"
            raise _inconsistent(film, what, f"expected {(len(trace.time), 3)}")
        _check_times(film, f"trace '{trace.name}'", trace.time)
    if not all(np.isfinite(event.time) for event in film.events):
        raise _inconsistent(film, "the time of an event is not a finite number", "leave the event out")


def _check_times(film: Film, what: str, time: Array, *values: Array) -> None:
    if any(value.shape != time.shape for value in values):
        raise _inconsistent(film, f"{what} does not have one value for each time", f"expected {time.shape}")
    if not (np.isfinite(time).all() and np.all(np.diff(time) >= 0.0)):
        raise _inconsistent(film, f"the times of {what} decrease or are not finite", "sort them")


def _inconsistent(film: Film, what: str, remedy: str) -> InputError:
    return InputError(f"film '{film.title}': {what}; {remedy}")
