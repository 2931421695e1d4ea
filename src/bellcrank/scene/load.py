"""`bellcrank.load`: a scene or a robot from a file; and the scene that an argument of a public function stands for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from bellcrank import arguments
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess, Trust, for_files_only
from bellcrank.robot.robot import Robot
from bellcrank.scene.overrides import EXPECTED_OVERRIDES
from bellcrank.scene.robot_config import find_config
from bellcrank.scene.scene import Scene, load_scene, read_scene
from bellcrank.scene.source_mapping import source_mapping


@arguments.named
def load(path_or_name: str | Path, overrides: Mapping[str, Any] | None = None, *, trust: Trust = ()) -> Scene | Robot:
    """Read a file that describes a machine: a scene in YAML, or a robot file (URDF, xacro, MJCF, SDFormat).

    All functions that take a scene or a robot take what this returns, and the path too.

    Args:
        path_or_name: Path of a file, or name of a bundled scene or robot (`bellcrank robots` lists them).
        overrides: Values to change, by dotted path; see `Scene.with_overrides`.
        trust: Folders from which files that the file names may be read, besides its own surroundings.

    Returns:
        A Robot for a robot file that describes a tree of bodies alone. A Scene for YAML, for a robot file with loops,
        springs or motors, and wherever values are changed.

    Raises:
        InputError: The file, one of the files that it names, or an override is wrong; the message is one sentence with
            file, line and key.

    Example:
        >>> import bellcrank as bc
        >>> bc.load("pendulum")
        Scene('Simple pendulum', Robot('pendulum', 1 joints, nq=1, nv=1, pendulum.urdf), from pendulum.yaml)
        >>> bc.load("talos")
        Robot('talos', 32 joints, nq=32, nv=32, talos_reduced.urdf)
    """
    scene = load_scene(path_or_name, overrides, trust=trust)
    file = scene.config.file
    more = bool(overrides) or (file is not None and bool(file.loops or file.springs or file.motors))
    return scene if more or not find_config(path_or_name)[1] else scene.robot


def given_scene(
    scene: Scene | Robot | str | Path, overrides: Mapping[str, Any] | None = None, trust: Trust = ()
) -> Scene:
    """A scene, or that of a robot, path or name, with overrides. Raises InputError, also where `trust` goes with no
    file.
    """
    if isinstance(scene, Scene | Robot):
        for_files_only(trust, "scene", "load_scene")
        scene = scene_of(scene) if isinstance(scene, Robot) else scene
    else:
        scene = load_scene(arguments.subject("scene", scene, "a scene or robot"), trust=trust)
    if overrides is not None and (changed := arguments.mapping("overrides", overrides, EXPECTED_OVERRIDES)):
        scene = scene.with_overrides(changed)
    return scene


def scene_of(robot: Robot) -> Scene:
    """The scene of a robot alone, without forces, constraints and controllers.

    Raises InputError where the robot's file has loops, springs or motors, which a robot leaves out, and where no scene
    says how the robot was loaded.
    """
    file, options = robot.file, robot.options
    if file.loops or file.springs:
        raise InputError(
            f"robot {robot.name}: {file.source} closes loops or has springs, which a Robot leaves out; give its path, "
            "or a Scene of bc.load_scene"
        )
    entries = {
        "gravity": list(options.gravity),
        "floating_base": options.floating_base,
        "friction": options.friction
        if isinstance(options.friction, str)
        else {name: {"viscous": one[0], "coulomb": one[1]} for name, one in options.friction.items()},
        "payloads": [
            {"mass": one.mass, "frame": one.frame, "cg": list(one.cg), "inertia": list(one.inertia)}
            for one in options.payloads
        ],
        "rotor_inertia": dict(options.rotor_inertia),
        "frames": {
            name: {"link": link, "xyz": list(xyz), "rpy": list(rpy)}
            for name, (link, xyz, rpy) in options.frames.items()
        },
    }
    data = {"name": robot.name, "urdf": str(file.source.resolve()), "robot_file": "tree"}
    access = FileAccess.of(file.source.resolve())
    access = replace(access, trusted=(*access.trusted, file.source.resolve()))
    given = {key: one for key, one in entries.items() if one not in ({}, [], "urdf", False)}
    scene = read_scene(source_mapping({**data, **given}), file.source, access)
    if scene.robot.file.urdf != file.urdf or scene.robot.options != options:
        raise InputError(
            f"robot {robot.name}: a scene cannot say how it was loaded (xacro_args, clean, friction_width); write a "
            "scene file (YAML), or give the path"
        )
    return replace(scene, robot=robot)
