"""What acts at the joints of an MJCF file: motors (<actuator>), springs, dampers, dry friction and armature."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bellcrank.messages import unknown_name
from bellcrank.notes import Note
from bellcrank.numerics import LARGEST
from bellcrank.robot.formats.mjcf_bodies import MOVING, MjcfBody, MjcfJoint, Start, active_range, reference_posture
from bellcrank.robot.formats.mjcf_element import MjcfElement
from bellcrank.robot.formats.mjcf_urdf import BodyWriter
from bellcrank.robot.formats.robot_file import FileJointSpring, FileSphericalSpring, JointMotor
from bellcrank.robot.formats.urdf_file import Urdf
from bellcrank.robot.formats.urdf_writing import Names, listed
from bellcrank.robot.model.payload import LoadOptions
from bellcrank.robot.model.pinocchio_model import pinocchio_model

PLACES = ("joint", "jointinparent", "tendon", "slidersite", "cranksite", "site", "body")
CONTROLLED = (
    "position", "velocity", "intvelocity", "orientation", "pid", "damper", "cylinder", "muscle", "dcmotor", "plugin",
)  # fmt: skip


@dataclass(frozen=True)
class Motors:
    """The motors, and by joint what they add there: armature (kg m² or kg) and damping (N m s/rad or N s/m)."""

    motors: tuple[JointMotor, ...]
    armature: Mapping[str, float]
    damping: Mapping[str, float]
    notes: tuple[str, ...]

    def effort(self, joint: MjcfJoint) -> float | None:
        """The largest torque or force of all motors at a joint; None where it is not limited."""
        here = [motor.effort for motor in self.motors if motor.joint == joint.name]
        known = [effort for effort in here if effort is not None]
        bounds = [sum(known)] if here and len(known) == len(here) else []
        if joint.effort is not None:
            bounds.append(max(abs(bound) for bound in joint.effort))
        return min(bounds, default=None)


def read_motors(elements: Sequence[MjcfElement], joints: Mapping[str, MjcfJoint], autolimits: bool) -> Motors:
    """The motors of resolved elements under <actuator>. Raises InputError."""
    motors: list[JointMotor] = []
    added: tuple[dict[str, float], dict[str, float]] = (defaultdict(float), defaultdict(float))
    elsewhere: list[str] = []
    acting = False  # one of them, without an input
    controlled: dict[str, str] = {}  # its joint
    names = Names([element.name for element in elements])
    for element in elements:
        name = element.name or names.new(element.tag)
        joint = _joint_of(element, joints)
        if joint is None or joint.kind not in MOVING:
            where = next((key for key in PLACES if key in element.attributes), "nothing")
            elsewhere.append(f"{name}: {where if joint is None else f'{joint.kind} joint'}")
            acting = acting or element.tag in CONTROLLED or _is_controlled(element)
            continue
        if element.tag in CONTROLLED or _is_controlled(element):
            controlled[name] = joint.name
        gear = (element.numbers("gear", 1, 6) or (1.0,))[0]
        for sums, key in zip(added, ("armature", "damping"), strict=True):
            sums[joint.name] += gear * gear * (element.numbers(key, 1, 3) or (0.0,))[0]
        motors.append(JointMotor(name=name, joint=joint.name, gear=gear, effort=_effort(element, gear, autolimits)))
    notes = []
    if elsewhere:
        text = f"actuators that do not act on a hinge or slide joint are not modelled ({listed(elsewhere)})."
        notes.append(Note(text, "changes", "force" if acting else ""))
    if controlled:
        text = f"actuators with a control or dynamics of their own are motors without it ({listed([*controlled])})."
        notes.append(Note(text, "changes", "servo", dict.fromkeys(controlled.values())))
    return Motors(tuple(motors), *added, tuple(notes))


def _joint_of(element: MjcfElement, joints: Mapping[str, MjcfJoint]) -> MjcfJoint | None:
    key = "joint" if "joint" in element.attributes else "jointinparent"
    if key not in element.attributes:
        return None
    name = element.required(key)
    if name not in joints:
        raise element.fail(f"{key}: {unknown_name('joint', name, joints)}")
    return joints[name]


def _is_controlled(element: MjcfElement) -> bool:
    """Whether a <general> has dynamics, or a force that depends on the joint's state."""
    plain = {"dyntype": "none", "gaintype": "fixed", "biastype": "none"}
    return element.tag == "general" and any(element.attributes.get(key, text) != text for key, text in plain.items())


def _effort(element: MjcfElement, gear: float, autolimits: bool) -> float | None:
    """The largest torque or force at the joint that forcerange and, of a plain motor, ctrlrange allow."""
    bounds = []
    force = active_range(element, "forcerange", "forcelimited", autolimits)
    if force is not None:
        bounds.append(max(abs(value) for value in force))
    if element.tag in ("motor", "general") and not _is_controlled(element):
        control = active_range(element, "ctrlrange", "ctrllimited", autolimits)
        gain = (element.numbers("gainprm", 1, 30) or (1.0,))[0] if element.tag == "general" else 1.0
        if control is not None:
            bounds.append(max(abs(gain * value) for value in control))
    return min(bounds) * abs(gear) if bounds else None


# ---- Springs, dampers, dry friction and armature of MJCF joints, those of motors and springdamper included.


def with_passive_forces(
    bodies: list[MjcfBody], motors: Motors, disabled: frozenset[str], source: Path
) -> list[MjcfBody]:
    """The bodies, their joints with the stiffness, damping and friction that act on them.

    `disabled` are the flags of <option> that are off. Raises InputError where a springdamper cannot be computed.
    """
    joints = joints_of(bodies)
    if any(map(has_spring_damper, joints)):
        tree = Urdf.of(BodyWriter(bodies, None, {}).robot("tree"), source)
        found = with_spring_dampers(joints, tree, reference_posture(bodies), rotor_inertia(joints, motors))
        by_name = {joint.name: joint for joint in found}
        bodies = _with_joints(bodies, lambda joint: by_name[joint.name])
    bodies = _with_joints(bodies, lambda joint: _enabled(joint, disabled))
    return _with_joints(bodies, lambda joint: _with_damping(joint, motors.damping.get(joint.name, 0.0)))


def joints_of(bodies: Sequence[MjcfBody]) -> list[MjcfJoint]:
    """All joints."""
    return [joint for body in bodies for joint in body.joints]


def springs_of(joints: Sequence[MjcfJoint]) -> Iterator[FileJointSpring | FileSphericalSpring]:
    """The springs of joints."""
    for joint in joints:
        if joint.stiffness[0] and joint.kind in MOVING:
            yield FileJointSpring(joint=joint.name, stiffness=joint.stiffness[0], reference=joint.spring_ref)
        elif joint.stiffness[0] and joint.kind == "ball":
            yield FileSphericalSpring(joint=joint.name, stiffness=joint.stiffness[0])


def rotor_inertia(joints: Sequence[MjcfJoint], motors: Motors) -> dict[str, float]:
    """The armature of joints and of their motors by joint, kg m² or kg."""
    sums = {j.name: j.armature + motors.armature.get(j.name, 0.0) for j in joints if j.kind != "free"}
    return {name: value for name, value in sums.items() if value}


def _with_joints(bodies: list[MjcfBody], change: Callable[[MjcfJoint], MjcfJoint]) -> list[MjcfBody]:
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


def has_spring_damper(joint: MjcfJoint) -> bool:
    """Whether a joint has a springdamper that MuJoCo uses: two positive numbers. Raises InputError."""
    given = joint.element.numbers("springdamper", 2, 2)
    return given is not None and min(given) > 0.0 and joint.kind != "free"


def with_spring_dampers(
    joints: Sequence[MjcfJoint], urdf: Urdf, posture: Start, armature: Mapping[str, float]
) -> list[MjcfJoint]:
    """The joints; the springdamper of a joint gives its stiffness and damping, of a time constant and a damping ratio.

    MuJoCo's documentation, "XML Reference", body/joint: with the inertia I that the joint feels in the posture of the
    file, stiffness = I / (T² ζ²) and damping = 2 I / T for the time constant T and the damping ratio ζ. As in MuJoCo,
    1/I is the joint's entry on the diagonal of M⁻¹, for a ball joint the mean of its three entries.
    `urdf` is the tree, `posture` that of the file by joint, `armature` the rotor inertia by joint. Raises InputError.
    """
    inertia = _inertias(joints, urdf, posture, armature)
    result = []
    for joint in joints:
        if has_spring_damper(joint):
            time, ratio = joint.element.numbers("springdamper", 2, 2) or (1.0, 1.0)
            felt = inertia[joint.name]
            if not (felt / LARGEST < (time * ratio) ** 2 and felt / LARGEST < time):
                raise joint.element.fail(f"springdamper {time:g} {ratio:g} gives a stiffness above {LARGEST:g}")
            joint = replace(joint, stiffness=(felt / (time * ratio) ** 2,), damping=(2.0 * felt / time,))
        result.append(joint)
    return result


def _inertias(
    joints: Sequence[MjcfJoint], urdf: Urdf, posture: Start, armature: Mapping[str, float]
) -> dict[str, float]:
    """The inertia (kg m² or kg) that each joint feels in a posture."""
    import pinocchio as pin

    model = pinocchio_model(urdf, LoadOptions(clean=False), mimic=False)[0]
    q, own = pin.neutral(model), np.zeros(model.nv)
    places = {}
    for joint in joints:
        moving = model.joints[model.getJointId(joint.name)]
        q[moving.idx_q : moving.idx_q + moving.nq] = posture[joint.name]
        places[joint.name] = slice(moving.idx_v, moving.idx_v + moving.nv)
        own[places[joint.name]] = armature.get(joint.name, 0.0)
    mass = np.array(pin.crba(model, model.createData(), q))
    mass = np.triu(mass) + np.triu(mass, 1).T + np.diag(own)
    try:
        inverse = np.diagonal(np.linalg.inv(mass))
    except np.linalg.LinAlgError:
        inverse = np.zeros(model.nv)
    if not (np.isfinite(inverse).all() and (inverse > 0.0).all()):
        first = next(joint for joint in joints if has_spring_damper(joint))
        raise first.element.fail("springdamper needs the inertia of all joints, and some joint moves no mass")
    return {name: 1.0 / float(inverse[place].mean()) for name, place in places.items()}
