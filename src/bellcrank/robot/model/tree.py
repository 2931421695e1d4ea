"""A robot's kinematic tree as plain records, in the layout that the tracer takes (cpp/tracer/tree.hpp)."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

Numbers = tuple[float, ...]


class JointPlacement(NamedTuple):
    """A frame in another one: the rotation matrix (9, row by row) and the translation (3, m)."""

    rotation: Numbers
    translation: Numbers


class TreeMimic(NamedTuple):
    """A joint that follows another, both numbered from 1: q_follower = multiplier q_leader + offset (rad or m)."""

    follower: int
    leader: int
    multiplier: float
    offset: float


@dataclass(frozen=True, kw_only=True)
class TreeJoint:
    """A joint with all that is fixed to its child link, in the joint's own frame.

    `kind` is one of joints.KINDS; `tracer_kind` and `sign` (−1: against the axis of that kind) say how the tracer
    models it. `parent` is the number of the joint before it, 0 for the world; `axis` a unit vector (zero for a joint
    of several degrees of freedom); `pitch` a screw's translation along it, m per rad; `placement` is in the parent
    joint's frame. `mass` (kg), `lever` (the centre of mass, m) and `inertia` (about it, kg m², order xx xy yy xz yz zz)
    are those of the body; `armature` (nv,) is the rotor inertia at the joint (kg m² or kg).
    """

    name: str
    kind: str
    tracer_kind: int
    sign: float
    parent: int
    nq: int
    nv: int
    axis: Numbers
    placement: JointPlacement
    mass: float
    lever: Numbers
    inertia: Numbers
    armature: Numbers
    pitch: float = 0.0


@dataclass(frozen=True, kw_only=True)
class TreeFrame:
    """A frame of the tree: a link, a joint, or a frame that the user added, with the link's own mass.

    `parent_frame` is a frame's number (−1 for the first frame), `parent_joint` that of the joint it moves with (0 for
    the world) and `moving_joint` that of the joint whose frame it is (−1 for none). `placement` is in the frame of
    `parent_joint`, `in_parent` and `rpy` (rad) in the parent frame; `mass`, `lever` and `inertia` are as in TreeJoint,
    in this frame.
    """

    name: str
    is_joint: bool
    is_body: bool
    parent_frame: int
    parent_joint: int
    moving_joint: int
    placement: JointPlacement
    in_parent: JointPlacement
    rpy: Numbers
    mass: float
    lever: Numbers
    inertia: Numbers


@dataclass(frozen=True)
class Tree:
    """Joints (without the world; mimicking ones too), frames (the world first) and mimics, each parent before its
    children; and how many numbers cleaning made exact, and by how much at most.
    """

    joints: tuple[TreeJoint, ...]
    frames: tuple[TreeFrame, ...]
    mimics: tuple[TreeMimic, ...] = ()
    cleaned_entries: int = 0
    cleaned_largest: float = 0.0

    # ---- as JSON

    def to_json(self) -> str:
        """The tree as JSON text, the same text for the same tree."""
        return json.dumps(self, default=vars, sort_keys=True)

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Tree:
        """The tree of what `to_json` wrote, parsed. Raises KeyError, TypeError or ValueError for anything else."""
        return cls(
            tuple(TreeJoint(**_record(joint, ("placement",))) for joint in data["joints"]),
            tuple(TreeFrame(**_record(frame, ("placement", "in_parent"))) for frame in data["frames"]),
            tuple(TreeMimic(*mimic) for mimic in data["mimics"]),
            data["cleaned_entries"],
            data["cleaned_largest"],
        )

    # ---- look-up

    def frame_index(self, name: str) -> int | None:
        """The number of the frame of that name, a link before a joint of the same name; None where there is none."""
        found = [k for k, frame in enumerate(self.frames) if frame.name == name]
        return min(found, key=lambda k: self.frames[k].is_joint) if found else None

    def supporting_joints(self, frame: int) -> tuple[int, ...]:
        """The numbers (from 1) of the joints between a frame, given by its number, and the world; outermost first."""
        joint, found = self.frames[frame].parent_joint, []
        while joint > 0:
            found.append(joint)
            joint = self.joints[joint - 1].parent
        return tuple(found)

    def followers(self) -> frozenset[int]:
        """The numbers (from 1) of joints that mimic others."""
        return frozenset(mimic.follower for mimic in self.mimics)

    def massive_frames(self) -> list[int]:
        """The numbers of the frames of moving links and payloads that have mass or inertia of their own."""
        return [
            k
            for k, frame in enumerate(self.frames)
            if frame.parent_joint > 0 and (frame.mass > 0.0 or any(x != 0.0 for x in frame.inertia))
        ]

    def moved_with(
        self, joints: Iterable[int], set_masses: Mapping[int, float] | None = None
    ) -> tuple[list[str], float]:
        """The links that move when these joints (numbered from 1) and their followers do, and their mass, kg.

        `set_masses` are masses, kg, that frames, by number, have instead of their own.
        """
        leading = set(joints)
        moving = {*leading, *(m.follower for m in self.mimics if m.leader in leading and m.multiplier != 0.0)}
        mass = 0.0
        for k, joint in enumerate(self.joints, 1):
            if k in moving or joint.parent in moving:
                moving.add(k)
                mass += joint.mass
        names = [frame.name for frame in self.frames if frame.is_body and frame.parent_joint in moving]
        if not set_masses:
            return names, mass
        masses = [set_masses.get(k, f.mass) for k, f in enumerate(self.frames) if f.parent_joint in moving]
        return names, float(sum(masses))

    # ---- variants

    def with_armature(self, armature: Mapping[str, float]) -> Tree:
        """The tree with rotor inertia (kg m² or kg) at the joints named; about each axis of a spherical joint."""
        if not armature:
            return self
        joints = (
            replace(joint, armature=(float(armature[joint.name]),) * joint.nv) if joint.name in armature else joint
            for joint in self.joints
        )
        return replace(self, joints=tuple(joints))

    def without_rotors(self) -> Tree:
        """The tree without rotor inertia at any joint."""
        return replace(self, joints=tuple(replace(joint, armature=(0.0,) * joint.nv) for joint in self.joints))


def _record(data: Mapping[str, Any], placements: tuple[str, ...]) -> dict[str, Any]:
    """The fields of a record: lists as tuples, placements as such."""
    fields = {key: tuple(value) if type(value) is list else value for key, value in data.items()}
    for key in placements:
        rotation, translation = fields[key]
        fields[key] = JointPlacement(tuple(rotation), tuple(translation))
    return fields
