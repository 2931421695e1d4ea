"""The tree of bodies under <worldbody> of an MJCF file, by MuJoCo's rules: placements, joints, shapes, sites and names.

<frame> moves what is in it; <replicate> repeats what is in it, each copy moved from the last.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from bellcrank.arrays import Array
from bellcrank.robot.formats.mjcf_compiler import Compiler, Defaults
from bellcrank.robot.formats.mjcf_element import MjcfElement
from bellcrank.robot.formats.mjcf_shapes import (
    NOTHING,
    SIZES,
    BodyInertia,
    InertiaReader,
    MjcfShape,
    geometry_of,
    shape_of,
)
from bellcrank.robot.formats.robot_file import WORLD
from bellcrank.robot.formats.urdf_file import MOST_MOVING
from bellcrank.robot.formats.urdf_writing import Names

KINDS = ("hinge", "slide", "ball", "free")
MOVING = ("hinge", "slide")  # those of one degree of freedom
MOST_BODIES = 20_000  # of a file, after <replicate>
Start = Mapping[str, float | tuple[float, ...]]  # positions by joint
GENERATED = ("composite", "flexcomp", "attach")  # elements that stand for bodies


@dataclass(frozen=True, kw_only=True)
class MjcfJoint:
    """A joint: where it is in its body (m), its axis there (unit vector), and its numbers in rad or m.

    At the position `ref` the body is where the file places it. `effort` is the range of the actuators' sum at the
    joint; `stiffness` and `damping` have further coefficients where the file gives polynomials.
    """

    name: str
    kind: str
    pos: Array
    axis: Array
    ref: float
    spring_ref: float
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    friction: float
    armature: float
    range: tuple[float, float] | None
    effort: tuple[float, float] | None
    element: MjcfElement


def joint_of(element: MjcfElement, name: str, frame: Array, compiler: Compiler) -> MjcfJoint:
    """The joint of a resolved <joint> or a <freejoint>, in a frame (4, 4) of its body. Raises InputError."""
    kind = "free" if element.tag == "freejoint" else element.choice("type", "hinge", *KINDS)
    axis = np.array(element.vector("axis", (0.0, 0.0, 1.0)))
    length = float(np.linalg.norm(axis))
    if length < 1e-14 and kind in MOVING:
        raise element.fail("axis: has the length zero; expected a direction")
    one = kind in MOVING

    def position(key: str) -> float:
        value = element.number(key, 0.0)
        return compiler.angles.radians(value) if kind == "hinge" else value if one else 0.0

    limits = active_range(element, "range", "limited", compiler.autolimits) if kind != "free" else None
    if limits is not None and kind in ("hinge", "ball"):
        limits = compiler.angles.radians(limits[0]), compiler.angles.radians(limits[1])
    damping = element.numbers("damping", 1, 3) or (0.0,)
    if damping[0] < 0.0:
        raise element.fail(f"damping: is {damping[0]:g}, which would add energy; expected 0 or more")
    efforts = None
    if one:
        efforts = active_range(element, "actuatorfrcrange", "actuatorfrclimited", compiler.autolimits)
    return MjcfJoint(
        name=name,
        kind=kind,
        pos=(frame @ np.array([*element.vector("pos", (0.0, 0.0, 0.0)), 1.0]))[:3] if kind != "free" else np.zeros(3),
        axis=frame[:3, :3] @ axis / length if one else axis,
        ref=position("ref"),
        spring_ref=position("springref"),
        stiffness=element.numbers("stiffness", 1, 3) or (0.0,),
        damping=damping,
        friction=element.number("frictionloss", 0.0, 0.0),
        armature=element.number("armature", 0.0, 0.0),
        range=limits,
        effort=efforts,
        element=element,
    )


def check_joints(body: MjcfElement, joints: Sequence[MjcfJoint], top: bool, world: bool) -> None:
    """Raises InputError where a body cannot have these joints, by MuJoCo's rules."""
    for k, joint in enumerate(joints):
        if world:
            raise joint.element.fail("the world has no joints; put the joint into a <body>")
        if joint.kind == "free" and (len(joints) > 1 or not top):
            raise joint.element.fail("a free joint must be the only joint of a body in <worldbody>")
        if joint.kind == "ball" and any(other.kind in ("hinge", "ball") for other in joints[k + 1 :]):
            raise joint.element.fail("a ball joint followed by a rotation in the same body is not supported")
    if sum(3 if joint.kind == "ball" else 1 for joint in joints) > 6 and joints[0].kind != "free":
        raise body.fail("has more than 6 degrees of freedom; a body has at most 6")


def active_range(element: MjcfElement, key: str, limited: str, automatic: bool) -> tuple[float, float] | None:
    """The range (lower, upper) of an attribute where it holds: `limited` is "true", or it is "auto" and a range other
    than 0 0 is given with automatic limits; None for no limit. Raises InputError.
    """
    holds, found = element.choice(limited, "auto", "true", "false", "auto"), element.numbers(key, 2, 2)
    if holds == "false" or (holds == "auto" and found in (None, (0.0, 0.0))):
        return None
    if found is None or found[0] >= found[1]:
        raise element.fail(f"{key}: expected a lower and a larger upper number")
    if holds == "auto" and not automatic:
        raise element.fail(f'has {key} but not {limited}; give {limited}="true" or "false"')
    return found[0], found[1]


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


def named(bodies: Sequence[MjcfBody]) -> list[MjcfBody]:
    """The bodies, every body and joint with a name of its own, unnamed sites left out.

    MuJoCo keeps names of bodies, joints and sites apart. Bodies and sites become links of one robot: a site with the
    name of a body is the link "site NAME". Raises InputError where a name is given twice.
    """
    _check_unique([(body.name, body.element) for body in bodies])
    _check_unique([(joint.name, joint.element) for body in bodies for joint in body.joints])
    _check_unique([(site.name, body.element) for body in bodies for site in body.sites])
    links = Names([body.name for body in bodies])
    joints = Names([joint.name for body in bodies for joint in body.joints])
    result: list[MjcfBody] = []
    for body in bodies:
        name = body.name or links.new(f"{result[body.parent].name}_child")
        fitted = tuple(replace(joint, name=joint.name or joints.new(f"{name}_{joint.kind}")) for joint in body.joints)
        sites = tuple(replace(site, link=links.new(site.name, f"site {site.name}")) for site in body.sites if site.name)
        result.append(replace(body, name=name, joints=fitted, sites=sites))
    return result


def _check_unique(names: Sequence[tuple[str, MjcfElement]]) -> None:
    seen: dict[str, MjcfElement] = {}
    for name, element in names:
        if name in seen and name:
            raise element.fail(
                f"the name '{name[:80]}' is used twice, also in line {seen[name].line}; rename one of them"
            )
        seen[name] = element


def reference_posture(bodies: Sequence[MjcfBody]) -> dict[str, float | tuple[float, ...]]:
    """The positions of joints where the bodies are as the file places them, MuJoCo's qpos0."""
    start: dict[str, float | tuple[float, ...]] = {}
    for body in bodies:
        for joint in body.joints:
            if joint.kind == "free":
                start[joint.name] = (*body.place[:3, 3].tolist(), *_turn(body.place))
            else:
                start[joint.name] = (0.0, 0.0, 0.0, 1.0) if joint.kind == "ball" else joint.ref
    return start


def _turn(place: Array) -> list[float]:
    return [float(value) for value in Rotation.from_matrix(place[:3, :3]).as_quat()]
