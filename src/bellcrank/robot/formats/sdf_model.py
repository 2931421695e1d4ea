"""Reads the models of an SDFormat file, nested and included ones too: links, joints and frames by full names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess
from bellcrank.notes import Note
from bellcrank.robot.formats.sdf_joints import SdfJoint, joint_axes, joint_type, pitch_of
from bellcrank.robot.formats.sdf_poses import MODEL, WORLD, Fail, Frame, Frames, numbers, read_pose, text_of
from bellcrank.robot.formats.urdf_elements import Vector3
from bellcrank.robot.formats.xml_tree import XmlElement, parse_xml, read_text

MOST_INCLUDES, MOST_DEPTH = 1000, 20
USED = {
    "model": {"link", "joint", "frame", "model", "include", "pose", "static", "self_collide", "allow_auto_disable"},
    "world": {"model", "joint", "frame", "include", "gravity"},
    "link": {"inertial", "visual", "collision", "pose", "self_collide", "must_be_base_link"},
    "joint": {"parent", "child", "pose", "axis", "axis2", "screw_thread_pitch"},
}  # tags that are read, or that say nothing about the motion


@dataclass(frozen=True)
class SdfLink:
    """A link: its full name and element, whether its model is static, and the folder of its file for meshes."""

    name: str
    element: XmlElement
    static: bool
    folder: Path


class SdfModels:
    """The links, joints and frames of an SDFormat file in one top scope.

    Attributes:
        name: The name of the model or world.
        links, joints: In the order of the file.
        frames: All named frames.
        gravity: Acceleration of gravity, m/s², or None.
        notes: What is not modelled.
    """

    def __init__(self, root: XmlElement, source: Path, access: FileAccess) -> None:
        self.links: list[SdfLink] = []
        self.joints: list[SdfJoint] = []
        self.gravity: Vector3 | None = None
        self._access, self._files = access, [source]  # the file that is read, after those that include it
        self.frames = Frames(self._fail)
        self.frames.add(WORLD, Frame(np.eye(4), "", "", root.line))
        self._version = _version(root, self._fail)
        self._unused: Counter[str] = Counter()
        self._notes: list[str] = []
        self._includes = 0
        world = root.find("world")
        if world is not None:
            self._world(world)
        else:
            models = [*root.find_all("model"), *root.find_all("include")]
            if len(models) != 1:
                raise self._fail(f"line {root.line}: expected one <model> or a <world>, found {len(models)} models")
            with self._file_of(models[0]) as element:
                self.name = element.attributes.get("name", "").strip() or source.stem
                self._model(element, "", static=False)

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence on each thing that is not modelled."""
        listed = ", ".join(f"{tag} ({count})" for tag, count in sorted(self._unused.items()))
        return (*self._notes, *((f"elements that are not used: {listed}.",) if listed else ()))

    def _fail(self, message: str) -> InputError:
        return InputError(f"{self._files[-1]}: " + "".join(c if c.isprintable() else " " for c in message))

    # ---- scopes

    def _world(self, world: XmlElement) -> None:
        self.name = world.attributes.get("name", "").strip() or WORLD
        gravity = world.find("gravity")
        if gravity is not None:
            self.gravity = _three(gravity, self._fail)
        self._count_unused(world)
        for child in world.children:
            if child.tag in ("model", "include"):
                with self._file_of(child) as element:
                    self._nested(element, "", static=False)
            elif child.tag == "frame":
                self._frame(child, "")
            elif child.tag == "joint":
                self._joint(child, "", static=False)

    def _model(self, model: XmlElement, prefix: str, static: bool) -> None:
        """The contents of a model whose names begin with `prefix`; the top model is placed in the world."""
        static = static or text_of(model, "static").lower() in ("true", "1")
        where = f"model '{prefix.removesuffix('::') or self.name}'"
        if not prefix:
            pose, base = read_pose(model, where, self._fail)
            if base not in ("", WORLD):
                raise self._fail(f"line {model.line}: {where}: relative_to: expected '{WORLD}', found '{base}'")
            inside = model.attributes.get("placement_frame", "").strip()
            self.frames.add(MODEL, Frame(pose, WORLD, self._canonical(model, prefix), model.line, inside))
        self._count_unused(model)
        for child in model.children:
            if child.tag == "link":
                self._link(child, prefix, static)
            elif child.tag == "frame":
                self._frame(child, prefix)
            elif child.tag == "joint":
                self._joint(child, prefix, static)
            elif child.tag in ("model", "include"):
                with self._file_of(child) as element:
                    self._nested(element, prefix, static)

    def _nested(self, model: XmlElement, prefix: str, static: bool) -> None:
        name, line = self._name(model), model.line
        full, inside = f"{prefix}{name}", model.attributes.get("placement_frame", "").strip()
        pose, base = read_pose(model, f"model '{full}'", self._fail)
        scope = self._scope(prefix)
        own = f"{full}::"
        self.frames.add(
            full,
            Frame(
                pose, self._full(base, prefix) if base else scope, self._canonical(model, own), line,
                f"{own}{inside}" if inside else "",
            ),
        )  # fmt: skip
        self.frames.add(f"{own}{MODEL}", Frame(np.eye(4), full, full, line))
        self._model(model, own, static)

    def _canonical(self, model: XmlElement, prefix: str) -> str:
        """The link that a model's frame moves with."""
        given = model.attributes.get("canonical_link", "").strip()
        link = model.find("link")
        if given or link is not None:
            return prefix + (given or self._name(link or model))
        nested = model.find("model")
        return f"{prefix}{self._name(nested)}" if nested is not None else WORLD

    def _scope(self, prefix: str) -> str:
        """The frame of a scope: that of its model, or the world."""
        return f"{prefix}{MODEL}" if f"{prefix}{MODEL}" in self.frames.named else WORLD

    def _full(self, name: str, prefix: str) -> str:
        return name if name == WORLD else self._scope(prefix) if name == MODEL else f"{prefix}{name}"

    # ---- elements

    def _link(self, link: XmlElement, prefix: str, static: bool) -> None:
        full = f"{prefix}{self._name(link)}"
        pose, base = read_pose(link, f"link '{full}'", self._fail)
        self.frames.add(full, Frame(pose, self._full(base, prefix) if base else self._scope(prefix), "", link.line))
        self.links.append(SdfLink(full, link, static, self._files[-1].parent))
        self._count_unused(link)
        if text_of(link, "gravity").lower() in ("false", "0"):
            text = f"link '{full}': gravity acts on it; <gravity>false</gravity> is not modelled."
            self._notes.append(Note(text, "changes", "gravity"))
            self._unused["gravity"] -= 1
            self._unused += Counter()

    def _frame(self, frame: XmlElement, prefix: str) -> None:
        full = f"{prefix}{self._name(frame)}"
        pose, base = read_pose(frame, f"frame '{full}'", self._fail)
        attached = frame.attributes.get("attached_to", "").strip()
        onto = self._full(attached, prefix) if attached else self._scope(prefix)
        self.frames.add(full, Frame(pose, self._full(base, prefix) if base else onto, onto, frame.line))

    def _joint(self, joint: XmlElement, prefix: str, static: bool) -> None:
        parent, child = (text_of(joint, tag) for tag in ("parent", "child"))
        if joint.attributes.get("name", "").strip() or not child:
            full = f"{prefix}{self._name(joint)}"
        else:
            full = f"{prefix}{child.replace('::', '_')}_joint"
            self._notes.append(Note(f"line {joint.line}: the joint of link '{child}' has no name; it is '{full}'."))
        where = f"joint '{full}'"
        if not parent or not child:
            raise self._fail(f"line {joint.line}: {where}: expected <parent> and <child>")
        kind = joint_type(joint, where, self._fail)
        axes = joint_axes(joint, kind, self._version, where, self._fail)
        axes = tuple(
            replace(
                axis,
                expressed_in=self._scope(prefix) if axis.expressed_in is None
                else full if not axis.expressed_in else self._full(axis.expressed_in, prefix),
                mimic=None if axis.mimic is None else (f"{prefix}{axis.mimic[0]}", *axis.mimic[1:]),
            )
            for axis in axes
        )  # fmt: skip
        pose, base = read_pose(joint, where, self._fail)
        onto = self._full(child, prefix)
        self.frames.add(full, Frame(pose, self._full(base, prefix) if base else onto, onto, joint.line))
        pitch = pitch_of(joint, where, self._fail) if kind == "screw" else 0.0
        self._count_unused(joint)
        if static:
            self._notes.append(f"{where}: its model is static; the joint is not used.")
        else:
            self.joints.append(SdfJoint(full, kind, self._full(parent, prefix), onto, axes, pitch, joint.line))

    def _name(self, element: XmlElement) -> str:
        name = element.attributes.get("name", "").strip()
        if not name or not name.isprintable() or "::" in name or name in (WORLD, MODEL):
            raise self._fail(
                f"line {element.line}: <{element.tag}> needs a name (without '::', not '{WORLD}' or '{MODEL}'), found "
                f"'{name}'"
            )
        return name

    def _count_unused(self, element: XmlElement) -> None:
        for child in element.children:
            if child.tag not in USED[element.tag]:
                self._unused[child.tag] += 1

    # ---- includes

    @contextmanager
    def _file_of(self, element: XmlElement) -> Iterator[XmlElement]:
        """A <model>, or the one that an <include> names, with its file as the one that is read."""
        if element.tag == "model":
            yield element
            return
        self._includes += 1
        if self._includes > MOST_INCLUDES:
            raise self._fail(f"line {element.line}: more than {MOST_INCLUDES} models are included")
        path = self._included(element)
        if path.resolve() in [file.resolve() for file in self._files]:
            raise self._fail(f"line {element.line}: <include>: {path} includes itself, directly or through others")
        if len(self._files) > MOST_DEPTH:
            raise self._fail(f"line {element.line}: <include>: files include each other more than {MOST_DEPTH} deep")
        if element.attributes.get("merge", "false").lower() in ("true", "1"):
            raise self._fail(f'line {element.line}: <include merge="true"> is not supported; include it as a model')
        root = parse_xml(read_text(path), path)
        model = root.find("model")
        if root.tag != "sdf" or model is None:
            raise self._fail(f"line {element.line}: <include>: {path} has no <model>; only models are included")
        over = {child.tag: child for child in element.children if child.tag in ("pose", "static")}
        attributes = {
            **model.attributes,
            "name": text_of(element, "name") or model.attributes.get("name", ""),
            "placement_frame": text_of(element, "placement_frame") or model.attributes.get("placement_frame", ""),
        }
        children = [child for child in model.children if child.tag not in over] + list(over.values())
        self._files.append(path)
        yield replace(model, attributes=attributes, children=children)
        self._files.pop()

    def _included(self, include: XmlElement) -> Path:
        folder, uri = self._files[-1].parent, text_of(include, "uri")
        where = f"line {include.line}: <include>"
        if not uri or "://" in uri.removeprefix("file://").removeprefix("model://"):
            raise self._fail(f"{where}: expected a <uri> of a file or of a folder with model.sdf, found '{uri[:80]}'")
        name = uri.removeprefix("file://").removeprefix("model://")
        above = [folder, *folder.parents][:3] if uri.startswith("model://") else [folder]
        try:
            for at in above:
                path = replace(self._access, folder=at).path(name)
                path = path / "model.sdf" if path.is_dir() else path
                if path.is_file():
                    return path
        except InputError as error:
            raise self._fail(f"{where}: {error}") from None
        raise self._fail(f"{where}: there is no file or folder '{uri[:80]}'")


def _version(root: XmlElement, fail: Fail) -> tuple[int, ...]:
    given = root.attributes.get("version", "").strip()
    words = given.split(".")
    if not given or len(words) > 3 or not all(word.isdecimal() and len(word) < 4 for word in words):
        raise fail(f"line {root.line}: <sdf>: expected a version such as 1.9, found '{given[:40]}'")
    return tuple(map(int, words))


def _three(element: XmlElement, fail: Fail) -> Vector3:
    values = numbers(element, f"<{element.tag}>", fail)
    if len(values) != 3:
        raise fail(f"line {element.line}: <{element.tag}>: expected 3 numbers, found {len(values)}")
    return values[0], values[1], values[2]
