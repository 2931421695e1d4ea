"""A film as a page carries it: JSON for its structure, and compressed blocks of arrays to which the JSON refers.

Every array becomes 32-bit words: multiples of a given step, or the bits of float32. Along each column the words are
replaced by their first or second differences, whichever are smaller; the sign is folded into the lowest bit, and the
four bytes of the words are stored apart. Smooth data are then mostly zeros, which deflate removes.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bellcrank.errors import InputError
from bellcrank.motion.kinematics.rotations import make_continuous
from bellcrank.motion.sampled.resampling import SHARE as VALUE_TOLERANCE
from bellcrank.replays.film.arrows import ArrowScale, arrow_scales
from bellcrank.replays.film.design_film import FilmedMotion
from bellcrank.replays.film.film import Chart, Film, FilmAxis, Trace, XYPlot, check_film
from bellcrank.replays.geometry.shapes import DrawnShape, Mesh

LARGEST = 2.0**31 - 1.0
SMALL_CHANGE = 1e-3  # of a value: float32 has seven digits, of which the change needs four
LEVEL = 6  # of zlib: a higher one takes twice the time for 1 % of the size
ArrayReference = dict[str, Any]  # as it stands in the page's JSON
ROUNDING = 0.1  # of the film's error bound: the error that rounding may add at any point
LEAST_ROUNDING = 1e-6  # of the extent: finer rounding is invisible
MESH_STEPS = 2.0**15 - 1.0  # across a mesh
UNSTRETCHED = 1e-9


class ArrayEncoder:
    """Collects arrays in one block; equal arrays are stored once."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._known: dict[bytes, ArrayReference] = {}

    def add_fixed_point(self, values: ArrayLike, step: float) -> ArrayReference:
        """Store finite values (n, …) within half a `step`; as float32 if that takes more than 32 bits."""
        table = _table(values)
        if table.size and np.abs(table).max() > LARGEST * step:
            return self.add_floats(values)
        return self._add(np.rint(table / step).astype(np.int32), step)

    def add_floats(self, values: ArrayLike) -> ArrayReference:
        """Store values (n, …) as float32, including NaN and infinities; values beyond its range become infinite."""
        with np.errstate(over="ignore"):
            return self._add(np.ascontiguousarray(_table(values), dtype=np.float32).view(np.int32), 0.0)

    def add_centred_floats(self, values: ArrayLike) -> ArrayReference:
        """Store values (n,) as float32, as differences from their centre if they change by little relative to it."""
        table = _table(values)
        some = table[np.isfinite(table)]
        middle = 0.5 * (float(some.min()) + float(some.max())) if some.size else 0.0
        if not some.size or not np.isfinite(middle) or np.ptp(some) >= SMALL_CHANGE * abs(middle):
            return self.add_floats(table)
        return {**self.add_floats(table - middle), "base": middle}

    def add_times(self, times: ArrayLike) -> ArrayReference:
        """Store finite times (n,) within 1e-9 of their span."""
        table = _table(times)
        begin = float(table.min()) if table.size else 0.0  # times since 1970 change by little relative to their size
        table = table - begin
        return {**self.add_fixed_point(table, (table.max() if table.size else 0.0) * 2.0**-30 or 1.0), "base": begin}

    def add_integers(self, values: ArrayLike) -> ArrayReference:
        """Store integers (n, …) of at most 32 bits."""
        return self._add(_table(values).astype(np.int32), 1.0)

    def text(self) -> str:
        """The block, deflated (zlib), in base64."""
        return deflate_base64(b"".join(self._parts))

    def _add(self, words: NDArray[np.int32], step: float) -> ArrayReference:
        order, folded = _smallest_differences(words)
        planes = np.ascontiguousarray(folded.T).reshape(-1).view(np.uint8).reshape(-1, 4).T.tobytes()
        key = planes + repr((words.shape, order, step)).encode()
        if key not in self._known:
            rows, columns = words.shape
            self._known[key] = {"offset": self._size, "rows": rows, "columns": columns, "order": order, "step": step}
            self._parts.append(planes)
            self._size += len(planes)
        return self._known[key]


def deflate_base64(data: bytes) -> str:
    """Bytes, deflated (zlib), in base64."""
    return base64.b64encode(zlib.compress(data, LEVEL)).decode("ascii")


def _table(values: ArrayLike) -> NDArray[Any]:
    table = np.asarray(values)
    return table.reshape(len(table), int(np.prod(table.shape[1:])))


def _smallest_differences(words: NDArray[np.int32]) -> tuple[int, NDArray[np.uint32]]:
    """The order, 1 or 2, of the differences along columns that take fewer bits; and these, with the sign folded in."""
    best: tuple[float, int, NDArray[np.uint32]] | None = None
    difference = words
    for order in (1, 2):
        difference = np.diff(difference, axis=0, prepend=np.int32(0))  # wraps around; decoding does, too
        folded = ((difference << 1) ^ (difference >> 31)).view(np.uint32)
        bits = float(np.log2(1.0 + folded).sum())
        if best is None or bits < best[0]:
            best = (bits, order, folded)
    assert best is not None
    return best[1], best[2]


def encode_film(film: Film, *, plots: bool = True) -> tuple[str, str]:
    """The JSON text of a film, safe inside an HTML script element, and its block of arrays in base64.

    Values of charts and XY plots that are not finite leave a gap; arrows are hidden there. Raises InputError if other
    data are not finite, or if parts of the film do not fit together.
    """
    check_film(film)
    arrays = ArrayEncoder()
    rounding = rounding_of(film)
    meshes: dict[int, tuple[int, Mesh]] = {}
    step = rounding / np.sqrt(3.0)  # of positions: half a step along each axis is half the rounding
    turn_step = rounding / (4.0 * max(reach_of(film), rounding))  # a step in a quaternion turns by 2 steps at the reach
    quaternions = film.poses[:, :, 3:] / np.linalg.norm(film.poses[:, :, 3:], axis=2, keepdims=True)
    scales = arrow_scales(film)
    content: dict[str, Any] = {
        "title": film.title,
        "facts": film.facts,
        "success": film.success,
        "notes": film.notes,
        "error_bound": film.error_bound + rounding,
        "tolerance": VALUE_TOLERANCE,
        "time": arrays.add_times(film.time),
        "positions": arrays.add_fixed_point(film.poses[:, :, :3], step),
        "quaternions": arrays.add_fixed_point(make_continuous(quaternions), turn_step),
        "bodies": [{"name": b.name, "shapes": [_shape(s, meshes) for s in b.shapes]} for b in film.bodies],
        "meshes": [_mesh(arrays, mesh) for _, mesh in meshes.values()],
        "camera": asdict(film.camera),
        "extent": _extent(film),
        "size": _size(film),
        "ground": film.ground and asdict(film.ground),
        "traces": [{"name": t.name, "segments": _segments(arrays, t, step)} for t in film.traces],
        "arrows": [_arrow(arrays, film, k, step, scales) for k in range(len(film.arrows))],
        "scales": [asdict(scale) for scale in scales],
        "rods": [{"name": r.name, "ends": arrays.add_fixed_point(r.ends, step)} for r in film.rods],
        "springs": [{"name": s.name, "ends": arrays.add_fixed_point(s.ends, step)} for s in film.springs],
        "axes": [_axis(a) for a in film.axes],
        "layers": [asdict(layer) for layer in film.layers],
        "events": [asdict(event) for event in sorted(film.events, key=lambda event: event.time)],
        "limits": [asdict(limit) for limit in film.limits],
        "charts": [_chart(arrays, c) for c in film.charts] if plots else [],
        "xy_plots": [_xy_plot(arrays, p) for p in film.xy_plots] if plots else [],
        "live": film.live.content if film.live is not None and plots else None,
    }
    return safe_json(content), arrays.text()


def safe_json(content: Any) -> str:
    """JSON that no HTML parser takes for markup: ASCII, without angle brackets and ampersands."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"), ensure_ascii=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


# ---- sizes


def rounding_of(film: Film) -> float:
    """The largest error of any point by rounding (m)."""
    return float(max(ROUNDING * film.error_bound, LEAST_ROUNDING * _extent(film)))


def _extent(film: Film) -> float:
    """The reach of the bodies and their motion from the centre of all positions (m)."""
    positions = film.poses[:, :, :3].reshape(-1, 3)
    half = 0.5 * float(np.linalg.norm(np.ptp(positions, axis=0))) if len(positions) else 0.0
    return half + reach_of(film) or 1.0


def _size(film: Film) -> float:
    """The largest reach of the bodies from the centre of their positions at one time (m)."""
    positions = film.poses[:, :, :3]
    apart = np.linalg.norm(np.ptp(positions, axis=1), axis=1) if len(film.bodies) else np.zeros(1)
    return 0.5 * float(apart.max()) + reach_of(film) or 1.0


def reach_of(film: Film) -> float:
    """The largest distance of any shape's point from its body's origin (m)."""
    radii: dict[int, float] = {}
    reach = 0.0
    for shape in (shape for body in film.bodies for shape in body.shapes):
        reach = max(reach, float(np.linalg.norm(shape.pose[:3])) + _radius(shape, radii))
    return reach


def _radius(shape: DrawnShape, radii: dict[int, float]) -> float:
    """The largest distance of a shape's points from its own origin (m); `radii` caches those of meshes."""
    if shape.kind == "mesh":
        if shape.mesh is None:
            raise InputError("a shape of kind 'mesh' has no mesh; give its triangles")
        if id(shape.mesh) not in radii:
            vertices = shape.mesh.vertices
            radii[id(shape.mesh)] = float(np.linalg.norm(vertices, axis=1).max()) if len(vertices) else 0.0
        return float(np.abs(shape.size).max()) * radii[id(shape.mesh)]
    if shape.kind == "box":
        return 0.5 * float(np.linalg.norm(shape.size))
    return float(np.hypot(shape.size[0], 0.5 * shape.size[1])) if shape.kind == "cylinder" else shape.size[0]


# ---- parts


def _shape(shape: DrawnShape, meshes: dict[int, tuple[int, Mesh]]) -> dict[str, Any]:
    number = None
    if shape.mesh is not None:
        number = meshes.setdefault(id(shape.mesh), (len(meshes), shape.mesh))[0]
    return {
        "kind": shape.kind,
        "size": _short(shape.size),
        "colour": _short(shape.colour),
        "pose": _short(shape.pose),
        "mesh": number,
    }


def _short(values: Iterable[float]) -> list[float]:
    return [float(f"{value:.7g}") for value in values]


def _mesh(arrays: ArrayEncoder, mesh: Mesh) -> dict[str, ArrayReference]:
    """Triangles, with vertices within half of 1 / MESH_STEPS of the mesh's size."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    size = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    return {
        "vertices": arrays.add_fixed_point(vertices, max(size, 1e-9) / MESH_STEPS),
        "faces": arrays.add_integers(mesh.faces),
    }


def _segments(arrays: ArrayEncoder, trace: Trace, step: float) -> list[dict[str, ArrayReference]]:
    """The connected segments of a trace, which has gaps where its points are not finite."""
    there = np.isfinite(trace.points).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]])))
    return [
        {"time": arrays.add_times(trace.time[a:b]), "points": arrays.add_fixed_point(trace.points[a:b], step)}
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if b - a > 1
    ]


def _arrow(arrays: ArrayEncoder, film: Film, number: int, step: float, scales: list[ArrowScale]) -> dict[str, Any]:
    """An arrow; where it is not finite its vector is zero and its point is the last finite one."""
    arrow = film.arrows[number]
    there = np.asarray(np.isfinite(np.hstack([arrow.points, arrow.vectors])).all(axis=1))
    last = np.maximum.accumulate(np.where(there, np.arange(len(there)), -1))
    points = np.where((last >= 0)[:, None], arrow.points[last], 0.0)
    return {
        "name": arrow.name,
        "is_torque": arrow.is_torque,
        "scale": next(k for k, scale in enumerate(scales) if number in scale.arrows),
        "time": arrays.add_times(film.time if arrow.time is None else arrow.time),
        "points": arrays.add_fixed_point(np.where(np.isfinite(points), points, 0.0), step),
        "vectors": arrays.add_floats(np.where(there[:, None], arrow.vectors, 0.0)),
    }


def _axis(axis: FilmAxis) -> dict[str, Any]:
    return {
        "name": axis.name,
        "body": axis.body,
        "point": _short(axis.point),
        "direction": _short(axis.direction),
        "torsion_spring": axis.torsion_spring,
    }


def _chart(arrays: ArrayEncoder, chart: Chart) -> dict[str, Any]:
    return {
        "title": chart.title,
        "unit": chart.unit,
        "logarithmic": chart.logarithmic,
        "tolerance": chart.tolerance,
        "lines": [
            {
                "name": line.name,
                "time": arrays.add_times(chart.time if line.time is None else line.time),
                "values": arrays.add_centred_floats(line.values),
            }
            for line in chart.lines
        ],
    }


def _xy_plot(arrays: ArrayEncoder, plot: XYPlot) -> dict[str, Any]:
    return {
        "title": plot.title,
        "x_label": plot.x_label,
        "y_label": plot.y_label,
        "tolerance": plot.tolerance,
        "time": arrays.add_times(plot.time),
        "x": arrays.add_centred_floats(plot.x),
        "y": arrays.add_centred_floats(plot.y),
        "limits": [{"name": name, "points": arrays.add_floats(points)} for name, points in plot.limits],
    }


def encode_motions(film: Film, motions: Sequence[FilmedMotion], arrays: ArrayEncoder) -> list[dict[str, Any]]:
    """Motions as `showMotion` of the page's view takes them, with references to arrays.

    Positions and rotations are rounded as those of the film.
    """
    rounding = rounding_of(film)
    step = rounding / np.sqrt(3.0)
    turn_step = rounding / (4.0 * max(reach_of(film), rounding))
    found = []
    for motion in motions:
        quaternions = motion.poses[:, :, 3:] / np.linalg.norm(motion.poses[:, :, 3:], axis=2, keepdims=True)
        stretched = np.abs(motion.stretch - np.eye(3)).max(axis=(1, 2)) > UNSTRETCHED
        found.append(
            {
                "time": arrays.add_times(motion.time),
                "positions": arrays.add_fixed_point(motion.poses[:, :, :3], step),
                "quaternions": arrays.add_fixed_point(make_continuous(quaternions), turn_step),
                "stretch": [[int(k), _short(motion.stretch[k].ravel())] for k in np.flatnonzero(stretched)],
                "springs": [arrays.add_fixed_point(spring.ends, step) for spring in motion.springs],
                "rods": [arrays.add_fixed_point(rod.ends, step) for rod in motion.rods],
                "events": [{"time": event.time, "text": event.text} for event in motion.events],
            }
        )
    return found
