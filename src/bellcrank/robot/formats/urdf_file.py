"""The links and joints of a URDF as checked records.

There are joint types beyond URDF's own. A spherical joint has a unit quaternion x y z w (child to parent) and the
angular velocity of the child relative to the parent, in the child's axes. A screw turns by its coordinate (rad) about
its axis and advances along it by pitch / 2π times that. A universal joint NAME becomes two revolute joints, NAME_1
about its `axis` and NAME_2 about its `axis2`, with a massless link NAME_cross between them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
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
from bellcrank.robot.formats.xml_tree import XmlElement

__all__ = ["Inertial", "Joint", "Link", "Mimic", "Reading", "Urdf", "reading_of"]

Part = TypeVar("Part", Link, Joint)
MOST_MOVING = 2000  # joints: a mass matrix takes memory with their square


@dataclass(frozen=True)
class Urdf:
    """A robot description that is a tree: links and joints by name, in the order of the file, and the root.

    There is one root, from which every link is reached once; numbers are finite, masses 0 or more, axes of unit length,
    and each mimicking joint mimics an independent joint (chains of mimics are resolved).
    """

    name: str
    source: Path
    links: dict[str, Link]
    joints: dict[str, Joint]
    root: str

    @classmethod
    def of(cls, robot: XmlElement, source: str | Path) -> Urdf:
        """An Urdf from the <robot> of a file; `source` is the name that errors carry.

        Raises InputError, one sentence with file, element and line, where there is no <robot>, it is not a tree (two
        roots, a loop, a link with two parents, an unknown or repeated name), or has an impossible value (not a number,
        NaN, a negative mass, a zero axis, a mimic of an unknown joint).
        """
        reading = reading_of(robot, source)
        if reading.urdf is None:
            raise reading.problems[0]
        return reading.urdf


@dataclass(frozen=True)
class Reading:
    """What could be read from a file: the Urdf, or None and the problems found (at least one).

    `links` and `joints` are those that could be read, also where there is no Urdf.
    """

    urdf: Urdf | None
    problems: tuple[InputError, ...]
    links: dict[str, Link]
    joints: dict[str, Joint]


def reading_of(robot: XmlElement, source: str | Path) -> Reading:
    """Read all of a <robot> that can be read, collecting the problems instead of raising the first one."""
    source = Path(source)
    problems: list[InputError] = []

    def fail(message: str) -> InputError:
        printable = "".join(c if c.isprintable() else " " for c in message)
        return InputError(f"{source}: {printable}")

    try:
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
        links, joints = _with_universal_split(links, joints, fail)
        root = _root(links, joints, fail)
        if (moving := sum(joint.type != "fixed" for joint in joints.values())) > MOST_MOVING:
            raise fail(
                f"has {moving} joints that move, expected at most {MOST_MOVING}; leave some out, or make them fixed"
            )
        joints = {name: _resolved(joint, joints, fail) for name, joint in joints.items()}
    except InputError as problem:
        return Reading(None, (problem,), links, joints)
    name = robot.attributes.get("name", "").strip() or source.stem
    return Reading(Urdf(name, source, links, joints, root), (), links, joints)


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


def _with_universal_split(
    links: Mapping[str, Link], joints: Mapping[str, Joint], fail: Callable[[str], InputError]
) -> tuple[dict[str, Link], dict[str, Joint]]:
    """The links and joints with every universal joint written as two revolute joints.

    Raises InputError, made by `fail`, where a name that this needs is taken.
    """
    new_links, new_joints = dict(links), {}
    for joint in joints.values():
        if joint.type != "universal":
            new_joints[joint.name] = joint
            continue
        first, second, cross = f"{joint.name}_1", f"{joint.name}_2", f"{joint.name}_cross"
        for kind, name, names in (("joint", first, joints), ("joint", second, joints), ("link", cross, links)):
            if name in names:
                raise fail(
                    f"there is a {kind} '{name}', a name that the universal joint '{joint.name}' needs for itself (its "
                    f"two axes are the joints '{first}' and '{second}'); rename one of them"
                )
        new_links[cross] = Link(cross, None, (), between_axes=True)
        revolute = "revolute" if joint.lower is not None or joint.upper is not None else "continuous"
        new_joints[first] = replace(joint, name=first, type=revolute, child=cross)
        new_joints[second] = replace(
            joint, name=second, type=revolute, parent=cross, xyz=(0.0, 0.0, 0.0), rpy=(0.0, 0.0, 0.0),
            axis=joint.axis_2, axis_length=1.0,
        )  # fmt: skip
    return new_links, new_joints


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
