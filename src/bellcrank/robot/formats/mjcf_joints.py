"""Joints of MJCF bodies: <joint> and <freejoint>."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bellcrank.robot.formats.mjcf_compiler import Compiler
from bellcrank.robot.formats.mjcf_element import MjcfElement
from bellcrank.robot.formats.mjcf_placement import Array

KINDS = ("hinge", "slide", "ball", "free")
MOVING = ("hinge", "slide")  # those of one degree of freedom


@dataclass(frozen=True, kw_only=True)
class MjcfJoint:
    """A joint: where it is in its body (m), its axis there (unit vector), and its numbers in rad or m.

    At the position `ref` the body is where the file places it. `effort` is the range of the actuators' sum at the
    joint; `stiffness` and `damping` have further coefficients where the file gives polynomials.
    """

    name: str
    kind: str
    pos: Array
    axis: Array
    ref: float
    spring_ref: float
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    friction: float
    armature: float
    range: tuple[float, float] | None
    effort: tuple[float, float] | None
    element: MjcfElement


def joint_of(element: MjcfElement, name: str, frame: Array, compiler: Compiler) -> MjcfJoint:
    """The joint of a resolved <joint> or a <freejoint>, in a frame (4, 4) of its body. Raises InputError."""
    kind = "free" if element.tag == "freejoint" else element.choice("type", "hinge", *KINDS)
    axis = np.array(element.vector("axis", (0.0, 0.0, 1.0)))
    length = float(np.linalg.norm(axis))
    if length < 1e-14 and kind in MOVING:
        raise element.fail("axis: has the length zero; expected a direction")
    one = kind in MOVING

    def position(key: str) -> float:
        value = element.number(key, 0.0)
        return compiler.angles.radians(value) if kind == "hinge" else value if one else 0.0

    limits = active_range(element, "range", "limited", compiler.autolimits) if kind != "free" else None
    if limits is not None and kind in ("hinge", "ball"):
        limits = compiler.angles.radians(limits[0]), compiler.angles.radians(limits[1])
    damping = element.numbers("damping", 1, 3) or (0.0,)
    if damping[0] < 0.0:
        raise element.fail(f"damping: is {damping[0]:g}, which would add energy; expected 0 or more")
    efforts = None
    if one:
        efforts = active_range(element, "actuatorfrcrange", "actuatorfrclimited", compiler.autolimits)
    return MjcfJoint(
        name=name,
        kind=kind,
        pos=(frame @ np.array([*element.vector("pos", (0.0, 0.0, 0.0)), 1.0]))[:3] if kind != "free" else np.zeros(3),
        axis=frame[:3, :3] @ axis / length if one else axis,
        ref=position("ref"),
        spring_ref=position("springref"),
        stiffness=element.numbers("stiffness", 1, 3) or (0.0,),
        damping=damping,
        friction=element.number("frictionloss", 0.0, 0.0),
        armature=element.number("armature", 0.0, 0.0),
        range=limits,
        effort=efforts,
        element=element,
    )


def check_joints(body: MjcfElement, joints: Sequence[MjcfJoint], top: bool, world: bool) -> None:
    """Raises InputError where a body cannot have these joints, by MuJoCo's rules."""
    for k, joint in enumerate(joints):
        if world:
            raise joint.element.fail("the world has no joints; put the joint into a <body>")
        if joint.kind == "free" and (len(joints) > 1 or not top):
            raise joint.element.fail("a free joint must be the only joint of a body in <worldbody>")
        if joint.kind == "ball" and any(other.kind in ("hinge", "ball") for other in joints[k + 1 :]):
            raise joint.element.fail("a ball joint followed by a rotation in the same body is not supported")
    if sum(3 if joint.kind == "ball" else 1 for joint in joints) > 6 and joints[0].kind != "free":
        raise body.fail("has more than 6 degrees of freedom; a body has at most 6")


def active_range(element: MjcfElement, key: str, limited: str, automatic: bool) -> tuple[float, float] | None:
    """The range (lower, upper) of an attribute where it holds: `limited` is "true", or it is "auto" and a range other
    than 0 0 is given with automatic limits; None for no limit. Raises InputError.
    """
    holds, found = element.choice(limited, "auto", "true", "false", "auto"), element.numbers(key, 2, 2)
    if holds == "false" or (holds == "auto" and found in (None, (0.0, 0.0))):
        return None
    if found is None or found[0] >= found[1]:
        raise element.fail(f"{key}: expected a lower and a larger upper number")
    if holds == "auto" and not automatic:
        raise element.fail(f'has {key} but not {limited}; give {limited}="true" or "false"')
    return found[0], found[1]
