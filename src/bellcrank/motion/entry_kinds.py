"""The motions of a robot configuration: read and checked when the file is loaded, built when asked for.

Kinds and their keys, units as elsewhere (m, rad or "… deg", s): circle {frame, center, radius, normal, turns}
and line {frame, end, begin}, both with {start, duration, speed, acceleration, jerk, profile, orientation,
samples, coordinates}; tool_path {frame, points, begin, blend, and the others
of a line}; waypoints {times, positions, samples}; point_to_point {from, to, positions, speed,
acceleration, jerk, profile, blend, share, samples}; dwell {position, duration}; csv {file}; join {parts: names
of motions, or motions in place}. A part of a join without `start` or `position` starts where the part before it ended.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Self

from bellcrank.arrays import Array
from bellcrank.config.fields import Fields
from bellcrank.errors import InputError
from bellcrank.messages import format_value, unknown_name
from bellcrank.motion.generators.path_entries import CircleEntry, LineEntry, PointToPointEntry, ToolPathEntry
from bellcrank.motion.motion_entry import MotionEntry, Posture, posture_of, read_posture

if TYPE_CHECKING:
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot

MOST_PARTS = 10_000  # of a join, those of joins in it counted one by one
MOST_JOINS = 50  # in each other


@dataclass(frozen=True)
class WaypointsEntry(MotionEntry):
    """A motion through postures at given times (s)."""

    times: tuple[float, ...]
    positions: tuple[Posture, ...]
    samples: int
    kind = "waypoints"

    @classmethod
    def read(cls, name: str, fields: Fields) -> Self:
        """The entry of a mapping."""
        times, positions = fields.numbers("times", "s"), fields.raw("positions")
        if not isinstance(positions, (list, tuple)):
            raise fields.error("positions", f"expected a list of postures, found {format_value(positions)}")
        if len(positions) != len(times):
            raise fields.error(
                "positions", f"expected one posture for each of the {len(times)} times, found {len(positions)}"
            )
        if len(times) < 2 or any(b <= a for a, b in pairwise(times)):
            raise fields.error("times", "expected at least two increasing times")
        postures = tuple(posture_of(fields, "positions", entry) for entry in positions)
        return cls(name, fields, times, postures, fields.integer("samples", 1001, minimum=2))

    @property
    def postures(self) -> tuple[Posture, ...]:
        """As in MotionEntry."""
        return self.positions

    def motion(self, robot: Robot, entries: Mapping[str, MotionEntry], previous: Array | None) -> Motion:
        """As `build`."""
        from bellcrank.motion.generators.waypoints import waypoints

        return waypoints(robot, self.times, self.positions, samples=self.samples, name=self.name)


@dataclass(frozen=True)
class DwellEntry(MotionEntry):
    """Rest at a posture, or at the one before, for `duration` s."""

    duration: float
    position: Posture | None
    kind = "dwell"

    @classmethod
    def read(cls, name: str, fields: Fields) -> Self:
        """The entry of a mapping."""
        duration = fields.number("duration", "s", positive=True)
        position = read_posture(fields, "position") if "position" in fields else None
        fields.known("position")
        return cls(name, fields, duration, position)

    @property
    def postures(self) -> tuple[Posture, ...]:
        """As in MotionEntry."""
        return () if self.position is None else (self.position,)

    def motion(self, robot: Robot, entries: Mapping[str, MotionEntry], previous: Array | None) -> Motion:
        """As `build`."""
        from bellcrank.motion.generators.waypoints import dwell

        position = previous if self.position is None else self.position
        if position is None:
            raise InputError("a dwell needs a 'position' unless it follows another motion in a join")
        return dwell(robot, position, self.duration, name=self.name)


@dataclass(frozen=True)
class CsvEntry(MotionEntry):
    """A motion in a CSV file; `text` is what the file held when the configuration was loaded, None if it was
    unreadable.
    """

    path: Path
    text: str | None
    kind = "csv"

    @classmethod
    def read(cls, name: str, fields: Fields) -> Self:
        """The entry of a mapping."""
        from bellcrank.motion.sampled.csv_file import motion_text

        path = fields.file("file")
        try:
            text = motion_text(path)  # read now, so that later changes of the file do not matter
        except InputError:
            text = None  # `motion` raises it again
        return cls(name, fields, path, text)

    def motion(self, robot: Robot, entries: Mapping[str, MotionEntry], previous: Array | None) -> Motion:
        """As `build`."""
        from bellcrank.motion.sampled.csv_file import read_motion

        return read_motion(robot, self.path, name=self.name, text=self.text)


@dataclass(frozen=True)
class JoinEntry(MotionEntry):
    """Motions one after the other: names of motions, or entries of their own."""

    parts: tuple[str | MotionEntry, ...]
    kind = "join"

    @classmethod
    def read(cls, name: str, fields: Fields) -> Self:
        """The entry of a mapping."""
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
        return cls(name, fields, tuple(parts))

    def part_entries(self, entries: Mapping[str, MotionEntry]) -> list[MotionEntry]:
        """The parts, names looked up in the configuration's motions."""
        return [entries[part] if isinstance(part, str) else part for part in self.parts]

    def motion(self, robot: Robot, entries: Mapping[str, MotionEntry], previous: Array | None) -> Motion:
        """As `build`."""
        from bellcrank.motion.motion import join

        motions: list[Motion] = []
        for part in self.part_entries(entries):
            motions.append(part.build(robot, entries, motions[-1].position[-1] if motions else previous))
        return join(*motions, name=self.name)


_CLASSES: tuple[type[MotionEntry], ...] = (
    CircleEntry, LineEntry, ToolPathEntry, WaypointsEntry, PointToPointEntry, DwellEntry, CsvEntry, JoinEntry,
)  # fmt: skip
KINDS: dict[str, type[MotionEntry]] = {entry.kind: entry for entry in _CLASSES}


OTHER_WORDS = {  # what other programs call these kinds
    "spline": "waypoints", "cubic": "waypoints", "path": "waypoints", "trajectory": "waypoints",
    "ptp": "point_to_point", "joint": "point_to_point", "movej": "point_to_point", "trapezoid": "point_to_point",
    "linear": "line", "lin": "line", "movel": "line", "arc": "circle", "movec": "circle",
    "pause": "dwell", "wait": "dwell", "hold": "dwell", "file": "csv", "table": "csv", "sequence": "join",
}  # fmt: skip


def read_motion_entry(name: str, fields: Fields) -> MotionEntry:
    """The entry of a motion. Raises InputError with file, key, what was expected and what was found."""
    kind = fields.raw("kind", None)
    if isinstance(kind, str) and (meant := OTHER_WORDS.get(kind)):
        raise fields.error("kind", f"unknown kind '{kind}'; did you mean '{meant}'? (expected: {', '.join(KINDS)})")
    entry = KINDS[fields.choice("kind", tuple(KINDS))].read(name, fields)
    assert entry.speed_factor > 0.0  # checked now, so that the key is read
    fields.done()
    return entry


def check_references(entries: Mapping[str, MotionEntry]) -> None:
    """Refuse joins of unknown motions, of themselves, and of more than MOST_PARTS parts, nested joins counted part by
    part (InputError).
    """
    known: dict[str, tuple[int, int]] = {}  # parts, and how deep joins are nested

    def visit(entry: MotionEntry, above: tuple[str, ...]) -> tuple[int, int]:
        if not isinstance(entry, JoinEntry):
            return 1, 0
        count, depth = 0, 0
        for part in entry.parts:
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
            raise entry.fields.error("parts", f"joins are nested more than {MOST_JOINS} deep")
        return count, depth

    for name, entry in entries.items():
        if name not in known:
            known[name] = visit(entry, (name,))


def csv_texts(entries: Iterable[MotionEntry]) -> Iterator[tuple[str, str]]:
    """(what is written under `file`, what the file held) of each CSV motion, parts of joins included."""
    for entry in entries:
        if isinstance(entry, CsvEntry) and entry.text is not None:
            yield entry.fields.text("file"), entry.text
        if isinstance(entry, JoinEntry):
            yield from csv_texts(part for part in entry.parts if isinstance(part, MotionEntry))


def joins(entry: MotionEntry | str, name: str) -> bool:
    """Whether a motion is joined from others, of which one is that of a name."""
    return isinstance(entry, JoinEntry) and any(one == name or joins(one, name) for one in entry.parts)
