"""A film as a page carries it: JSON for what it is made of, and one block of numbers that the JSON points into."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from bellcrank.errors import InputError
from bellcrank.motion.resampling import SHARE as VALUE_SHARE
from bellcrank.replays.film.arrow_scale import arrow_scales
from bellcrank.replays.film.film import Array, Axis, Chart, Film, Mesh, Plane, Shape, Trace
from bellcrank.replays.film.film_check import check
from bellcrank.replays.page.block import Block, Reference

SHARE = 0.1  # of the film's bound: how far rounding may put a point off, besides
FINEST = 1e-6  # of the extent: rounding finer than this is not seen
MESH_STEPS = 2.0**15 - 1.0  # across a mesh


def pack(film: Film, *, plots: bool = True) -> tuple[str, str]:
    """The JSON text of a film, safe inside an HTML script element, and its block of numbers in base64.

    Raises InputError where the film contradicts itself or holds what is not a finite number, but for values of charts
    and planes, which leave a gap there, and for arrows, which are hidden there.
    """
    check(film)
    block = Block()
    rounding = _rounding(film)
    meshes: dict[int, tuple[int, Mesh]] = {}
    place = rounding / np.sqrt(3.0)  # a step: half a step along each axis is half the rounding
    turn = rounding / (4.0 * max(_reach(film), rounding))  # quaternion off by a step turns by 2, at the reach
    scales = arrow_scales(film)
    content: dict[str, Any] = {
        "title": film.title,
        "facts": film.facts,
        "good": film.good,
        "notes": film.notes,
        "bound": film.bound + rounding,
        "share": VALUE_SHARE,
        "time": block.add_times(film.time),
        "places": block.add_steps(film.poses[:, :, :3], place),
        "turns": block.add_steps(_continuous(film.poses[:, :, 3:]), turn),
        "bodies": [{"name": b.name, "shapes": [_shape(s, meshes) for s in b.shapes]} for b in film.bodies],
        "meshes": [_mesh(block, mesh) for _, mesh in meshes.values()],
        "camera": {"position": film.camera.position, "target": film.camera.target, "up": film.camera.up},
        "extent": _extent(film),
        "size": _size(film),
        "ground": film.ground and {"normal": film.ground.normal, "height": film.ground.height},
        "traces": [{"name": t.name, "pieces": _pieces(block, t, place)} for t in film.traces],
        "arrows": [_arrow(block, film, k, place, scales) for k in range(len(film.arrows))],
        "scales": scales,
        "rods": [{"name": r.name, "ends": block.add_steps(r.ends, place)} for r in film.rods],
        "springs": [{"name": s.name, "ends": block.add_steps(s.ends, place)} for s in film.springs],
        "axes": [_axis(a) for a in film.axes],
        "marks": [{"time": m.time, "text": m.text} for m in sorted(film.marks, key=lambda m: m.time)],
        "charts": [_chart(block, c) for c in film.charts] if plots else [],
        "planes": [_plane(block, p) for p in film.planes] if plots else [],
    }
    return safe_json(content), block.text()


def safe_json(content: Any) -> str:
    """JSON that no HTML parser can take for markup: ASCII only, and without angle brackets and ampersands."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"), ensure_ascii=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


# ---- sizes


def _rounding(film: Film) -> float:
    """How far rounding may put any point off (m)."""
    return float(max(SHARE * film.bound, FINEST * _extent(film)))


def _extent(film: Film) -> float:
    """How far the bodies and their motion reach from the middle of where they are (m)."""
    places = film.poses[:, :, :3].reshape(-1, 3)
    half = 0.5 * float(np.linalg.norm(np.ptp(places, axis=0))) if len(places) else 0.0
    return half + _reach(film) or 1.0


def _size(film: Film) -> float:
    """How far the bodies reach from the middle of where they are at one time, at most (m)."""
    places = film.poses[:, :, :3]
    apart = np.linalg.norm(np.ptp(places, axis=1), axis=1) if len(film.bodies) else np.zeros(1)
    return 0.5 * float(apart.max()) + _reach(film) or 1.0


def _reach(film: Film) -> float:
    """The farthest that any shape's point lies from its body's origin (m)."""
    spans: dict[int, float] = {}
    reach = 0.0
    for shape in (shape for body in film.bodies for shape in body.shapes):
        reach = max(reach, float(np.linalg.norm(shape.pose[:3])) + _radius(shape, spans))
    return reach


def _radius(shape: Shape, spans: dict[int, float]) -> float:
    if shape.kind == "mesh":
        if shape.mesh is None:
            raise InputError("a shape of kind 'mesh' has no mesh; give its triangles")
        if id(shape.mesh) not in spans:
            vertices = shape.mesh.vertices
            spans[id(shape.mesh)] = float(np.linalg.norm(vertices, axis=1).max()) if len(vertices) else 0.0
        return float(np.abs(shape.size).max()) * spans[id(shape.mesh)]
    if shape.kind == "box":
        return 0.5 * float(np.linalg.norm(shape.size))
    return float(np.hypot(shape.size[0], 0.5 * shape.size[1])) if shape.kind == "cylinder" else shape.size[0]


# ---- parts


def _continuous(turns: Array) -> Array:
    """Unit quaternions (n, bodies, 4) whose signs do not jump from frame to frame."""
    unit = turns / np.linalg.norm(turns, axis=2, keepdims=True)
    flips = np.where(np.einsum("nbk,nbk->nb", unit[1:], unit[:-1]) < 0.0, -1.0, 1.0)
    signs = np.cumprod(flips, axis=0)
    unit[1:] *= signs[:, :, None]
    return np.asarray(unit)


def _shape(shape: Shape, meshes: dict[int, tuple[int, Mesh]]) -> dict[str, Any]:
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


def _short(values: tuple[float, ...]) -> list[float]:
    return [float(f"{value:.7g}") for value in values]


def _mesh(block: Block, mesh: Mesh) -> dict[str, Reference]:
    """Triangles: corners to within half of 1 / MESH_STEPS of the mesh's size."""
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    size = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    return {
        "vertices": block.add_steps(vertices, max(size, 1e-9) / MESH_STEPS),
        "faces": block.add_integers(mesh.faces),
    }


def _pieces(block: Block, trace: Trace, place: float) -> list[dict[str, Reference]]:
    """The unbroken stretches of a trace: it is not drawn where its points are not finite."""
    there = np.isfinite(trace.points).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]])))
    return [
        {"time": block.add_times(trace.time[a:b]), "points": block.add_steps(trace.points[a:b], place)}
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if b - a > 1
    ]


def _arrow(block: Block, film: Film, number: int, place: float, scales: list[dict[str, Any]]) -> dict[str, Any]:
    arrow = film.arrows[number]
    there = np.asarray(np.isfinite(np.hstack([arrow.points, arrow.vectors])).all(axis=1))
    last = np.maximum.accumulate(np.where(there, np.arange(len(there)), -1))  # where it was seen last
    points = np.where((last >= 0)[:, None], arrow.points[last], 0.0)
    return {
        "name": arrow.name,
        "about": arrow.about,
        "scale": next(k for k, scale in enumerate(scales) if number in scale["arrows"]),
        "time": block.add_times(film.time if arrow.time is None else arrow.time),
        "points": block.add_steps(np.where(np.isfinite(points), points, 0.0), place),
        "vectors": block.add_floats(np.where(there[:, None], arrow.vectors, 0.0)),
    }


def _axis(axis: Axis) -> dict[str, Any]:
    return {
        "name": axis.name,
        "body": axis.body,
        "point": _short(axis.point),
        "direction": _short(axis.direction),
        "spring": axis.spring,
    }


def _chart(block: Block, chart: Chart) -> dict[str, Any]:
    return {
        "title": chart.title,
        "unit": chart.unit,
        "logarithmic": chart.logarithmic,
        "share": chart.share,
        "lines": [
            {
                "name": line.name,
                "time": block.add_times(chart.time if line.time is None else line.time),
                "values": block.add_values(line.values),
            }
            for line in chart.lines
        ],
    }


def _plane(block: Block, plane: Plane) -> dict[str, Any]:
    return {
        "title": plane.title,
        "x_label": plane.x_label,
        "y_label": plane.y_label,
        "share": plane.share,
        "time": block.add_times(plane.time),
        "x": block.add_values(plane.x),
        "y": block.add_values(plane.y),
        "limits": [{"name": name, "points": block.add_floats(points)} for name, points in plane.limits],
    }
