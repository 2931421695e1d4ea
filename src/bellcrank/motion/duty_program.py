"""`DutyStep`: a step of a duty program, which says in which order motions and pauses follow each other in a cycle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bellcrank import arguments
from bellcrank.config.fields import Fields
from bellcrank.errors import InputError
from bellcrank.messages import format_value

_EXPECTED = "expected a list such as [pick, {motion: circle, repeat: 3}, {pause: 2 s}]"


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
        >>> from bellcrank.motion.duty_program import DutyStep
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
            >>> from bellcrank.motion.duty_program import DutyStep
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
