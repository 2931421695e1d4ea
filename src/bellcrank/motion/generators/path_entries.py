"""Motions of a robot configuration that draw a frame along circles, lines and points, or go from point to point."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from bellcrank.arrays import Array
from bellcrank.config.fields import Fields, parse_number
from bellcrank.errors import InputError
from bellcrank.messages import format_value, unknown_name
from bellcrank.motion.motion_entry import MotionEntry, Posture, posture_of, read_posture

if TYPE_CHECKING:
    from bellcrank.motion.generators.path import Circle, FramePath, Line, PathOptions, Placement
    from bellcrank.motion.generators.tool_path import PathPoint, Polyline
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot

PROFILES = ("constant", "trapezoid", "quintic", "s_curve")


@dataclass(frozen=True)
class PathEntry(MotionEntry):
    """A motion that draws a frame along a path; `start` is the posture whose branch it follows, `placement` where the
    path lies as a whole, None: as it is written.
    """

    options: PathOptions
    start: Posture | None
    placement: Placement | None

    @abstractmethod
    def written_paths(self, here: Array) -> tuple[FramePath, ...]:
        """The paths as they are written."""

    def paths(self, here: Array) -> tuple[FramePath, ...]:
        """The paths from stop to stop, for a frame that is `here` (3,) m at the start. Raises InputError."""
        paths = self.written_paths(here)
        return paths if self.placement is None else tuple(map(self.placement.moved, paths))

    def motion(self, robot: Robot, entries: Mapping[str, MotionEntry], previous: Array | None) -> Motion:
        """As `build`."""
        from bellcrank.motion.kinematics.path_inverse_kinematics import follow_paths, start_posture

        start = start_posture(robot, previous if self.start is None else self.start)
        here = robot.frame_pose(self.options.frame, start)[0]
        return follow_paths(robot, self.paths(here), start)


@dataclass(frozen=True)
class CircleEntry(PathEntry):
    """A motion along a circle."""

    circle: Circle
    kind = "circle"

    @classmethod
    def read(cls, name: str, fields: Fields) -> Self:
        """The entry of a mapping."""
        from bellcrank.motion.generators.path import Circle

        options, start = _read_path(name, fields, "constant")
        circle = Circle(
            center=fields.vector("center", 3, "m"),
            radius=fields.number("radius", "m", positive=True),
            normal=fields.vector("normal", 3, "", (0.0, 0.0, 1.0)),
            turns=fields.number("turns", "", 1.0),
        )
        return cls(name, fields, options, start, read_placement(fields), circle)

    def written_paths(self, here: Array) -> tuple[FramePath, ...]:
        """The path, which does not depend on where the frame is."""
        return (self.circle.path(self.options),)


@dataclass(frozen=True)
class LineEntry(PathEntry):
    """A motion along a straight line."""

    line: Line
    kind = "line"

    @classmethod
    def read(cls, name: str, fields: Fields) -> Self:
        """The entry of a mapping."""
        from bellcrank.motion.generators.path import Line

        options, start = _read_path(name, fields, "quintic")
        end = fields.vector("end", 3, "m")
        begin = fields.vector("begin", 3, "m") if "begin" in fields else None
        fields.known("begin")
        return cls(name, fields, options, start, _placed(fields), Line(end, begin))

    def written_paths(self, here: Array) -> tuple[FramePath, ...]:
        """The path, from `here` (3,) m where the entry gives no begin."""
        return (self.line.path(self.options, here),)


def _read_path(name: str, fields: Fields, profile: str) -> tuple[PathOptions, Posture | None]:
    """What circles and lines have in common, and the start posture; `profile` where the mapping gives none."""
    from bellcrank.motion.generators.path import PathOptions

    timing: dict[str, Any] = {
        "duration": fields.optional_number("duration", "s", positive=True),
        "speed": fields.optional_number("speed", "m/s", positive=True),
        "acceleration": fields.optional_number("acceleration", "m/s^2", positive=True),
        "jerk": fields.optional_number("jerk", "m/s^3", positive=True),
    }
    if timing["duration"] is None and timing["speed"] is None and timing["acceleration"] is None:
        raise fields.error("", "the key 'duration' is missing (or limits: 'speed', 'acceleration', 'jerk')")
    profile = fields.choice("profile", PROFILES, profile)
    place, start = read_place(fields)
    return PathOptions(name=name, profile=profile, **place, **timing), start


def read_place(fields: Fields) -> tuple[dict[str, Any], Posture | None]:
    """Which frame moves, with which orientation and coordinates and how many rows; and the start posture."""
    samples = fields.integer("samples", 1001, minimum=2)
    start = read_posture(fields, "start") if "start" in fields else None
    orientation: str | tuple[float, ...] | None = None
    if "orientation" in fields:
        held = fields.raw("orientation") == "hold"
        orientation = "hold" if held else fields.vector("orientation", 3, "rad")
    coordinates = _read_coordinates(fields) if "coordinates" in fields else None
    fields.known("start", "orientation", "coordinates")
    found = {
        "frame": fields.text("frame"),
        "orientation": orientation,
        "samples": samples,
        "coordinates": coordinates,
    }
    return found, start


def read_placement(fields: Fields) -> Placement | None:
    """Where the path lies, if that is given."""
    from bellcrank.motion.generators.path import Placement

    fields.known("placement")
    if "placement" not in fields:
        return None
    own = fields.mapping("placement")
    found = Placement(tuple(own.number(axis, "m", 0.0) for axis in ("x", "y", "z")), own.number("yaw", "rad", 0.0))
    own.done()
    return found


def _placed(fields: Fields) -> Placement | None:
    """The same of a path whose begin has to be given."""
    found = read_placement(fields)
    if found is not None and "begin" not in fields:
        raise fields.error("placement", "a path that begins where the frame is cannot be placed; give 'begin'")
    return found


def _read_coordinates(fields: Fields) -> tuple[str, ...]:
    given = fields.raw("coordinates")
    if not isinstance(given, (list, tuple)) or not given or not {"x", "y", "z"}.issuperset(map(str, given)):
        raise fields.error("coordinates", f"expected a list of some of x, y, z, found {format_value(given)}")
    return tuple(dict.fromkeys(map(str, given)))


# ---- Motions of a robot configuration that draw a frame along lines and arcs with blends.


LIMITED_PROFILES = ("trapezoid", "s_curve")
KEYS = ("to", "via", "blend")


@dataclass(frozen=True)
class ToolPathEntry(PathEntry):
    """A motion along lines and arcs."""

    polyline: Polyline
    kind = "tool_path"

    @classmethod
    def read(cls, name: str, fields: Fields) -> Self:
        """The entry of a mapping."""
        from bellcrank.motion.generators.path import PathOptions
        from bellcrank.motion.generators.tool_path import Polyline

        place, start = read_place(fields)
        options = PathOptions(
            name=name,
            profile=fields.choice("profile", LIMITED_PROFILES, "s_curve"),
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
        return cls(name, fields, options, start, _placed(fields), polyline)

    def written_paths(self, here: Array) -> tuple[FramePath, ...]:
        """The paths, from `here` (3,) m where the entry gives no begin."""
        return self.polyline.paths(self.options, here)


def _point(fields: Fields, number: int, given: object) -> PathPoint:
    """A point: a list of 3 lengths, or a mapping with to, via, blend."""
    from bellcrank.motion.generators.tool_path import PathPoint

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


# ---- Motions of a robot configuration from posture to posture in the time that limits of the joints allow.


UNITS = {"speed": "rad/s or m/s", "acceleration": "rad/s^2 or m/s^2", "jerk": "rad/s^3 or m/s^3"}
Limit = str | float | dict[str, float]


@dataclass(frozen=True)
class PointToPointEntry(MotionEntry):
    """A motion from posture to posture; `limits` are those that the mapping gives, by "speed", "acceleration", "jerk".

    `begin` None: from the posture before, in a join.
    """

    begin: Posture | None
    targets: tuple[Posture, ...]
    limits: Mapping[str, Limit]
    profile: str
    blend: float
    share: float
    samples: int
    kind = "point_to_point"

    @classmethod
    def read(cls, name: str, fields: Fields) -> Self:
        """The entry of a mapping."""
        begin, targets = _read_postures(fields)
        return cls(
            name=name,
            fields=fields,
            begin=begin,
            targets=targets,
            limits={key: _read_limit(fields, key) for key in UNITS if key in fields},
            profile=fields.choice("profile", LIMITED_PROFILES, "s_curve"),
            blend=fields.number("blend", "rad or m", 0.0, nonnegative=True),
            share=fields.number("share", "", 1.0, positive=True, maximum=1.0),
            samples=fields.integer("samples", 1001, minimum=2),
        )

    def motion(self, robot: Robot, entries: Mapping[str, MotionEntry], previous: Array | None) -> Motion:
        """As `build`."""
        from bellcrank.motion.generators.point_to_point import point_to_point

        begin = previous if self.begin is None else self.begin
        if begin is None:
            raise InputError("give 'from', unless the motion follows another one in a join")
        return point_to_point(
            robot,
            [begin, *self.targets],
            profile=self.profile,
            blend=self.blend,
            share=self.share,
            samples=self.samples,
            name=self.name,
            **self.limits,
        )

    @property
    def postures(self) -> tuple[Posture, ...]:
        """As in MotionEntry."""
        return self.targets if self.begin is None else (self.begin, *self.targets)


def _read_postures(fields: Fields) -> tuple[Posture | None, tuple[Posture, ...]]:
    """The first posture, if it is given, and those that follow: from `from` and `to`, or `positions`."""
    fields.known("from", "to", "positions")
    if "positions" in fields:
        for key in ("from", "to"):
            if key in fields:
                raise fields.error(key, "give 'from' and 'to', or 'positions', not both")
        positions = fields.raw("positions")
        if not isinstance(positions, (list, tuple)) or len(positions) < 2:
            raise fields.error("positions", f"expected a list of two postures or more, found {format_value(positions)}")
        postures = tuple(posture_of(fields, "positions", entry) for entry in positions)
        return postures[0], postures[1:]
    return read_posture(fields, "from") if "from" in fields else None, (read_posture(fields, "to"),)


def _read_limit(fields: Fields, key: str) -> Limit:
    value = fields.raw(key)
    if key == "speed" and value == "urdf":
        return "urdf"
    if not isinstance(value, Mapping):
        return fields.number(key, UNITS[key], positive=True)
    found = {}
    for joint, number in value.items():
        try:
            found[str(joint)] = parse_number(number, UNITS[key])
        except ValueError as error:
            raise fields.error(key, f"joint '{joint}': {error}") from None
        if found[str(joint)] <= 0.0:
            raise fields.error(key, f"joint '{joint}': expected more than 0, found {format_value(number)}")
    return found
