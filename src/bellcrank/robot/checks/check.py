"""Checks of a whole URDF file: findings with a severity, from the file and its meshes."""

from __future__ import annotations

import io
import logging
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from bellcrank import arguments
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import FileAccess, Trust
from bellcrank.robot.checks.element_checks import (
    ORDER,
    SHOWN,
    Finding,
    articulated_findings,
    format_findings,
    joint_findings,
    link_findings,
    listed,
    massless_findings,
    moving_without_mass,
    without_source,
)
from bellcrank.robot.formats.file_readers import read_robot_file, root_tag
from bellcrank.robot.formats.mesh_path import find_mesh, looked_for
from bellcrank.robot.formats.urdf_elements import JOINT_TYPES, MIMICKED, origin_from
from bellcrank.robot.formats.urdf_file import Joint, Link, Urdf, reading_of
from bellcrank.robot.formats.xml_tree import XmlElement, parse_xml, read_text, xml_text

__all__ = ["Finding", "check_urdf", "format_findings"]


@arguments.named
def check_urdf(path: str | Path, *, trust: Trust = ()) -> list[Finding]:
    """Check a robot file: its elements, its tree, its masses and its meshes; compare a URDF with what yourdfpy reads.

    Other formats are checked as the URDF that they become. What only a URDF can say, such as the velocity limits that
    MJCF does not have, is not asked of them.

    An error makes dynamics wrong or impossible, a warning is about something that is probably not intended, and a note
    about something that is easily missed. A file that cannot be read gives one finding and no exception.

    Args:
        path: Path of the file.
        trust: Folders outside the file's surroundings in which meshes are looked for.

    Returns:
        The findings, errors first. Each has a `severity` ("error", "warning" or "note"), the element that it is about
        (`where`) and a sentence (`message`).

    Raises:
        InputError: The path is not a path.

    Example:
        >>> import bellcrank as bc
        >>> bc.check_urdf(bc.load_robot("planar_2r").source)
        []
    """
    source = arguments.path("path", path, "the path of a robot file")
    access = FileAccess.of(source.resolve(), trust)
    try:
        file = read_robot_file(source, access)
        text = read_text(source)
        own_text = source.suffix == ".xacro" or file.urdf == parse_xml(text, source)  # whose numbers a person wrote
    except BellcrankError as problem:
        return [Finding("error", "file", without_source(source, str(problem)))]
    reading = reading_of(file.urdf, source)
    findings = [Finding("error", "file", without_source(source, str(problem))) for problem in reading.problems]
    for link in reading.links.values():
        findings.extend(link_findings(link))
    motors = {motor.joint for motor in file.motors}
    for joint in reading.joints.values():
        if own_text or not is_mjcf(source):
            findings.extend(joint_findings(joint, typed=own_text))
        else:  # MJCF has no velocity limits, ranges where a joint has them, and efforts where it has motors
            findings.extend(joint_findings(joint, ("effort",) if joint.name in motors else (), typed=False))
    findings.extend(_mesh_findings(reading.links, source, access))
    findings.extend(massless_findings(reading.links))
    if reading.urdf is not None:
        findings.extend(moving_without_mass(reading.urdf))
    if reading.links:
        findings.extend(_unused_elements(file.urdf, reading.joints))
    findings.extend(Finding("note", "file", note) for note in file.notes)
    if reading.urdf is not None:
        findings.extend(articulated_findings(reading.urdf, any(found.severity == "error" for found in findings)))
        same = own_text and source.suffix != ".xacro"
        findings.extend(_yourdfpy_findings(reading.urdf, text if same else xml_text(file.urdf)))
    return sorted(findings, key=lambda found: ORDER.index(found.severity))


def is_mjcf(source: Path) -> bool:
    """Whether a robot file is in MuJoCo's format. Raises InputError where it cannot be read."""
    return root_tag(read_text(source)) == "mujoco"


def _mesh_findings(links: Mapping[str, Link], source: Path, access: FileAccess) -> Iterator[Finding]:
    """Warnings about mesh files that are not found."""
    users: dict[str, list[str]] = {}
    for link in links.values():
        for mesh in dict.fromkeys(link.meshes):
            users.setdefault(mesh, []).append(link.name)
    missing = [mesh for mesh in users if find_mesh(mesh, source, access) is None]
    for mesh in missing[:SHOWN]:
        beyond = looked_for([mesh], source, access)
        message = f"the mesh {mesh} was not found{beyond}; dynamics do not need it"
        yield Finding("warning", listed("link", users[mesh]), message)
    if len(missing) > SHOWN:
        yield Finding("warning", "meshes", f"{len(missing) - SHOWN} more of {len(users)} were not found")


def _unused_elements(robot: XmlElement, joints: Mapping[str, Joint]) -> Iterator[Finding]:
    """Warnings about elements that have no effect: mimics of fixed joints, transmissions of unknown joints, shapes with
    a wrong origin.
    """
    for element in robot.find_all("joint"):
        name, kind = element.attributes.get("name", ""), element.attributes.get("type")
        if element.find("mimic") is not None and kind in JOINT_TYPES and kind not in MIMICKED:
            yield Finding("warning", f"joint '{name}'", f"is {kind}, so its <mimic> has no effect; remove it")
    for element in robot.find_all("transmission"):
        name = element.attributes.get("name", "")
        for driven in element.find_all("joint"):
            joint = driven.attributes.get("name", "")
            if joint not in joints:
                yield Finding("warning", f"transmission '{name}'", f"drives a joint '{joint}' that does not exist")
    for element in robot.find_all("link"):
        name = element.attributes.get("name", "")
        for shape in element.children:
            if shape.tag in ("visual", "collision"):
                try:
                    origin_from(shape, f"<{shape.tag}>", InputError)
                except InputError as error:
                    yield Finding("warning", f"link '{name}'", f"{error}; the shape is not drawn")


def _yourdfpy_findings(urdf: Urdf, text: str) -> Iterator[Finding]:

    for difference in differences_from_yourdfpy(urdf, text)[:20]:
        yield Finding("note", "yourdfpy", difference)


# ---- Comparison of a URDF as it was read with what yourdfpy, an independent reader, reads.

TOLERANCE = 1e-9  # of a rotation or translation entry; everything else is compared exactly


def differences_from_yourdfpy(urdf: Urdf, text: str) -> list[str]:
    """The values that yourdfpy reads differently from the text of a URDF: one phrase each.

    Masses, centres of gravity, inertias, joint types, parents, placements, axes, limits, friction and mimics are
    compared (yourdfpy does not read transmissions). That yourdfpy cannot read the file is a difference too.
    """
    import numpy as np
    import pinocchio as pin
    import yourdfpy

    log = logging.getLogger("yourdfpy.urdf")
    level = log.level
    log.setLevel(logging.CRITICAL)
    try:
        with np.errstate(all="ignore"):  # shapes, which are not compared, may overflow
            robot: Any = yourdfpy.URDF.load(
                io.BytesIO(text.lstrip("\ufeff").encode("utf-8")),
                build_scene_graph=False,
                build_collision_scene_graph=False,
                load_meshes=False,
                load_collision_meshes=False,
            ).robot
    except Exception as error:
        return [f"yourdfpy does not read the file ({type(error).__name__}: {' '.join(str(error).split())})"]
    finally:
        log.setLevel(level)
    differences: list[str] = []

    def compare(where: str, ours: object, theirs: object) -> None:
        if ours != theirs:
            differences.append(f"{where} is {ours}, but {theirs} as yourdfpy reads it")

    def compare_poses(where: str, ours: Link | Joint, theirs: Any) -> None:
        part = ours.inertial if isinstance(ours, Link) else ours
        assert part is not None
        pose = np.eye(4) if theirs is None else np.asarray(theirs)
        if np.abs(pose[:3, :3] - pin.rpy.rpyToMatrix(*part.rpy)).max() > TOLERANCE:
            differences.append(f"{where}: the rotation differs from yourdfpy's")
        if np.abs(pose[:3, 3] - part.xyz).max() > TOLERANCE:
            differences.append(f"{where}: the position differs from yourdfpy's")

    # a universal joint is one joint there, two joints and a link here
    between = {link.name for link in urdf.links.values() if link.between_axes}
    links = [name for name in urdf.links if name not in between]
    joints = [joint.name for joint in urdf.joints.values() if not between & {joint.parent, joint.child}]
    compare("the list of links", sorted(links), sorted(link.name.strip() for link in robot.links))
    others = [joint.name.strip() for joint in robot.joints if joint.type != "universal"]
    compare("the list of joints", sorted(joints), sorted(others))
    for theirs in robot.links:
        link = urdf.links.get(theirs.name.strip())
        if link is None or (link.inertial is None) != (theirs.inertial is None):
            differences.append(f"link '{theirs.name}': only one of the two readers finds its mass")
            continue
        if link.inertial is None:
            continue
        where = f"link '{link.name}'"
        ixx, ixy, ixz, iyy, iyz, izz = link.inertial.inertia
        compare(f"{where}: the mass", link.inertial.mass, theirs.inertial.mass)
        compare(
            f"{where}: the inertia",
            [[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]],
            theirs.inertial.inertia.tolist(),
        )
        compare_poses(where, link, theirs.inertial.origin)
    for theirs in robot.joints:
        joint = urdf.joints.get(theirs.name.strip())
        if joint is not None and theirs.type != "universal":
            differences.extend(_joint_differences(joint, theirs))
            compare_poses(f"joint '{joint.name}'", joint, theirs.origin)
    return differences


def _joint_differences(joint: Joint, theirs: Any) -> list[str]:
    import numpy as np

    ours: dict[str, object] = {"type": joint.type, "parent": joint.parent, "child": joint.child}
    other: dict[str, object] = {"type": theirs.type, "parent": theirs.parent, "child": theirs.child}
    limit, dynamics = theirs.limit, theirs.dynamics
    for key in ("effort", "velocity", "lower", "upper"):
        value = getattr(joint, key)
        if value is not None and (value != 0.0 or getattr(limit, key, None) is not None):
            ours[key], other[key] = value, getattr(limit, key, None)
    for key in ("damping", "friction"):
        value = getattr(joint, key)
        if value is not None:
            ours[key], other[key] = value, float(getattr(dynamics, key))
    if joint.mimic is not None:
        ours["mimic"], other["mimic"] = True, theirs.mimic is not None
    found = [
        f"joint '{joint.name}': {key} is {ours[key]}, but {other[key]} as yourdfpy reads it"
        for key in ours
        if ours[key] != other[key]
    ]
    if joint.type in ("revolute", "continuous", "prismatic"):
        axis = np.asarray(theirs.axis) / np.linalg.norm(theirs.axis)
        if np.abs(axis - joint.axis).max() > TOLERANCE:
            found.append(f"joint '{joint.name}': the axis differs from yourdfpy's")
    return found
