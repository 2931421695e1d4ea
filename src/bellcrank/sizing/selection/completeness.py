"""How many products of a catalogue state what each criterion needs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bellcrank.actuators.catalogue.catalogue import Catalogue
from bellcrank.actuators.gear import DIRECT, Gear
from bellcrank.actuators.motor import Motor
from bellcrank.arrays import Mask
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
        pairs: Share of all pairs of a motor and a gear (or none) that state everything; None where there is no motor.
    """

    criterion: str
    motors: int | None
    gears: int | None
    pairs: float | None


def completeness(catalogue: Catalogue) -> tuple[Completeness, ...]:
    """How many products of a catalogue state what each criterion needs, in the order of the criteria.

    Actuators sold as one pair with `DIRECT` alone, motors also with every gear.
    """
    return tuple(_of(criterion, catalogue) for criterion in CRITERIA)


def _of(criterion: Criterion, catalogue: Catalogue) -> Completeness:
    motors, gears = catalogue.motors, (*catalogue.gears, DIRECT)
    of_motor = np.array([[_states(needed, "motor", one, DIRECT) for one in motors] for needed in criterion.needs])
    of_gear = np.array([[_states(needed, "gear", _NONE, one) for one in gears] for needed in criterion.needs])
    possible = np.ones((len(motors), len(gears)), dtype=bool)
    possible[[one.kind == "actuator" for one in motors], :-1] = False
    complete = (of_motor[:, :, None] & of_gear[:, None, :]).any(axis=0) & possible if len(motors) else possible
    return Completeness(
        criterion=criterion.name,
        motors=_count(of_motor[_asking("motor", criterion)]),
        gears=_count(of_gear[_asking("gear", criterion), :-1]),
        pairs=float(complete.sum() / possible.sum()) if len(motors) else None,
    )


def _states(needed: Sequence[str], side: str, motor: Motor, gear: Gear) -> bool:
    """Whether a product states those of the needed fields that belong to its side."""
    return not lacks(tuple(name for name in needed if name.startswith(side)), motor, gear)


def _asking(side: str, criterion: Criterion) -> list[int]:
    """Numbers of the alternatives that need something of a side."""
    return [k for k, needed in enumerate(criterion.needs) if any(name.startswith(f"{side}.") for name in needed)]


def _count(states: Mask) -> int | None:
    """The number of products (columns) that satisfy one of the alternatives (rows); None without any."""
    return int(states.any(axis=0).sum()) if len(states) else None
