"""Motions of a robot configuration that draw a frame along lines and arcs with blends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from bellcrank.config.fields import Fields, parse_number
from bellcrank.messages import format_value, unknown_name
from bellcrank.motion.path_entries import PathEntry, read_place

if TYPE_CHECKING:
    from bellcrank.motion.coordinates import Array
    from bellcrank.motion.path import FramePath
    from bellcrank.motion.tool_path import PathPoint, Polyline

PROFILES = ("trapezoid", "s_curve")
KEYS = ("to", "via", "blend")


@dataclass(frozen=True)
class ToolPathEntry(PathEntry):
    """A motion along lines and arcs."""

    polyline: Polyline
    kind = "tool_path"

    @classmethod
    def read(cls, name: str, fields: Fields) -> Self:
        """The entry of a mapping."""
        from bellcrank.motion.path import PathOptions
        from bellcrank.motion.tool_path import Polyline

        place, start = read_place(fields)
        options = PathOptions(
            name=name,
            profile=fields.choice("profile", PROFILES, "s_curve"),
            speed=fields.optional_number("speed", "m/s", positive=True),
            acceleration=fields.number("acceleration", "m/s^2", positive=True),
            jerk=fields.optional_number("jerk", "m/s^3", positive=True),
            **place,
        )
        points = fields.raw("points")
        if not isinstance(points, (list, tuple)) or not points:
            raise fields.error("points", f"expected a list of points, found {format_value(points)}")
        polyline = Polyline(
            tuple(_point(fields, number, point) for number, point in enumerate(points, start=1)),
            fields.vector("begin", 3, "m") if "begin" in fields else None,
            fields.number("blend", "m", 0.0, nonnegative=True),
        )
        fields.known("begin")
        return cls(name, fields, options, start, polyline)

    def paths(self, here: Array) -> tuple[FramePath, ...]:
        """The paths, from `here` (3,) m where the entry gives no begin."""
        return self.polyline.paths(self.options, here)


def _point(fields: Fields, number: int, given: object) -> PathPoint:
    """A point: a list of 3 lengths, or a mapping with to, via, blend."""
    from bellcrank.motion.tool_path import PathPoint

    if not isinstance(given, Mapping):
        return PathPoint(_lengths(fields, f"point {number}", given))
    for key in given:
        if key not in KEYS:
            raise fields.error("points", f"point {number}: {unknown_name('key', str(key), KEYS)}")
    if "to" not in given:
        raise fields.error("points", f"point {number}: the key 'to' is missing")
    via = _lengths(fields, f"point {number}: via", given["via"]) if "via" in given else None
    blend = None
    if "blend" in given:
        (blend,) = _lengths(fields, f"point {number}: blend", [given["blend"]], 1)
        if blend < 0.0:
            raise fields.error("points", f"point {number}: blend: expected 0 m or more, found {blend:g}")
    return PathPoint(_lengths(fields, f"point {number}", given["to"]), via, blend)


def _lengths(fields: Fields, what: str, given: object, count: int = 3) -> tuple[float, ...]:
    if not isinstance(given, (list, tuple)) or len(given) != count:
        raise fields.error("points", f"{what}: expected a list of {count} numbers in m, found {format_value(given)}")
    try:
        return tuple(parse_number(entry, "m") for entry in given)
    except ValueError as error:
        raise fields.error("points", f"{what}: {error}") from None
