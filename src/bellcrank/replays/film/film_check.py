"""Whether a film holds together: as many poses as times, and nothing that is not a number where one is needed."""

from __future__ import annotations

import numpy as np

from bellcrank.errors import InputError
from bellcrank.replays.film.film import Array, Film


def check(film: Film) -> None:
    """Raise InputError, naming what is wrong, where a film contradicts itself."""
    n, names = len(film.time), [body.name for body in film.bodies]
    if film.time.shape != (n,) or n == 0:
        raise _wrong(film, "it has no frame", "give it at least one time")
    if film.poses.shape != (n, len(names), 7):
        raise _wrong(film, f"poses are {film.poses.shape}", f"expected {(n, len(names), 7)}: frames, bodies, 7")
    if not (np.isfinite(film.time).all() and np.all(np.diff(film.time) > 0.0)):
        raise _wrong(film, "its times do not increase", "give finite times, each after the one before")
    bad = np.argwhere(~np.isfinite(film.poses).all(axis=2))
    if len(bad):
        frame, body = (int(k) for k in bad[0])
        what = f"the pose of body '{names[body]}' at {film.time[frame]:g} s is not a finite number"
        raise _wrong(film, what, "end the film before it")
    if np.any(np.linalg.norm(film.poses[:, :, 3:], axis=2) < 1e-6):
        raise _wrong(film, "a quaternion of its poses is zero", "give unit quaternions x y z w")
    camera = np.array([film.camera.position, film.camera.target, film.camera.up])
    if not np.isfinite(camera).all() or not np.linalg.norm(np.cross(camera[0] - camera[1], camera[2])) > 0.0:
        raise _wrong(film, "its camera looks nowhere", "give a position, a target apart from it, and an up across")
    if not film.bound >= 0.0:
        raise _wrong(film, f"its bound is {film.bound}", "give what frames are off at most, in m")
    for kind, name, ends in (
        *(("spring", spring.name, spring.ends) for spring in film.springs),
        *(("rod", rod.name, rod.ends) for rod in film.rods),
    ):
        if ends.shape != (n, 2, 3) or not np.isfinite(ends).all():
            raise _wrong(film, f"{kind} '{name}' has no finite ends", f"expected {(n, 2, 3)} numbers")
    for arrow in film.arrows:
        rows = n if arrow.time is None else len(arrow.time)
        if arrow.points.shape != (rows, 3) or arrow.vectors.shape != (rows, 3) or not rows:
            raise _wrong(film, f"arrow '{arrow.name}' has another number of frames", f"expected {(rows, 3)} numbers")
        if arrow.time is not None:
            _check_times(film, f"arrow '{arrow.name}'", arrow.time)
    for axis in film.axes:
        if not 0 <= axis.body < len(names):
            raise _wrong(film, f"axis '{axis.name}' is of body {axis.body}", f"there are {len(names)} bodies")
    for chart in film.charts:
        for line in chart.lines:
            time = chart.time if line.time is None else line.time
            _check_times(film, f"line '{line.name}' of chart '{chart.title}'", time, line.values)
    for plane in film.planes:
        _check_times(film, f"plane '{plane.title}'", plane.time, plane.x, plane.y)
    for trace in film.traces:
        if trace.points.shape != (len(trace.time), 3):
            raise _wrong(film, f"trace '{trace.name}' has points {trace.points.shape}", f"{len(trace.time)} times")
        _check_times(film, f"trace '{trace.name}'", trace.time)
    if not all(np.isfinite(mark.time) for mark in film.marks):
        raise _wrong(film, "the time of a mark is not a finite number", "leave the mark out")


def _check_times(film: Film, what: str, time: Array, *values: Array) -> None:
    if any(value.shape != time.shape for value in values):
        raise _wrong(film, f"{what} has not one value a time", f"expected {time.shape}")
    if not (np.isfinite(time).all() and np.all(np.diff(time) >= 0.0)):
        raise _wrong(film, f"the times of {what} go back or are not finite", "sort them")


def _wrong(film: Film, what: str, remedy: str) -> InputError:
    return InputError(f"film '{film.title}': {what}; {remedy}")
