"""What a sizing is of: a mechanism over motions, from a robot, a linkage, a scene, a configuration or a file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from bellcrank import arguments
from bellcrank.actuators.actuator import Actuator
from bellcrank.config.yaml_file import read_yaml
from bellcrank.dynamics.mechanism import Mechanism, mechanism_of
from bellcrank.dynamics.open_chain_inverse_dynamics import OpenChain
from bellcrank.errors import InputError
from bellcrank.files.access import Trust
from bellcrank.messages import unknown_name
from bellcrank.motion.motion import Motion
from bellcrank.notes import Note, in_use
from bellcrank.robot.payload import Payload
from bellcrank.robot.robot import Robot
from bellcrank.scene.overrides import EXPECTED_OVERRIDES, declared
from bellcrank.text import one_line

if TYPE_CHECKING:
    from bellcrank.actuators.coupled_transmission import CoupledTransmission
    from bellcrank.motion.duty_program import DutyStep
    from bellcrank.scene.robot_config import RobotConfig
    from bellcrank.scene.scene import Scene

OneMotion = Motion | str | Path
DUTY_NOT_USED = "the duty program of the configuration is not used: the given motions are cycles of their own"
SCENE_KEYS = (  # keys of a file that affect sizing, or of which it says that they do not
    "constraints", "forces", "joints", "joint_stops", "control", "parameters", "initial", "base", "supply",
)  # fmt: skip


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
    robot: Robot | Mechanism | RobotConfig | Scene | str | Path,
    motions: OneMotion | Sequence[OneMotion] | None,
    payloads: Iterable[Payload] = (),
    trust: Trust = (),
    actuators: Mapping[str, Actuator] | None = None,
    overrides: Mapping[str, Any] | None = None,
) -> SizingSubject:
    """The mechanism and motions that the arguments of `bellcrank.size` and `bellcrank.select` stand for.

    Args:
        robot: A Robot or Linkage; or a RobotConfig, a Scene, or the path or name of a configuration or URDF.
        motions: Motions, names or paths; None: those of the configuration.
        payloads: Payloads besides those that the robot carries.
        trust: Folders whose files a configuration or URDF may name.
        actuators: Actuators by joint; None: those of the configuration.
        overrides: Values of a scene, configuration or URDF to change, by dotted path.

    Returns:
        The subject.

    Raises:
        InputError: For an unknown robot or motion; where there is no motion; for an argument of the wrong type.

    Example:
        >>> from bellcrank.sizing.subject import sizing_subject
        >>> subject = sizing_subject("geared_pendulum", None)
        >>> [motion.name for motion in subject.motions]
        ['lift_and_return']
    """
    from bellcrank.scene.robot_config import RobotConfig, load_robot_config
    from bellcrank.scene.scene import Scene, load_scene

    loads = arguments.several("payloads", payloads, Payload, "Payloads", alone=True)
    folders = arguments.several("trust", [trust] if isinstance(trust, (str, Path)) else trust, object, "folders")
    if folders and not isinstance(robot, (str, Path)):
        raise InputError(
            "argument 'trust': it is for files, and 'robot' is read already; give it where the robot is loaded"
        )
    if overrides is not None and arguments.mapping("overrides", overrides, EXPECTED_OVERRIDES):
        if not isinstance(robot, (Scene, str, Path)):
            raise InputError(
                "argument 'overrides': it changes values of a scene, configuration or URDF; give 'robot' as a path, a "
                "name, or a Scene of bc.load_scene"
            )
        robot = changed_scene(robot if isinstance(robot, Scene) else load_scene(robot, trust=trust), overrides)
    if not isinstance(robot, (RobotConfig, Scene, str, Path)):
        if loads and not isinstance(robot, Robot):
            raise InputError("argument 'payloads': they belong to the robot of a Linkage; load it with them")
        mechanism = mechanism_of(robot.with_payloads(loads) if isinstance(robot, Robot) and loads else robot)
        listed = _distinct_names(_motions(() if motions is None else motions))
        return SizingSubject(mechanism, listed, actuators or {}, None)
    if isinstance(robot, RobotConfig):
        config = robot
    else:
        config = robot.config if isinstance(robot, Scene) else load_robot_config(robot, trust=trust)
    given = robot if isinstance(robot, Scene) else None
    if actuators is not None:
        config = replace(config, actuators=actuators)
    mechanism, named = mechanism_and_motions(config, config.robot(loads), motions, given)
    return SizingSubject(mechanism, _distinct_names(named), config.actuators, config, motions is None)


def changed_scene(scene: Scene, overrides: Mapping[str, Any]) -> Scene:
    """The scene with overrides, which its configuration keeps for the notes of a sizing. Raises InputError."""
    changed = scene.with_overrides(overrides)
    return replace(
        changed, config=replace(changed.config, overrides={**scene.config.overrides, **declared(scene, overrides)})
    )


def mechanism_and_motions(
    config: RobotConfig,
    robot: Robot,
    motions: OneMotion | Sequence[OneMotion] | None = None,
    scene: Scene | None = None,
) -> tuple[Mechanism, list[Motion]]:
    """What the sizing of a robot configuration is of: its mechanism, and motions of all of the mechanism's joints.

    Args:
        config: The configuration.
        robot: Its robot, with payloads: `config.robot(payloads)`.
        motions: Motions, names of its motions or paths of CSV files; by default all of its motions.
        scene: The scene whose forces and constraints count; by default that of the configuration's file.

    Returns:
        The mechanism and the list of motions, as `bellcrank.size` takes them.

    Raises:
        InputError: For an unknown motion, and where there is none.

    Example:
        >>> import bellcrank as bc
        >>> from bellcrank.sizing.subject import mechanism_and_motions
        >>> config = bc.load_robot_config("geared_pendulum")
        >>> mechanism, motions = mechanism_and_motions(config, config.robot())
        >>> bc.size(mechanism, motions, config.actuators).inside
        True
    """
    mechanism = _mechanism(config, robot) if scene is None else mechanism_of(scene, robot)
    return mechanism, [_motion(config, mechanism, one) for one in _requested(config, motions)]


def _mechanism(config: RobotConfig, robot: Robot) -> Mechanism:
    """The mechanism of a configuration's file, with its constraints, forces and parameters."""
    from bellcrank.scene.scene import load_scene

    is_robot_file = config.source.resolve() == config.urdf.resolve()
    alone = is_robot_file or not _says_more(read_yaml(config.source))
    if alone and not (config.file and (config.file.loops or config.file.springs)):
        return OpenChain(robot, actuated=config.actuated or None)
    trusted = () if config.access is None else [folder for folder in config.access.trusted if folder.is_dir()]
    return mechanism_of(load_scene(config.source, trust=trusted), robot)


def _says_more(data: Mapping[str, Any]) -> bool:
    """Whether a file has keys of a scene, or drives."""
    drives = data.get("actuators") or {}
    return not data.keys().isdisjoint(SCENE_KEYS) or any(
        isinstance(entry, Mapping) and "model" in entry for entry in drives.values()
    )


def _requested(config: RobotConfig, given: object) -> list[OneMotion]:
    """The motions that are asked for, by default all of the configuration; InputError where there are none."""
    if given is None:
        if not config.motions:
            raise InputError(
                f"{config.source}: there is no motion to size over; give a CSV file (--motion FILE), or write a robot "
                "configuration with motions"
            )
        return list(config.motions)
    kinds = "Motions, names of motions or paths of CSV files"
    listed = arguments.several("motions", [given] if isinstance(given, (Motion, str, Path)) else given, object, kinds)
    for one in listed:
        arguments.instance("motions", one, (Motion, str, Path), kinds)
    return list(listed)  # type: ignore[arg-type]


def _motion(config: RobotConfig, mechanism: Mechanism, one: OneMotion) -> Motion:
    """The motion that a name, a path or a Motion stands for; InputError."""
    from bellcrank.motion.csv_file import read_motion

    robot = mechanism.robot
    if mechanism.closed:
        return mechanism.along(one)[0]
    if isinstance(one, Motion):
        return one
    if str(one) in config.motions:
        return config.motion(robot, str(one))
    path = arguments.path("motions", one, "the name of a motion, or the path of a CSV file")
    if path.suffix or "/" in str(one):
        return read_motion(robot, path, name=path.stem)
    raise InputError(f"{config.source}: {unknown_name('motion', str(one), config.motions)}, nor a file of that name")


def _motions(given: object) -> list[Motion]:
    """One motion or a list of them as a list; InputError."""
    from bellcrank.simulation.trajectory import Trajectory

    listed = arguments.several(
        "motions", [given] if isinstance(given, (Motion, Trajectory)) else given, object, "Motions"
    )
    for one in listed:
        if isinstance(one, Trajectory):
            remedy = "write the run with run.to_csv(path) and read it with read_motion(robot, path)"
            arguments.refuse("motions", "a Motion or a list of them", one, remedy=remedy)
    return list(arguments.several("motions", listed, Motion, "Motions"))


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
