"""Links, joints and transmissions of a URDF, each read and checked by itself."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.formats.xml_tree import XmlElement

JOINT_TYPES = (
    "revolute", "continuous", "prismatic", "fixed", "floating", "planar",
    "spherical", "universal", "screw",  # beyond URDF
)  # fmt: skip
MIMICKED = ("revolute", "continuous", "prismatic", "screw")  # joints that can mimic and be mimicked
MOVING_AXIS = ("revolute", "continuous", "prismatic", "planar", "universal", "screw")
NO_LIMIT = 1e30  # a limit of at least this size stands for none
LARGEST = 1e30  # of masses, lengths and inertias
SQUARE = 1e-6  # cosine of the angle between axes that are normal to each other
NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")

Vector3 = tuple[float, float, float]


@dataclass(frozen=True)
class Inertial:
    """Mass (kg), pose of the centre of gravity in the link (xyz m, rpy rad) and inertia about it.

    `inertia` is (ixx, ixy, ixz, iyy, iyz, izz) in kg m², in the axes that rpy gives.
    """

    mass: float
    xyz: Vector3
    rpy: Vector3
    inertia: tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class Link:
    """A rigid body: its name, its inertial data (None: massless) and the mesh files that it names.

    `between_axes`: the file does not have it; it stands between the two axes of a universal joint.
    """

    name: str
    inertial: Inertial | None
    meshes: tuple[str, ...]
    between_axes: bool = False


@dataclass(frozen=True)
class Mimic:
    """A joint that mimics another: position = multiplier × position of `joint` + offset (rad or m)."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Joint:
    """A joint, at `xyz` (m) and `rpy` (rad) in its parent link; `axis` is a unit vector in its frame.

    Limits are in rad, m, N m, N, rad/s and m/s, None where the file gives none; damping in N m s/rad or N s/m
    and friction in N m or N, None where not given. `axis_length` is the length of the axis as written in
    the file, and `reduction` the mechanicalReduction of the joint's transmission. `pitch` is the translation of a screw
    along its axis, m per revolution (negative: left-handed), and `axis_2` the second axis of a universal joint.
    """

    name: str
    type: str
    parent: str
    child: str
    xyz: Vector3
    rpy: Vector3
    axis: Vector3
    lower: float | None
    upper: float | None
    effort: float | None
    velocity: float | None
    damping: float | None
    friction: float | None
    mimic: Mimic | None
    reduction: float | None = None
    axis_length: float = 1.0
    pitch: float = 0.0
    axis_2: Vector3 = (0.0, 1.0, 0.0)


def link_from(element: XmlElement, fail: Callable[[str], InputError]) -> Link:
    """A <link> as a Link; `fail(message)` makes the InputError that names the file."""
    name = _name(element, fail)
    where = f"link '{name}'"
    inertial = element.find("inertial")
    meshes = tuple(
        mesh.attributes["filename"]
        for shape in element.children
        if shape.tag in ("visual", "collision")
        for mesh in shape.walk()
        if mesh.tag == "mesh" and mesh.attributes.get("filename")
    )
    return Link(name, _inertial(inertial, where, fail) if inertial is not None else None, meshes)


def _inertial(element: XmlElement, where: str, fail: Callable[[str], InputError]) -> Inertial:
    xyz, rpy = origin_from(element, f"{where}, <inertial>", fail)
    mass_element, inertia_element = element.find("mass"), element.find("inertia")
    if mass_element is None or "value" not in mass_element.attributes:
        raise fail(
            f'{where} (line {element.line}): <inertial> has no <mass value="…"/>; give the mass in kg, '
            "or leave <inertial> out for a massless link"
        )
    mass = _number(mass_element, "value", f"{where}, <mass>", fail)
    if mass < 0.0:
        raise fail(f"{where}, <mass> (line {mass_element.line}): the mass is {mass:g} kg; expected 0 or more")
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    if inertia_element is None:
        raise fail(
            f"{where} (line {element.line}): <inertial> has no <inertia …/>; give {', '.join(names)} in kg m² about "
            "the centre of gravity (all 0 for a point mass)"
        )
    missing = [name for name in names if name not in inertia_element.attributes]
    if missing:
        raise fail(
            f"{where}, <inertia> (line {inertia_element.line}): lacks {', '.join(missing)}; "
            f"all of {', '.join(names)} are needed, in kg m²"
        )
    ixx, ixy, ixz, iyy, iyz, izz = (_number(inertia_element, name, f"{where}, <inertia>", fail) for name in names)
    return Inertial(mass, xyz, rpy, (ixx, ixy, ixz, iyy, iyz, izz))


def joint_from(element: XmlElement, fail: Callable[[str], InputError]) -> Joint:
    """A <joint> as a Joint; `fail(message)` makes the InputError that names the file."""
    name = _name(element, fail)
    where = f"joint '{name}'"
    kind = element.attributes.get("type")
    if kind is None:
        raise fail(f"{where} (line {element.line}): has no type; expected one of {', '.join(JOINT_TYPES)}")
    if kind not in JOINT_TYPES:
        raise fail(f"{where} (line {element.line}): {unknown_name('joint type', kind, JOINT_TYPES)}")
    parent, child = (_link_named(element, tag, where, fail) for tag in ("parent", "child"))
    if parent == child:
        raise fail(
            f"{where} (line {element.line}): link '{child}' is its own parent; a joint connects two different links"
        )
    xyz, rpy = origin_from(element, where, fail)
    axis, length = _axis(element, kind, where, fail)
    lower, upper, effort, velocity = _limits(element, kind, where, fail)
    damping, friction = _dynamics(element, where, fail)
    mimic = _mimic(element, where, fail) if kind in MIMICKED else None
    return Joint(
        name, kind, parent, child, xyz, rpy, axis, lower, upper, effort, velocity, damping, friction, mimic,
        axis_length=length, pitch=_pitch(element, kind, where, fail), axis_2=_second_axis(element, axis, where, fail),
    )  # fmt: skip


def reduction_from(element: XmlElement, fail: Callable[[str], InputError]) -> dict[str, float]:
    """The mechanicalReduction of a <transmission>, by joint name; empty where it gives none."""
    where = f"transmission '{element.attributes.get('name', '')}'"
    joints = [joint for joint in element.find_all("joint") if joint.attributes.get("name")]
    for holder in (*element.find_all("actuator"), *joints, element):
        reduction = holder.find("mechanicalReduction")
        if reduction is not None and reduction.text.strip():
            value = _parse(reduction.text, f"{where}, <mechanicalReduction>", reduction.line, fail)
            return {joint.attributes["name"]: value for joint in joints}
    return {}


def _name(element: XmlElement, fail: Callable[[str], InputError]) -> str:
    name = element.attributes.get("name", "").strip()
    if not name:
        raise fail(f'the <{element.tag}> in line {element.line} has no name; give it name="…"')
    if not name.isprintable():
        raise fail(f"the <{element.tag}> in line {element.line} has control characters in its name; remove them")
    return name


def _link_named(element: XmlElement, tag: str, where: str, fail: Callable[[str], InputError]) -> str:
    found = element.find(tag)
    link = found.attributes.get("link", "").strip() if found is not None else ""
    if not link:
        raise fail(f'{where} (line {element.line}): has no <{tag} link="…"/>; name its {tag} link')
    return link


def origin_from(element: XmlElement, where: str, fail: Callable[[str], InputError]) -> tuple[Vector3, Vector3]:
    """An element's <origin>: xyz (m) and rpy (rad), 0 where it has none; `fail(message)` makes the InputError."""
    origin = element.find("origin")
    if origin is None:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    return (
        _vector(origin, "xyz", f"{where}, <origin>", fail),
        _vector(origin, "rpy", f"{where}, <origin>", fail),
    )


def _axis(element: XmlElement, kind: str, where: str, fail: Callable[[str], InputError]) -> tuple[Vector3, float]:
    found = element.find("axis")
    if found is None or "xyz" not in found.attributes:
        return (1.0, 0.0, 0.0), 1.0
    if kind not in MOVING_AXIS:
        return (1.0, 0.0, 0.0), 1.0
    x, y, z = _vector(found, "xyz", f"{where}, <axis>", fail)
    length = math.hypot(x, y, z)
    if length < 1e-9:
        raise fail(
            f"{where}, <axis> (line {found.line}): the axis is {found.attributes['xyz']!r}, of length zero; "
            "a unit vector was expected, such as 0 0 1"
        )
    return (x / length, y / length, z / length), length


def _limits(
    element: XmlElement, kind: str, where: str, fail: Callable[[str], InputError]
) -> tuple[float | None, float | None, float | None, float | None]:
    limit = element.find("limit")
    if limit is None:
        return None, None, None, None
    where = f"{where}, <limit>"
    found: dict[str, float | None] = {}
    for key in ("lower", "upper", "effort", "velocity"):
        value = _number(limit, key, where, fail, largest=math.inf) if key in limit.attributes else None
        found[key] = None if value is None or abs(value) >= NO_LIMIT else value
    for key in ("effort", "velocity"):
        value = found[key]
        if value is not None and value < 0.0:
            raise fail(f"{where} (line {limit.line}): {key} is {value:g}; expected 0 or more")
    if kind not in ("revolute", "prismatic", "universal", "screw"):
        return None, None, found["effort"], found["velocity"]
    lower, upper = found["lower"], found["upper"]
    if "lower" in limit.attributes and "upper" not in limit.attributes:
        upper = 0.0  # what the URDF specification says of one limit alone
    if "upper" in limit.attributes and "lower" not in limit.attributes:
        lower = 0.0
    if lower is not None and upper is not None and lower > upper:
        raise fail(
            f"{where} (line {limit.line}): lower {lower:g} is above upper {upper:g} (an "
            "omitted one is 0); exchange or correct them"
        )
    return lower, upper, found["effort"], found["velocity"]


def _pitch(element: XmlElement, kind: str, where: str, fail: Callable[[str], InputError]) -> float:
    """The pitch of a screw, m per revolution; 0 for any other joint."""
    if kind != "screw":
        return 0.0
    if "pitch" not in element.attributes:
        raise fail(
            f'{where} (line {element.line}): a screw has no pitch; write pitch="…" on the <joint>, in m per revolution'
        )
    pitch = _number(element, "pitch", where, fail)
    if pitch == 0.0:
        raise fail(f"{where} (line {element.line}): the pitch is 0; write a revolute joint instead")
    return pitch


def _second_axis(element: XmlElement, axis: Vector3, where: str, fail: Callable[[str], InputError]) -> Vector3:
    """The second axis of a universal joint, <axis2>, normal to the first one; 0 1 0 where there is none."""
    if element.attributes.get("type") != "universal":
        return 0.0, 1.0, 0.0
    found = element.find("axis2")
    second, line = (0.0, 1.0, 0.0), element.line
    if found is not None:
        line = found.line
        x, y, z = _vector(found, "xyz", f"{where}, <axis2>", fail)
        length = math.hypot(x, y, z)
        if length < 1e-9:
            raise fail(
                f"{where}, <axis2> (line {line}): the axis has length zero; expected a unit vector, such as 0 1 0"
            )
        second = (x / length, y / length, z / length)
    if abs(sum(a * b for a, b in zip(axis, second, strict=True))) > SQUARE:
        raise fail(
            f"{where} (line {line}): the axes {list(axis)} and {list(second)} of the universal joint are not normal to "
            "each other; correct <axis> or <axis2>, or write two revolute joints with a link between them"
        )
    return second


def _dynamics(element: XmlElement, where: str, fail: Callable[[str], InputError]) -> tuple[float | None, float | None]:
    dynamics = element.find("dynamics")
    if dynamics is None:
        return None, None
    values: list[float | None] = []
    for key in ("damping", "friction"):
        value = _number(dynamics, key, f"{where}, <dynamics>", fail) if key in dynamics.attributes else None
        if value is not None and value < 0.0:
            raise fail(
                f"{where}, <dynamics> (line {dynamics.line}): {key} is {value:g}, which would add energy; expected 0 "
                "or more"
            )
        values.append(value)
    return values[0], values[1]


def _mimic(element: XmlElement, where: str, fail: Callable[[str], InputError]) -> Mimic | None:
    mimic = element.find("mimic")
    if mimic is None:
        return None
    leader = mimic.attributes.get("joint", "").strip()
    if not leader:
        raise fail(f'{where}, <mimic> (line {mimic.line}): does not name the joint that it mimics; give joint="…"')
    multiplier = _number(mimic, "multiplier", f"{where}, <mimic>", fail, default=1.0)
    return Mimic(leader, multiplier, _number(mimic, "offset", f"{where}, <mimic>", fail, default=0.0))


def attribute_vector(element: XmlElement, key: str, where: str, fail: Callable[[str], InputError]) -> Vector3:
    """Three numbers of an attribute, 0 where it is missing; `fail(message)` makes the InputError."""
    return _vector(element, key, where, fail)


def attribute_number(element: XmlElement, key: str, where: str, fail: Callable[[str], InputError]) -> float:
    """The finite number of an attribute; `fail(message)` makes the InputError."""
    return _number(element, key, where, fail)


def _vector(element: XmlElement, key: str, where: str, fail: Callable[[str], InputError]) -> Vector3:
    words = element.attributes.get(key, "0 0 0").split()
    if len(words) != 3:
        raise fail(
            f"{where} (line {element.line}): {key}={element.attributes[key]!r} has {len(words)} numbers; "
            "expected 3, separated by blanks"
        )
    x, y, z = (_parse(word, f"{where}, {key}", element.line, fail) for word in words)
    return x, y, z


def _number(
    element: XmlElement,
    key: str,
    where: str,
    fail: Callable[[str], InputError],
    default: float | None = None,
    largest: float = LARGEST,
) -> float:
    text = element.attributes.get(key)
    if text is None and default is not None:
        return default
    return _parse(text or "", f"{where}, {key}", element.line, fail, largest)


def _parse(text: str, where: str, line: int, fail: Callable[[str], InputError], largest: float = LARGEST) -> float:
    text = text.strip()
    if "${" in text or "$(" in text:
        raise fail(
            f"{where} (line {line}): {text[:40]!r} is a xacro expression; expand the file first: "
            "xacro robot.urdf.xacro > robot.urdf"
        )
    if text.lower().lstrip("+-") in ("nan", "inf", "infinity"):
        raise fail(f"{where} (line {line}): is {text!r}; a finite number was expected (leave a limit out for none)")
    if not NUMBER.fullmatch(text):
        raise fail(f"{where} (line {line}): {text[:40]!r} is not a number; a number in SI units was expected")
    value = float(text)
    if abs(value) > largest or (math.isinf(value) and largest < math.inf):
        raise fail(f"{where} (line {line}): {text[:40]!r} is too large; expected at most {LARGEST:g}")
    return value
