"""`bellcrank.load`: a scene or a robot from a file; and the scene that an argument of a public function stands for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bellcrank import arguments
from bellcrank.files.access import Trust, for_files_only
from bellcrank.robot.robot import Robot
from bellcrank.scene.overrides import EXPECTED_OVERRIDES
from bellcrank.scene.robot_config import find_config
from bellcrank.scene.scene import Scene, load_scene


@arguments.named
def load(
    path_or_name: str | Path, overrides: Mapping[str, Any] | None = None, *, trust: Trust = ()
) -> Scene | Robot:
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
        >>> bc.load("urdf/pendulum.urdf")
        Robot('pendulum', 1 joints, nq=1, nv=1, pendulum.urdf)
    """
    scene = load_scene(path_or_name, overrides, trust=trust)
    file = scene.config.file
    more = bool(overrides) or (file is not None and bool(file.loops or file.springs or file.motors))
    return scene if more or not find_config(path_or_name)[1] else scene.robot


def given_scene(scene: Scene | str | Path, overrides: Mapping[str, Any] | None = None, trust: Trust = ()) -> Scene:
    """A scene, or that of a path or name, with overrides. Raises InputError, also where `trust` goes with no file."""
    if isinstance(scene, Scene):
        for_files_only(trust, "scene", "load_scene")
    else:
        scene = load_scene(arguments.subject("scene", scene, "a scene"), trust=trust)
    if overrides is not None and (changed := arguments.mapping("overrides", overrides, EXPECTED_OVERRIDES)):
        scene = scene.with_overrides(changed)
    return scene
