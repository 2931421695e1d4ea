"""Changing the types and names of joints of a URDF text, as the YAML files of Gepetto's parallel robots do.

Their `joint_name` lists joints that are revolute in the URDF and `joint_type` what they really are: SPHERICAL, FIXED
(at 0), or UJOINT_XY and alike, a universal joint about two axes of the joint's frame, in this order.
Source: `completeRobotLoader` of Gepetto/example-parallel-robots.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from difflib import get_close_matches
from itertools import count
from pathlib import Path
from typing import Final

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.notes import Note
from bellcrank.robot.formats.xml_tree import XmlElement, escaped, parse_xml, quoted

_AXES: Final = {"X": "1 0 0", "Y": "0 1 0", "Z": "0 0 1"}
GEPETTO_TYPES: Final = ("SPHERICAL", "FIXED", *(f"UJOINT_{a}{b}" for a in _AXES for b in _AXES if a != b))


def with_joint_types(text: str, types: Mapping[str, str], source: Path | str) -> tuple[str, tuple[str, ...]]:
    """A URDF text in which some joints have other types; Gepetto's loader leaves out names that no joint has.

    Args:
        text: Text of a URDF, which is well-formed XML.
        types: New types by the names of joints: one of GEPETTO_TYPES, in capital or small letters.
        source: File that gives the types, for messages.

    Returns:
        The text of a URDF in the extended sense (extended_joints.py), every element in the same line as before; and one
        sentence for each name that no joint has.

    Raises:
        InputError: There is no such type.

    Example:
        >>> urdf = '<robot name="r"><joint name="hip" type="revolute"><axis xyz="1 0 0"/></joint></robot>'
        >>> with_joint_types(urdf, {"hip": "UJOINT_YZ"}, "robot.yaml")[0]
        '<robot name="r"><joint name="hip" type="universal"><axis xyz="0 1 0"/><axis2 xyz="0 0 1"/></joint></robot>'
    """
    if not types:
        return text, ()
    robot = parse_xml(text, source)
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
    children = [changed.get(id(child), child) for child in robot.children]
    pieces: list[str] = []
    _write(replace(robot, children=children), pieces, 1)
    return "".join(pieces), tuple(notes)


def with_joint_names(text: str, source: Path | str) -> tuple[str, tuple[Note, ...]]:
    """A URDF text in which every joint has a name, that of its child link with "_joint" where it had none.

    Args:
        text: Text of a URDF, which is well-formed XML.
        source: Its file, for messages.

    Returns:
        The text, every element in the same line as before; and a note on each joint that was given a name.

    Example:
        >>> urdf = '<robot name="r"><joint type="fixed"><parent link="a"/><child link="b"/></joint></robot>'
        >>> with_joint_names(urdf, "robot.urdf")[1]
        ("line 1: the joint of link 'b' has no name; it is called 'b_joint'.",)
    """
    robot = parse_xml(text, source)
    names = [joint.attributes.get("name", "").strip() for joint in robot.find_all("joint")]
    if all(names):
        return text, ()
    taken, children, notes = {*names}, list[XmlElement](), list[Note]()
    for child in robot.children:
        end = child.find("child")
        link = "" if end is None else end.attributes.get("link", "").strip()
        if child.tag == "joint" and not child.attributes.get("name", "").strip() and link:
            free = (f"{link}_joint{k or ''}" for k in count())
            name = next(name for name in free if name not in taken)
            taken.add(name)
            notes.append(Note(f"line {child.line}: the joint of link '{link}' has no name; it is called '{name}'."))
            child = replace(child, attributes={**child.attributes, "name": name})
        children.append(child)
    pieces: list[str] = []
    _write(replace(robot, children=children), pieces, 1)
    return "".join(pieces), tuple(notes)


def without_motor(text: str, source: Path | str, names: Iterable[str]) -> dict[str, str]:
    """The joints of a URDF that cannot have a motor, as they are fixed or follow another joint, and why.

    Args:
        text: Text of a URDF, which is well-formed XML.
        source: Its file, for messages.
        names: The joints that are meant to have motors.

    Returns:
        Why, by the name of the joint.

    Example:
        >>> without_motor('<robot name="r"><joint name="weld" type="fixed"/></robot>', "robot.urdf", ["weld"])
        {'weld': 'is fixed'}
    """
    found = {}
    for joint in parse_xml(text, source).find_all("joint"):
        name, mimic = joint.attributes.get("name", "").strip(), joint.find("mimic")
        if name in names and joint.attributes.get("type") == "fixed":
            found[name] = "is fixed"
        elif name in names and mimic is not None:
            found[name] = f"follows joint '{mimic.attributes.get('joint', '').strip()}' (mimic)"
    return found


def motor_notes(path: Path, still: Mapping[str, str]) -> tuple[Note, ...]:
    """Notes on joints (`without_motor`) that a Gepetto YAML lists among the motors."""
    return tuple(Note(f"{path.name}: name_mot: joint '{name}' {why}; it has no motor.") for name, why in still.items())


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


def _write(element: XmlElement, pieces: list[str], line: int) -> int:
    """Add the text of an element to the pieces, from this line on, each tag in its own line; the line of its end."""
    pieces.append("\n" * max(element.line - line, 0))
    line = max(line, element.line)
    attributes = "".join(f" {key}={quoted(value)}" for key, value in element.attributes.items())
    written = escaped(element.text.strip())
    if not element.children and not written:
        pieces.append(f"<{element.tag}{attributes}/>")
        return line
    pieces.append(f"<{element.tag}{attributes}>{written}")
    line += written.count("\n")
    for child in element.children:
        line = _write(child, pieces, line)
    pieces.append(f"</{element.tag}>")
    return line
