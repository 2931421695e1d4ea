"""A URDF as a RobotFile: its tree, the loops that it writes itself, and those of a Gepetto YAML beside it.

What the URDF says and is not used, elements and attributes that are not known, is noted with what may have been meant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches
from functools import lru_cache
from itertools import count
from pathlib import Path

from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess
from bellcrank.messages import unknown_name
from bellcrank.notes import Note
from bellcrank.robot.formats.gepetto_file import (
    gepetto_beside,
    gepetto_of_others,
    motor_notes,
    read_gepetto,
    with_joint_types,
    without_motor,
)
from bellcrank.robot.formats.robot_file import JointMotor, RobotFile
from bellcrank.robot.formats.urdf_extensions import (
    BALL,
    BUSHING,
    SPRING,
    ball_constraints,
    gazebo_balls,
    refuse_unread,
    rotor_inertias,
    springs,
)
from bellcrank.robot.formats.urdf_loops import TAGS, loops_of
from bellcrank.robot.formats.xacro_text import expanded
from bellcrank.robot.formats.xml_tree import XmlElement, parse_xml


def read_urdf_robot(
    text: str, source: Path, access: FileAccess, xacro_args: Mapping[str, str] | None = None
) -> RobotFile:
    """The contents of a URDF, given as text, and of a Gepetto YAML beside it; the tree itself is not checked here.

    `xacro_args` are values of the arguments of a xacro file.

    Raises InputError, one sentence, where a loop is wrong.
    """
    if source.suffix == ".xacro":
        text = expanded(text, source, access, xacro_args or {})
    beside = gepetto_beside(source, access)
    robot, unnamed = with_joint_names(parse_xml(text, source))

    def fail(message: str) -> InputError:
        return InputError(f"{source}: " + "".join(c if c.isprintable() else " " for c in message))

    refuse_unread(robot, fail)
    file = RobotFile(
        source=source,
        urdf=robot,
        loops=(*loops_of(robot, fail), *ball_constraints(robot, fail), *gazebo_balls(robot, fail)),
        springs=springs(robot, fail),
        rotor_inertia=rotor_inertias(robot, fail),
        notes=(*unnamed, *unused(robot), *(gepetto_of_others(source, access) if beside is None else ())),
    )
    return file if beside is None else _with_gepetto(file, beside)


def _with_gepetto(file: RobotFile, path: Path) -> RobotFile:
    if file.loops:
        raise InputError(
            f"{file.source}: has loops of its own, and {path.name} beside it closes loops too; keep one of them"
        )
    found = read_gepetto(path)
    joints = [joint.attributes.get("name", "").strip() for joint in file.urdf.find_all("joint")]
    links = [link.attributes.get("name", "").strip() for link in file.urdf.find_all("link")]
    for frame in (name for a, b, _ in found.loops for name in (a, b)):
        if frame not in links and frame not in joints:
            raise InputError(f"{path}: closed_loop: {unknown_name('frame', frame, [*links, *joints])}")
    for name in found.motors:
        if name not in joints:
            raise InputError(f"{path}: name_mot: {unknown_name('joint', name, joints)}")
    urdf, notes = with_joint_types(file.urdf, found.joint_types, path)
    still = without_motor(urdf, found.motors)
    return replace(
        file,
        urdf=urdf,
        loops=found.frame_loops("loop"),
        loop_file=path.resolve(),
        motors=tuple(JointMotor(name=name, joint=name) for name in dict.fromkeys(found.motors) if name not in still),
        notes=(*file.notes, *found.notes, *notes, *motor_notes(path, still)),
    )


def with_joint_names(robot: XmlElement) -> tuple[XmlElement, tuple[Note, ...]]:
    """A <robot> in which every joint has a name, that of its child link with "_joint" where it had none.

    Returns:
        The <robot>, every element with the line that it had; and a note on each joint that was given a name.

    Example:
        >>> text = '<robot name="r"><joint type="fixed"><parent link="a"/><child link="b"/></joint></robot>'
        >>> with_joint_names(parse_xml(text, "robot.urdf"))[1]
        ("line 1: the joint of link 'b' has no name; it is called 'b_joint'.",)
    """
    names = [joint.attributes.get("name", "").strip() for joint in robot.find_all("joint")]
    if all(names):
        return robot, ()
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
    return replace(robot, children=children), tuple(notes)


CHILDREN = {  # of the elements that are read, what they may contain
    "robot": ("link", "joint", "material", "transmission", "gazebo", "sensor", "ros2_control", "frame",
              BALL, SPRING, BUSHING, *TAGS),
    "link": ("inertial", "visual", "collision"),
    "joint": ("origin", "parent", "child", "axis", "axis2", "limit", "dynamics", "mimic", "calibration",
              "safety_controller"),
    "inertial": ("origin", "mass", "inertia"),
}  # fmt: skip
ATTRIBUTES = {
    "robot": ("name", "version"),
    "link": ("name", "type"),
    "joint": ("name", "type", "pitch"),
    "origin": ("xyz", "rpy"),
    "inertial": (),
    "parent": ("link",),
    "child": ("link",),
    "axis": ("xyz",),
    "axis2": ("xyz",),
    "frame": ("name", "link", "xyz", "rpy"),
    "limit": ("lower", "upper", "effort", "velocity"),
    "dynamics": ("damping", "friction"),
    "mimic": ("joint", "multiplier", "offset"),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
}
OWNERS = {name: tag for tag in ("dynamics", "limit", "mimic", "mass", "inertia") for name in ATTRIBUTES[tag]}
CLOSE = 0.75  # difflib's ratio from which a name counts as another one misspelt
MOST = 8  # kinds that are listed
MOST_MISSPELT = 20  # sentences
LONGEST = 40  # characters of a name that are compared and shown


def unused(robot: XmlElement) -> tuple[str, ...]:
    """A sentence for each name that is misspelt or stands at the wrong element, and one for all others."""
    found: list[str] = []
    others: dict[str, tuple[int, int]] = {}  # how often, and the first line
    waiting = [robot]
    while waiting:
        element = waiting.pop()
        for name in element.attributes:
            if not name.startswith("xmlns") and name not in ATTRIBUTES.get(element.tag, (name,)):
                what = f"the attribute '{name:.{LONGEST}}' of <{element.tag}>"
                _note(found, others, element, what, _meant(element.tag, name))
        for child in reversed(element.children):
            if element.tag not in CHILDREN or child.tag in CHILDREN[element.tag]:
                if child.tag in CHILDREN or child.tag in ATTRIBUTES:
                    waiting.append(child)
                continue
            close = _close(child.tag, CHILDREN[element.tag])
            what = f"<{child.tag:.{LONGEST}}> in <{element.tag}>"
            _note(found, others, child, what, f"<{close}>" if close else "")
    if others:
        parts = [
            f"{what} ({f'{count} times, first' if count > 1 else 'once,'} in line {line})"
            for what, (count, line) in others.items()
        ]
        more = f" and {len(parts) - MOST} more kinds" if len(parts) > MOST else ""
        found.append(f"what is not known and not used: {', '.join(parts[:MOST])}{more}.")
    return tuple(found)


def _meant(tag: str, name: str) -> str:
    """What an unknown attribute may have been meant to be; empty where nothing is like it."""
    close = _close(name, ATTRIBUTES[tag])
    if close:
        return f"'{close}'"
    return f"'{name}' of <{OWNERS[name]}>" if name in OWNERS else ""


@lru_cache(maxsize=8192)
def _close(name: str, known: tuple[str, ...]) -> str:
    """The known name that is most like another one; empty where none is."""
    close = get_close_matches(name, known, 1, CLOSE) if len(name) <= LONGEST else []
    return close[0] if close else ""


def _note(found: list[str], others: dict[str, tuple[int, int]], element: XmlElement, what: str, meant: str) -> None:
    if meant and len(found) < MOST_MISSPELT:
        text = f"line {element.line}: {what} is not known and not used; was {meant} meant?"
        found.append(Note(text, "changes"))
        return
    count, line = others.get(what, (0, element.line))
    others[what] = (count + 1, line)
