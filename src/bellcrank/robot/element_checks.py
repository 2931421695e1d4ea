"""Checks of single links and joints of a URDF, from their numbers alone."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator

from bellcrank.robot.finding import Finding
from bellcrank.robot.urdf_file import Inertial, Joint, Link, Urdf

ROUND_OFF = 1e-6  # share of the largest principal moment that printed digits may be off
POINT = 1e-12  # m²: a body whose radius of gyration is below 1 µm is a point; its inertia is round-off
ALMOST = 2e-3  # rad: 1.57 and 3.14 are this near a right angle, and nothing deliberate is
CLEANED = 1e-11  # rad: what load_robot makes exact
UNIT = 1e-6  # an axis this near length 1 is a unit vector
FRICTION_SHARE = 0.2  # of the effort limit
LIMITS = ("lower", "upper", "effort", "velocity")
LIKE_DEGREES = 25.0  # rad: a joint limit beyond this, four turns, was meant in degrees


def element_findings(urdf: Urdf) -> list[Finding]:
    """The findings about single links and joints of a URDF."""
    return [
        *(finding for link in urdf.links.values() for finding in link_findings(link)),
        *(finding for joint in urdf.joints.values() for finding in joint_findings(joint)),
    ]


def principal_moments(inertia: tuple[float, float, float, float, float, float]) -> tuple[float, float, float]:
    """The principal moments (kg m²), smallest first, of an inertia (ixx, ixy, ixz, iyy, iyz, izz)."""
    import numpy as np

    ixx, ixy, ixz, iyy, iyz, izz = inertia
    low, middle, high = np.linalg.eigvalsh([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]).tolist()
    return low, middle, high


def link_findings(link: Link) -> Iterator[Finding]:
    """What is wrong with a link's mass and inertia."""
    where = f"link '{link.name}'"
    inertial = link.inertial
    if inertial is None:
        return
    low, middle, high = principal_moments(inertial.inertia)
    size = max(abs(low), abs(high))
    off = ROUND_OFF * size + POINT * inertial.mass
    moments = f"principal moments {low:.4g}, {middle:.4g}, {high:.4g} kg m²"
    if low < -off:
        yield Finding(
            "error",
            where,
            f"the inertia is not positive ({moments}): kinetic energy would be negative; check the signs",
        )
    elif low + middle < high - off:
        rounding = high <= 1.001 * (low + middle)
        yield Finding(
            "warning" if rounding else "error",
            where,
            f"the inertia violates the triangle inequality ({moments}: the largest exceeds the sum of the others by "
            f"{high - low - middle:.3g}); "
            + ("this may be rounding: give more digits" if rounding else "no rigid body has such an inertia"),
        )
    if inertial.mass == 0.0 and size > 0.0:
        yield Finding("warning", where, f"has no mass but an inertia ({moments}); give both or neither")
    elif inertial.mass > 0.0 and _gyration(inertial) > 5.0:
        yield Finding(
            "warning",
            where,
            f"{inertial.mass:g} kg with an inertia of {high:.4g} kg m² has a radius of gyration of "
            f"{_gyration(inertial):.3g} m; is the inertia in kg m² and about the centre of gravity?",
        )


def _gyration(inertial: Inertial) -> float:
    """The largest radius of gyration, m."""
    return math.sqrt(max(principal_moments(inertial.inertia)[2], 0.0) / inertial.mass)


def joint_findings(joint: Joint, limits: Collection[str] = LIMITS, typed: bool = True) -> Iterator[Finding]:
    """What is wrong, or easily missed, with a joint's axis, origin, limits, friction and mimic.

    Args:
        joint: The joint.
        limits: The limits whose absence is reported.
        typed: Whether a person wrote the angles, which may then be right angles with few digits.
    """
    where = f"joint '{joint.name}'"
    moving = joint.type in ("revolute", "continuous", "prismatic")
    unit, turning = ("m", "m/s") if joint.type == "prismatic" else ("rad", "rad/s")
    if moving and abs(joint.axis_length - 1.0) > UNIT:
        yield Finding(
            "warning",
            where,
            f"the axis has length {joint.axis_length:.7g}, not 1; only its direction is used",
        )
    if joint.type == "planar" and joint.axis != (0.0, 0.0, 1.0):
        yield Finding(
            "error",
            where,
            f"the axis of a planar joint is {list(joint.axis)}; only 0 0 1 is supported: rotate its origin",
        )
    for name, angle in zip(("roll", "pitch", "yaw"), joint.rpy, strict=True):
        off = angle - round(angle / (math.pi / 2)) * (math.pi / 2)
        if typed and CLEANED < abs(off) <= ALMOST:
            yield Finding(
                "warning",
                where,
                f"the {name} {angle!r} is {off:+.3g} rad off {round(angle / (math.pi / 2)) * 90}°; "
                f"write {round(angle / (math.pi / 2)) * (math.pi / 2)!r} if the right angle is meant",
            )
    if moving and joint.mimic is None:
        yield from _limit_findings(joint, where, (unit, turning), limits)
    if moving and joint.mimic is not None:
        mimic = joint.mimic
        yield Finding(
            "note",
            where,
            f"mimics joint '{mimic.joint}': position = {mimic.multiplier:g} × its position {mimic.offset:+g} {unit}; "
            "it is not an independent joint, and its torque is carried by the joint that it mimics",
        )
        if mimic.multiplier == 0.0:
            yield Finding("warning", where, "mimics with multiplier 0, so it never moves; make it a fixed joint")


def _limit_findings(joint: Joint, where: str, units: tuple[str, str], limits: Collection[str]) -> Iterator[Finding]:
    unit, turning = units
    endless = ("lower", "upper") if joint.type == "continuous" else ()
    missing = [key for key in LIMITS if key in limits and key not in endless and getattr(joint, key) is None]
    if missing:
        yield Finding("warning", where, f"has no {' and no '.join(missing)} limit; no margin can be computed")
    for key in ("effort", "velocity"):
        if getattr(joint, key) == 0.0:
            yield Finding(
                "warning", where, f"the {key} limit is 0, which every motion exceeds; give a limit, or omit it"
            )
    if joint.lower is not None and joint.lower == joint.upper:
        yield Finding("warning", where, f"lower and upper limit are both {joint.lower:g} {unit}: it cannot move")
    if joint.type == "revolute" and max(abs(joint.lower or 0.0), abs(joint.upper or 0.0)) > LIKE_DEGREES:
        yield Finding(
            "warning",
            where,
            f"the limits {joint.lower} and {joint.upper} rad look like degrees; expected rad",
        )
    if joint.effort:
        viscous = (joint.damping or 0.0) * (joint.velocity or 0.0)
        friction = (joint.friction or 0.0) + viscous
        if friction > FRICTION_SHARE * joint.effort:
            at = f" at {joint.velocity:g} {turning}" if viscous else ""
            yield Finding(
                "warning",
                where,
                f"friction (damping {joint.damping or 0:g}, friction {joint.friction or 0:g}) takes "
                f"{100 * friction / joint.effort:.3g} % of the effort limit {joint.effort:g}{at}; "
                "such values are often placeholders",
            )
