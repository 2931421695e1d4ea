"""Writes links of SDFormat as links of a URDF: inertia, and shapes for pictures."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bellcrank.robot.formats.mjcf_placement import Array, inverse
from bellcrank.robot.formats.mjcf_urdf import origin
from bellcrank.robot.formats.sdf_model import SdfLink
from bellcrank.robot.formats.sdf_poses import Fail, Frames, number, numbers, read_pose, text_of
from bellcrank.robot.formats.xml_tree import XmlElement, quoted

ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def link_xml(link: SdfLink, source: Path, frames: Frames, fail: Fail) -> tuple[str, list[str]]:
    """The <link> of a URDF, and sentences about what is not modelled. Raises InputError."""
    where, notes = f"link '{link.name}'", list[str]()
    parts = [f"<link name={quoted(link.name)}>", _inertial(link, where, frames, fail, notes)]
    for element in link.element.children:
        if element.tag in ("visual", "collision"):
            parts += _shape(link, element, source, where, frames, fail, notes)
    return "".join([*parts, "</link>"]), notes


def _inertial(link: SdfLink, where: str, frames: Frames, fail: Fail, notes: list[str]) -> str:
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
    values = {name: number(given, name, float(name in ("ixx", "iyy", "izz")), where, fail) for name in ENTRIES}
    listed = " ".join(f'{name}="{value!r}"' for name, value in values.items())
    return f'<inertial>{origin(place)}<mass value="{mass!r}"/><inertia {listed}/></inertial>'


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
    link: SdfLink, element: XmlElement, source: Path, where: str, frames: Frames, fail: Fail, notes: list[str]
) -> Iterator[str]:
    """A <visual> or <collision>, where URDF has its shape."""
    name = element.attributes.get("name", "")
    where = f"{where}, <{element.tag}> '{name}'"
    geometry = element.find("geometry")
    shape = next((child for child in geometry.children), None) if geometry is not None else None
    solid = "" if shape is None else _solid(link, shape, source, where, fail)
    if not solid:
        if shape is not None and shape.tag not in ("empty", "plane"):
            notes.append(f"{where}: <{shape.tag}> is not drawn.")
        return
    colour = _colour(element) if element.tag == "visual" else ""
    yield f"<{element.tag}>{origin(_placed(link, element, where, frames, fail))}<geometry>{solid}</geometry>"
    yield f"{colour}</{element.tag}>"


def _solid(link: SdfLink, shape: XmlElement, source: Path, where: str, fail: Fail) -> str:
    where = f"{where}, <{shape.tag}>"
    if shape.tag == "box":
        size = shape.find("size")
        values = (1.0, 1.0, 1.0) if size is None else numbers(size, where, fail)
        return f'<box size="{" ".join(map(repr, values))}"/>'
    if shape.tag == "sphere":
        return f'<sphere radius="{number(shape, "radius", 1.0, where, fail)!r}"/>'
    if shape.tag in ("cylinder", "capsule"):
        radius, length = (number(shape, key, 1.0, where, fail) for key in ("radius", "length"))
        return f'<{shape.tag} radius="{radius!r}" length="{length!r}"/>'
    if shape.tag == "mesh":
        scale = shape.find("scale")
        values = (1.0, 1.0, 1.0) if scale is None else numbers(scale, where, fail)
        uri = _mesh(text_of(shape, "uri"), link.folder, source)
        return f'<mesh filename={quoted(uri)} scale="{" ".join(map(repr, values))}"/>'
    return ""


def _mesh(uri: str, folder: Path, source: Path) -> str:
    """The name of a mesh file relative to the top file: names in an included file are relative to that file."""
    name = uri.removeprefix("file://")
    if "://" in name or Path(name).is_absolute() or folder == source.parent:
        return name
    return os.path.relpath(folder / name, source.parent).replace(os.sep, "/")


def _colour(visual: XmlElement) -> str:
    material = visual.find("material")
    diffuse = None if material is None else material.find("diffuse")
    words = [] if diffuse is None else diffuse.text.split()
    try:
        values = [float(word) for word in words]
    except ValueError:
        return ""
    if len(values) not in (3, 4) or not all(math.isfinite(value) for value in values):
        return ""
    return f'<material name=""><color rgba="{" ".join(map(repr, [*values, 1.0][:4]))}"/></material>'
