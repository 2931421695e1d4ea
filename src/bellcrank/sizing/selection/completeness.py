"""How many products of a catalogue state what each criterion needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from bellcrank.actuators.catalogue import Catalogue
from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.motor import Motor
from bellcrank.sizing.selection.criteria import Criterion, lacks
from bellcrank.sizing.selection.judge import CRITERIA

_NONE = Motor(id="none", maker="", model="")


@dataclass(frozen=True, kw_only=True)
class Completeness:
    """How many products state what a criterion needs.

    Attributes:
        criterion: Its name.
        motors: Number of motors that state what it needs of a motor; None where it needs nothing of them.
        gears: Number of gears, in the same way.
        pairs: Share of all pairs of a motor and a gear (or none) that state everything.
    """

    criterion: str
    motors: int | None
    gears: int | None
    pairs: float


def completeness(catalogue: Catalogue) -> tuple[Completeness, ...]:
    """How many products of a catalogue state what each criterion needs, in the order of the criteria.

    Actuators sold as one pair with `DIRECT` alone, motors also with every gear.
    """
    return tuple(_of(criterion, catalogue) for criterion in CRITERIA)


def _of(criterion: Criterion, catalogue: Catalogue) -> Completeness:
    motors, gears = catalogue.motors, (*catalogue.gears, DIRECT)
    of_motor = [[_states(needed, "motor", motor, DIRECT) for motor in motors] for needed in criterion.needs]
    of_gear = [
        [_states(needed, "gear", motors[0], gear) for gear in gears] if motors else [] for needed in criterion.needs
    ]
    asked = {name.split(".")[0] for needed in criterion.needs for name in needed}
    complete = possible = 0
    for m, motor in enumerate(motors):
        usable = [len(gears) - 1] if motor.kind == "actuator" else range(len(gears))
        possible += len(usable)
        complete += sum(any(a[m] and b[g] for a, b in zip(of_motor, of_gear, strict=True)) for g in usable)
    return Completeness(
        criterion=criterion.name,
        motors=_count(of_motor) if "motor" in asked else None,
        gears=_count([one[:-1] for one in of_gear]) if "gear" in asked else None,
        pairs=complete / possible if possible else 0.0,
    )


def _states(needed: Sequence[str], side: str, motor: Motor, gear: Gear) -> bool:
    """Whether a product states those of the needed fields that belong to its side."""
    return not lacks(tuple(name for name in needed if name.startswith(side)), motor, gear)


def _count(alternatives: Sequence[Sequence[bool]]) -> int:
    """The number of products that satisfy one of the alternatives."""
    return sum(any(states) for states in zip(*alternatives, strict=True))
