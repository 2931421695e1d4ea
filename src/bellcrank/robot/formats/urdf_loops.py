"""Closed loops that extensions of URDF write into the file itself.

- `<loop_joint name type><link1 link xyz rpy/><link2 …/><axis xyz/></loop_joint>`: NVIDIA's URDF importer of Isaac Sim
  (its documentation writes link1 for both links), types spherical, fixed, revolute and continuous, and older versions
  of Drake, which write no type and mean a hinge. Types prismatic, planar and universal (with <axis2>, fixed in link2)
  are read too.
- URDF+ (M. Chignoli et al., "URDF+: An Enhanced URDF for Robots with Kinematic Loops", 2024, arXiv:2411.19753, and its
  parser): `<loop name type><predecessor link><origin/></predecessor><successor …/><axis xyz/></loop>`, types fixed,
  revolute and continuous, here also those above, and
  `<coupling name><predecessor link/><successor link/><ratio value/></coupling>`: ratio times the sum of the joint
  positions from the nearest common ancestor to the predecessor equals the sum of those to the successor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.formats.robot_file import FrameLoop, FramePlace, JointRelation, Loop, LoopKind
from bellcrank.robot.formats.urdf_elements import Vector3, attribute_number, attribute_vector, origin_from
from bellcrank.robot.formats.xml_tree import XmlElement

TAGS = ("loop_joint", "loop", "coupling")
KINDS: dict[str, LoopKind] = {
    "spherical": "point", "ball": "point", "fixed": "weld", "revolute": "hinge", "continuous": "hinge",
    "prismatic": "prismatic", "planar": "planar", "universal": "universal",
}  # fmt: skip

Fail = Callable[[str], InputError]


def loops_of(robot: XmlElement, fail: Fail) -> tuple[Loop, ...]:
    """The loops and couplings under a <robot>, in the order of the file; `fail(message)` makes the InputError."""
    links = [link.attributes.get("name", "").strip() for link in robot.find_all("link")]
    loops: list[Loop] = []
    for element in robot.children:
        if element.tag in TAGS:
            name = element.attributes.get("name", "").strip()
            if not name or "." in name:
                raise fail(f"line {element.line}: <{element.tag}> needs a name without dots, found '{name}'")
            if name in [loop.name for loop in loops]:
                raise fail(f"line {element.line}: two loops have the name '{name}'; rename one of them")
            where = f"<{element.tag}> '{name}'"
            if element.tag == "coupling":
                loops.append(_coupling(element, name, where, robot, links, fail))
            else:
                loops.append(_loop(element, name, where, links, fail))
    return tuple(loops)


def _loop(element: XmlElement, name: str, where: str, links: list[str], fail: Fail) -> FrameLoop:
    if element.tag == "loop":
        a, b = (_side(element, tag, where, links, fail) for tag in ("predecessor", "successor"))
    else:
        sides = [child for child in element.children if child.tag in ("link1", "link2")]
        if len(sides) != 2:
            raise fail(f"line {element.line}: {where} has {len(sides)} links; expected <link1> and <link2>")
        a, b = (_isaac_side(side, where, links, fail) for side in sides)
    if a.frame == b.frame:
        raise fail(f"line {element.line}: {where} connects link '{a.frame}' to itself; name two links")
    given = element.attributes.get("type", "revolute" if element.tag == "loop_joint" else "")
    if given not in KINDS:
        raise fail(f"line {element.line}: {where}: {unknown_name('type of loop', given, KINDS)}")
    kind = KINDS[given]
    if kind in ("point", "weld"):
        return FrameLoop(name=name, kind=kind, a=a, b=b)
    axis = _axis(element, "axis", where, fail)
    if kind == "universal":
        return FrameLoop(name=name, kind=kind, a=a, b=b, axis=axis, axis_2=_axis(element, "axis2", where, fail))
    return FrameLoop(name=name, kind=kind, a=a, b=b, axis=axis)


def _axis(element: XmlElement, tag: str, where: str, fail: Fail) -> Vector3:
    """The unit axis in both frames. URDF+ and Drake say 1 0 0 where there is none; Isaac's tag has no axis."""
    found = element.find(tag)
    if found is None:
        if tag == "axis2":
            raise fail(f'line {element.line}: {where} is universal without a second axis; add <axis2 xyz="…"/>')
        if element.tag == "loop_joint" and "type" in element.attributes:
            raise fail(f'line {element.line}: {where} has no axis; add <axis xyz="…"/>')
        return (1.0, 0.0, 0.0)
    x, y, z = attribute_vector(found, "xyz", f"{where}, <{tag}>", fail)
    length = math.hypot(x, y, z)
    if length < 1e-9:
        raise fail(f"line {found.line}: {where}, <{tag}>: expected a direction, found a vector of length zero")
    return (x / length, y / length, z / length)


def _side(element: XmlElement, tag: str, where: str, links: list[str], fail: Fail) -> FramePlace:
    side = _link(element, tag, where, links, fail)
    return FramePlace(side.attributes["link"].strip(), *origin_from(side, f"{where}, <{tag}>", fail))


def _isaac_side(side: XmlElement, where: str, links: list[str], fail: Fail) -> FramePlace:
    where = f"{where}, <{side.tag}>"
    link = _known(side, where, links, fail)
    return FramePlace(link, attribute_vector(side, "xyz", where, fail), attribute_vector(side, "rpy", where, fail))


def _link(element: XmlElement, tag: str, where: str, links: list[str], fail: Fail) -> XmlElement:
    side = element.find(tag)
    if side is None:
        raise fail(f'line {element.line}: {where} has no <{tag} link="…"/>')
    _known(side, f"{where}, <{tag}>", links, fail)
    return side


def _known(side: XmlElement, where: str, links: list[str], fail: Fail) -> str:
    link = side.attributes.get("link", "").strip()
    if link not in links:
        raise fail(f"line {side.line}: {where}: {unknown_name('link', link, links)}")
    return link


def _coupling(
    element: XmlElement, name: str, where: str, robot: XmlElement, links: list[str], fail: Fail
) -> JointRelation:
    one, other = (
        _link(element, tag, where, links, fail).attributes["link"].strip() for tag in ("predecessor", "successor")
    )
    ratio = element.find("ratio")
    if ratio is None:
        raise fail(f'line {element.line}: {where} has no <ratio value="…"/>')
    value = attribute_number(ratio, "value", f"{where}, <ratio>", fail)
    above = _joints_above(robot)
    first, second = (_path(link, above, element, where, fail) for link in (one, other))
    shared = set(first) & set(second)
    terms = [(joint, value) for joint in first if joint not in shared]
    terms += [(joint, -1.0) for joint in second if joint not in shared]
    if not terms:
        raise fail(f"line {element.line}: {where}: no joint moves its links relative to each other")
    return JointRelation(name=name, terms=tuple(terms))


def _joints_above(robot: XmlElement) -> Mapping[str, tuple[str, str, str]]:
    """(joint, its type, its parent link) by child link."""
    found = {}
    for joint in robot.find_all("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            kind, name = (joint.attributes.get(key, "").strip() for key in ("type", "name"))
            found[child.attributes.get("link", "").strip()] = (name, kind, parent.attributes.get("link", "").strip())
    return found


def _path(
    link: str, above: Mapping[str, tuple[str, str, str]], element: XmlElement, where: str, fail: Fail
) -> list[str]:
    """The moving joints from the root to a link."""
    joints: list[str] = []
    seen: set[str] = set()
    while link in above and link not in seen:
        seen.add(link)
        name, kind, link = above[link]
        if kind in ("revolute", "continuous", "prismatic"):
            joints.append(name)
        elif kind != "fixed":
            raise fail(f"line {element.line}: {where}: joint '{name}' on its path is {kind}; a coupling cannot span it")
    return joints[::-1]
