"""The same robot as MJCF, SDFormat and xacro, written from the numbers of its URDF in the ways of each format.

MJCF: angles in degrees, Euler angles in another order, principal inertias with their axes, defaults. SDFormat: poses of
links in the model at zero, inertias with a pose, axes in the model's frame. xacro: properties, expressions and a macro.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
MJCF_JOINTS = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide"}


@dataclass(frozen=True)
class Part:
    """A link and the joint above it; `place` is the joint's in its parent."""

    link: str
    body: tuple[float, pin.SE3, Array] | None  # mass, placement of the inertia, inertia in its axes
    joint: ElementTree.Element | None
    place: pin.SE3
    parts: tuple[Part, ...]

    @property
    def kind(self) -> str:
        return "fixed" if self.joint is None else self.joint.get("type", "")

    @property
    def axis(self) -> Array:
        found = None if self.joint is None else self.joint.find("axis")
        return np.array([1.0, 0.0, 0.0] if found is None else [float(x) for x in found.get("xyz", "").split()])

    def number(self, tag: str, key: str) -> float | None:
        found = None if self.joint is None else self.joint.find(tag)
        return None if found is None or found.get(key) is None else float(found.get(key, "0"))


def read_parts(path: Path) -> Part:
    """The tree of a URDF from its root link."""
    root = ElementTree.parse(path).getroot()
    links = {str(link.get("name")): link for link in root.findall("link")}
    above = {str(joint.find("child").get("link")): joint for joint in root.findall("joint")}

    def part(name: str) -> Part:
        own = links[name].find("inertial")
        body = None
        if own is not None:
            entry = own.find("inertia").attrib
            xx, xy, xz, yy, yz, zz = (float(entry[key]) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
            moments = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            body = float(own.find("mass").get("value")), _placed(own), moments
        joint = above.get(name)
        below = [child for child, each in above.items() if each.find("parent").get("link") == name]
        place = pin.SE3.Identity() if joint is None else _placed(joint)
        return Part(name, body, joint, place, tuple(part(child) for child in below))

    return part(next(name for name in links if name not in above))


def _placed(element: ElementTree.Element) -> pin.SE3:
    origin = element.find("origin")
    if origin is None:
        return pin.SE3.Identity()
    xyz, rpy = (np.array([float(x) for x in origin.get(key, "0 0 0").split()]) for key in ("xyz", "rpy"))
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), xyz)


def _text(numbers: Array) -> str:
    return " ".join(repr(float(x)) for x in np.ravel(numbers))


# ---- MJCF


def mjcf(root: Part, rotors: dict[str, float]) -> str:
    """An MJCF file; joints in the middle of a tree that float become bodies of the world."""
    free: list[str] = []

    def body(part: Part) -> str:
        if part.kind == "floating":
            assert part.place.isIdentity()
            free.append(f'<body name="{part.link}"><freejoint name="{part.joint.get("name")}"/>{inside(part)}</body>')
            return ""
        angles = np.degrees(pin.rpy.matrixToRpy(part.place.rotation)[::-1])  # about z, the new y and the new x
        where = f'pos="{_text(part.place.translation)}" euler="{_text(angles)}"'
        return f'<body name="{part.link}" {where}>{joint(part)}{inside(part)}</body>'

    def joint(part: Part) -> str:
        if part.kind == "fixed":
            return ""
        name, slides = str(part.joint.get("name")), part.kind == "prismatic"
        lower, upper = (part.number("limit", key) for key in ("lower", "upper"))
        limits = ""
        if part.kind != "continuous":
            scale = 1.0 if slides else 180.0 / np.pi
            limits = f'range="{_text(scale * np.array([lower or 0.0, upper or 0.0]))}" limited="true"'
        damping, friction = (part.number("dynamics", key) or 0.0 for key in ("damping", "friction"))
        own = f'damping="{damping!r}" frictionloss="{friction!r}"' if damping or friction else ""
        rotor = f'armature="{rotors[name]!r}"' if name in rotors else ""
        kind = "" if not slides else 'type="slide"'  # hinge is the default
        return f'<joint name="{name}" {kind} axis="{_text(2.5 * part.axis)}" {limits} {own} {rotor}/>'

    def inside(part: Part) -> str:
        inertial = ""
        if part.body is not None:
            mass, place, moments = part.body
            principal, axes = np.linalg.eigh(place.rotation @ moments @ place.rotation.T)
            axes = axes * np.sign(np.linalg.det(axes))
            x, y, z, w = Rotation.from_matrix(axes).as_quat()
            turn = f'quat="{_text(np.array([w, x, y, z]))}" diaginertia="{_text(principal)}"'
            inertial = f'<inertial pos="{_text(place.translation)}" mass="{mass!r}" {turn}/>'
        return inertial + "".join(body(each) for each in part.parts)

    tree = inside(root) if root.link == "world" else body(root)
    return (
        '<mujoco model="same"><compiler angle="degree" eulerseq="zyx" autolimits="true"/>'
        '<default><joint armature="0"/></default>'
        f"<worldbody>{tree}{''.join(free)}</worldbody></mujoco>"
    )


# ---- SDFormat


def sdf(root: Part, attached: bool) -> str:
    """An SDFormat model whose root is attached to the world, or free; what floats in the middle of it has no joint."""
    lines = []
    if attached and root.link != "world":
        lines = [f'<joint name="to_world" type="fixed"><parent>world</parent><child>{root.link}</child></joint>']

    def pose(place: pin.SE3) -> str:
        return f"<pose>{_text(np.concatenate([place.translation, pin.rpy.matrixToRpy(place.rotation)]))}</pose>"

    def add(part: Part, above: pin.SE3, parent: str) -> None:
        place = above * part.place
        moments = "".join(f"<{key}>1e-12</{key}>" for key in ("ixx", "iyy", "izz"))
        inertial = f"<inertial><mass>1e-9</mass><inertia>{moments}</inertia></inertial>"

        if part.body is not None:
            mass, at, m = part.body
            values = zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), m[np.triu_indices(3)].tolist(), strict=True)
            inertia = "".join(f"<{key}>{value!r}</{key}>" for key, value in values)
            inertial = f"<inertial>{pose(at)}<mass>{mass!r}</mass><inertia>{inertia}</inertia></inertial>"
        if part.link != "world":
            lines.append(f'<link name="{part.link}">{pose(place)}{inertial}</link>')
        if part.kind not in ("", "floating") and part.joint is not None:
            lines.append(joint(part, place, parent))
        for each in part.parts:
            add(each, place, part.link)

    def joint(part: Part, place: pin.SE3, parent: str) -> str:
        ends = f"<parent>{parent}</parent><child>{part.link}</child>"
        if part.kind == "fixed":
            return f'<joint name="{part.joint.get("name")}" type="fixed">{ends}</joint>'
        numbers = {key: part.number("limit", key) for key in ("lower", "upper", "effort", "velocity")}
        if part.kind == "continuous":
            numbers["lower"] = numbers["upper"] = None
        limit = "".join(f"<{key}>{value!r}</{key}>" for key, value in numbers.items() if value is not None)
        losses = {key: part.number("dynamics", key) or 0.0 for key in ("damping", "friction")}
        dynamics = "".join(f"<{key}>{value!r}</{key}>" for key, value in losses.items())
        axis = f'<xyz expressed_in="__model__">{_text(place.rotation @ part.axis)}</xyz>'
        return (
            f'<joint name="{part.joint.get("name")}" type="{part.kind}">{ends}<axis>{axis}<limit>{limit}</limit>'
            f"<dynamics>{dynamics}</dynamics></axis></joint>"
        )

    add(root, pin.SE3.Identity(), "world")
    model = f'<model name="same">{"".join(lines)}</model>'
    return f'<sdf version="1.9">{model}</sdf>'


# ---- xacro


def xacro(path: Path) -> str:
    """The URDF with each number as an expression of a property, and a macro for limits."""
    tree = ElementTree.parse(path)
    root = tree.getroot()
    for link in root.findall("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    for element in root.iter():
        for key in ("xyz", "rpy", "value", "ixx", "ixy", "ixz", "iyy", "iyz", "izz", "lower", "upper"):
            if element.get(key) is not None:
                halves = [f"${{two * ({float(x) / 2.0!r})}}" for x in element.get(key, "").split()]
                element.set(key, " ".join(halves))
    text = ElementTree.tostring(root, encoding="unicode")
    head = text.index(">") + 1
    own = text[:head].replace("<robot", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"', 1)
    return f'{own}<xacro:property name="two" value="${{1 + 1.0}}"/>{text[head:]}'
