"""Checks of single links and joints of a URDF, from their numbers alone."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from bellcrank.robot.dynamics.articulated_inertia import articulated_inertias, vanishing_inertia
from bellcrank.robot.formats.urdf_file import Inertial, Joint, Link, Urdf

Severity = Literal["error", "warning", "note"]
ORDER: tuple[Severity, ...] = ("error", "warning", "note")
SHOWN = 5  # names or files of one kind that are written out


@dataclass(frozen=True)
class Finding:
    """One finding about a URDF: its severity, the element it is about, and a sentence."""

    severity: Severity
    where: str
    message: str


def format_findings(findings: list[Finding]) -> str:
    """Findings as text for a terminal: one a line, then how many there are of each severity."""
    lines = [f"  {found.severity:<8} {found.where}: {found.message}" for found in findings]
    counts = [sum(found.severity == severity for found in findings) for severity in ORDER]
    summary = ", ".join(
        f"{count} {severity}{'' if count == 1 else 's'}" for count, severity in zip(counts, ORDER, strict=True) if count
    )
    return "\n".join([*lines, f"  {summary or 'nothing found'}"])


def listed(kind: str, names: list[str]) -> str:
    """Names, the first SHOWN of them: link 'a', or links 'a', 'b' and 3 more."""
    if len(names) == 1:
        return f"{kind} '{names[0]}'"
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"{kind}s " + ", ".join(f"'{name}'" for name in names[:SHOWN]) + more


def without_source(source: Path, message: str) -> str:
    """A message without the file's name at its beginning."""
    return message.removeprefix(f"{source}: ")


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


# ---- Checks of what the joints of a URDF move: links without mass, and joints without inertia about their axis.


def massless_findings(links: Mapping[str, Link]) -> Iterator[Finding]:
    """The note about links that have an <inertial> of mass 0."""
    zero = [link.name for link in links.values() if link.inertial is not None and link.inertial.mass == 0.0]
    if zero:
        yield Finding("note", listed("link", zero), "an <inertial> of mass 0 is treated as no <inertial>")


def moving_without_mass(urdf: Urdf, loaded: Iterable[str] = ()) -> list[Finding]:
    """The warning about links that a joint moves and that have no mass, links fixed to them included.

    `loaded` are links that carry a payload, which counts as mass.
    """
    carried: dict[str, float] = {name: 1.0 for name in loaded}
    order = [urdf.root]
    children: dict[str, list[Joint]] = {}
    for joint in urdf.joints.values():
        children.setdefault(joint.parent, []).append(joint)
    for name in order:
        order.extend(joint.child for joint in children.get(name, ()))
    for name in reversed(order):
        inertial = urdf.links[name].inertial
        fixed = (joint.child for joint in children.get(name, ()) if joint.type == "fixed")
        carried[name] = carried.get(name, 0.0) + (inertial.mass if inertial else 0.0) + sum(carried[x] for x in fixed)
    moved = {joint.child for joint in urdf.joints.values() if joint.type != "fixed"}
    bare = [name for name in order if name in moved and carried[name] == 0.0 and not urdf.links[name].between_axes]
    if not bare:
        return []
    one = len(bare) == 1
    missing = "no <inertial>" if all(urdf.links[name].inertial is None for name in bare) else "an <inertial> of mass 0"
    text = (
        f"{'moves' if one else 'move'} with a joint and {'has' if one else 'have'} no mass ({missing}): the torques "
        f"do not include "
        f"{'its' if one else 'their'} weight and inertia; add an <inertial> unless the real part has no mass"
    )
    return [Finding("warning", listed("link", bare), text)]


def articulated_findings(urdf: Urdf, already_wrong: bool) -> Iterator[Finding]:
    """The errors about joints whose inertia about their own axis vanishes, or is negative unless `already_wrong`."""
    for name, (least, threshold) in articulated_inertias(urdf).items():
        what = "mass" if urdf.joints[name].type == "prismatic" else "inertia"
        if abs(least) <= threshold:
            yield Finding("error", f"joint '{name}'", vanishing_inertia(urdf, name, least))
        elif least < 0.0 and not already_wrong:
            yield Finding(
                "error",
                f"joint '{name}'",
                f"the {what} that it moves is negative ({least:.3g}): kinetic energy would be negative; check masses "
                f"and inertias",
            )
