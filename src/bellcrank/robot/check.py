"""What is wrong with a URDF, or will bite later: findings with a severity, from the file alone."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from bellcrank import arguments
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import FileAccess, Trust
from bellcrank.robot.mesh_path import find_mesh, looked_for
from bellcrank.robot.urdf_elements import origin_from
from bellcrank.robot.urdf_file import Inertial, Joint, Link, Urdf, reading_of
from bellcrank.robot.xml_tree import Element, parse_xml, read_text

Severity = Literal["error", "warning", "note"]
ORDER: tuple[Severity, ...] = ("error", "warning", "note")

ROUND_OFF = 1e-6  # share of the largest principal moment that printed digits may be off
POINT = 1e-12  # m²: a body whose radius of gyration is below 1 µm is a point; its inertia is round-off
ALMOST = 2e-3  # rad: 1.57 and 3.14 are this near a right angle, and nothing deliberate is
CLEANED = 1e-11  # rad: what load_robot makes exact
SHOWN = 5  # names or files of one kind that are written out
UNIT = 1e-6  # an axis this near length 1 is a unit vector
FRICTION_SHARE = 0.2  # of the effort limit
LIKE_DEGREES = 25.0  # rad: a joint limit beyond this, four turns, was meant in degrees


@dataclass(frozen=True)
class Finding:
    """One thing to know about a URDF: how bad it is, which element it is about, and a sentence."""

    severity: Severity
    where: str
    message: str


def check_urdf(path: str | Path, *, trust: Trust = ()) -> list[Finding]:
    """All findings about a URDF file, errors first; empty where there is nothing to say. Meshes are looked for near it,
    and in the folders `trust` (files/access.py).

    An error makes dynamics wrong or impossible, a warning probably is not meant, a note tells what is easily
    missed. A file that cannot be read at all gives one finding; nothing is raised.
    """
    source = arguments.path("path", path, "the path of a URDF")
    try:
        text = read_text(source)
        reading = reading_of(text, source)
    except BellcrankError as problem:
        return [Finding("error", "file", _without(source, str(problem)))]
    findings = [Finding("error", "file", _without(source, str(problem))) for problem in reading.problems]
    for link in reading.links.values():
        findings.extend(_link_findings(link))
    for joint in reading.joints.values():
        findings.extend(_joint_findings(joint))
    findings.extend(_mesh_findings(reading.links, source, FileAccess.of(source.resolve(), trust)))
    findings.extend(_massless_findings(reading.links, reading.joints))
    if reading.urdf is not None:
        findings.extend(moving_without_mass(reading.urdf))
    if reading.links:
        findings.extend(_element_findings(parse_xml(text, source), reading.joints))
    if reading.urdf is not None:
        findings.extend(_articulated_findings(reading.urdf, any(found.severity == "error" for found in findings)))
        findings.extend(_second_findings(reading.urdf))
    return sorted(findings, key=lambda found: ORDER.index(found.severity))


def element_findings(urdf: Urdf) -> list[Finding]:
    """The findings about single links and joints of a URDF that was read: quick, from its numbers alone."""
    return [
        *(finding for link in urdf.links.values() for finding in _link_findings(link)),
        *(finding for joint in urdf.joints.values() for finding in _joint_findings(joint)),
    ]


def format_findings(findings: list[Finding]) -> str:
    """Findings as text for a terminal, one a line, with a closing line of how many there are."""
    lines = [f"  {found.severity:<8} {found.where}: {found.message}" for found in findings]
    counts = [sum(found.severity == severity for found in findings) for severity in ORDER]
    summary = ", ".join(
        f"{count} {severity}{'' if count == 1 else 's'}" for count, severity in zip(counts, ORDER, strict=True) if count
    )
    return "\n".join([*lines, f"  {summary or 'nothing found'}"])


def _without(source: Path, message: str) -> str:
    return message.removeprefix(f"{source}: ")


def principal_moments(inertia: tuple[float, float, float, float, float, float]) -> tuple[float, float, float]:
    """The principal moments (kg m²), smallest first, of an inertia (ixx, ixy, ixz, iyy, iyz, izz)."""
    import numpy as np

    ixx, ixy, ixz, iyy, iyz, izz = inertia
    low, middle, high = np.linalg.eigvalsh([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]).tolist()
    return low, middle, high


def _link_findings(link: Link) -> Iterator[Finding]:
    where = f"link '{link.name}'"
    inertial = link.inertial
    if inertial is None:
        return
    low, middle, high = principal_moments(inertial.inertia)
    size = max(abs(low), abs(high))
    off = ROUND_OFF * size + POINT * inertial.mass
    moments = f"principal moments {low:.4g}, {middle:.4g}, {high:.4g} kg m²"
    if low < -off:
        yield Finding("error", where, f"the inertia is not positive ({moments}); no body has it: check its signs")
    elif low + middle < high - off:
        rounding = high <= 1.001 * (low + middle)
        yield Finding(
            "warning" if rounding else "error",
            where,
            f"the inertia breaks the triangle inequality ({moments}: the largest exceeds the sum of the "
            f"others by "
            f"{high - low - middle:.3g}); "
            + ("by so little that it may be rounding: give more digits" if rounding else "no body has it"),
        )
    if inertial.mass == 0.0 and size > 0.0:
        yield Finding("warning", where, f"has no mass but an inertia ({moments}); give both or neither")
    elif inertial.mass > 0.0 and _gyration(inertial) > 5.0:
        yield Finding(
            "warning",
            where,
            f"{inertial.mass:g} kg with an inertia of {high:.4g} kg m² is as if it were spread "
            f"{_gyration(inertial):.3g} m "
            "around; is the inertia in kg m² and about the centre of gravity?",
        )


def _gyration(inertial: Inertial) -> float:
    return math.sqrt(max(principal_moments(inertial.inertia)[2], 0.0) / inertial.mass)


def _joint_findings(joint: Joint) -> Iterator[Finding]:
    where = f"joint '{joint.name}'"
    moving = joint.type in ("revolute", "continuous", "prismatic")
    unit, turning = ("m", "m/s") if joint.type == "prismatic" else ("rad", "rad/s")
    if moving and abs(joint.axis_length - 1.0) > UNIT:
        yield Finding(
            "warning",
            where,
            f"the axis has length {joint.axis_length:.7g}, not 1; its direction alone is used",
        )
    if joint.type == "planar" and joint.axis != (0.0, 0.0, 1.0):
        yield Finding(
            "error",
            where,
            f"the axis of a planar joint is {list(joint.axis)}; only 0 0 1 can be used: turn its origin",
        )
    for name, angle in zip(("roll", "pitch", "yaw"), joint.rpy, strict=True):
        off = angle - round(angle / (math.pi / 2)) * (math.pi / 2)
        if CLEANED < abs(off) <= ALMOST:
            yield Finding(
                "warning",
                where,
                f"the {name} {angle!r} is {off:+.3g} rad off {round(angle / (math.pi / 2)) * 90}°; "
                f"write {round(angle / (math.pi / 2)) * (math.pi / 2)!r} if the right angle is meant",
            )
    if moving and joint.mimic is None:
        yield from _limit_findings(joint, where, unit, turning)
    if moving and joint.mimic is not None:
        mimic = joint.mimic
        yield Finding(
            "note",
            where,
            f"follows joint '{mimic.joint}': position = {mimic.multiplier:g} × its position "
            f"{mimic.offset:+g} {unit}; "
            "it is no joint of its own here, and its share of the torque goes to the joint it follows",
        )
        if mimic.multiplier == 0.0:
            yield Finding("warning", where, "follows with multiplier 0, so it never moves; make it a fixed joint")


def _limit_findings(joint: Joint, where: str, unit: str, turning: str) -> Iterator[Finding]:
    wanted = ("effort", "velocity") if joint.type == "continuous" else ("lower", "upper", "effort", "velocity")
    missing = [key for key in wanted if getattr(joint, key) is None]
    if missing:
        yield Finding("warning", where, f"has no {' and no '.join(missing)} limit; margins against it cannot be given")
    for key in ("effort", "velocity"):
        if getattr(joint, key) == 0.0:
            yield Finding("warning", where, f"the {key} limit is 0, which any motion exceeds; give it, or leave it out")
    if joint.lower is not None and joint.lower == joint.upper:
        yield Finding("warning", where, f"lower and upper limit are both {joint.lower:g} {unit}: it cannot move")
    if joint.type == "revolute" and max(abs(joint.lower or 0.0), abs(joint.upper or 0.0)) > LIKE_DEGREES:
        yield Finding(
            "warning",
            where,
            f"the limits {joint.lower} and {joint.upper} rad look like degrees; rad was expected",
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


def _mesh_findings(links: dict[str, Link], source: Path, access: FileAccess) -> Iterator[Finding]:
    users: dict[str, list[str]] = {}
    for link in links.values():
        for mesh in dict.fromkeys(link.meshes):
            users.setdefault(mesh, []).append(link.name)
    missing = [mesh for mesh in users if find_mesh(mesh, source, access) is None]
    for mesh in missing[:SHOWN]:
        beyond = looked_for([mesh], source, access)
        message = f"the mesh {mesh} was not found{beyond}; dynamics do not need it"
        yield Finding("warning", _these("link", users[mesh]), message)
    if len(missing) > SHOWN:
        yield Finding("warning", "meshes", f"{len(missing) - SHOWN} more of {len(users)} were not found")


def _these(kind: str, names: list[str]) -> str:
    """Names in a row, the first few of them: link 'a', or links 'a', 'b' and 3 more."""
    if len(names) == 1:
        return f"{kind} '{names[0]}'"
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"{kind}s " + ", ".join(f"'{name}'" for name in names[:SHOWN]) + more


def _element_findings(robot: Element, joints: dict[str, Joint]) -> Iterator[Finding]:
    """What only the elements themselves tell: parts of the file that have no effect, and shapes that stand nowhere."""
    for element in robot.find_all("joint"):
        name, kind = element.attributes.get("name", ""), element.attributes.get("type")
        if element.find("mimic") is not None and kind in ("fixed", "floating", "planar"):
            yield Finding("warning", f"joint '{name}'", f"is {kind}, so its <mimic> has no effect; remove it")
    for element in robot.find_all("transmission"):
        name = element.attributes.get("name", "")
        for driven in element.find_all("joint"):
            if driven.attributes.get("name", "") not in joints:
                unknown = driven.attributes.get("name", "")
                yield Finding("warning", f"transmission '{name}'", f"drives a joint '{unknown}' that is not there")
    for element in robot.find_all("link"):
        name = element.attributes.get("name", "")
        for shape in element.children:
            if shape.tag in ("visual", "collision"):
                try:
                    origin_from(shape, f"<{shape.tag}>", InputError)
                except InputError as error:
                    yield Finding(
                        "warning", f"link '{element.attributes.get('name', '')}'", f"{error}; it is not drawn"
                    )


def _massless_findings(links: dict[str, Link], joints: dict[str, Joint]) -> Iterator[Finding]:
    zero = [link.name for link in links.values() if link.inertial is not None and link.inertial.mass == 0.0]
    if zero:
        yield Finding("note", _these("link", zero), "an <inertial> of mass 0 is the same as none")


def moving_without_mass(urdf: Urdf, loaded: Iterable[str] = ()) -> list[Finding]:
    """The warning about links that a joint moves and that have no mass, those fixed to them counted in.

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
    bare = [name for name in order if name in moved and carried[name] == 0.0]
    if not bare:
        return []
    one = len(bare) == 1
    missing = "no <inertial>" if all(urdf.links[name].inertial is None for name in bare) else "an <inertial> of mass 0"
    text = (
        f"{'moves' if one else 'move'} with a joint and {'has' if one else 'have'} no mass ({missing}): torques leave "
        f"{'its' if one else 'their'} weight and inertia out; write the <inertial> unless the real part has none"
    )
    return [Finding("warning", _these("link", bare), text)]


def vanishing_inertia(urdf: Urdf, name: str, least: float) -> str:
    """The sentence about a joint about whose axis nothing has inertia (kg m² or kg)."""
    what = "mass" if urdf.joints[name].type == "prismatic" else "inertia"
    return (
        f"the {what} that it moves about its axis vanishes ({least:.2g}): its acceleration is undefined; give a link "
        "beyond it a mass (off the axis) or an inertia"
    )


def _articulated_findings(urdf: Urdf, already_wrong: bool) -> Iterator[Finding]:
    from bellcrank.robot.articulated_inertia import articulated_inertias

    try:
        inertias = articulated_inertias(urdf)
    except InputError as problem:
        yield Finding("error", "robot", _without(urdf.source, str(problem)))
        return
    for name, (least, threshold) in inertias.items():
        what = "mass" if urdf.joints[name].type == "prismatic" else "inertia"
        if abs(least) <= threshold:
            yield Finding("error", f"joint '{name}'", vanishing_inertia(urdf, name, least))
        elif least < 0.0 and not already_wrong:
            yield Finding(
                "error",
                f"joint '{name}'",
                f"the {what} that it moves about its axis is negative ({least:.3g})",
            )


def _second_findings(urdf: Urdf) -> Iterator[Finding]:
    from bellcrank.robot.yourdfpy_comparison import differences_from_yourdfpy

    for difference in differences_from_yourdfpy(urdf)[:20]:
        yield Finding("note", "second reading", difference)
