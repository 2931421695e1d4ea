"""Motions of a robot configuration from posture to posture in the time that limits of the joints allow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from bellcrank.config.fields import Fields, parse_number
from bellcrank.errors import InputError
from bellcrank.messages import format_value
from bellcrank.motion.motion_entry import MotionEntry, Posture, posture_of, read_posture

if TYPE_CHECKING:
    from bellcrank.motion.coordinates import Array
    from bellcrank.motion.motion import Motion
    from bellcrank.robot.robot import Robot

PROFILES = ("trapezoid", "s_curve")
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
            profile=fields.choice("profile", PROFILES, "s_curve"),
            blend=fields.number("blend", "rad or m", 0.0, nonnegative=True),
            share=fields.number("share", "", 1.0, positive=True, maximum=1.0),
            samples=fields.integer("samples", 1001, minimum=2),
        )

    def motion(self, robot: Robot, entries: Mapping[str, MotionEntry], previous: Array | None) -> Motion:
        """As `build`."""
        from bellcrank.motion.point_to_point import point_to_point

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
