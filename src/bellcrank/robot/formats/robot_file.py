"""The contents of a robot file of any format, as the one record that the readers of all formats return.

A reader returns a tree as the elements of a URDF, in which joints may also have the types `spherical`, `universal` and
`screw`, and beside it what a URDF cannot say: closed loops, springs, motors, the start, and what is not modelled. The
records are neutral: `bellcrank.elements` makes constraints and forces of them. The elements stay beside the checked
links and joints that are read from them, because pictures, `check_urdf` and saved runs need what those leave out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final, Literal, NamedTuple

from bellcrank.robot.formats.urdf_elements import Vector3
from bellcrank.robot.formats.urdf_file import Urdf
from bellcrank.robot.formats.xml_tree import XmlElement

WORLD: Final = "world"  # the frame of the world, where no link has this name
LoopKind = Literal["point", "hinge", "weld", "distance", "universal", "prismatic", "planar"]


@dataclass(frozen=True)
class FramePlace:
    """A frame at `xyz` (m) and `rpy` (rad, fixed axes x, y, z) in a link or frame of the URDF, or in WORLD."""

    frame: str
    xyz: Vector3 = (0.0, 0.0, 0.0)
    rpy: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class FrameLoop:
    """A closed loop between the frames a and b.

    point: the origins coincide. weld: the frames coincide. hinge: the origins and the axes `axis` (unit vector in each
    frame) coincide. distance: the origins are `length` (m) apart. universal: the origins coincide, and `axis` of a is
    perpendicular to `axis_2` of b. prismatic: the frames coincide but for a translation along `axis`. planar: they
    coincide but for translations perpendicular to `axis` and a turn about it.
    """

    name: str
    kind: LoopKind
    a: FramePlace
    b: FramePlace
    axis: Vector3 = (0.0, 0.0, 1.0)
    length: float | None = None
    axis_2: Vector3 = (0.0, 1.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class JointCoupling:
    """A relation of joint positions, rad or m: q_joint = c₀ + c₁ q_leader + c₂ q_leader² + …

    Without a leader the joint is held at c₀.
    """

    name: str
    joint: str
    leader: str | None
    coefficients: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class JointRelation:
    """A linear relation of joint positions (rad or m), terms (joint, coefficient): Σ coefficient · q = constant."""

    name: str
    terms: tuple[tuple[str, float], ...]
    constant: float = 0.0


@dataclass(frozen=True, kw_only=True)
class FileJointSpring:
    """A spring at a joint: torque (force) = −stiffness (position − reference), N m/rad (N/m) and rad (m)."""

    joint: str
    stiffness: float
    reference: float = 0.0


@dataclass(frozen=True, kw_only=True)
class FileSphericalSpring:
    """A spring at a spherical joint: torque = −stiffness θ e, N m/rad, with the rotation vector θ e of the joint."""

    joint: str
    stiffness: float


@dataclass(frozen=True, kw_only=True)
class FrameSpring:
    """A spring with a damper between two points: tension = stiffness (l − free_length) + damping l̇, N/m, N s/m, m."""

    name: str
    a: FramePlace
    b: FramePlace
    stiffness: float
    damping: float
    free_length: float


@dataclass(frozen=True, kw_only=True)
class FrameBushing:
    """A bushing that holds the frame b at a: N m/rad, N m s/rad about roll, pitch, yaw, and N/m, N s/m along axes."""

    name: str
    a: FramePlace
    b: FramePlace
    torque_stiffness: Vector3
    torque_damping: Vector3
    force_stiffness: Vector3
    force_damping: Vector3


@dataclass(frozen=True, kw_only=True)
class JointMotor:
    """A motor at a joint: the joint turns `gear` times slower than the motor; `effort` is the largest torque or force
    at the joint (N m or N), None where the file gives none.
    """

    name: str
    joint: str
    gear: float = 1.0
    effort: float | None = None


Loop = FrameLoop | JointCoupling | JointRelation


def relation_text(loop: JointCoupling | JointRelation) -> str:
    """The expression, of joint positions, that a relation keeps at zero."""
    if isinstance(loop, JointRelation):
        terms = [(coefficient, _position(joint)) for joint, coefficient in loop.terms]
        constant = loop.constant
    else:
        constant, *powers = loop.coefficients
        terms = [(1.0, _position(loop.joint))]
        if loop.leader is not None:
            terms += [(-c, f"{_position(loop.leader)}**{k}") for k, c in enumerate(powers, 1) if c]
    text = " + ".join(f"({coefficient!r})*{term}" for coefficient, term in terms)
    return f"{text} + ({-constant!r})"


def _position(joint: str) -> str:
    return f"joint({joint!r}).position"


class Floor(NamedTuple):
    """A plane that is fixed in the world: a point (m) and its unit normal, on whose side bodies are."""

    name: str
    point: tuple[float, ...]
    normal: tuple[float, ...]


class ContactShape(NamedTuple):
    """A shape of a link that would touch floors (their numbers): its kind, size (m) as in MJCF, and place (4 × 4)."""

    name: str
    link: str
    kind: str
    size: tuple[float, ...]
    place: tuple[tuple[float, ...], ...]
    floors: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class RobotFile:
    """What a robot file says.

    Attributes:
        source: Path of the file.
        urdf: The <robot> of a URDF, with the tree and its shapes. Joint types are those of URDF, and `spherical`,
            `universal` and `screw` (attribute `pitch`, m per revolution). Lines are those of the file.
        loops: Closed loops and couplings of joints.
        loop_file: The resolved path of another file that the loops were read from, or None.
        springs: Springs at joints and between points, and bushings.
        motors: Motors at joints.
        rotor_inertia: Rotor inertia reflected to the joint, by joint, kg m² (kg for prismatic joints).
        start: Positions of joints at the start, by joint (rad or m, or all coordinates of the joint); None: not given.
        keyframe: What the file calls the start, such as "the keyframe 'home'"; empty where it does not give one.
        gravity: Acceleration of gravity in the world, m/s²; None: not given.
        notes: What the file says and is not modelled, one sentence each.
        floors: Planes that are fixed in the world.
        contacts: The shapes that would touch them.
    """

    source: Path
    urdf: XmlElement
    loops: tuple[Loop, ...] = ()
    loop_file: Path | None = None
    springs: tuple[FileJointSpring | FileSphericalSpring | FrameSpring | FrameBushing, ...] = ()
    motors: tuple[JointMotor, ...] = ()
    rotor_inertia: Mapping[str, float] = field(default_factory=dict)
    start: Mapping[str, float | tuple[float, ...]] | None = None
    keyframe: str = ""
    gravity: Vector3 | None = None
    notes: tuple[str, ...] = ()
    floors: tuple[Floor, ...] = ()
    contacts: tuple[ContactShape, ...] = ()

    @cached_property
    def tree(self) -> Urdf:
        """The links and joints, checked. Raises InputError, one sentence with file, element and line."""
        return Urdf.of(self.urdf, self.source)
