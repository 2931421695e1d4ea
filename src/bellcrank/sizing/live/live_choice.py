"""Motors and gears among which the reader of a selection's page chooses, as expressions of the numbers of the choices.

Each pair is traced with the judge's own code (live_criteria.py); the number of the choice picks one of the results. The
body of a motor and gear at its mount is a payload of the robot, whose mass, centre and inertia the choice picks too, so
that the loads of all joints follow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.actuators.actuator import Actuator
from bellcrank.errors import BellcrankError
from bellcrank.files.temporaries import temporary_folder
from bellcrank.robot.model.payload import Payload
from bellcrank.scene.scene import load_scene
from bellcrank.sizing.live.live_criteria import DriveSample, DriveUses, LiveDrive, LiveSample
from bellcrank.sizing.selection.criteria import CriterionResult
from bellcrank.sizing.selection.selection import AxisSelection, Candidate, Selection, pair_id
from bellcrank.sizing.selection.written_config import actuator_payload
from bellcrank.sizing.size import size

if TYPE_CHECKING:
    import casadi

    from bellcrank.actuators.gear import Gear
    from bellcrank.actuators.motor import Motor
    from bellcrank.sizing.result import Sizing

MOST = 5  # pairs of a joint: each adds its expressions to the page


@dataclass(frozen=True, kw_only=True)
class Alternative:
    """A motor and gear of a joint.

    Attributes:
        name: Their ids, "motor+gear".
        label: Their names.
        actuator: The motor and gear under their conditions.
        judged: Their criteria.
        body: Their body at the mount; None where the robot does not have one.
    """

    name: str
    label: str
    actuator: Actuator
    judged: tuple[CriterionResult, ...]
    body: Payload | None


@dataclass(frozen=True)
class Choices:
    """The motors and gears of joints, those of the sizing first; `bodies` says which payload of the robot, counted from
    1, the body of those of a joint is.
    """

    pairs: Mapping[str, tuple[Alternative, ...]] = field(default_factory=dict)
    bodies: Mapping[str, int] = field(default_factory=dict)


@dataclass(eq=False)
class LiveChoice:
    """One of several motors and gears of a joint, as `LiveDrive`; `choice` is the number of it."""

    drives: Sequence[LiveDrive]
    choice: casadi.SX

    @property
    def ratio(self) -> casadi.SX | float:
        """The gear's ratio."""
        return pick(self.choice, [drive.ratio for drive in self.drives])

    def at(self, sample: LiveSample) -> DriveSample:
        """What the drive bears at a sample; 0 in place of sizes and rates that not all drives have."""
        self._each = each = [drive.at(sample) for drive in self.drives]
        return DriveSample(
            pick(self.choice, [one.shaft for one in each]),
            self._rows([one.sizes for one in each]),
            self._rows([one.rates for one in each]),
        )

    def uses(self, most: list[casadi.SX], mean: list[casadi.SX], joint: tuple[casadi.SX, ...]) -> DriveUses:
        """The uses, NaN of criteria that the chosen drive does not have."""
        found = [
            drive.uses(most[: len(one.sizes)], mean[: len(one.rates)], joint)
            for drive, one in zip(self.drives, self._each, strict=True)
        ]
        names = dict.fromkeys(name for one in found for name in one.uses)
        uses = {name: pick(self.choice, [one.uses.get(name, np.nan) for one in found]) for name in names}
        self.computed = {name: [k for k, one in enumerate(found) if name in one.uses] for name in names}
        return DriveUses(found[0].rms_torque, uses)

    def _rows(self, each: list[list[casadi.SX]]) -> list[casadi.SX]:
        count = max(map(len, each))
        return [pick(self.choice, [one[k] if k < len(one) else 0.0 for one in each]) for k in range(count)]


def pick(choice: casadi.SX, values: Sequence[casadi.SX | float]) -> casadi.SX:
    """The value whose number is `choice`."""
    import casadi

    found = casadi.SX(values[0])
    for k, value in enumerate(values[1:], 1):
        if not (isinstance(value, float) and found.is_constant() and float(found) == value):
            found = casadi.if_else(choice == k, value, found)
    return found


def selected_sizing(selection: Selection) -> tuple[Sizing, Choices] | str:
    """The sizing of the chosen motors and gears, and the best others; or a clause that says why there is none."""
    if any(one.chosen is None for one in selection.axes):
        return "not every axis has a motor"
    config = None if selection.inputs is None else selection.inputs.config
    if config is None or selection.inputs is None:
        return "it was not made for a robot configuration"
    trusted = [config.source.resolve().parent, config.urdf.resolve().parent]
    trusted += [] if config.access is None else [folder for folder in config.access.trusted if folder.is_dir()]
    try:
        with temporary_folder("selection") as folder:
            written = load_scene(selection.write_config(folder / f"{config.source.stem}.yaml"), trust=trusted)
            names = [motion.name for motion in selection.inputs.motions]
            if not set(names) <= set(written.config.motions):
                return "its motions are not those of the configuration"
            sizing = size(written, names)
    except BellcrankError as error:
        return f"its configuration cannot be written: {error}"
    if {joint.name for joint in sizing.joints} != {one.axis.name for one in selection.axes}:
        return "its axes are not joints with a motor each"
    return sizing, _choices(selection, len(written.config.payloads))


def _choices(selection: Selection, count: int) -> Choices:
    """The pairs of each joint with a motor of its own; `count` payloads end with the bodies of those chosen."""
    found = dict[str, tuple[Alternative, ...]]()
    bodies = [name for one in selection.axes if (name := _body_of(selection, one)) is not None]
    for one in selection.axes:
        assert one.chosen is not None
        others = [each for each in one.candidates if each.id != one.chosen.id]
        pairs = list[Alternative]()
        for candidate in [one.chosen, *others][:MOST]:
            try:
                pair = _alternative(selection, one, candidate)
            except BellcrankError:  # the URDF contains a heavier one
                continue
            if not pairs or _comparable(pair, pairs[0]):
                pairs.append(pair)
        found[one.axis.name] = tuple(pairs)
    return Choices(found, {name: count - len(bodies) + 1 + k for k, name in enumerate(bodies)})


def _comparable(pair: Alternative, first: Alternative) -> bool:
    """Whether the masses of both, and what their torques need, are known or are part of the robot."""
    known = not pair.actuator.unknown_of_torque and not first.actuator.unknown_of_torque
    return known and (pair.body is None) == (first.body is None)


def _body_of(selection: Selection, one: AxisSelection) -> str | None:
    assert one.chosen is not None
    if not selection.feedback or one.chosen.mass is None or actuator_payload(one, one.chosen) is None:
        return None
    return one.axis.name


def _alternative(selection: Selection, one: AxisSelection, candidate: Candidate) -> Alternative:
    body = None
    if selection.feedback and candidate.mass is not None:
        data = actuator_payload(one, candidate)
        body = None if data is None else Payload(data["mass"], data["frame"], tuple(data["cg"]), tuple(data["inertia"]))
    products: list[Motor | Gear] = [candidate.motor]
    if candidate.gear.kind != "direct":
        products.append(candidate.gear)
    return Alternative(
        name=pair_id(candidate.motor, candidate.gear),
        label=" + ".join(f"{product.maker} {product.model}" for product in products),
        actuator=Actuator.of(*selection.stated(candidate), one.conditions),
        judged=tuple(each for each in candidate.criteria if each.verdict != "note"),
        body=body,
    )
