"""The tree of bodies under <worldbody> of an MJCF file: placements, joints, shapes and sites, by MuJoCo's rules.

<frame> moves what is in it; <replicate> repeats what is in it, each copy moved from the last.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from bellcrank.robot.formats.mjcf_compiler import Compiler, Defaults
from bellcrank.robot.formats.mjcf_element import MjcfElement
from bellcrank.robot.formats.mjcf_inertia import NOTHING, BodyInertia, InertiaReader
from bellcrank.robot.formats.mjcf_joints import MjcfJoint, check_joints, joint_of
from bellcrank.robot.formats.mjcf_placement import Array
from bellcrank.robot.formats.mjcf_shapes import SIZES, MjcfShape, geometry_of, shape_of
from bellcrank.robot.formats.urdf_file import MOST_MOVING

MOST_BODIES = 20_000  # of a file, after <replicate>
WORLD = "world"
GENERATED = ("composite", "flexcomp", "attach")  # elements that stand for bodies


@dataclass(frozen=True)
class Site:
    """A frame of a body: its name in the file, and that of its link."""

    name: str
    place: Array
    link: str = ""


@dataclass(frozen=True, kw_only=True)
class MjcfBody:
    """A body: the number of its parent among all bodies (the world's is 0, its own), and its placement there.

    It moves where a joint is between it and the world. Only then must its mass be known.
    """

    name: str
    parent: int
    place: Array
    joints: tuple[MjcfJoint, ...]
    shapes: tuple[MjcfShape, ...]
    sites: tuple[Site, ...]
    inertia: BodyInertia
    moves: bool
    has_unknown_mass: bool
    element: MjcfElement


@dataclass
class _Contents:
    """What is found in a body."""

    joints: list[MjcfJoint] = field(default_factory=list)
    shapes: list[MjcfShape] = field(default_factory=list)
    sites: list[Site] = field(default_factory=list)
    inertials: list[tuple[MjcfElement, Array]] = field(default_factory=list)
    bodies: list[tuple[MjcfElement, _Scope]] = field(default_factory=list)


@dataclass(frozen=True)
class _Scope:
    """Where an element stands: the frame (4, 4) in its body, the childclass, and what <replicate> adds to names."""

    frame: Array
    childclass: str | None
    suffix: str = ""


class BodyReader:
    """Reads the bodies of a file."""

    def __init__(self, compiler: Compiler, defaults: Defaults, inertias: InertiaReader) -> None:
        self._compiler, self._defaults, self._inertias = compiler, defaults, inertias
        self._bodies: list[MjcfBody] = []
        self._copies = self._joints = 0
        self._moves: dict[int, Array] = {}  # of the copies (n, 4, 4) that the <replicate> of an id makes

    def read(self, root: MjcfElement) -> list[MjcfBody]:
        """All bodies, parents before children, in MuJoCo's order; the first one is the world. Raises InputError."""
        worlds = list(root.find_all("worldbody"))
        if not worlds:
            raise root.fail("has no <worldbody>; at least one body was expected")
        merged = replace(worlds[0], children=tuple(child for world in worlds for child in world.children))
        self._read_body(merged, _Scope(np.eye(4), None), 0)
        if len(self._bodies) == 1:
            raise worlds[0].fail("has no <body>; at least one was expected")
        return self._bodies

    def _read_body(self, element: MjcfElement, scope: _Scope, parent: int) -> None:
        if len(self._bodies) >= MOST_BODIES:
            raise element.fail(f"there are more than {MOST_BODIES} bodies; this is too large a model")
        number, found = len(self._bodies), _Contents()
        inner = _Scope(np.eye(4), self._childclass(element, scope), scope.suffix)
        self._read_contents(element, inner, found)
        world = number == 0
        check_joints(element, found.joints, top=parent == 0 and not world, world=world)
        self._joints += len(found.joints)
        if self._joints > MOST_MOVING:
            raise element.fail(f"there are more than {MOST_MOVING} joints; this is too large a model")
        moves = bool(found.joints) or (not world and self._bodies[parent].moves)
        inertia = NOTHING if world else self._inertias.of(found.inertials, found.shapes, moves)
        body = MjcfBody(
            name=WORLD if world else _name(element, scope),
            parent=parent,
            place=np.eye(4) if world else scope.frame @ self._compiler.angles.placement(element),
            joints=tuple(found.joints),
            shapes=tuple(found.shapes),
            sites=tuple(found.sites),
            inertia=NOTHING if inertia is None else inertia,
            moves=moves,
            has_unknown_mass=inertia is None,
            element=element,
        )
        self._bodies.append(body)
        for child, outer in found.bodies:
            self._read_body(child, outer, number)

    def _childclass(self, element: MjcfElement, scope: _Scope) -> str | None:
        name = element.attributes.get("childclass")
        if name is not None:
            self._defaults.check(element, name)
        return name or scope.childclass

    def _read_contents(self, element: MjcfElement, scope: _Scope, found: _Contents) -> None:
        """Sort the children of a body, <frame> or <replicate> into `found`."""
        angles, defaults = self._compiler.angles, self._defaults
        for child in element.children:
            if child.tag == "body":
                found.bodies.append((child, scope))
            elif child.tag in ("joint", "freejoint"):
                resolved = defaults.resolved(child, "joint", scope.childclass) if child.tag == "joint" else child
                found.joints.append(joint_of(resolved, _name(child, scope), scope.frame, self._compiler))
            elif child.tag == "geom":
                found.shapes.append(shape_of(defaults.resolved(child, "geom", scope.childclass), angles, scope.frame))
            elif child.tag == "site":
                site = defaults.resolved(child, "site", scope.childclass)
                kind = site.choice("type", "sphere", *SIZES)
                has_size = "fromto" in site.attributes
                place = geometry_of(site, kind, angles)[1] if has_size else angles.placement(site)
                found.sites.append(Site(_name(child, scope), scope.frame @ place))
            elif child.tag == "inertial":
                found.inertials.append((child, scope.frame))
            elif child.tag == "frame":
                frame = scope.frame @ angles.placement(child)
                self._read_contents(child, _Scope(frame, self._childclass(child, scope), scope.suffix), found)
            elif child.tag == "replicate":
                for copy in self._copies_of(child, scope):
                    self._read_contents(child, copy, found)
            elif child.tag in GENERATED:
                raise child.fail(
                    f"<{child.tag}> is not supported; load the file with MuJoCo and save it (mj_saveLastXML), which "
                    "writes the bodies that it stands for"
                )

    def _copies_of(self, element: MjcfElement, scope: _Scope) -> Iterator[_Scope]:
        """The scopes of the copies that a <replicate> makes.

        Copy k is turned by k times the Euler angles, as in MuJoCo, which is not k turns where several angles differ
        from 0; and it is moved from the last by the offset in the axes of the last. Source: MuJoCo, XML reference,
        `replicate`.
        """
        count = element.number("count", 0.0)
        if count < 1.0 or count != int(count):
            raise element.fail(f"count: expected a whole number from 1 on, found {count:g}")
        self._copies += int(count)
        if self._copies > MOST_BODIES:
            raise element.fail(f"makes more than {MOST_BODIES} copies; this is too large a model")
        if id(element) not in self._moves:  # that of a <replicate> in another one is read for each copy
            offset, euler = (np.array(element.vector(key, (0.0, 0.0, 0.0))) for key in ("offset", "euler"))
            moves = np.tile(np.eye(4), (int(count), 1, 1))
            moves[:, :3, :3] = self._compiler.angles.euler(np.arange(count)[:, None] * euler).as_matrix()
            moves[1:, :3, 3] = np.cumsum(moves[:-1, :3, :3] @ offset, axis=0)
            self._moves[id(element)] = moves
        separator, digits = element.attributes.get("sep", ""), len(str(int(count) - 1))
        for k, frame in enumerate(scope.frame @ self._moves[id(element)]):
            yield replace(scope, frame=frame, suffix=f"{separator}{k:0{digits}d}{scope.suffix}")


def _name(element: MjcfElement, scope: _Scope) -> str:
    return element.name + scope.suffix if element.name else ""
