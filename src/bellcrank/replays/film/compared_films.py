"""Two films over each other: the bodies of the second are tinted and translucent, its lines stand in the same charts.

Frames are added where only one film has some. Between frames both move as before, so that neither changes: positions
are interpolated linearly, orientations at a constant rate. A film that ends first stands still from then on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bellcrank.arrays import Array, Indices
from bellcrank.replays.film.camera import fit_camera
from bellcrank.replays.film.decimation import slerp
from bellcrank.replays.film.film import BodyLayer, Camera, Chart, Film, FilmLine
from bellcrank.replays.geometry.shapes import Colour, DrawnBody, outlines, world_corners

TINT, TINTED, OPACITY = (0.84, 0.37, 0.0), 0.6, 0.45  # of the second film's bodies
MOST_LOOKED_AT = 200  # frames by which the camera is placed


def compared_films(film: Film, other: Film) -> Film:
    """A film with another one over it, whose names begin with its title, or with "second" where both are the same."""
    first, second = names_of(film, other)
    time = np.union1d(film.time, other.time)
    poses = np.concatenate([_poses_at(one, time) for one in (film, other)], axis=1)
    count = len(film.bodies)
    bodies = (*film.bodies, *(_tinted(body, second) for body in other.bodies))
    layers = (
        *film.layers,
        *(
            replace(layer, bodies=tuple(k + count for k in layer.bodies), name=f"{second}: {layer.name}")
            for layer in other.layers
        ),
        BodyLayer("over each other", first, tuple(range(count))),
        BodyLayer("over each other", second, tuple(range(count, len(bodies)))),
    )
    notes = [*film.notes, *(f"{second}: {note}" for note in other.notes)]
    for name, one in ((first, film), (second, other)):
        if one.time[-1] < time[-1]:
            notes.append(f"{name} ends at {one.time[-1]:.6g} s and stands still from then on, its lines too")
    if other.limits:
        notes.append(f"active limits are those of {first}; those of {second} are not shown")
    return replace(
        film,
        title=f"{film.title}: two over each other" if film.title == other.title else f"{first} and {second}",
        time=time,
        poses=poses,
        bodies=bodies,
        layers=layers,
        camera=_camera(film.camera, poses, bodies),
        error_bound=max(film.error_bound, other.error_bound),
        ground=film.ground or other.ground,
        traces=(*film.traces, *(replace(trace, name=f"{second}: {trace.name}") for trace in other.traces)),
        arrows=tuple(
            replace(arrow, name=name, time=one.time if arrow.time is None else arrow.time)
            for one, prefix in ((film, ""), (other, f"{second}: "))
            for arrow in one.arrows
            for name in (f"{prefix}{arrow.name}",)
        ),
        springs=(
            *(replace(spring, ends=_ends_at(film, spring.ends, time)) for spring in film.springs),
            *(replace(s, name=f"{second}: {s.name}", ends=_ends_at(other, s.ends, time)) for s in other.springs),
        ),
        rods=(
            *(replace(rod, ends=_ends_at(film, rod.ends, time)) for rod in film.rods),
            *(replace(rod, name=f"{second}: {rod.name}", ends=_ends_at(other, rod.ends, time)) for rod in other.rods),
        ),
        axes=(
            *film.axes,
            *(replace(axis, name=f"{second}: {axis.name}", body=axis.body + count) for axis in other.axes),
        ),
        events=tuple(
            sorted(
                (*film.events, *(replace(event, text=f"{second}: {event.text}") for event in other.events)),
                key=lambda event: event.time,
            )
        ),
        charts=_charts(film.charts, other.charts, second),
        xy_plots=(*film.xy_plots, *(replace(plot, title=f"{second}: {plot.title}") for plot in other.xy_plots)),
        facts=(*film.facts, *((f"{second}: {name}", value) for name, value in other.facts)),
        success=film.success and other.success,
        notes=tuple(notes),
    )


def names_of(film: Film, other: Film) -> tuple[str, str]:
    """How two films over each other are called."""
    return (film.title, other.title) if film.title != other.title else ("first", "second")


def _tinted(body: DrawnBody, prefix: str) -> DrawnBody:
    shapes = tuple(replace(shape, colour=_tint(shape.colour)) for shape in body.shapes)
    return DrawnBody(f"{prefix}: {body.name}", shapes)


def _tint(colour: Colour) -> Colour:
    red, green, blue = ((1.0 - TINTED) * a + TINTED * b for a, b in zip(colour[:3], TINT, strict=True))
    return red, green, blue, OPACITY * colour[3]


def _shares(film: Film, time: Array) -> tuple[Indices, Indices, Array]:
    """The frames (m,) before and after each time (m,), and the share of the way from one to the other."""
    after = np.clip(np.searchsorted(film.time, time, side="left"), 0, len(film.time) - 1)
    before = np.where(film.time[after] > time, np.maximum(after - 1, 0), after)
    span = film.time[after] - film.time[before]
    share = np.divide(time - film.time[before], span, out=np.zeros(len(time)), where=span > 0.0)
    return before, after, share


def _poses_at(film: Film, time: Array) -> Array:
    """The poses (m, bodies, 7) at times (m,), as the page interpolates them."""
    before, after, share = _shares(film, time)
    begin, end, part = film.poses[before], film.poses[after].copy(), share[:, None]
    turned = np.einsum("mkc,mkc->mk", begin[..., 3:], end[..., 3:]) < 0.0
    end[turned, 3:] *= -1.0  # the shorter way
    _, quaternions = slerp(begin[..., 3:], end[..., 3:], part)
    points = begin[..., :3] + part[..., None] * (end[..., :3] - begin[..., :3])
    return np.concatenate([points, quaternions], axis=2)


def _ends_at(film: Film, ends: Array, time: Array) -> Array:
    before, after, share = _shares(film, time)
    return np.asarray(ends[before] + share[:, None, None] * (ends[after] - ends[before]))


def _charts(charts: Sequence[Chart], others: Sequence[Chart], second: str) -> tuple[Chart, ...]:
    """The charts of a film with the lines of those of another one of the same title and unit, and the others of it."""
    rest = {_kind(chart): chart for chart in others}
    found = []
    for chart in charts:
        other = rest.pop(_kind(chart), None)
        if other is not None:
            tolerances = (chart.tolerance, other.tolerance)
            known = None if None in tolerances else max(tolerance or 0.0 for tolerance in tolerances)
            lines = (*_timed(chart, ""), *_timed(other, f"{second}: "))
            chart = replace(chart, lines=lines, tolerance=known)
        found.append(chart)
    return (*found, *(replace(chart, title=f"{second}: {chart.title}") for chart in rest.values()))


def _kind(chart: Chart) -> tuple[str, str]:
    """What a chart shows: its title without figures of its own in parentheses, and its unit."""
    return chart.title.partition(" (")[0], chart.unit


def _timed(chart: Chart, prefix: str) -> list[FilmLine]:
    return [
        FilmLine(f"{prefix}{line.name}", line.values, chart.time if line.time is None else line.time)
        for line in chart.lines
    ]


def _camera(camera: Camera, poses: Array, bodies: Sequence[DrawnBody]) -> Camera:
    """A camera in the direction of another one, that sees all bodies at all times."""
    some = poses[np.unique(np.linspace(0, len(poses) - 1, MOST_LOOKED_AT).astype(int))]
    points = world_corners(some, outlines(bodies)).reshape(-1, 3)
    return fit_camera(points, np.subtract(camera.position, camera.target), np.asarray(camera.up))
