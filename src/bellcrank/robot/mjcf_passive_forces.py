"""Springs, dampers, dry friction and armature of MJCF joints, those of motors and springdamper included."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from bellcrank.robot.mjcf_actuators import Motors
from bellcrank.robot.mjcf_bodies import Body
from bellcrank.robot.mjcf_joints import MOVING, MjcfJoint
from bellcrank.robot.mjcf_springdamper import has_spring_damper, with_spring_dampers
from bellcrank.robot.mjcf_start import reference_posture
from bellcrank.robot.mjcf_urdf import UrdfWriter
from bellcrank.robot.robot_file import JointSpring, SphericalSpring
from bellcrank.robot.urdf_file import Urdf


def with_passive_forces(bodies: list[Body], motors: Motors, disabled: frozenset[str], source: Path) -> list[Body]:
    """The bodies, their joints with the stiffness, damping and friction that act on them.

    `disabled` are the flags of <option> that are off. Raises InputError where a springdamper cannot be computed.
    """
    joints = joints_of(bodies)
    if any(map(has_spring_damper, joints)):
        tree = Urdf.from_text(UrdfWriter(bodies, {}, {}).text("tree"), source)
        found = with_spring_dampers(joints, tree, reference_posture(bodies), rotor_inertia(joints, motors))
        by_name = {joint.name: joint for joint in found}
        bodies = _with_joints(bodies, lambda joint: by_name[joint.name])
    bodies = _with_joints(bodies, lambda joint: _enabled(joint, disabled))
    return _with_joints(bodies, lambda joint: _with_damping(joint, motors.damping.get(joint.name, 0.0)))


def joints_of(bodies: Sequence[Body]) -> list[MjcfJoint]:
    """All joints."""
    return [joint for body in bodies for joint in body.joints]


def springs_of(joints: Sequence[MjcfJoint]) -> Iterator[JointSpring | SphericalSpring]:
    """The springs of joints."""
    for joint in joints:
        if joint.stiffness[0] and joint.kind in MOVING:
            yield JointSpring(joint=joint.name, stiffness=joint.stiffness[0], reference=joint.spring_ref)
        elif joint.stiffness[0] and joint.kind == "ball":
            yield SphericalSpring(joint=joint.name, stiffness=joint.stiffness[0])


def rotor_inertia(joints: Sequence[MjcfJoint], motors: Motors) -> dict[str, float]:
    """The armature of joints and of their motors by joint, kg m² or kg."""
    sums = {j.name: j.armature + motors.armature.get(j.name, 0.0) for j in joints if j.kind != "free"}
    return {name: value for name, value in sums.items() if value}


def _with_joints(bodies: list[Body], change: Callable[[MjcfJoint], MjcfJoint]) -> list[Body]:
    return [replace(body, joints=tuple(map(change, body.joints))) for body in bodies]


def _enabled(joint: MjcfJoint, disabled: frozenset[str]) -> MjcfJoint:
    """The joint without the passive forces that flags disable."""
    if disabled & {"spring", "passive"}:
        joint = replace(joint, stiffness=(0.0,))
    if disabled & {"damper", "passive"}:
        joint = replace(joint, damping=(0.0,))
    return replace(joint, friction=0.0) if "frictionloss" in disabled else joint


def _with_damping(joint: MjcfJoint, added: float) -> MjcfJoint:
    return replace(joint, damping=(joint.damping[0] + added, *joint.damping[1:])) if added else joint
