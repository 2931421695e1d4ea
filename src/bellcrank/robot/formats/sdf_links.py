"""Links of SDFormat as links of a URDF: inertia, and shapes for pictures."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bellcrank.arrays import Array
from bellcrank.robot.formats.mjcf_placement import inverse
from bellcrank.robot.formats.sdf_model import SdfLink
from bellcrank.robot.formats.sdf_poses import Fail, Frames, number, read_pose, text_of
from bellcrank.robot.formats.sdf_poses import numbers as numbers_of
from bellcrank.robot.formats.urdf_writing import ENTRIES, element, inertial_element, numbers, origin, shape_element
from bellcrank.robot.formats.xml_tree import XmlElement


def link_element(link: SdfLink, source: Path, frames: Frames, fail: Fail) -> tuple[XmlElement, list[str]]:
    """The <link> of a URDF, and sentences about what is not modelled. Raises InputError."""
    where, notes = f"link '{link.name}'", list[str]()
    parts = [_inertial(link, where, frames, fail, notes)]
    for child in link.element.children:
        if child.tag in ("visual", "collision"):
            parts += _shape(link, child, source, where, frames, fail, notes)
    return element("link", link.element.line, *parts, name=link.name), notes


def _inertial(link: SdfLink, where: str, frames: Frames, fail: Fail, notes: list[str]) -> XmlElement:
    """Mass and inertia; SDFormat's default of both is 1."""
    inertial = link.element.find("inertial")
    if inertial is None:
        notes.append(f"{where} has no <inertial>; SDFormat's default is used: 1 kg and 1 kg m² about each axis.")
        inertial = XmlElement("inertial", {}, link.element.line)
    where = f"{where}, <inertial>"
    if inertial.attributes.get("auto", "false").strip().lower() in ("true", "1"):
        raise fail(f'line {inertial.line}: {where}: auto="true" is not supported; write mass and inertia')
    for tag in ("fluid_added_mass", "density", "auto_inertia_params"):
        if inertial.find(tag) is not None:
            notes.append(f"{where}: <{tag}> is not modelled.")
    mass = number(inertial, "mass", 1.0, where, fail)
    if mass < 0.0:
        raise fail(f"line {inertial.line}: {where}: the mass is {mass:g} kg; expected 0 or more")
    place = _placed(link, inertial, where, frames, fail)
    given = inertial.find("inertia") or XmlElement("inertia", {}, inertial.line)
    values = [number(given, name, float(name in ("ixx", "iyy", "izz")), where, fail) for name in ENTRIES]
    return inertial_element(mass, origin(place, inertial.line), values, inertial.line)


def _placed(link: SdfLink, element: XmlElement, where: str, frames: Frames, fail: Fail) -> Array:
    """The pose of an element of a link in the link."""
    pose, base = read_pose(element, where, fail)
    if not base:
        return pose
    prefix = link.name.rpartition("::")[0]
    full = f"{prefix}::{base}" if prefix else base
    frames.known(full, element.line, f"{where}, relative_to")
    return np.asarray(inverse(frames.pose(link.name)) @ frames.pose(full) @ pose)


def _shape(
    link: SdfLink, shown: XmlElement, source: Path, where: str, frames: Frames, fail: Fail, notes: list[str]
) -> Iterator[XmlElement]:
    """A <visual> or <collision>, where URDF has its shape."""
    name = shown.attributes.get("name", "")
    where = f"{where}, <{shown.tag}> '{name}'"
    geometry = shown.find("geometry")
    shape = next((child for child in geometry.children), None) if geometry is not None else None
    solid = None if shape is None else _solid(link, shape, source, where, fail)
    if solid is None:
        if shape is not None and shape.tag not in ("empty", "plane"):
            notes.append(f"{where}: <{shape.tag}> is not drawn.")
        return
    colour = _colour(shown) if shown.tag == "visual" else ""
    yield shape_element(shown.tag, _placed(link, shown, where, frames, fail), solid, colour, shown.line)


def _solid(link: SdfLink, shape: XmlElement, source: Path, where: str, fail: Fail) -> XmlElement | None:
    where = f"{where}, <{shape.tag}>"
    line, box, scale = shape.line, shape.find("size"), shape.find("scale")
    if shape.tag == "box":
        return element("box", line, size=numbers((1.0, 1.0, 1.0) if box is None else numbers_of(box, where, fail)))
    if shape.tag == "sphere":
        return element("sphere", line, radius=number(shape, "radius", 1.0, where, fail))
    if shape.tag in ("cylinder", "capsule"):
        radius, length = (number(shape, key, 1.0, where, fail) for key in ("radius", "length"))
        return element(shape.tag, line, radius=radius, length=length)
    if shape.tag == "mesh":
        factors = (1.0, 1.0, 1.0) if scale is None else numbers_of(scale, where, fail)
        uri = _mesh(text_of(shape, "uri"), link.folder, source)
        return element("mesh", line, filename=uri, scale=numbers(factors))
    return None


def _mesh(uri: str, folder: Path, source: Path) -> str:
    """The name of a mesh file relative to the top file: names in an included file are relative to that file."""
    name = uri.removeprefix("file://")
    if "://" in name or Path(name).is_absolute() or folder == source.parent:
        return name
    return os.path.relpath(folder / name, source.parent).replace(os.sep, "/")


def _colour(visual: XmlElement) -> str:
    """The numbers of its colour, "" where none are given."""
    material = visual.find("material")
    diffuse = None if material is None else material.find("diffuse")
    words = [] if diffuse is None else diffuse.text.split()
    try:
        values = [float(word) for word in words]
    except ValueError:
        return ""
    if len(values) not in (3, 4) or not all(math.isfinite(value) for value in values):
        return ""
    return numbers([*values, 1.0][:4])
