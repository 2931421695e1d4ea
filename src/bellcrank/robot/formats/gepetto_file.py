"""The YAML files of Gepetto's parallel robots (example-parallel-robots), which close the loops of a URDF.

`closed_loop` lists pairs of frames, `type` is 3d (the origins coincide) or 6d (the frames coincide), `name_mot` lists
the joints with motors. `joint_name` lists joints that are revolute in the URDF and `joint_type` what they really are:
SPHERICAL, FIXED (at 0), or UJOINT_XY and alike. Source: `completeRobotLoader` of Gepetto/example-parallel-robots.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final

from bellcrank.config.yaml_file import read_yaml
from bellcrank.errors import InputError
from bellcrank.files.access import MOST_YAML, FileAccess, read_bytes
from bellcrank.messages import format_value, unknown_name
from bellcrank.notes import Note
from bellcrank.robot.formats.robot_file import FrameLoop, FramePlace
from bellcrank.robot.formats.xml_tree import XmlElement

SUFFIXES = (".yaml", ".yml")
MOST_FILES = 50  # of a folder that are looked at
KEYS = ("closed_loop", "type", "name_mot", "joint_name", "joint_type")


@dataclass(frozen=True)
class GepettoLoops:
    """The contents of a Gepetto YAML: (frame a, frame b, "3d" or "6d") of each loop, the joints with motors, the new
    types of joints as they are written, and sentences about keys that are not used.
    """

    loops: tuple[tuple[str, str, str], ...]
    motors: tuple[str, ...]
    joint_types: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def frame_loops(self, name: str) -> tuple[FrameLoop, ...]:
        """The loops as records, named NAME_1, NAME_2, …"""
        return tuple(
            FrameLoop(name=f"{name}_{k}", kind="point" if kind == "3d" else "weld", a=FramePlace(a), b=FramePlace(b))
            for k, (a, b, kind) in enumerate(self.loops, 1)
        )


def read_gepetto(path: str | Path) -> GepettoLoops:
    """Read a Gepetto YAML. Raises InputError, one sentence, for other contents."""
    data = read_yaml(path)
    pairs, kinds = data.get("closed_loop", []), data.get("type", [])
    if not isinstance(pairs, list) or not all(isinstance(p, list) and len(p) == 2 for p in pairs):
        raise InputError(f"{path}: closed_loop: expected a list of pairs of frames, such as [[loop_A, loop_B]]")
    if not isinstance(kinds, list) or len(kinds) != len(pairs):
        raise InputError(
            f"{path}: type: expected one of 3d and 6d for each of the {len(pairs)} loops, found {format_value(kinds)}"
        )
    for kind in kinds:
        if str(kind).lower() not in ("3d", "6d"):
            raise InputError(f"{path}: type: {unknown_name('type', str(kind), ['3d', '6d'])}")
    return GepettoLoops(
        loops=tuple((str(a), str(b), str(kind).lower()) for (a, b), kind in zip(pairs, kinds, strict=True)),
        motors=_names(data, "name_mot"),
        joint_types=_joint_types(path, data),
        notes=tuple(f"{Path(path).name}: the key '{key}' is not used." for key in data if key not in KEYS),
    )


def gepetto_beside(urdf: Path, access: FileAccess) -> Path | None:
    """The Gepetto YAML beside a URDF: robot.yaml beside robot.urdf, with the key `closed_loop`; None without one."""
    for suffix in SUFFIXES:
        path = urdf.with_suffix(suffix)
        if path.is_file() and access.allows(path) and b"closed_loop" in read_bytes(path, MOST_YAML):
            return path if "closed_loop" in read_yaml(path) else None
    return None


def gepetto_of_others(urdf: Path, access: FileAccess) -> tuple[Note, ...]:
    """A note on each YAML of Gepetto in the folder of a URDF that closes loops and belongs to no URDF by its name."""
    if access.held or not urdf.parent.is_dir():
        return ()
    found = []
    listed = itertools.islice((path for path in sorted(urdf.parent.iterdir()) if path.suffix in SUFFIXES), MOST_FILES)
    for path in listed:
        named = any(path.with_suffix(suffix).is_file() for suffix in (".urdf", ".xacro"))
        if named or path.stem == urdf.stem or not path.is_file() or not access.allows(path):
            continue
        if path.stat().st_size > MOST_YAML or b"\nclosed_loop" not in b"\n" + path.read_bytes():
            continue
        text = (
            f"{path.name} beside it closes loops (closed_loop) and is not used; where it belongs to this file, call it "
            f"{urdf.with_suffix('.yaml').name}, or name it under 'constraints' of a scene"
        )
        found.append(Note(text, "changes"))
    return tuple(found)


def _names(data: Mapping[str, Any], key: str) -> tuple[str, ...]:
    names = data.get(key) or []
    return tuple(map(str, names if isinstance(names, list) else [names]))


def _joint_types(path: str | Path, data: Mapping[str, Any]) -> dict[str, str]:
    names, kinds = _names(data, "joint_name"), _names(data, "joint_type")
    if len(names) != len(kinds):
        raise InputError(
            f"{path}: joint_type: expected a type for each of the {len(names)} joints of joint_name, found {len(kinds)}"
        )
    return dict(zip(names, kinds, strict=True))


_AXES: Final = {"X": "1 0 0", "Y": "0 1 0", "Z": "0 0 1"}
GEPETTO_TYPES: Final = ("SPHERICAL", "FIXED", *(f"UJOINT_{a}{b}" for a in _AXES for b in _AXES if a != b))


def with_joint_types(
    robot: XmlElement, types: Mapping[str, str], source: Path | str
) -> tuple[XmlElement, tuple[str, ...]]:
    """A <robot> in which some joints have other types; Gepetto's loader leaves out names that no joint has.

    Args:
        robot: The <robot> of a URDF.
        types: New types by the names of joints: one of GEPETTO_TYPES, in capital or small letters. UJOINT_XY and alike
            are universal joints about two axes of the joint's frame, in this order.
        source: File that gives the types, for messages.

    Returns:
        The <robot> of a URDF in the extended sense (urdf_file.py), every element with the line that it had; and one
        sentence for each name that no joint has.

    Raises:
        InputError: There is no such type.

    Example:
        >>> from bellcrank.robot.formats.xml_tree import parse_xml
        >>> urdf = parse_xml('<robot><joint name="hip" type="revolute"><axis xyz="1 0 0"/></joint></robot>', "r.urdf")
        >>> [joint] = with_joint_types(urdf, {"hip": "UJOINT_YZ"}, "robot.yaml")[0].children
        >>> joint.attributes["type"], [(axis.tag, axis.attributes["xyz"]) for axis in joint.children]
        ('universal', [('axis', '0 1 0'), ('axis2', '0 0 1')])
    """
    joints = {joint.attributes.get("name", "").strip(): joint for joint in robot.find_all("joint")}
    changed: dict[int, XmlElement] = {}
    notes: list[str] = []
    for name, kind in types.items():
        if kind.upper() not in GEPETTO_TYPES:
            raise InputError(f"{source}: joint_type of '{name}': {unknown_name('type', kind, GEPETTO_TYPES)}")
        if name in joints:
            changed[id(joints[name])] = _changed(joints[name], kind.upper())
        else:
            close = get_close_matches(name, joints, 1)
            like = f" (the nearest name is '{close[0]}')" if close else ""
            notes.append(
                f"{Path(source).name}: joint_name: no joint is named '{name}'{like}; its new type is not used."
            )
    return replace(robot, children=[changed.get(id(child), child) for child in robot.children]), tuple(notes)


def _changed(joint: XmlElement, kind: str) -> XmlElement:
    """The element of a joint with another type; a mimic of the former one is left out."""
    kept = [child for child in joint.children if child.tag not in ("axis", "axis2", "mimic")]
    if not kind.startswith("UJOINT"):
        return replace(joint, attributes={**joint.attributes, "type": kind.lower()}, children=kept)
    line = max([joint.line, *(child.line for child in kept)])
    axes = [
        XmlElement(tag, {"xyz": _AXES[letter]}, line) for tag, letter in zip(("axis", "axis2"), kind[-2:], strict=True)
    ]
    return replace(joint, attributes={**joint.attributes, "type": "universal"}, children=[*kept, *axes])


def without_motor(robot: XmlElement, names: Iterable[str]) -> dict[str, str]:
    """The joints of a <robot> that cannot have a motor, as they are fixed or follow another joint, and why.

    Args:
        robot: The <robot> of a URDF.
        names: The joints that are meant to have motors.

    Returns:
        Why, by the name of the joint.

    Example:
        >>> from bellcrank.robot.formats.xml_tree import parse_xml
        >>> without_motor(parse_xml('<robot><joint name="weld" type="fixed"/></robot>', "robot.urdf"), ["weld"])
        {'weld': 'is fixed'}
    """
    found = {}
    for joint in robot.find_all("joint"):
        name, mimic = joint.attributes.get("name", "").strip(), joint.find("mimic")
        if name in names and joint.attributes.get("type") == "fixed":
            found[name] = "is fixed"
        elif name in names and mimic is not None:
            found[name] = f"follows joint '{mimic.attributes.get('joint', '').strip()}' (mimic)"
    return found


def motor_notes(path: Path, still: Mapping[str, str]) -> tuple[Note, ...]:
    """Notes on joints (`without_motor`) that a Gepetto YAML lists among the motors."""
    return tuple(Note(f"{path.name}: name_mot: joint '{name}' {why}; it has no motor.") for name, why in still.items())
