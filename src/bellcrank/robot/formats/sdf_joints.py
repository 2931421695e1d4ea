"""Joints of SDFormat: their axes, limits, friction, springs and mimics, each as a record."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bellcrank.arrays import Array
from bellcrank.messages import unknown_name
from bellcrank.robot.formats.sdf_poses import Fail, number, numbers
from bellcrank.robot.formats.xml_tree import XmlElement

TYPES = {
    "revolute": "revolute", "continuous": "continuous", "prismatic": "prismatic", "fixed": "fixed", "ball": "spherical",
    "universal": "universal", "revolute2": "universal", "screw": "screw",
}  # fmt: skip
AXES = {"revolute": 1, "continuous": 1, "prismatic": 1, "fixed": 0, "spherical": 0, "universal": 2, "screw": 1}
NO_LIMIT = 1e15  # SDFormat's default limits are ±1e16
SEALED = ("sensor", "physics")  # children of a joint without an effect here


@dataclass(frozen=True)
class JointAxis:
    """An axis of a joint: its unit vector in the frame that it is expressed in ("" for the joint's own frame; None for
    that of the parent's model), limits (rad, m, N m, N, rad/s, m/s; None: none), damping, friction, and a spring.
    """

    direction: tuple[float, float, float]
    expressed_in: str | None
    lower: float | None
    upper: float | None
    effort: float | None
    velocity: float | None
    damping: float
    friction: float
    stiffness: float
    reference: float
    mimic: tuple[str, float, float] | None  # leader, multiplier, offset


@dataclass(frozen=True)
class SdfJoint:
    """A joint: full names of its joint, parent and child frame, its type in the extended URDF, axes, and pitch (m per
    revolution) of a screw.
    """

    name: str
    type: str
    parent: str
    child: str
    axes: tuple[JointAxis, ...]
    pitch: float
    line: int


def joint_type(element: XmlElement, where: str, fail: Fail) -> str:
    """The type of a joint in the extended URDF. Raises InputError."""
    given = element.attributes.get("type", "").strip()
    if given not in TYPES:
        raise fail(f"line {element.line}: {where}: {unknown_name('joint type', given, TYPES)}")
    return TYPES[given]


def joint_axes(
    element: XmlElement, kind: str, version: tuple[int, ...], where: str, fail: Fail
) -> tuple[JointAxis, ...]:
    """The axes of a joint. Raises InputError."""
    tags = ("axis", "axis2")[: AXES[kind]]
    return tuple(_axis(element, tag, version, f"{where}, <{tag}>", fail) for tag in tags)


def _axis(joint: XmlElement, tag: str, version: tuple[int, ...], where: str, fail: Fail) -> JointAxis:
    axis = joint.find(tag)
    if axis is None:
        raise fail(f"line {joint.line}: {where} is missing; expected <{tag}><xyz>…</xyz></{tag}>")
    xyz = axis.find("xyz")
    values = (0.0, 0.0, 1.0) if xyz is None else numbers(xyz, f"{where}, <xyz>", fail)
    if len(values) != 3:
        raise fail(f"line {axis.line}: {where}, <xyz>: expected 3 numbers, found {len(values)}")
    length = math.hypot(*values)
    if not 1e-9 < length < math.inf:
        raise fail(f"line {axis.line}: {where}, <xyz>: expected a direction, found a vector of length {length:.3g}")
    expressed_in: str | None = "" if xyz is None else xyz.attributes.get("expressed_in", "").strip()
    old = axis.find("use_parent_model_frame")
    # before 1.5 axes were in the frame of the model (libsdformat converts them so), then by this element
    if version < (1, 7) and (version < (1, 5) if old is None else old.text.strip().lower() in ("true", "1")):
        expressed_in = None
    limit, dynamics = axis.find("limit") or XmlElement("limit", {}, axis.line), axis.find("dynamics")
    lower, upper = (
        number(limit, key, sign * math.inf, where, fail, True) for key, sign in (("lower", -1), ("upper", 1))
    )
    if lower > upper:
        raise fail(f"line {limit.line}: {where}: lower {lower:g} is above upper {upper:g}")
    effort, velocity = (number(limit, key, math.inf, where, fail, True) for key in ("effort", "velocity"))
    terms = dynamics or XmlElement("dynamics", {}, axis.line)
    damping, friction, stiffness, reference = (
        number(terms, key, 0.0, where, fail) for key in ("damping", "friction", "spring_stiffness", "spring_reference")
    )
    for key, value in (("damping", damping), ("friction", friction), ("spring_stiffness", stiffness)):
        if value < 0.0:
            raise fail(f"line {terms.line}: {where}, <{key}>: expected 0 or more, found {value:g}")
    x, y, z = (value / length for value in values)
    return JointAxis(
        (x, y, z), expressed_in, _bound(lower), _bound(upper), _most(effort), _most(velocity), damping, friction,
        stiffness, reference, _mimic(axis, where, fail),
    )  # fmt: skip


def _bound(value: float) -> float | None:
    return None if abs(value) >= NO_LIMIT else value


def _most(value: float) -> float | None:
    """A largest effort or speed; a negative one stands for none."""
    return None if value < 0.0 or value >= NO_LIMIT else value


def _mimic(axis: XmlElement, where: str, fail: Fail) -> tuple[str, float, float] | None:
    """(leader, multiplier, offset) with follower = multiplier leader + offset, from multiplier (leader − reference) +
    offset.
    """
    mimic = axis.find("mimic")
    if mimic is None:
        return None
    leader = mimic.attributes.get("joint", "").strip()
    if not leader or mimic.attributes.get("axis", "axis") != "axis":
        raise fail(f"line {mimic.line}: {where}, <mimic>: expected the name of a joint whose first axis is followed")
    factor, offset, reference = (
        number(mimic, key, default, where, fail)
        for key, default in (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
    )
    return leader, factor, offset - factor * reference


def pitch_of(element: XmlElement, where: str, fail: Fail) -> float:
    """The pitch of a screw, m per revolution. Raises InputError."""
    if element.find("screw_thread_pitch") is None:
        raise fail(
            f"line {element.line}: {where} has no <screw_thread_pitch>; write it, in m per revolution (<thread_pitch>, "
            "which has other units and sign, is not supported)"
        )
    pitch = number(element, "screw_thread_pitch", 0.0, where, fail)
    if pitch == 0.0:
        raise fail(f"line {element.line}: {where}: the pitch is 0; write a revolute joint instead")
    return pitch


def turned(axis: JointAxis, rotation: Array) -> tuple[float, float, float]:
    """The direction of an axis, turned by a rotation (3, 3)."""
    x, y, z = (float(value) for value in rotation @ np.array(axis.direction))
    return x, y, z
