"""An SDFormat file as a RobotFile: a spanning tree of its links, and the joints that remain as closed loops.

A joint is an edge between two links. Edges join the tree in the order of the file, joints whose child already is a
child last; an edge that closes a circle is a loop. The base is the world where a joint or a static model is attached to
it, otherwise the first link that is no child; other links without a way to the base float. A joint that the tree meets
from its child's side is turned around: the coordinate of a revolute, prismatic or screw joint stays the same with the
opposite axis.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess
from bellcrank.notes import Note
from bellcrank.robot.formats.mjcf_placement import inverse, roll_pitch_yaw, vector
from bellcrank.robot.formats.robot_file import FileJointSpring, FrameLoop, FramePlace, LoopKind, RobotFile
from bellcrank.robot.formats.sdf_joints import JointAxis, SdfJoint, turned
from bellcrank.robot.formats.sdf_links import link_element
from bellcrank.robot.formats.sdf_model import SdfModels
from bellcrank.robot.formats.sdf_poses import WORLD
from bellcrank.robot.formats.urdf_writing import Names, element, joint_element, numbers
from bellcrank.robot.formats.xml_tree import XmlElement, parse_xml

IDENTITY = np.eye(4)
NEAR = 1e-13  # m, and for entries of rotation matrices: equal placements
LOOPS: dict[str, LoopKind] = {
    "revolute": "hinge", "continuous": "hinge", "spherical": "point", "fixed": "weld", "universal": "universal",
    "prismatic": "prismatic",
}  # fmt: skip


@dataclass(frozen=True)
class Edge:
    """A joint between the links `first` and `second`, its parent's and its child's."""

    joint: SdfJoint
    first: str
    second: str


def read_sdf(text: str, source: Path, access: FileAccess) -> RobotFile:
    """The contents of an SDFormat file, given as text. Raises InputError, one sentence with file and line."""
    models = SdfModels(parse_xml(text, source), source, access)
    return _Builder(models, source).file()


class _Builder:
    def __init__(self, models: SdfModels, source: Path) -> None:
        self.models, self.source = models, source
        self.joints = {joint.name: joint for joint in models.joints}
        links = [link.name for link in models.links]
        if not links:
            raise InputError(f"{source}: there is no <link>; at least one was expected")
        self.names = Names([*links, WORLD])
        self.titles = Names(list(self.joints))
        self.notes = list(models.notes)
        static = {link.name for link in models.links if link.static}
        edges = [edge for joint in models.joints if (edge := self._edge(joint, static)) is not None]
        self.tree, self.closing = _spanning_tree(edges)
        children = {edge.second for edge in edges}
        grounded = bool(static) or any(WORLD in (edge.first, edge.second) for edge in edges)
        self.base = WORLD if grounded else next((link for link in links if link not in children), links[0])
        if not grounded:
            self.notes.append(
                f"no joint attaches the model to the world: its base '{self.base}' is fixed, unless the scene says "
                "floating_base: true."
            )

    def file(self) -> RobotFile:
        """The record."""
        parts = list[XmlElement]()
        for link in self.models.links:
            own, notes = link_element(link, self.source, self.models.frames, self._fail)
            parts.append(own)
            self.notes += notes
        parts += self._tree_parts()
        loops = tuple(self._loop(edge) for edge in self.closing)
        springs = tuple(
            FileJointSpring(joint=edge.joint.name, stiffness=axis.stiffness, reference=axis.reference)
            for edge in self.tree
            for axis in edge.joint.axes[:1]
            if axis.stiffness
        )
        return RobotFile(
            source=self.source,
            urdf=element("robot", 1, *parts, name=self.models.name),
            loops=loops,
            springs=springs,
            gravity=self.models.gravity,
            notes=tuple(dict.fromkeys(self.notes)),
        )

    # ---- the graph

    def _edge(self, joint: SdfJoint, static: set[str]) -> Edge | None:
        """The links of a joint; a link of a static model is the world. None where both are."""
        frames = self.models.frames
        for name in (joint.parent, joint.child):
            frames.known(name, joint.line, f"joint '{joint.name}'")
        first, second = (WORLD if link in static else link for link in map(frames.link, (joint.parent, joint.child)))
        if first == second:
            if first == WORLD:
                self.notes.append(f"joint '{joint.name}': both of its links are fixed; it is not used.")
                return None
            raise self._fail(f"line {joint.line}: joint '{joint.name}': link '{first}' is its parent and its child")
        return Edge(joint, first, second)

    def _place(self, name: str, inside: str) -> Array:
        """The placement of a frame in another one where all joints are at 0."""
        pose = self.models.frames.pose
        place = inverse(pose(inside)) @ pose(name)
        return IDENTITY if np.abs(place - IDENTITY).max() <= NEAR else np.asarray(place)

    def _tree_parts(self) -> Iterator[XmlElement]:
        """The joints from the base on, and links between."""
        root = self.base
        place = IDENTITY if root == WORLD else self._place(root, WORLD)
        if root == WORLD:
            yield element("link", 1, name=WORLD)
        elif not np.array_equal(place, IDENTITY):  # the base link keeps its place in the world
            root = self.names.new(self.models.name)
            yield element("link", 1, name=root)
            yield self._fixed(root, self.base, place, 1)
        for link in self.models.links:
            if link.static:
                yield self._fixed(root, link.name, self._place(link.name, WORLD), link.element.line)
        beside: dict[str, list[Edge]] = {}
        for edge in self.tree:
            beside.setdefault(edge.first, []).append(edge)
            beside.setdefault(edge.second, []).append(edge)
        reached = {self.base}
        yield from self._grown(self.base, beside, reached)
        for link in self.models.links:
            if link.name not in reached and not link.static:
                if root != WORLD:
                    raise self._fail(
                        f"line {link.element.line}: no joint connects link '{link.name}' with link '{self.base}'; "
                        "connect one of them with the world by a joint"
                    )
                reached.add(link.name)
                place = self._place(link.name, WORLD)
                title = self.titles.new(f"{link.name}_free")
                yield joint_element(title, "floating", root, link.name, place, link.element.line)
                yield from self._grown(link.name, beside, reached)

    def _grown(self, start: str, beside: dict[str, list[Edge]], reached: set[str]) -> Iterator[XmlElement]:
        waiting = [start]
        while waiting:
            at = waiting.pop(0)
            for edge in beside.get(at, ()):
                other = edge.second if edge.first == at else edge.first
                if other in reached:
                    continue
                reached.add(other)
                waiting.append(other)
                yield from self._joint(edge, at, other)

    def _joint(self, edge: Edge, at: str, other: str) -> Iterator[XmlElement]:
        """The joint from a link to the next, with a massless link where the next link's frame is elsewhere."""
        joint, turn = edge.joint, 1.0 if edge.first == at else -1.0
        if turn < 0.0 and joint.type == "universal":
            raise self._fail(
                f"line {joint.line}: joint '{joint.name}' must be met from its parent; exchange its parent and child"
            )
        rest = self._place(other, joint.name)
        child = other
        if not np.array_equal(rest, IDENTITY):
            child = self.names.new(f"{joint.name}_child")
            yield element("link", joint.line, name=child)
        axes = tuple(
            replace(axis, direction=vector(turn * np.array(self._direction(joint, k))))
            for k, axis in enumerate(joint.axes)
        )
        yield from joint_elements(replace(joint, axes=axes), at, child, self._place(joint.name, at), self.names)
        if child != other:
            yield self._fixed(child, other, rest, joint.line)

    def _direction(self, joint: SdfJoint, axis: int) -> tuple[float, float, float]:
        one = joint.axes[axis]
        frame = self.models.frames.known(one.expressed_in or joint.name, joint.line, f"joint '{joint.name}', <axis>")
        return turned(one, self._place(frame, joint.name)[:3, :3])

    def _fixed(self, parent: str, child: str, place: Array, line: int) -> XmlElement:
        return joint_element(self.titles.new(f"{child}_fixed"), "fixed", parent, child, place, line)

    # ---- loops

    def _loop(self, edge: Edge) -> FrameLoop:
        joint = edge.joint
        if joint.type not in LOOPS:
            raise self._fail(
                f"line {joint.line}: joint '{joint.name}' closes a loop and is {joint.type}; expected: revolute, "
                "continuous, ball, universal, prismatic or fixed; write another joint of the loop later in the file"
            )
        unused = [
            word
            for axis in joint.axes
            for word, value in (
                ("limits", axis.lower is not None or axis.upper is not None), ("damping", axis.damping),
                ("friction", axis.friction), ("spring", axis.stiffness), ("mimic", axis.mimic),
            )
            if value
        ]  # fmt: skip
        if unused:
            text = f"joint '{joint.name}' closes a loop; its {', '.join(unused)} are not modelled."
            self.notes.append(Note(text, "changes", "" if unused == ["limits"] else "force"))
        a, b = (self._side(link, joint) for link in (edge.second, edge.first))
        first, *second = [self._direction(joint, k) for k in range(len(joint.axes))] or [(0.0, 0.0, 1.0)]
        name, kind = joint.name.replace(".", "_"), LOOPS[joint.type]
        if second:  # the first axis is fixed in the parent, which is b
            return FrameLoop(name=name, kind=kind, a=a, b=b, axis=second[0], axis_2=first)
        return FrameLoop(name=name, kind=kind, a=a, b=b, axis=first)

    def _side(self, link: str, joint: SdfJoint) -> FramePlace:
        place = self._place(joint.name, link)
        return FramePlace(link, vector(place[:3, 3]), roll_pitch_yaw(place[:3, :3]))

    def _fail(self, message: str) -> InputError:
        return InputError(f"{self.source}: {message}")


def _spanning_tree(edges: list[Edge]) -> tuple[list[Edge], list[Edge]]:
    """The edges of a spanning forest, and those that close circles (Kruskal's algorithm).

    Joints that cannot be loops come first, then those whose child is no child yet, in the order of the file.
    """
    taken: set[str] = set()
    later = []
    for edge in edges:
        later.append(edge.second in taken)
        taken.add(edge.second)
    order = sorted(range(len(edges)), key=lambda k: (edges[k].joint.type in LOOPS, later[k], k))
    group: dict[str, str] = {}

    def root(link: str) -> str:
        while (above := group.setdefault(link, link)) != link:
            group[link] = group[above]
            link = above
        return link

    tree: list[Edge] = []
    closing: list[Edge] = []
    for k in order:
        a, b = root(edges[k].first), root(edges[k].second)
        (closing if a == b else tree).append(edges[k])
        group[a] = b
    return tree, closing


def joint_elements(joint: SdfJoint, parent: str, child: str, place: Array, links: Names) -> Iterator[XmlElement]:
    """A joint; one with two axes that differ in more than their direction is two revolute joints and a link."""
    axes, line = joint.axes, joint.line
    if len(axes) == 2 and replace(axes[1], direction=axes[0].direction) != axes[0]:
        cross = links.new(f"{joint.name}_cross")
        yield element("link", line, name=cross)
        for k, (axis, ends) in enumerate(zip(axes, ((parent, cross), (cross, child)), strict=True), 1):
            single = replace(joint, name=f"{joint.name}_{k}", type="revolute", axes=(axis,))
            yield from joint_elements(single, *ends, place if k == 1 else IDENTITY, links)
        return
    kind = joint.type
    if kind == "revolute" and axes[0].lower is None and axes[0].upper is None:
        kind = "continuous"
    parts = [element(tag, line, xyz=numbers(one.direction)) for tag, one in zip(("axis", "axis2"), axes, strict=False)]
    if axes:
        parts += _terms(axes[0], kind, line)
    pitch = joint.pitch if kind == "screw" else None
    yield joint_element(joint.name, kind, parent, child, place, line, *parts, pitch=pitch)


def _terms(axis: JointAxis, kind: str, line: int) -> Iterator[XmlElement]:
    """Limits, friction and mimic of an axis."""
    lower, upper = (None, None) if kind == "continuous" else (axis.lower, axis.upper)
    if (lower is None) != (upper is None):  # URDF takes a missing one of two limits for 0
        lower, upper = -1e30 if lower is None else lower, 1e30 if upper is None else upper
    if (lower, axis.effort, axis.velocity) != (None, None, None):
        yield element("limit", line, effort=axis.effort, velocity=axis.velocity, lower=lower, upper=upper)
    if axis.damping or axis.friction:
        yield element("dynamics", line, damping=axis.damping, friction=axis.friction)
    if axis.mimic is not None:
        leader, multiplier, offset = axis.mimic
        yield element("mimic", line, joint=leader, multiplier=multiplier, offset=offset)
