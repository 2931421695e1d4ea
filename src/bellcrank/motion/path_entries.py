"""Motions of a robot configuration that draw a frame along a circle or a line."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from bellcrank.config.fields import Fields
from bellcrank.messages import format_value
from bellcrank.motion.motion_entry import MotionEntry, Posture, read_posture

if TYPE_CHECKING:
    from bellcrank.motion.coordinates import Array
    from bellcrank.motion.motion import Motion
    from bellcrank.motion.path import Circle, FramePath, Line, PathOptions
    from bellcrank.robot.robot import Robot

PROFILES = ("constant", "trapezoid", "quintic", "s_curve")


@dataclass(frozen=True)
class PathEntry(MotionEntry):
    """A motion that draws a frame along a path; `start` is the posture whose branch it follows."""

    options: PathOptions
    start: Posture | None

    @abstractmethod
    def paths(self, here: Array) -> tuple[FramePath, ...]:
        """The paths from stop to stop, for a frame that is `here` (3,) m at the start. Raises InputError."""

    def motion(self, robot: Robot, entries: Mapping[str, MotionEntry], previous: Array | None) -> Motion:
        """As `build`."""
        from bellcrank.motion.path_following import follow_paths, start_posture

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
        from bellcrank.motion.path import Circle

        options, start = _read_path(name, fields, "constant")
        circle = Circle(
            center=fields.vector("center", 3, "m"),
            radius=fields.number("radius", "m", positive=True),
            normal=fields.vector("normal", 3, "", (0.0, 0.0, 1.0)),
            turns=fields.number("turns", "", 1.0),
        )
        return cls(name, fields, options, start, circle)

    def paths(self, here: Array) -> tuple[FramePath, ...]:
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
        from bellcrank.motion.path import Line

        options, start = _read_path(name, fields, "quintic")
        end = fields.vector("end", 3, "m")
        begin = fields.vector("begin", 3, "m") if "begin" in fields else None
        fields.known("begin")
        return cls(name, fields, options, start, Line(end, begin))

    def paths(self, here: Array) -> tuple[FramePath, ...]:
        """The path, from `here` (3,) m where the entry gives no begin."""
        return (self.line.path(self.options, here),)


def _read_path(name: str, fields: Fields, profile: str) -> tuple[PathOptions, Posture | None]:
    """What circles and lines have in common, and the start posture; `profile` where the mapping gives none."""
    from bellcrank.motion.path import PathOptions

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


def _read_coordinates(fields: Fields) -> tuple[str, ...]:
    given = fields.raw("coordinates")
    if not isinstance(given, (list, tuple)) or not given or not {"x", "y", "z"}.issuperset(map(str, given)):
        raise fields.error("coordinates", f"expected a list of some of x, y, z, found {format_value(given)}")
    return tuple(dict.fromkeys(map(str, given)))
