"""One motion of a robot configuration, of any kind, and the postures in it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from bellcrank.arrays import Array
from bellcrank.config.fields import Fields, parse_number
from bellcrank.errors import BellcrankError
from bellcrank.messages import format_value
from bellcrank.motion.motion import Motion

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot

Posture = dict[str, float] | tuple[float, ...]


@dataclass(frozen=True)
class MotionEntry(ABC):
    """One motion of a configuration: its name, and the mapping in which it stands."""

    name: str
    fields: Fields
    kind: ClassVar[str]

    @classmethod
    @abstractmethod
    def read(cls, name: str, fields: Fields) -> Self:
        """The entry of a mapping. Raises InputError naming file and key."""

    @property
    def postures(self) -> tuple[Posture, ...]:
        """The postures that the entry names; none where it moves a frame, or holds other motions."""
        return ()

    @property
    def speed_factor(self) -> float:
        """The factor on all speeds of the motion, which keeps its path. InputError where it is not positive."""
        return self.fields.number("speed_factor", "", 1.0, positive=True)

    def paced(self, made: Motion) -> Motion:
        """The motion `made` of this entry at the speed that its factor says."""
        return made if self.speed_factor == 1.0 else stretched(made, 1.0 / self.speed_factor)

    @abstractmethod
    def motion(self, robot: Robot, entries: Mapping[str, MotionEntry], previous: Array | None) -> Motion:
        """As `build`; errors need not name the configuration."""

    def build(self, robot: Robot, entries: Mapping[str, MotionEntry], previous: Array | None = None) -> Motion:
        """The motion for a robot, starting from the posture `previous` (nq,) where the entry gives none.

        `entries` are the configuration's motions. Raises BellcrankError naming the place in the configuration.
        """
        try:
            return self.paced(self.motion(robot, entries, previous))
        except BellcrankError as error:
            if str(error).startswith(self.fields.where):
                raise
            raise type(error)(f"{self.fields.error('', str(error))}") from None


def read_posture(fields: Fields, key: str) -> Posture:
    """A posture: {joint: angle} or a list of all coordinates, rad ("30 deg") or m; InputError otherwise."""
    return posture_of(fields, key, fields.raw(key))


def posture_of(fields: Fields, key: str, value: object) -> Posture:
    """The posture that a value is, for a key of the mapping; InputError otherwise."""
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


# ---- A motion in more or less time: the same positions, velocities divided by s and accelerations by s².


def stretched(motion: Motion, factor: float) -> Motion:
    """The motion in `factor` times its time, which begins at the same time."""
    begin = motion.time[0]
    return replace(
        motion,
        time=begin + factor * (motion.time - begin),
        velocity=motion.velocity / factor,
        acceleration=motion.acceleration / factor**2,
        speed_noise=tuple(np.array(motion.speed_noise) / factor),
        forms=tuple(form.stretched(float(begin), factor) for form in motion.forms),
    )
