"""One motion of a robot configuration, of any kind, and the order of motions and pauses in a duty program."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from bellcrank import arguments
from bellcrank.arrays import Array
from bellcrank.config.fields import Fields, parse_number
from bellcrank.errors import BellcrankError, InputError
from bellcrank.messages import format_value
from bellcrank.motion.motion import Motion

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot


Posture = dict[str, float] | tuple[float, ...]
_EXPECTED = "expected a list such as [pick, {motion: circle, repeat: 3}, {pause: 2 s}]"


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


@dataclass(frozen=True)
class DutyStep:
    """A motion that is repeated, or a pause in which the posture is held.

    Args:
        motion: Name of the motion; None for a pause.
        repeat: How many times in a row the motion is carried out, at least 1.
        pause: Duration of the pause, s; 0 for a motion.

    Raises:
        InputError: For a step that is neither a motion nor a pause, or both.

    Example:
        >>> from bellcrank.motion.motion_entry import DutyStep
        >>> [DutyStep("pick", 3), DutyStep(pause=2.0)]
        [DutyStep(motion='pick', repeat=3, pause=0.0), DutyStep(motion=None, repeat=1, pause=2.0)]
    """

    motion: str | None = None
    repeat: int = 1
    pause: float = 0.0

    def __post_init__(self) -> None:
        if self.motion is not None:
            arguments.text("motion", self.motion, "the name of a motion")
        object.__setattr__(self, "repeat", arguments.whole("repeat", self.repeat, least=1, where="a duty step"))
        pause = arguments.number("pause", self.pause, "s", least=0.0, most=arguments.LARGEST, where="a duty step")
        object.__setattr__(self, "pause", pause)
        if (self.motion is None) == (pause == 0.0):
            raise InputError("a duty step: expected either a motion, or a pause of more than 0 s")

    def as_data(self) -> dict[str, Any]:
        """The step as a mapping of a file.

        Returns:
            The keys `motion` and `repeat`, or `pause` in s.

        Example:
            >>> from bellcrank.motion.motion_entry import DutyStep
            >>> DutyStep("pick", 3).as_data(), DutyStep(pause=2.0).as_data()
            ({'motion': 'pick', 'repeat': 3}, {'pause': 2.0})
        """
        return {"pause": self.pause} if self.motion is None else {"motion": self.motion, "repeat": self.repeat}


def duty_from_fields(fields: Fields, key: str = "duty") -> tuple[DutyStep, ...]:
    """The duty program under a key of a file, empty where the key is missing. Raises InputError."""
    value = fields.raw(key, ())
    if not isinstance(value, (list, tuple)) or (key in fields and not value):
        raise fields.error(key, f"{_EXPECTED}, found {format_value(value)}")
    return tuple(_step(fields, key, entry, number) for number, entry in enumerate(value, 1))


def checked_duty(given: Sequence[Any] | None) -> tuple[DutyStep, ...] | None:
    """A duty program given as an argument: DutySteps, names of motions, or mappings as in a file; None for None.

    Raises InputError.
    """
    if given is None:
        return None
    listed = arguments.several("duty", given, object, "motions and pauses")
    fields = Fields({"duty": list(listed)}, "argument")
    if not listed:
        raise fields.error("duty", f"{_EXPECTED}, found nothing")
    return tuple(
        entry if isinstance(entry, DutyStep) else _step(fields, "duty", entry, number)
        for number, entry in enumerate(listed, 1)
    )


def _step(fields: Fields, key: str, entry: Any, number: int) -> DutyStep:
    """A step from the name of a motion or a mapping. Raises InputError that names its place in the list."""
    if isinstance(entry, str) and entry.strip():
        return DutyStep(entry)
    place = f"{fields.path}.{key}[{number}]" if fields.path else f"{key}[{number}]"
    if not isinstance(entry, Mapping):
        raise fields.error(key, f"{_EXPECTED}, found {arguments.found(entry)} as entry {number}")
    step = Fields(entry, fields.where, place, fields.access)
    if "pause" in step:
        found = DutyStep(pause=step.number("pause", "s", positive=True))
    else:
        step.known("pause")
        found = DutyStep(step.text("motion"), step.integer("repeat", 1, minimum=1))
    step.done()
    return found
