"""The motions of a robot configuration: read and checked at once, built when asked for.

Kinds and their keys, units as elsewhere (m, rad or "… deg", s): circle {frame, center, radius, normal, turns}
and line {frame, end, begin}, both with {start, duration, speed, acceleration, jerk, profile, orientation,
samples, coordinates}; waypoints {times, positions, samples}; dwell {position, duration}; csv {file}; join {parts: names
of motions, or motions in place}. In a join a part without `start` or `position` starts where the part before
it ended.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from bellcrank.config.fields import Fields, parse_number
from bellcrank.errors import BellcrankError, InputError
from bellcrank.messages import format_value, unknown_name

if TYPE_CHECKING:
    from bellcrank.motion.coordinates import Array
    from bellcrank.motion.motion import Motion
    from bellcrank.motion.path import FramePath
    from bellcrank.robot.robot import Robot

KINDS = ("circle", "line", "waypoints", "dwell", "csv", "join")
MOST_PARTS = 10_000  # of a join, those of joins in it counted one by one
MOST_JOINS = 50  # in each other
PROFILES = ("constant", "trapezoid", "quintic", "s_curve")
Posture = dict[str, float] | tuple[float, ...]


@dataclass(frozen=True)
class MotionEntry:
    """One motion of a configuration: its kind, checked arguments, and where it stands."""

    name: str
    kind: str
    arguments: Mapping[str, Any]
    fields: Fields

    def build(self, robot: Robot, entries: Mapping[str, MotionEntry], previous: Any = None) -> Motion:
        """The motion for a robot, going on from the posture `previous` (nq,) where it says no other.

        `entries` are the configuration's motions. Raises BellcrankError naming the place in the configuration.
        """
        try:
            motion: Motion = _BUILD[self.kind](self, robot, entries, previous)
            return motion
        except BellcrankError as error:
            if str(error).startswith(self.fields.where):
                raise
            raise type(error)(f"{self.fields.error('', str(error))}") from None


def read_motion_entry(name: str, fields: Fields) -> MotionEntry:
    """Check one motion's mapping; InputError names file, key, what was expected and what there is."""
    kind = fields.choice("kind", KINDS)
    arguments = _READ[kind](fields, name)
    fields.done()
    return MotionEntry(name, kind, arguments, fields)


def check_references(entries: Mapping[str, MotionEntry]) -> None:
    """Refuse a join of an unknown motion or of itself, and one of more than MOST_PARTS parts once those of the motions
    that it names are counted (InputError).
    """
    known: dict[str, tuple[int, int]] = {}  # parts, and how deep joins stand in each other

    def visit(entry: MotionEntry, above: tuple[str, ...]) -> tuple[int, int]:
        count, depth = 0 if entry.kind == "join" else 1, 0
        for part in entry.arguments.get("parts", ()):
            if isinstance(part, MotionEntry):
                inside = visit(part, above)
            elif part not in entries:
                raise entry.fields.error("parts", unknown_name("motion", part, entries))
            elif part in above:
                raise entry.fields.error("parts", f"the motion '{part}' is joined to itself")
            else:
                if part not in known and len(above) < MOST_JOINS:
                    known[part] = visit(entries[part], (*above, part))
                inside = known.get(part, (0, MOST_JOINS))
            count, depth = count + inside[0], max(depth, inside[1] + 1)
        if count > MOST_PARTS:
            raise entry.fields.error("parts", f"expected a join of at most {MOST_PARTS} motions, found {count}")
        if depth > MOST_JOINS:
            raise entry.fields.error("parts", f"joins stand more than {MOST_JOINS} deep in each other")
        return count, depth

    for name, entry in entries.items():
        if name not in known:
            known[name] = visit(entry, (name,))


def csv_texts(entries: Iterable[MotionEntry]) -> Iterator[tuple[str, str]]:
    """(what is written under `file`, what the file held) of each CSV motion, those in joins among them."""
    for entry in entries:
        if entry.kind == "csv" and entry.arguments["text"] is not None:
            yield entry.fields.text("file"), entry.arguments["text"]
        yield from csv_texts(part for part in entry.arguments.get("parts", ()) if isinstance(part, MotionEntry))


def read_posture(fields: Fields, key: str) -> Posture:
    """A posture: {joint: angle} or a list of all coordinates, rad ("30 deg") or m; InputError otherwise."""
    return _posture(fields, key, fields.raw(key))


def _posture(fields: Fields, key: str, value: object) -> Posture:
    if isinstance(value, Mapping):
        result = {}
        for joint, angle in value.items():
            try:
                result[str(joint)] = parse_number(angle, "rad or m")
            except ValueError as error:
                raise fields.error(key, f"joint '{joint}': {error}") from None
        return result
    if isinstance(value, (list, tuple)):
        try:
            return tuple(parse_number(entry, "rad or m") for entry in value)
        except ValueError as error:
            raise fields.error(key, str(error)) from None
    raise fields.error(key, f"expected {{joint: angle}} or a list of coordinates, found {format_value(value)}")


def _read_timing(fields: Fields, profile: str) -> dict[str, Any]:
    values: dict[str, Any] = {
        "duration": fields.optional_number("duration", "s", positive=True),
        "speed": fields.optional_number("speed", "m/s", positive=True),
        "acceleration": fields.optional_number("acceleration", "m/s^2", positive=True),
        "jerk": fields.optional_number("jerk", "m/s^3", positive=True),
    }
    if values["duration"] is None and values["speed"] is None and values["acceleration"] is None:
        raise fields.error("", "the key 'duration' is missing (or limits: 'speed', 'acceleration', 'jerk')")
    values = {key: value for key, value in values.items() if value is not None}
    values["profile"] = fields.choice("profile", PROFILES, profile)
    values["samples"] = fields.integer("samples", 1001, minimum=2)
    if "start" in fields:
        values["start"] = read_posture(fields, "start")
    if "orientation" in fields:
        held = fields.raw("orientation") == "hold"
        values["orientation"] = "hold" if held else fields.vector("orientation", 3, "rad")
    if "coordinates" in fields:
        values["coordinates"] = _read_coordinates(fields)
    fields.known("start", "orientation", "coordinates")
    values["frame"] = fields.text("frame")
    return values


def _read_coordinates(fields: Fields) -> tuple[str, ...]:
    given = fields.raw("coordinates")
    if not isinstance(given, (list, tuple)) or not given or not {"x", "y", "z"}.issuperset(map(str, given)):
        raise fields.error("coordinates", f"expected a list of some of x, y, z, found {format_value(given)}")
    return tuple(dict.fromkeys(map(str, given)))


def _read_circle(fields: Fields, name: str) -> dict[str, Any]:
    return _read_timing(fields, "constant") | {
        "center": fields.vector("center", 3, "m"),
        "radius": fields.number("radius", "m", positive=True),
        "normal": fields.vector("normal", 3, "", (0.0, 0.0, 1.0)),
        "turns": fields.number("turns", "", 1.0),
    }


def _read_line(fields: Fields, name: str) -> dict[str, Any]:
    values = _read_timing(fields, "quintic") | {"end": fields.vector("end", 3, "m")}
    if "begin" in fields:
        values["begin"] = fields.vector("begin", 3, "m")
    fields.known("begin")
    return values


def _read_waypoints(fields: Fields, name: str) -> dict[str, Any]:
    times, positions = fields.numbers("times", "s"), fields.raw("positions")
    if not isinstance(positions, (list, tuple)):
        raise fields.error("positions", f"expected a list of postures, found {format_value(positions)}")
    if len(positions) != len(times):
        raise fields.error(
            "positions", f"expected one posture for each of the {len(times)} times, found {len(positions)}"
        )
    if len(times) < 2 or any(b <= a for a, b in pairwise(times)):
        raise fields.error("times", "expected at least two times that increase")
    return {
        "times": times,
        "positions": [_posture(fields, "positions", entry) for entry in positions],
        "samples": fields.integer("samples", 1001, minimum=2),
    }


def _read_dwell(fields: Fields, name: str) -> dict[str, Any]:
    values: dict[str, Any] = {"duration": fields.number("duration", "s", positive=True)}
    if "position" in fields:
        values["position"] = read_posture(fields, "position")
    fields.known("position")
    return values


def _read_csv(fields: Fields, name: str) -> dict[str, Any]:
    from bellcrank.motion.csv_file import motion_text

    path = fields.file("file")
    try:
        return {
            "path": path,
            "text": motion_text(path),
        }  # read now, so that a configuration is what it was when it was loaded
    except InputError:
        return {"path": path, "text": None}  # whoever asks for the motion is told


def _read_join(fields: Fields, name: str) -> dict[str, Any]:
    raw = fields.raw("parts")
    if not isinstance(raw, (list, tuple)) or not raw:
        raise fields.error("parts", f"expected a list of motions, found {format_value(raw)}")
    parts: list[str | MotionEntry] = []
    for index, entry in enumerate(raw):
        if isinstance(entry, str):
            parts.append(entry)
        elif isinstance(entry, Mapping):
            place = Fields(entry, fields.where, f"{fields.path}.parts[{index + 1}]", fields.access)
            parts.append(read_motion_entry(f"{name} part {index + 1}", place))
        else:
            raise fields.error("parts", f"expected names of motions or mappings, found {format_value(entry)}")
    return {"parts": tuple(parts)}


def frame_path(entry: MotionEntry, here: Array) -> FramePath:
    """The path of an entry of kind circle or line, from a frame that is `here` (3,) m. Raises InputError."""
    from bellcrank.motion import path

    given = dict(entry.arguments)
    timing = (given.get("duration"), given.get("speed"), given.get("acceleration"), given.get("jerk"))
    last = (given.get("orientation"), given["samples"], given.get("coordinates", path.AXES), entry.name)
    if entry.kind == "circle":
        shape = (given["center"], given["radius"], given["normal"], given["turns"])
        return path.circle_path(given["frame"], *shape, timing, given["profile"], *last)
    return path.line_path(given["frame"], here, given["end"], given.get("begin"), timing, given["profile"], *last)


def _build_path(entry: MotionEntry, robot: Robot, entries: Mapping[str, MotionEntry], previous: Any) -> Motion:
    from bellcrank.motion import path

    arguments = dict(entry.arguments)
    if "start" not in arguments and previous is not None:
        arguments["start"] = previous
    make: Callable[..., Motion] = path.circle if entry.kind == "circle" else path.line
    return make(robot, name=entry.name, **arguments)


def _build_waypoints(entry: MotionEntry, robot: Robot, entries: Mapping[str, MotionEntry], previous: Any) -> Motion:
    from bellcrank.motion.waypoints import waypoints

    arguments = entry.arguments
    positions: Sequence[Any] = arguments["positions"]
    return waypoints(robot, arguments["times"], positions, samples=arguments["samples"], name=entry.name)


def _build_dwell(entry: MotionEntry, robot: Robot, entries: Mapping[str, MotionEntry], previous: Any) -> Motion:
    from bellcrank.motion.motion import dwell

    position = entry.arguments.get("position", previous)
    if position is None:
        raise InputError("a dwell needs a 'position' unless it follows another motion in a join")
    return dwell(robot, position, entry.arguments["duration"], name=entry.name)


def _build_csv(entry: MotionEntry, robot: Robot, entries: Mapping[str, MotionEntry], previous: Any) -> Motion:
    from bellcrank.motion.csv_file import read_motion

    return read_motion(robot, entry.arguments["path"], name=entry.name, text=entry.arguments["text"])


def _build_join(entry: MotionEntry, robot: Robot, entries: Mapping[str, MotionEntry], previous: Any) -> Motion:
    from bellcrank.motion.motion import join

    motions: list[Motion] = []
    for part in entry.arguments["parts"]:
        one = entries[part] if isinstance(part, str) else part
        motions.append(one.build(robot, entries, motions[-1].position[-1] if motions else previous))
    return join(*motions, name=entry.name)


_READ: dict[str, Callable[[Fields, str], dict[str, Any]]] = {
    "circle": _read_circle,
    "line": _read_line,
    "waypoints": _read_waypoints,
    "dwell": _read_dwell,
    "csv": _read_csv,
    "join": _read_join,
}
_BUILD: dict[str, Callable[[MotionEntry, Any, Mapping[str, MotionEntry], Any], Any]] = {
    "circle": _build_path,
    "line": _build_path,
    "waypoints": _build_waypoints,
    "dwell": _build_dwell,
    "csv": _build_csv,
    "join": _build_join,
}
