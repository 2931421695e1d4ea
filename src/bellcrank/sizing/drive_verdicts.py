"""What criteria say of given motors and gears: of each drive along its load cycles, and of all drives together."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from bellcrank import arguments
from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.actuator_fields import ROBOT_WIDE, actuator_data
from bellcrank.actuators.conditions import Conditions
from bellcrank.cached_values import cached_property
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.notes import WithNotes
from bellcrank.present.results import JsonLayout, Result
from bellcrank.sizing.selection.axis_loads_of import AxisModel, axis_model
from bellcrank.sizing.selection.criteria import TOLERANCE, CriterionResult
from bellcrank.sizing.selection.judge import in_words
from bellcrank.sizing.selection.judged_axes import MAIN
from bellcrank.sizing.selection.load_cycles import transition_notes
from bellcrank.sizing.selection.load_reductions import ReducedLoads, reduce_loads
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.system_criteria import judge_system

if TYPE_CHECKING:
    from bellcrank.actuators.coupled_transmission import CoupledTransmission
    from bellcrank.actuators.mount import Mount
    from bellcrank.dynamics.inverse.mechanism import Mechanism
    from bellcrank.motion.motion import Motion
    from bellcrank.motion.motion_entry import DutyStep
    from bellcrank.scene.robot_config import RobotConfig


def conditions_of(
    config: RobotConfig | None, axis: str | None = None, given: Conditions | Mapping[str, Any] | None = None
) -> Conditions:
    """The conditions under which the motor and gear of an axis are judged.

    Each field is what is given; else what `actuators.NAME` of the configuration states; else what its `conditions`
    state; else the default. Entries of `assume` and `momentary_loads` count as fields.

    Args:
        config: The robot configuration; None: there is none.
        axis: Name of the joint, or of the motor of a coupled transmission; None: of the whole robot.
        given: Conditions, or a mapping of their fields; of Conditions those that `sources` names.

    Returns:
        The conditions, whose `sources` say where each stated field comes from.

    Raises:
        InputError: For an unknown field or a wrong value in `given`.

    Example:
        >>> import bellcrank as bc
        >>> from bellcrank.sizing.drive_verdicts import conditions_of
        >>> conditions = conditions_of(bc.load_scene("planar_2r").config, "elbow", {"ambient": 40.0})
        >>> conditions.safety_factor, dict(conditions.sources)
        (1.2, {'ambient': 'given', 'safety_factor': 'actuators.elbow'})
    """
    common = Conditions() if config is None else config.conditions
    actuator = None if config is None or axis is None else config.actuators.get(axis)
    stated: Mapping[str, Any] = {}
    if actuator is not None and not actuator.by_ratings:
        own = actuator.conditions
        stated = own.only(name for name, source in own.sources.items() if source != ROBOT_WIDE)
    elif actuator is not None and actuator.safety_factor != common.safety_factor:
        stated = {"safety_factor": actuator.safety_factor}
    return common.updated(stated, f"actuators.{axis}").updated(given)


def check_momentary_loads(conditions: Conditions, axes: Sequence[str]) -> None:
    """Refuse momentary loads of an axis that there is not (InputError)."""
    for name in dict(conditions.momentary_loads):
        if name not in axes:
            raise InputError(f"conditions: momentary_loads: {unknown_name('axis', name, axes)}")


@dataclass(frozen=True, kw_only=True)
class DriveVerdict:
    """The criteria of the motor and gear of one axis along its load cycles.

    Attributes:
        axis: Name of the joint, or of the motor of a coupled transmission.
        actuator: The motor and gear, or the ratings.
        criteria: Each criterion and note, in words.
    """

    axis: str
    actuator: Actuator
    criteria: tuple[CriterionResult, ...]

    @property
    def judged(self) -> tuple[CriterionResult, ...]:
        """The criteria that have a limit for this drive: those that are not notes."""
        return tuple(one for one in self.criteria if one.verdict != "note")

    @property
    def margins(self) -> dict[str, float | None]:
        """1 - use of each criterion that is judged; negative where exceeded, None where unknown."""
        return {one.name: None if one.use is None else 1.0 - one.use for one in self.judged}

    @property
    def exceeded(self) -> tuple[CriterionResult, ...]:
        """The criteria whose limit is exceeded."""
        return tuple(one for one in self.criteria if one.verdict == "exceeded")

    @property
    def unknown(self) -> tuple[CriterionResult, ...]:
        """The criteria of which something is not stated."""
        return tuple(one for one in self.criteria if one.verdict == "unknown")

    @property
    def main_unknown(self) -> tuple[CriterionResult, ...]:
        """Those unknown criteria without which the drive may be far too weak or too slow."""
        return tuple(one for one in self.unknown if one.name in MAIN)

    @property
    def binding(self) -> CriterionResult | None:
        """The criterion with the largest known use; None where none is known."""
        return max((one for one in self.judged if one.use is not None), key=lambda one: one.use or 0.0, default=None)

    @property
    def state(self) -> str:
        """ "inside", "exceeded", or "not known" where a criterion is unknown and none is exceeded."""
        return "exceeded" if self.exceeded else "not known" if self.unknown else "inside"


@dataclass(frozen=True, kw_only=True)
class DriveVerdicts(WithNotes, Result):
    """The verdicts on the motors and gears of a robot, made by `bellcrank.judge`.

    `to_csv` writes one row an axis and criterion; those of all axes together come last.

    Attributes:
        drives: Of each axis that has an actuator.
        system: The criteria of all axes together, where every axis has an actuator.
        robot: Name of the robot or robot configuration.
        cycles: Names of the cycles along which they are judged.
        axes_without: Names of the axes that have no actuator.
        warnings: Sentences about what to look at.
        undetermined: A sentence for each joint whose peaks the rows of a sampled motion do not determine, and a `Note`
            on each force and loop of the robot's file that is not modelled.
    """

    drives: tuple[DriveVerdict, ...]
    system: tuple[CriterionResult, ...] = ()
    robot: str = ""
    cycles: tuple[str, ...] = ()
    axes_without: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    undetermined: tuple[str, ...] = ()
    json_layout: ClassVar = JsonLayout(1, ascii_only=True)

    def __repr__(self) -> str:
        return f"DriveVerdicts('{self.robot}', {', '.join(f'{one.axis}: {one.state}' for one in self.drives)})"

    def table(self) -> str:
        """Every criterion of each motor and gear, notes, and the verdict.

        Returns:
            Lines of text.

        Example:
            >>> import bellcrank as bc
            >>> "Geared pendulum" in bc.judge("geared_pendulum").table()
            True
        """
        from bellcrank.sizing.verdict_tables import table, verdict

        return "\n".join([table(self), *(f"note: {text}" for text in self.warnings), "", verdict(self)])

    def of(self, axis: str) -> DriveVerdict:
        """The verdict on the drive of an axis.

        Args:
            axis: Name of the joint, or of the motor of a coupled transmission.

        Returns:
            Its DriveVerdict.

        Raises:
            InputError: For an unknown name, or an axis without an actuator.

        Example:
            >>> import bellcrank as bc
            >>> bc.judge("geared_pendulum").of("shoulder").state
            'inside'
        """
        arguments.text("axis", axis, "the name of an axis")
        for one in self.drives:
            if one.axis == axis:
                return one
        names = [one.axis for one in self.drives]
        raise InputError(f"verdicts on {self.robot}: {unknown_name('axis with an actuator', axis, names)}")

    @property
    def inside(self) -> bool:
        """Whether no criterion is exceeded, as far as they are known, and the motions determine the peaks."""
        exceeded = any(one.exceeded for one in self.drives) or any(one.verdict == "exceeded" for one in self.system)
        return not exceeded and not self.undetermined

    @property
    def verified(self) -> bool:
        """Whether no criterion is exceeded, and no main criterion is unknown: no motor may be far too weak or slow."""
        return self.inside and not any(one.main_unknown for one in self.drives)

    def _rows(self) -> list[Sequence[object]]:
        rows: list[Sequence[object]] = [["axis", "criterion", "use", "verdict", "text"]]
        for axis, criteria in (*((one.axis, one.criteria) for one in self.drives), ("all axes", self.system)):
            rows += [[axis, one.name, "" if one.use is None else one.use, one.verdict, one.text] for one in criteria]
        return rows

    def as_dict(self) -> dict[str, Any]:
        """The verdicts as JSON holds them.

        Returns:
            Robot, cycles, the verdict, and each drive with its criteria; a use is None where it is unknown.

        Example:
            >>> import bellcrank as bc
            >>> bc.judge("geared_pendulum").as_dict()["inside"]
            True
        """
        drives = [
            {
                "axis": one.axis,
                "actuator": actuator_data(one.actuator),
                "state": one.state,
                "criteria": [each.as_dict() for each in one.criteria],
            }
            for one in self.drives
        ]
        return {
            "robot": self.robot,
            "cycles": list(self.cycles),
            "inside": self.inside,
            "verified": self.verified,
            "drives": drives,
            "system": [one.as_dict() for one in self.system],
            "axes_without_actuator": list(self.axes_without),
            "warnings": list(self.warnings),
            "notes": [note.as_dict() for note in self.notes],
            **({"undetermined": list(self.undetermined)} if self.undetermined else {}),
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class DriveJudging:
    """Given drives along the cycles of a mechanism, judged when their verdicts are asked for, by the criteria by which
    `bellcrank.select` chooses.

    The masses are those that the robot has: those of the drives are part of its links and payloads. Raises InputError
    as `axis_loads`, for loads when the verdicts are asked for.

    Attributes:
        mechanism: An open chain or a linkage.
        motions: Motions of all of its joints.
        drives: Actuators by the name of the axis: a joint, or the motor of a coupled transmission.
        duty: The order of motions and pauses; None: each motion is a cycle that repeats.
        transmissions: Coupled transmissions, whose motors are axes in place of their joints.
        mounts: Where actuators are mounted.
        conditions: The supply, bus and brake resistor of all axes together; by default each is unknown.
        mass_tolerance: Share by which each link's mass and inertia may be off.

    Example:
        >>> import bellcrank as bc
        >>> from bellcrank.sizing.drive_verdicts import DriveJudging
        >>> from bellcrank.sizing.sizing_subject import sizing_subject
        >>> subject = sizing_subject("geared_pendulum", None)
        >>> judging = DriveJudging(mechanism=subject.mechanism, motions=subject.motions, drives=subject.actuators)
        >>> judging.verdicts.drives[0].state, judging.verdicts.drives[0].binding.name
        ('inside', 'continuous torque')
    """

    mechanism: Mechanism
    motions: Sequence[Motion]
    drives: Mapping[str, Actuator]
    duty: Sequence[DutyStep] | None = None
    transmissions: Sequence[CoupledTransmission] = ()
    mounts: Mapping[str, Mount] | None = None
    conditions: Conditions | None = None
    mass_tolerance: float = 0.0

    def __post_init__(self) -> None:
        if self.drives:
            axes = [axis.name for axis in self._model.axes]
            for one in (self.conditions or Conditions(), *(drive.conditions for drive in self.drives.values())):
                check_momentary_loads(one, axes)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, DriveJudging) and self.verdicts == other.verdicts

    def __hash__(self) -> int:
        return hash(self.verdicts)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_model"}

    @cached_property
    def _model(self) -> AxisModel:
        return axis_model(self.mechanism, self.motions, self.transmissions, self.mounts)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about the cycles."""
        return transition_notes(self.mechanism, self.motions, self.duty) if self.drives else ()

    @cached_property
    def verdicts(self) -> DriveVerdicts:
        """The verdicts, in the order of the mechanism's axes."""
        drives, of_robot = self.drives, self.conditions or Conditions()
        if not drives:
            return DriveVerdicts(drives=())
        found = self._model.along(self.motions, self.duty, drives, self.mass_tolerance, other_masses=False)
        loads = [one for one in reduce_loads(found.axes, found.cycles) if one.axis.name in drives]
        system: tuple[CriterionResult, ...] = ()
        if len(loads) == len(found.axes) and _has_bus(drives.values(), of_robot):
            system = judge_system([pair_of(drives[one.axis.name]) for one in loads], loads, of_robot)
        return DriveVerdicts(
            drives=tuple(_verdict(one, drives[one.axis.name]) for one in loads),
            system=system,
            cycles=tuple(dict.fromkeys(cycle.name for cycle in found.cycles)),
            axes_without=tuple(axis.name for axis in found.axes if axis.name not in drives),
            warnings=found.warnings,
        )


def pair_of(actuator: Actuator) -> Pairs:
    """The one pair of an actuator."""
    return Pairs.of(actuator.rows)


def _verdict(loads: ReducedLoads, actuator: Actuator) -> DriveVerdict:
    criteria = in_words(pair_of(actuator), loads, actuator.conditions)
    return DriveVerdict(axis=loads.axis.name, actuator=actuator, criteria=criteria)


def _has_bus(drives: Iterable[Actuator], conditions: Conditions) -> bool:
    """Whether the criteria of all axes together are wanted: a limit is given, or all drives are products."""
    given = (
        conditions.supply_power, conditions.bus_capacitance, conditions.brake_resistor_power,
        conditions.brake_resistance, conditions.brake_resistor_peak_power,
    )  # fmt: skip
    return any(one is not None for one in given) or not any(one.rows[0].by_ratings for one in drives)


def smallest(margins: Iterable[float | None]) -> float | None:
    """The smallest known margin; None where none is known."""
    return min((one for one in margins if one is not None and not math.isnan(one)), default=None)


def kept(margin: float | None) -> bool:
    """Whether a limit is kept: its margin is not negative by more than the tolerance, or there is no limit."""
    return margin is None or margin >= -TOLERANCE
