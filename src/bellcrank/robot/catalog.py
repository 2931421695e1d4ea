"""Robots by name: those that come with bellcrank and those of the package example-robot-data."""

from __future__ import annotations

from collections import Counter
from functools import lru_cache
from pathlib import Path

from bellcrank.errors import InputError
from bellcrank.files import bundled_data
from bellcrank.files.bundled_data import example_folders
from bellcrank.messages import unknown_name

SUFFIXES = (".urdf", ".xacro", ".xml", ".mjcf", ".sdf", ".world")  # of robot files
# Names that people use for what example-robot-data files under another name.
SHORT_NAMES = {
    "allegro_left": "allegro_hand_description/urdf/allegro_left_hand.urdf",
    "allegro_right": "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "anymal": "anymal_b_simple_description/robots/anymal.urdf",
    "anymal_b": "anymal_b_simple_description/robots/anymal.urdf",
    "anymal_c": "anymal_c_simple_description/urdf/anymal.urdf",
    "anymal_kinova": "anymal_b_simple_description/robots/anymal-kinova.urdf",
    "b1_z1": "b1_description/urdf/b1-z1.urdf",
    "g1": "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "g1_hands": "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf",
    "hyq": "hyq_description/robots/hyq_no_sensors.urdf",
    "solo8": "solo_description/robots/solo.urdf",
    "solo12": "solo_description/robots/solo12.urdf",
    "talos": "talos_data/robots/talos_reduced.urdf",
    "talos_arm": "talos_data/robots/talos_left_arm.urdf",
    "talos_full": "talos_data/robots/talos_full_v2.urdf",
    "ur3": "ur_description/urdf/ur3_robot.urdf",
    "ur3_limited": "ur_description/urdf/ur3_joint_limited_robot.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "ur5_limited": "ur_description/urdf/ur5_joint_limited_robot.urdf",
    "ur10": "ur_description/urdf/ur10_robot.urdf",
    "ur10_limited": "ur_description/urdf/ur10_joint_limited_robot.urdf",
    "panda": "panda_description/urdf/panda.urdf",
}


def find_urdf(name_or_path: str | Path) -> Path:
    """The URDF file for a path or a name: an existing file, a bundled robot, or a robot of example-robot-data.

    Raises InputError with the names that exist where there is none.
    """
    given = str(name_or_path)
    path = Path(name_or_path)
    if "\0" in given:
        raise InputError(f"the robot {given!r} contains a null character; name a file or a robot")
    try:
        folder = bool(given) and path.is_dir()
        if path.exists() and not folder and given:
            return path  # a pipe or a device is refused by the reader
    except OSError:
        folder = False  # too long for a path
    if isinstance(name_or_path, str):
        known = find_named(given)
        if known is not None:
            return known
        if path.suffix not in SUFFIXES and Path(given).name == given and not folder:
            more = "" if list(example_folders()) else "; more robots come with: pip install example-robot-data"
            raise InputError(unknown_name("robot", given, names()) + more)
    if folder:
        raise InputError(f"{given}: is a folder; name the URDF file in it")
    raise InputError(f"{given}: no such file; give the path of a robot file or the name of a robot, such as planar_2r")


def find_named(name: str) -> Path | None:
    """The URDF file of the robot of this name, or None."""
    own = _bundled()
    if name in own:
        return own[name]
    if name in SHORT_NAMES:
        for root in example_folders():
            if (root / SHORT_NAMES[name]).is_file():
                return root / SHORT_NAMES[name]
    return names().get(name)


def names() -> dict[str, Path]:
    """The URDF file of every robot that has a name: bundled ones first, then those of example-robot-data."""
    own = _bundled()
    return own | {name: path for name, path in _examples().items() if name not in own}


def _bundled() -> dict[str, Path]:
    return {path.stem: path for path in sorted(bundled_data.folder("urdf").glob("*.urdf"))}


@lru_cache(maxsize=1)
def _examples() -> dict[str, Path]:
    """Names in example-robot-data: short ones, file stems, and a package's name where it has one robot."""
    found: dict[str, Path] = {}
    for root in example_folders():
        paths = sorted([*root.glob("*/urdf/*.urdf"), *root.glob("*/robots/*.urdf")])
        stems = Counter(path.stem for path in paths)
        packages = Counter(path.parts[-3] for path in paths)
        for name, relative in SHORT_NAMES.items():
            if (root / relative).is_file():
                found.setdefault(name, root / relative)
        for path in paths:
            package = path.parts[-3].removesuffix("_description").removesuffix("_data")
            unique = stems[path.stem] == 1
            found.setdefault(path.stem if unique else f"{package}_{path.stem}", path)
            if packages[path.parts[-3]] == 1:
                found.setdefault(package, path)
    return dict(sorted(found.items()))
