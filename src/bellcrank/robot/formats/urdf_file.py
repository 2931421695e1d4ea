"""Reading a URDF file into checked records, and writing the part of it that Pinocchio needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.formats.extended_joints import PLAIN_TYPES, split_universal
from bellcrank.robot.formats.urdf_elements import (
    MIMICKED,
    Inertial,
    Joint,
    Link,
    Mimic,
    joint_from,
    link_from,
    reduction_from,
)
from bellcrank.robot.formats.xml_tree import XmlElement, parse_xml, quoted, read_text

__all__ = ["UNLIMITED", "Inertial", "Joint", "Link", "Mimic", "Reading", "Urdf", "read_urdf", "reading_of"]

Part = TypeVar("Part", Link, Joint)
UNLIMITED = 1e300  # in pinocchio_xml: stands for "no limit", as Pinocchio's reader accepts no infinity
MOST_MOVING = 2000  # joints: a mass matrix takes memory with their square


@dataclass(frozen=True)
class Urdf:
    """A robot description that is a tree: links and joints by name, in the order of the file, and the root.

    There is one root, from which every link is reached once; numbers are finite, masses 0 or more, axes of unit length,
    and each mimicking joint mimics an independent joint (chains of mimics are resolved).
    """

    name: str
    source: Path
    text: str
    links: dict[str, Link]
    joints: dict[str, Joint]
    root: str

    @classmethod
    def from_text(cls, text: str, source: str | Path) -> Urdf:
        """An Urdf from the text of a file; `source` is the name that errors carry.

        Raises InputError, one sentence with file, element and line, where the text is not a valid URDF.
        """
        reading = reading_of(text, source)
        if reading.urdf is None:
            raise reading.problems[0]
        return reading.urdf

    def pinocchio_xml(self) -> str:
        """The kinematic and inertial part as a URDF text for `pinocchio.buildModelFromXML`.

        Continuous joints become revolute, so that every one-degree-of-freedom joint has one coordinate; spherical
        joints floating and screws revolute, to be replaced in the model (extended_joints.py); a
        limit that the file does not give is ±UNLIMITED (1e300). Shapes, transmissions and simulator elements
        are left out.
        """
        lines = [f"<robot name={quoted(self.name)}>"]
        for link in self.links.values():
            lines.append(f"<link name={quoted(link.name)}>{_inertial_xml(link.inertial)}</link>")
        lines.extend(_joint_xml(joint) for joint in self.joints.values())
        return "\n".join([*lines, "</robot>", ""])


def read_urdf(path: str | Path) -> Urdf:
    """Read and check a URDF file.

    Raises InputError, one sentence with file, element and line, where the file is missing, empty, truncated or not XML,
    has no <robot>, is not a tree (two roots, a loop, a link with two parents, an unknown or repeated name), or has an
    impossible value (not a number, NaN, a negative mass, a zero axis, a mimic of an unknown joint).
    """
    source = Path(path)
    return Urdf.from_text(read_text(source), source)


@dataclass(frozen=True)
class Reading:
    """What could be read from a text: the Urdf, or None and the problems found (at least one).

    `links` and `joints` are those that could be read, also where there is no Urdf.
    """

    urdf: Urdf | None
    problems: tuple[InputError, ...]
    links: dict[str, Link]
    joints: dict[str, Joint]


def reading_of(text: str, source: str | Path) -> Reading:
    """Read all of a text that can be read, collecting the problems instead of raising the first one."""
    source = Path(source)
    problems: list[InputError] = []

    def fail(message: str) -> InputError:
        printable = "".join(c if c.isprintable() else " " for c in message)
        return InputError(f"{source}: {printable}")

    try:
        robot = parse_xml(text, source)
        _refuse_foreign(robot, fail)
    except InputError as problem:
        return Reading(None, (problem,), {}, {})
    links = _named(robot, "link", lambda element: link_from(element, fail), fail, problems)
    joints = _named(robot, "joint", lambda element: joint_from(element, fail), fail, problems)
    for element in robot.find_all("transmission"):
        try:
            for name, reduction in reduction_from(element, fail).items():
                if name in joints:
                    joints[name] = replace(joints[name], reduction=reduction)
        except InputError as problem:
            problems.append(problem)
    if problems:
        return Reading(None, tuple(problems), links, joints)
    try:
        links, joints = split_universal(links, joints, fail)
        root = _root(links, joints, fail)
        if (moving := sum(joint.type != "fixed" for joint in joints.values())) > MOST_MOVING:
            raise fail(
                f"has {moving} joints that move, expected at most {MOST_MOVING}; leave some out, or make them fixed"
            )
        joints = {name: _resolved(joint, joints, fail) for name, joint in joints.items()}
    except InputError as problem:
        return Reading(None, (problem,), links, joints)
    name = robot.attributes.get("name", "").strip() or source.stem
    return Reading(Urdf(name, source, text, links, joints, root), (), links, joints)


def _refuse_foreign(robot: XmlElement, fail: Callable[[str], InputError]) -> None:
    xacro = next((element for element in robot.walk() if element.tag.startswith("xacro:")), None)
    if xacro is not None:
        raise fail(
            f"line {xacro.line}: contains the xacro element <{xacro.tag}>; expand the file first: "
            "xacro robot.urdf.xacro > robot.urdf"
        )
    if robot.tag != "robot":
        tag = f"<{robot.tag}>" if robot.tag in ("sdf", "mujoco", "COLLADA") else "another"
        raise fail(f"the root element is {tag}; a URDF's <robot> was expected")
    if robot.find("link") is None:
        raise fail("the <robot> has no <link>; at least one was expected")


def _named(
    robot: XmlElement,
    tag: str,
    make: Callable[[XmlElement], Part],
    fail: Callable[[str], InputError],
    problems: list[InputError],
) -> dict[str, Part]:
    parts: dict[str, Part] = {}
    lines: dict[str, int] = {}
    for element in robot.find_all(tag):
        try:
            part = make(element)
            if part.name in parts:
                raise fail(
                    f"{tag} '{part.name}' is defined twice, in lines {lines[part.name]} and {element.line}; "
                    "rename one of them"
                )
        except InputError as problem:
            problems.append(problem)
            continue
        parts[part.name] = part
        lines[part.name] = element.line
    return parts


def _root(links: dict[str, Link], joints: dict[str, Joint], fail: Callable[[str], InputError]) -> str:
    """The one link without a parent, once the joints are known to make a tree of all links."""
    above: dict[str, Joint] = {}
    children: dict[str, list[str]] = {name: [] for name in links}
    for joint in joints.values():
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                raise fail(f"joint '{joint.name}', <{role}>: {unknown_name('link', link, links)}")
        if joint.child in above:
            raise fail(
                f"link '{joint.child}' has two parents, by the joints '{above[joint.child].name}' and "
                f"'{joint.name}'; a URDF is a tree: remove one joint of the loop and close the loop by a constraint"
            )
        above[joint.child] = joint
        children[joint.parent].append(joint.child)
    roots = [name for name in links if name not in above]
    if not roots:
        raise fail(
            f"there is no root link: the joints {_loop(next(iter(links)), above)} form a loop; remove one of them"
        )
    if len(roots) > 1:
        named = ", ".join(f"'{root}'" for root in roots[:5]) + (", …" if len(roots) > 5 else "")
        raise fail(f"there are {len(roots)} root links ({named}); a robot has one: connect the others to it by joints")
    reached: set[str] = set()
    waiting = [roots[0]]
    while waiting:
        link = waiting.pop()
        reached.add(link)
        waiting.extend(children[link])
    lost = next((name for name in links if name not in reached), None)
    if lost is not None:
        raise fail(f"the joints {_loop(lost, above)} form a loop apart from root '{roots[0]}'; remove one of them")
    return roots[0]


def _loop(link: str, above: dict[str, Joint]) -> str:
    """The names of the joints on the loop that the parents of this link run into."""
    seen: set[str] = set()
    while link not in seen:
        seen.add(link)
        link = above[link].parent
    names, start = [above[link].name], link
    link = above[link].parent
    while link != start:
        names.append(above[link].name)
        link = above[link].parent
    shown = names[::-1][:6]
    return ", ".join(f"'{name}'" for name in shown) + (", …" if len(names) > 6 else "")


def _resolved(joint: Joint, joints: dict[str, Joint], fail: Callable[[str], InputError]) -> Joint:
    """The joint with its mimic pointing at an independent joint: q = m (m' q' + o') + o, chain by chain."""
    if joint.mimic is None:
        return joint
    leader, multiplier, offset = joint.mimic.joint, joint.mimic.multiplier, joint.mimic.offset
    passed = [joint.name]
    while True:
        if leader in passed:
            what = "mimics itself" if len(passed) == 1 else f"mimics itself through '{passed[-1]}'"
            raise fail(f"joint '{joint.name}', <mimic>: {what}; it must mimic an independent joint")
        if leader not in joints:
            raise fail(f"joint '{passed[-1]}', <mimic>: {unknown_name('joint', leader, joints)}")
        if joints[leader].type not in MIMICKED:
            raise fail(
                f"joint '{passed[-1]}', <mimic>: joint '{leader}' is {joints[leader].type}; "
                "only a revolute, continuous or prismatic joint or a screw can be mimicked"
            )
        following = joints[leader].mimic
        if following is None:
            return replace(joint, mimic=Mimic(leader, multiplier, offset))
        passed.append(leader)
        offset += multiplier * following.offset
        multiplier *= following.multiplier
        leader = following.joint


def _numbers(values: tuple[float, ...]) -> str:
    return '"' + " ".join(repr(value) for value in values) + '"'


def _inertial_xml(inertial: Inertial | None) -> str:
    if inertial is None:
        return ""
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    inertia = " ".join(f'{name}="{value!r}"' for name, value in zip(names, inertial.inertia, strict=True))
    return (
        f"<inertial><origin xyz={_numbers(inertial.xyz)} rpy={_numbers(inertial.rpy)}/>"
        f'<mass value="{inertial.mass!r}"/><inertia {inertia}/></inertial>'
    )


def _joint_xml(joint: Joint) -> str:
    kind = PLAIN_TYPES.get(joint.type, joint.type)
    parts = [
        f"<joint name={quoted(joint.name)} type={quoted(kind)}>",
        f"<parent link={quoted(joint.parent)}/><child link={quoted(joint.child)}/>",
        f"<origin xyz={_numbers(joint.xyz)} rpy={_numbers(joint.rpy)}/>",
    ]
    if kind in ("revolute", "prismatic", "planar"):
        parts.append(f"<axis xyz={_numbers(joint.axis)}/>")
    if kind in ("revolute", "prismatic"):
        lower = -UNLIMITED if joint.lower is None else joint.lower
        upper = UNLIMITED if joint.upper is None else joint.upper
        effort = UNLIMITED if joint.effort is None else joint.effort
        velocity = UNLIMITED if joint.velocity is None else joint.velocity
        parts.append(f'<limit lower="{lower!r}" upper="{upper!r}" effort="{effort!r}" velocity="{velocity!r}"/>')
        parts.append(f'<dynamics damping="{joint.damping or 0.0!r}" friction="{joint.friction or 0.0!r}"/>')
    if joint.mimic is not None:
        mimic = joint.mimic
        parts.append(
            f'<mimic joint={quoted(mimic.joint)} multiplier="{mimic.multiplier!r}" offset="{mimic.offset!r}"/>'
        )
    return "".join([*parts, "</joint>"])
