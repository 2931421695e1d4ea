"""What a sizing is of: a mechanism over motions, from a robot, a scene or a file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from bellcrank import arguments
from bellcrank.actuators.actuator import Actuator
from bellcrank.dynamics.inverse.mechanism import Mechanism, mechanism_of
from bellcrank.errors import InputError
from bellcrank.files.access import Trust
from bellcrank.messages import one_line, unknown_name
from bellcrank.motion.motion import Motion
from bellcrank.notes import Note, in_use
from bellcrank.robot.model.payload import Payload
from bellcrank.robot.robot import Robot
from bellcrank.scene.overrides import EXPECTED_OVERRIDES, declared

if TYPE_CHECKING:
    from bellcrank.actuators.coupled_transmission import CoupledTransmission
    from bellcrank.motion.motion_entry import DutyStep
    from bellcrank.scene.robot_config import RobotConfig
    from bellcrank.scene.scene import Scene

OneMotion = Motion | str | Path
DUTY_NOT_USED = "the duty program of the configuration is not used: the given motions are cycles of their own"


class SizingSubject(NamedTuple):
    """What is sized: a mechanism over motions, each with a name of its own; the configuration where there is one.

    `all_motions` says whether the motions are all of the configuration; along its duty program motors are then judged.
    """

    mechanism: Mechanism
    motions: list[Motion]
    actuators: Mapping[str, Actuator]
    config: RobotConfig | None
    all_motions: bool = False

    @property
    def transmissions(self) -> tuple[CoupledTransmission, ...]:
        """Motors of the configuration that move several joints together."""
        return () if self.config is None else self.config.transmissions

    @property
    def duty(self) -> tuple[DutyStep, ...] | None:
        """The duty program along which motors are judged; None: each motion is a cycle that repeats."""
        return self.config.duty or None if self.config is not None and self.all_motions else None

    @property
    def duty_notes(self) -> tuple[str, ...]:
        """That the duty program of the configuration is not used, where that is so."""
        return (DUTY_NOT_USED,) if self.config is not None and self.config.duty and not self.all_motions else ()

    @property
    def file_notes(self) -> tuple[Note, ...]:
        """What the robot's file says and is not modelled; reached where it acts along the motions."""
        robot = self.mechanism.robot
        said = robot.notes if self.config is None else self.config.notes
        return in_use(said, None, bool(robot.gravity.any()))  # the motions are those of the servos

    @property
    def notes(self) -> tuple[str, ...]:
        """What is to be said of the configuration: its own notes, what was changed, and what only selection uses."""
        config = self.config
        if config is None:
            return self.file_notes
        duty = (
            "loads are those of each motion as a cycle; the motors and gears are judged along the duty program of the "
            "configuration"
        )
        return (*self.file_notes, *override_notes(config), *([duty] if self.duty else self.duty_notes))


def override_notes(config: RobotConfig) -> list[str]:
    """A sentence on the values of a configuration's file that were changed; none where there are none."""
    shown = dict[str, Any]()
    for path, value in config.overrides.items():
        of_tree = isinstance(value, Mapping) and value.keys() == {"value", "sets"} and path.startswith("parameters.")
        shown[", ".join(value["sets"]) if of_tree else path] = value["value"] if of_tree else value
    changed = ", ".join(f"{path} = {one_line(str(value)):.80}" for path, value in shown.items())
    return [f"values that differ from those of {config.source.name}: {changed}"] if changed else []


def sizing_subject(
    robot: Robot | Mechanism | Scene | str | Path,
    motions: OneMotion | Sequence[OneMotion] | None,
    payloads: Iterable[Payload] = (),
    trust: Trust = (),
    actuators: Mapping[str, Actuator] | None = None,
    overrides: Mapping[str, Any] | None = None,
    argument: str = "motions",
) -> SizingSubject:
    """The mechanism and motions that the arguments of `bellcrank.size` and `bellcrank.select` stand for.

    Args:
        robot: A Robot, a mechanism, a Scene, or the path or name of a scene or robot file.
        motions: Motions, names or paths; None: those of the scene.
        payloads: Payloads besides those that the robot carries.
        trust: Folders whose files a scene or robot file may name.
        actuators: Actuators by joint; None: those of the scene.
        overrides: Values of a scene or robot file to change, by dotted path.
        argument: The name of the argument for motions in messages.

    Returns:
        The subject.

    Raises:
        InputError: For an unknown robot or motion; where there is no motion; for an argument of the wrong type.

    Example:
        >>> from bellcrank.sizing.sizing_subject import sizing_subject
        >>> subject = sizing_subject("geared_pendulum", None)
        >>> [motion.name for motion in subject.motions]
        ['lift_and_return']
    """
    from bellcrank.scene.scene import Scene, load_scene

    loads = arguments.several("payloads", payloads, Payload, "Payloads", alone=True)
    folders = arguments.several("trust", [trust] if isinstance(trust, (str, Path)) else trust, object, "folders")
    if folders and not isinstance(robot, (str, Path)):
        raise InputError(
            "argument 'trust': applies only to paths, and 'robot' is loaded already; give it where the robot is loaded"
        )
    if isinstance(robot, (str, Path)):
        robot = load_scene(robot, trust=trust)
    if overrides is not None and arguments.mapping("overrides", overrides, EXPECTED_OVERRIDES):
        if not isinstance(robot, Scene):
            raise InputError(
                "argument 'overrides': it changes values of a scene or robot file; give 'robot' as a path, a name, or "
                "a Scene of bc.load_scene"
            )
        robot = changed_scene(robot, overrides)
    if not isinstance(robot, Scene):
        if loads and not isinstance(robot, Robot):
            raise InputError("argument 'payloads': they belong to the robot of a Linkage; load it with them")
        mechanism = mechanism_of(robot.with_payloads(loads) if isinstance(robot, Robot) and loads else robot)
        listed = _distinct_names(_motions(() if motions is None else motions, argument))
        return SizingSubject(mechanism, listed, actuators or {}, None)
    config, scene = robot.config, robot
    if actuators is not None:
        config = replace(config, actuators=actuators)
    mechanism = mechanism_of(scene, config.robot(loads) if loads or actuators is not None else scene.robot)
    named = [_motion(config, mechanism, one, argument) for one in _requested(config, motions, argument)]
    return SizingSubject(mechanism, _distinct_names(named), config.actuators, config, motions is None)


def changed_scene(scene: Scene, overrides: Mapping[str, Any]) -> Scene:
    """The scene with overrides, which its configuration keeps for the notes of a sizing. Raises InputError."""
    changed = scene.with_overrides(overrides)
    return replace(
        changed, config=replace(changed.config, overrides={**scene.config.overrides, **declared(scene, overrides)})
    )


def _requested(config: RobotConfig, given: object, argument: str) -> list[OneMotion]:
    """The motions that are asked for, by default all of the configuration; InputError where there are none."""
    if given is None:
        if not config.motions:
            raise InputError(
                f"{config.source}: there is no motion to size over; give a CSV file (--motion FILE), or write a robot "
                "configuration with motions"
            )
        return list(config.motions)
    kinds = "Motions, names of motions or paths of CSV files"
    listed = arguments.several(argument, [given] if isinstance(given, (Motion, str, Path)) else given, object, kinds)
    for one in listed:
        arguments.instance(argument, one, (Motion, str, Path), kinds)
    return list(listed)  # type: ignore[arg-type]


def _motion(config: RobotConfig, mechanism: Mechanism, one: OneMotion, argument: str) -> Motion:
    """The motion that a name, a path or a Motion stands for; InputError."""
    from bellcrank.motion.sampled.csv_file import read_motion

    robot = mechanism.robot
    if mechanism.closed:
        return mechanism.along(one)[0]
    if isinstance(one, Motion):
        return one
    if str(one) in config.motions:
        return config.motion(robot, str(one))
    path = arguments.path(argument, one, "the name of a motion, or the path of a CSV file")
    if path.suffix or "/" in str(one):
        return read_motion(robot, path, name=path.stem)
    raise InputError(f"{config.source}: {unknown_name('motion', str(one), config.motions)}, nor a file of that name")


def _motions(given: object, argument: str) -> list[Motion]:
    """One motion or a list of them as a list; InputError."""
    from bellcrank.simulation.trajectory.trajectory import Trajectory

    listed = arguments.several(
        argument, [given] if isinstance(given, (Motion, Trajectory)) else given, object, "Motions"
    )
    for one in listed:
        if isinstance(one, Trajectory):
            remedy = "write the run with run.to_csv(path) and read it with read_motion(robot, path)"
            arguments.refuse(argument, "a Motion or a list of them", one, remedy=remedy)
    return list(arguments.several(argument, listed, Motion, "Motions"))


def _distinct_names(motions: Sequence[Motion]) -> list[Motion]:
    """The motions, each with a name of its own: the second "circle" becomes "circle (2)"."""
    names: list[str] = []
    for motion in motions:
        name, number = motion.name, 1
        while name in names:
            number += 1
            name = f"{motion.name} ({number})"
        names.append(name)
    return [
        motion if motion.name == name else replace(motion, name=name)
        for motion, name in zip(motions, names, strict=True)
    ]
