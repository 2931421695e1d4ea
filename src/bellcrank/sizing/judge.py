"""`bellcrank.judge`: whether the motors and gears that are given can drive a robot along its motions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank import arguments
from bellcrank.actuators.actuator import Actuator
from bellcrank.actuators.conditions import Conditions
from bellcrank.errors import InputError
from bellcrank.files.access import Trust
from bellcrank.notes import reached
from bellcrank.robot.model.payload import Payload
from bellcrank.robot.robot import Robot
from bellcrank.sizing.drive_verdicts import DriveJudging, DriveVerdicts
from bellcrank.sizing.loads.load_checks import refuse_massless
from bellcrank.sizing.loads.motion_peaks import undetermined_peaks
from bellcrank.sizing.mechanism_sizing import motion_warnings
from bellcrank.sizing.size import checked_actuators, checked_mass_tolerance
from bellcrank.sizing.sizing_subject import OneMotion, override_notes, sizing_subject

if TYPE_CHECKING:
    from bellcrank.scene.scene import Scene


@arguments.named
def judge(
    robot: Robot | Scene | str | Path,
    motions: OneMotion | Sequence[OneMotion] | None = None,
    actuators: Mapping[str, Actuator] | None = None,
    mass_tolerance: float = 0.0,
    *,
    conditions: Conditions | Mapping[str, Any] | None = None,
    payloads: Iterable[Payload] = (),
    allow_massless: Iterable[str] = (),
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
) -> DriveVerdicts:
    """Judge the motors and gears that a robot configuration names, along motions, without choosing others.

    Every criterion is that by which `bellcrank.select` chooses, and the verdict is that which `bellcrank.size` shows.
    Masses are those of the robot: motors and gears count where its links and payloads contain them.

    Args:
        robot: As for `size`.
        motions: As for `size`. The duty program of a configuration counts where all of its motions do.
        actuators: Motor and gear by joint, those of coupled transmissions by motor; by default those of the
            configuration.
        mass_tolerance: As for `size`.
        conditions: Supply, surroundings and safety, as for `select`; what is given replaces what the configuration
            states.
        payloads: Payloads besides those that the robot carries.
        allow_massless: Links without mass that motors may move, as for `size`; other motors that move no mass are
            refused.
        overrides: Values of a scene, configuration or URDF to change, by dotted path, as for `size`.
        trust: Folders whose files a robot configuration or URDF may name, besides those near it.

    Returns:
        The DriveVerdicts; `print` shows every criterion, `DriveVerdicts.inside` is the verdict.

    Raises:
        InputError: For what `size` refuses, and where no actuator is given.

    Example:
        >>> import bellcrank as bc
        >>> verdicts = bc.judge("geared_pendulum")
        >>> verdicts.inside, verdicts.of("shoulder").binding.name
        (True, 'continuous torque')
    """
    stated = Conditions().updated(conditions)
    tolerance = checked_mass_tolerance(mass_tolerance)
    given = None if actuators is None else checked_actuators(actuators)
    subject = sizing_subject(robot, motions, payloads, trust, given, overrides)
    if not subject.actuators:
        name = subject.mechanism.robot.name if subject.config is None else subject.config.source
        raise InputError(
            f"{name}: no motor and gear is given to judge; write them under the key 'actuators', or choose some with "
            "`bellcrank select`"
        )
    massless = refuse_massless("verdicts", subject.mechanism, subject.motions, allow_massless)
    config = subject.config
    drives = {name: one.under(stated) for name, one in subject.actuators.items()}
    found = DriveJudging(
        mechanism=subject.mechanism,
        motions=subject.motions,
        drives=drives,
        duty=subject.duty,
        transmissions=() if config is None else config.transmissions,
        mounts=None if config is None else config.mounts,
        conditions=(Conditions() if config is None else config.conditions).updated(stated),
        mass_tolerance=tolerance,
    ).verdicts
    notes = [*subject.file_notes, *([] if config is None else override_notes(config))]
    notes += subject.duty_notes
    notes += [*subject.mechanism.robot.findings, *subject.mechanism.robot.inertia_warnings, *massless]
    notes += motion_warnings(subject.mechanism, subject.motions)
    name = subject.mechanism.robot.name if config is None else config.name
    return replace(
        found,
        robot=name,
        warnings=tuple(dict.fromkeys([*notes, *found.warnings])),
        undetermined=(
            *undetermined_peaks(subject.mechanism, subject.motions, drives),
            *reached(subject.file_notes),
        ),
    )
