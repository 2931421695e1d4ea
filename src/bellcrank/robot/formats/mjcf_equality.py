"""Closed loops and couplings of an MJCF file: <connect>, <weld>, <joint> and <tendon> under <equality>.

A constraint between bodies holds in the posture in which the file places them, MuJoCo's qpos0; one between sites lets
the sites coincide. MuJoCo's documentation, "XML Reference", section "equality".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.polynomial import Polynomial
from scipy.spatial.transform import Rotation

from bellcrank.arrays import Array
from bellcrank.messages import unknown_name
from bellcrank.notes import Note
from bellcrank.robot.formats.mjcf_bodies import MOVING, MjcfBody, MjcfJoint
from bellcrank.robot.formats.mjcf_element import MjcfElement
from bellcrank.robot.formats.mjcf_placement import inverse, placement, roll_pitch_yaw, translation, vector
from bellcrank.robot.formats.robot_file import (
    WORLD,
    FrameLoop,
    FramePlace,
    JointCoupling,
    JointRelation,
    Loop,
    LoopKind,
)
from bellcrank.robot.formats.urdf_writing import Names

Tendon = tuple[tuple[str, float], ...]  # (joint, coefficient) of a fixed tendon
READ = ("connect", "weld", "joint", "tendon")
UNMODELLED = "under <equality> is not modelled"
SIDES = ("body1", "site1", "joint1", "body2", "site2", "joint2", "tendon1", "tendon2")


class EqualityReader:
    """Reads the constraints between named bodies, whose sites and joints have their own names in the file."""

    def __init__(self, bodies: Sequence[MjcfBody], tendons: Mapping[str, Tendon]) -> None:
        self._tendons = tendons
        self._joints = {joint.name: joint for body in bodies for joint in body.joints}
        self._places: dict[str, Array] = {}  # of bodies in the world, in the posture of the file
        self._sites: dict[str, tuple[str, Array]] = {}
        for body in bodies:
            above = self._places[bodies[body.parent].name] if self._places else np.eye(4)
            self._places[body.name] = above @ body.place
            for site in body.sites:
                self._sites[site.name] = (body.name, site.place)

    def read(self, elements: Sequence[MjcfElement]) -> tuple[list[Loop], list[str]]:
        """The constraints of resolved elements, and a sentence about each that is not modelled. Raises InputError."""
        loops: list[Loop] = []
        notes: list[str] = []
        names = Names([element.name for element in elements])
        for element in elements:
            ends = [element.attributes[key] for key in SIDES if key in element.attributes]
            name = element.name or names.new("_".join([element.tag, *ends]))
            if element.tag not in READ or not self._is_linear(element):
                text = f"line {element.line}: the constraint <{element.tag}> {UNMODELLED}."
                notes.append(Note(text, "changes", "loop"))
            elif not element.flag("active", True):
                notes.append(f"line {element.line}: the <{element.tag}> '{name}' is inactive and left out.")
            elif element.tag == "joint":
                loops.append(self._coupling(name, element))
            elif element.tag == "tendon":
                loops.append(self._relation(name, element))
            else:
                loops.append(self._frames(name, element))
        return loops, notes

    def _frames(self, name: str, element: MjcfElement) -> FrameLoop:
        kind: LoopKind = "point" if element.tag == "connect" else "weld"
        if "site1" in element.attributes or "site2" in element.attributes:
            if "body1" in element.attributes or "body2" in element.attributes:
                raise element.fail("names sites and bodies; name two sites, or bodies")
            a, b = (self._sites[self._known(element, key, self._sites, "site")] for key in ("site1", "site2"))
        else:
            one = self._known(element, "body1", self._places, "body")
            two = self._known(element, "body2", self._places, "body") if "body2" in element.attributes else WORLD
            there = inverse(self._places[one]) @ self._places[two]  # body 2 in body 1
            if element.tag == "connect":
                element.required("anchor")
                anchor = translation(np.array(element.vector("anchor", (0.0, 0.0, 0.0))))
                a, b = (one, anchor), (two, inverse(there) @ anchor)
            else:
                anchor = translation(np.array(element.vector("anchor", (0.0, 0.0, 0.0))))
                a, b = (one, _relative_pose(element, there @ anchor)), (two, anchor)
        if a[0] == b[0]:
            raise element.fail("constrains a body to itself; name two bodies")
        if element.tag == "weld" and element.number("torquescale", 1.0) == 0.0:
            kind = "point"  # MuJoCo scales the rotation in the residual by it
        return FrameLoop(name=name, kind=kind, a=_place(*a), b=_place(*b))

    def _coupling(self, name: str, element: MjcfElement) -> JointCoupling:
        """q₁ − ref₁ = p(q₂ − ref₂), multiplied out to powers of q₂."""
        given = element.numbers("polycoef", 1, 5) or ()
        own = Polynomial([*given, *(0.0, 1.0, 0.0, 0.0, 0.0)[len(given) :]])
        joint, leader = self._one(element, "joint1"), None
        if "joint2" in element.attributes:
            leader = self._one(element, "joint2")
            if leader is joint:
                raise element.fail("couples a joint to itself; name two joints")
            found = own(Polynomial([-leader.ref, 1.0])) + joint.ref
        else:
            found = Polynomial([own.coef[0] + joint.ref])
        coefficients = tuple(float(value) for value in np.trim_zeros(found.coef, "b")) or (0.0,)
        return JointCoupling(
            name=name, joint=joint.name, leader=None if leader is None else leader.name, coefficients=coefficients
        )

    def _is_linear(self, element: MjcfElement) -> bool:
        """Whether a <tendon> is a linear relation of hinge and slide joints; true for other elements."""
        if element.tag != "tendon":
            return True
        tendons = [
            self._tendons.get(element.attributes[key]) for key in ("tendon1", "tendon2") if key in element.attributes
        ]
        return bool(tendons) and all(tendons) and not any((element.numbers("polycoef", 1, 5) or ())[2:])

    def _relation(self, name: str, element: MjcfElement) -> JointRelation:
        """L₁ − L₁(ref) = c₀ + c₁ (L₂ − L₂(ref)) of fixed tendons, whose lengths L are sums of coefficient · q."""
        given = element.numbers("polycoef", 1, 5) or ()
        constant, slope, *_ = (*given, *(0.0, 1.0)[len(given) :])
        terms = dict.fromkeys(self._joints, 0.0)
        for key, factor in (("tendon1", 1.0), ("tendon2", -slope)):
            for joint, coefficient in self._tendons.get(element.attributes.get(key, ""), ()):
                if joint not in self._joints:
                    raise element.fail(f"{key}: {unknown_name('joint', joint, self._joints)}")
                if self._joints[joint].kind not in MOVING:
                    raise element.fail(f"{key}: the joint '{joint}' is not a hinge or slide")
                terms[joint] += factor * coefficient
        used = tuple((joint, value) for joint, value in terms.items() if value)
        return JointRelation(
            name=name, terms=used, constant=constant + sum(value * self._joints[joint].ref for joint, value in used)
        )

    def _one(self, element: MjcfElement, key: str) -> MjcfJoint:
        joint = self._joints[self._known(element, key, self._joints, "joint")]
        if joint.kind not in MOVING:
            raise element.fail(f"{key}: the joint '{joint.name}' is a {joint.kind} joint; expected a hinge or slide")
        return joint

    def _known(self, element: MjcfElement, key: str, known: Mapping[str, object], kind: str) -> str:
        name = element.required(key)
        if name not in known:
            raise element.fail(f"{key}: {unknown_name(kind, name, known)}")
        return name


def fixed_tendons(root: MjcfElement) -> dict[str, Tendon]:
    """The <fixed> tendons of a file by name. Raises InputError."""
    return {
        tendon.name: tuple((part.required("joint"), part.number("coef", 1.0)) for part in tendon.find_all("joint"))
        for section in root.find_all("tendon")
        for tendon in section.find_all("fixed")
    }


def _relative_pose(element: MjcfElement, there: Array) -> Array:
    """The placement in body 1 of body 2's anchor, with the axes of body 2, that `relpose` gives; `there` where its
    quaternion is zero or it is missing.
    """
    x, y, z, *quaternion = element.vector("relpose", (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    if not any(quaternion):
        return there
    return placement(np.array([x, y, z]), Rotation.from_quat([*quaternion[1:], quaternion[0]]))


def _place(frame: str, place: Array) -> FramePlace:
    return FramePlace(frame, vector(place[:3, 3]), roll_pitch_yaw(place[:3, :3]))
