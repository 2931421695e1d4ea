"""Motors of an MJCF file: the elements under <actuator> that act at a hinge or slide joint."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from bellcrank.messages import unknown_name
from bellcrank.notes import Note
from bellcrank.robot.formats.mjcf_element import MjcfElement
from bellcrank.robot.formats.mjcf_joints import MOVING, MjcfJoint, active_range
from bellcrank.robot.formats.mjcf_names import Names, listed
from bellcrank.robot.formats.robot_file import JointMotor

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
