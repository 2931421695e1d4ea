"""`bc.size`: sizing of a robot over motions, or of a robot configuration over the motions that it holds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from bellcrank import arguments
from bellcrank.actuators.actuator import Drive
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.motion.motion import Motion
from bellcrank.robot.payload import Payload
from bellcrank.robot.robot import Robot
from bellcrank.sizing.arguments import drives_of, tolerance_of
from bellcrank.sizing.linkage import Mechanism, mechanism_of, mechanism_of_config
from bellcrank.sizing.result import Sizing
from bellcrank.sizing.size import size as size_robot

if TYPE_CHECKING:
    from bellcrank.scene.robot_config import RobotConfig
    from bellcrank.scene.scene import Scene

OneMotion = Motion | str | Path


def size(
    robot: Robot | Mechanism | RobotConfig | Scene | str | Path,
    motions: OneMotion | Sequence[OneMotion] | None = None,
    drives: Mapping[str, Drive] | None = None,
    mass_tolerance: float = 0.0,
    *,
    payloads: Iterable[Payload] = (),
    allow_massless: Iterable[str] = (),
) -> Sizing:
    """Size every one-degree-of-freedom joint of a robot, or every motor of a linkage, over one or several motions.

    Args:
        robot: A Robot or Linkage; or a robot configuration: the path or name of a YAML file or URDF, a RobotConfig or a Scene.
        motions: Motions; with a configuration also names of its motions and paths of CSV files, by default all of its
            motions. Each counts as a cycle that repeats, and the worst of them counts.
        drives: Motor and gear by joint name; by default those of the configuration.
        mass_tolerance: A share: with 0.1 each link as a whole, its mass and inertia together, is scaled by one factor
            within 1 ± 0.1.
        payloads: Payloads besides those that the robot carries.
        allow_massless: Links without mass that motors may move; a motor that moves nothing with mass is otherwise not
            sized, and `Sizing.unsizable` says why.

    Returns:
        The Sizing; `print` shows its table, `Sizing.inside` is the verdict.

    Raises:
        InputError: For an unknown robot, motion, joint or link, a missing motion, or an argument of the wrong type.

    Example:
        >>> sizing = bc.size("ur5", mass_tolerance=0.1)
        >>> sizing.joint("elbow_joint").peak_torque
    """
    from bellcrank.scene.robot_config import RobotConfig, load_robot_config
    from bellcrank.scene.scene import Scene

    mass_tolerance = tolerance_of(mass_tolerance)
    loads = arguments.several("payloads", payloads, Payload, "Payloads", alone=True)
    links = arguments.several("allow_massless", allow_massless, str, "names of links", alone=True)
    if not isinstance(robot, (RobotConfig, Scene, str, Path)):
        if loads and not isinstance(robot, Robot):
            raise InputError("payloads: they belong to the robot of a Linkage; load it with them")
        carrying = robot.with_payloads(loads) if isinstance(robot, Robot) and loads else robot
        given: object = () if motions is None else motions
        return size_robot(carrying, given, drives, mass_tolerance, allow_massless=links)  # type: ignore[arg-type]
    config = (
        robot
        if isinstance(robot, RobotConfig)
        else robot.config
        if isinstance(robot, Scene)
        else load_robot_config(robot)
    )
    if drives is not None:
        config = replace(config, actuators=drives_of(drives))
    sized, over = chosen(config, config.robot(loads), motions, robot if isinstance(robot, Scene) else None)
    sizing = size_robot(sized, over, config.actuators, mass_tolerance, allow_massless=links)
    return replace(sizing, robot=config.name, warnings=(*config.deprecations, *sizing.warnings))


def chosen(
    config: RobotConfig,
    robot: Robot,
    motions: OneMotion | Sequence[OneMotion] | None = None,
    scene: Scene | None = None,
) -> tuple[Mechanism, list[Motion]]:
    """What a robot configuration's sizing is of: its mechanism, and the motions of all of the mechanism's joints.

    Args:
        configuration: The configuration.
        robot: Its robot, with payloads: `config.robot(payloads)`.
        motions: Motions, names of its motions or paths of CSV files; by default all of its motions.
        scene: The scene whose forces and constraints count; by default that of the configuration's file.

    Returns:
        The mechanism and the list of motions, as `bc.size` takes them.

    Raises:
        InputError: For an unknown motion, and where there is none.

    Example:
        >>> configuration = load_robot_config("five_bar")
        >>> mechanism, motions = chosen(configuration, config.robot())
        >>> bc.size(mechanism, motions, configuration.actuators)
    """
    mechanism = mechanism_of_config(config, robot) if scene is None else mechanism_of(scene, robot)
    return mechanism, [_motion(config, mechanism, one) for one in _listed(config, motions)]


def _listed(config: RobotConfig, given: object) -> list[OneMotion]:
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
