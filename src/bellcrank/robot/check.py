"""Checks of a whole URDF file: findings with a severity, from the file and its meshes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from bellcrank import arguments
from bellcrank.errors import BellcrankError, InputError
from bellcrank.files.access import FileAccess, Trust
from bellcrank.robot.element_checks import (
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
from bellcrank.robot.file_readers import read_robot_file, root_tag
from bellcrank.robot.mesh_path import find_mesh, looked_for
from bellcrank.robot.urdf_elements import JOINT_TYPES, MIMICKED, origin_from
from bellcrank.robot.urdf_file import Joint, Link, Urdf, reading_of
from bellcrank.robot.xml_tree import Element, parse_xml, read_text

__all__ = ["Finding", "check_urdf", "format_findings"]


@arguments.named
def check_urdf(path: str | Path, *, trust: Trust = ()) -> list[Finding]:
    """Check a robot file: its elements, its tree, its masses and its meshes; compare a URDF with what yourdfpy reads.

    Other formats are checked as the URDF that they become; lines in messages are those of that URDF. What only a URDF
    can say, such as the velocity limits that MJCF does not have, is not asked of them.

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
        text = file.urdf
        reading = reading_of(text, source)
    except BellcrankError as problem:
        return [Finding("error", "file", without_source(source, str(problem)))]
    findings = [Finding("error", "file", without_source(source, str(problem))) for problem in reading.problems]
    for link in reading.links.values():
        findings.extend(link_findings(link))
    own_text = file.urdf == read_text(source) or source.suffix == ".xacro"  # a URDF, whose numbers a person wrote
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
        findings.extend(_unused_elements(parse_xml(text, source), reading.joints))
    findings.extend(Finding("note", "file", note) for note in file.notes)
    if reading.urdf is not None:
        findings.extend(articulated_findings(reading.urdf, any(found.severity == "error" for found in findings)))
        findings.extend(_yourdfpy_findings(reading.urdf))
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


def _unused_elements(robot: Element, joints: Mapping[str, Joint]) -> Iterator[Finding]:
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


def _yourdfpy_findings(urdf: Urdf) -> Iterator[Finding]:
    from bellcrank.robot.yourdfpy_comparison import differences_from_yourdfpy

    for difference in differences_from_yourdfpy(urdf)[:20]:
        yield Finding("note", "yourdfpy", difference)
