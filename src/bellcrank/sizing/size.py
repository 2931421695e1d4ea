"""`bellcrank.size`: size the motors of a robot, a linkage, a scene or a robot configuration over motions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank import arguments
from bellcrank.actuators.actuator import Actuator
from bellcrank.files.access import Trust
from bellcrank.notes import reached
from bellcrank.robot.model.payload import Payload
from bellcrank.robot.robot import Robot
from bellcrank.sizing.mechanism_sizing import size_mechanism
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.sizing_subject import OneMotion, sizing_subject

if TYPE_CHECKING:
    from bellcrank.scene.robot_config import RobotConfig
    from bellcrank.scene.scene import Scene


@arguments.named
def size(
    robot: Robot | Scene | str | Path,
    motions: OneMotion | Sequence[OneMotion] | None = None,
    actuators: Mapping[str, Actuator] | None = None,
    mass_tolerance: float = 0.0,
    *,
    payloads: Iterable[Payload] = (),
    allow_massless: Iterable[str] = (),
    overrides: Mapping[str, Any] | None = None,
    trust: Trust = (),
) -> Sizing:
    """Size the motors of a robot over one or several motions.

    Every joint with one degree of freedom has a motor; in a closed linkage the actuated joints have. Torques follow
    from inverse dynamics (τ = M(q) q̈ + C(q, q̇) q̇ + g(q) + friction − the scene's forces). The forces and parameters
    of a scene are included, its control is not. Each motion counts as a cycle that repeats.

    Args:
        robot: A Robot, a Scene, or the path or name of a scene or robot file.
        motions: Motions; with a configuration also names of its motions and paths of CSV files, by default all of its
            motions.
        actuators: Motor and gear by joint name, those of a configuration's coupled transmissions by motor; by default
            those of the configuration.
        mass_tolerance: A share, such as 0.1: peaks are the worst case with each link as a whole, its mass and inertia
            together, scaled by one factor within 1 ± 0.1.
        payloads: Payloads besides those that the robot carries.
        allow_massless: Links without mass that motors may move. A motor that moves no mass is otherwise not sized, and
            `Sizing.unsizable` says why.
        overrides: Values of a scene, configuration or URDF to change, by dotted path, such as {"payloads.1.mass": 5.0};
            see `Scene.with_overrides`.
        trust: Folders whose files a robot configuration or URDF may name, besides those near it.

    Returns:
        The Sizing; `print` shows its tables, `Sizing.inside` is the verdict.

    Raises:
        InputError: For an unknown robot, motion, joint or link; where there is no motion; for an argument of the wrong
            type; where an actuator's rotor inertia contradicts the robot's; and where a load is not a finite number.

    Example:
        >>> import bellcrank as bc
        >>> sizing = bc.size("geared_pendulum", mass_tolerance=0.1)
        >>> round(sizing.joint("shoulder").peak_torque, 3)
        10.791
    """
    mass_tolerance = checked_mass_tolerance(mass_tolerance)
    links = arguments.several("allow_massless", allow_massless, str, "names of links", alone=True)
    given = None if actuators is None else checked_actuators(actuators)
    subject = sizing_subject(robot, motions, payloads, trust, given, overrides)
    omitted = reached(subject.file_notes)
    config = subject.config
    sizing = size_mechanism(
        subject.mechanism,
        subject.motions,
        subject.actuators,
        mass_tolerance,
        links,
        () if config is None else config.transmissions,
        duty=subject.duty,
        mounts=None if config is None else config.mounts,
        conditions=None if config is None else config.conditions,
    )
    _ = sizing.judging.verdicts  # what is wrong with the loads of drives is said now
    notes, undetermined = list(subject.notes), (*sizing.undetermined, *omitted)
    if config is not None:
        own = config if given is None else None  # else its file names other actuators
        sizing, notes = replace(sizing, robot=config.name, config=own), [*notes, *_transmission_notes(config)]
    return replace(sizing, warnings=(*notes, *sizing.warnings), undetermined=undetermined)


def _transmission_notes(config: RobotConfig) -> list[str]:
    """What the coupled transmissions of a configuration change."""
    return [
        f"torques and speeds of {', '.join(one.joints)} are those of the joints, also in histories and pictures; "
        f"their coupled transmission gives {', '.join(one.motors)} others"
        for one in config.transmissions
    ]


def checked_mass_tolerance(value: object) -> float:
    """A mass tolerance, a share of at least 0 and below 1; InputError."""
    share = arguments.number("mass_tolerance", value, least=0.0)
    if share >= 1.0:
        arguments.refuse("mass_tolerance", "a share of at least 0 and below 1, such as 0.1", value)
    return share


def checked_actuators(given: object) -> dict[str, Actuator]:
    """Actuators by the names of joints, none where they are None; InputError."""
    if given is None:
        return {}
    listed = arguments.mapping("actuators", given, "a mapping of joint names to Actuators")
    for name, actuator in listed.items():
        arguments.instance(f'actuators["{name:.80}"]', actuator, Actuator, "an Actuator")
    return listed
