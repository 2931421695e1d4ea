"""What other programs write into a URDF beside its tree: what is read of it, and what is refused.

Read: Drake's `<drake:ball_constraint>` and `<drake:linear_spring_damper>`, its rotor inertia and gear ratio in a
transmission (Drake's documentation, "Parsing Models for Multibody Dynamics"), and Gazebo's `<springStiffness>` and
`<springReference>` of a joint. Refused: other elements that close a loop or add a force or a joint, because the motion
would be wrong without them.
"""

from __future__ import annotations

from collections.abc import Callable

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.robot_file import FrameLoop, FramePlace, FrameSpring, JointSpring
from bellcrank.robot.urdf_elements import NUMBER, attribute_number, attribute_vector
from bellcrank.robot.xml_tree import Element

Fail = Callable[[str], InputError]
BALL, SPRING = "drake:ball_constraint", "drake:linear_spring_damper"
UNUSED = ("drake:collision_filter_group",)  # of Drake's, without effect on the motion
REFUSED = {  # what an element does that is not modelled
    "drake:linear_bushing_rpy": "adds a bushing",
    "drake:tendon_constraint": "couples joints by a tendon",
    "drake:joint": "adds a joint",
    "constraint": "closes a loop",
    "loop_joints": "closes a loop",
}


def refuse_unread(robot: Element, fail: Fail) -> None:
    """Raise InputError where an element closes a loop, or adds a force or a joint, and is not read."""
    for element in robot.children:
        does = REFUSED.get(element.tag)
        if does is None and element.tag.startswith("drake:") and element.tag not in (BALL, SPRING, *UNUSED):
            does = "is not known"
        if element.tag == "gazebo" and (joint := element.find("joint")) is not None:
            raise fail(
                f'line {joint.line}: <gazebo> closes a loop with <joint name="{joint.attributes.get("name", "")}">, '
                "which is not read; write it as <loop_joint>, or under 'constraints' of a scene, and remove it here"
            )
        if does is not None:
            raise fail(
                f"line {element.line}: <{element.tag}> {does}, and is not read; write it under 'constraints' or "
                "'forces' of a scene, and remove it here"
            )


def ball_constraints(robot: Element, fail: Fail) -> tuple[FrameLoop, ...]:
    """Drake's ball constraints: a point of one link coincides with a point of another."""
    return tuple(
        FrameLoop(name=f"ball_constraint_{k}", kind="point", a=a, b=b)
        for k, (a, b) in enumerate((_ends(element, robot, fail) for element in robot.find_all(BALL)), start=1)
    )


def springs(robot: Element, fail: Fail) -> tuple[JointSpring | FrameSpring, ...]:
    """Drake's linear springs with dampers, and Gazebo's springs at joints."""
    found: list[JointSpring | FrameSpring] = []
    for k, element in enumerate(robot.find_all(SPRING), start=1):
        a, b = _ends(element, robot, fail)
        stiffness, damping, length = (_value(element, what, fail) for what in ("stiffness", "damping", "free_length"))
        found.append(
            FrameSpring(name=f"spring_damper_{k}", a=a, b=b, stiffness=stiffness, damping=damping, free_length=length)
        )
    joints = [joint.attributes.get("name", "").strip() for joint in robot.find_all("joint")]
    for element in robot.find_all("gazebo"):
        stiff, rest = element.find("springStiffness"), element.find("springReference")
        if stiff is None:
            continue
        name = element.attributes.get("reference", "").strip()
        if name not in joints:
            raise fail(f"line {stiff.line}: <gazebo>, <springStiffness>: {unknown_name('joint', name, joints)}")
        stiffness = _text_number(stiff, fail)
        if stiffness != 0.0:
            reference = 0.0 if rest is None else _text_number(rest, fail)
            found.append(JointSpring(joint=name, stiffness=stiffness, reference=reference))
    return tuple(found)


def rotor_inertias(robot: Element, fail: Fail) -> dict[str, float]:
    """Rotor inertia times the square of the gear ratio, by joint, as Drake's transmissions state it, kg m² (kg)."""
    found: dict[str, float] = {}
    for element in robot.find_all("transmission"):
        joint, actuator = element.find("joint"), element.find("actuator")
        inertia = None if actuator is None else actuator.find("drake:rotor_inertia")
        if joint is None or actuator is None or inertia is None:
            continue
        gear = actuator.find("drake:gear_ratio")
        ratio = 1.0 if gear is None else attribute_number(gear, "value", "<drake:gear_ratio>", fail)
        size = attribute_number(inertia, "value", "<drake:rotor_inertia>", fail)
        if size < 0.0:
            raise fail(f"line {inertia.line}: <drake:rotor_inertia>: expected a number of 0 or more, found {size:g}")
        found[joint.attributes.get("name", "").strip()] = size * ratio * ratio
    return found


def _ends(element: Element, robot: Element, fail: Fail) -> tuple[FramePlace, FramePlace]:
    """The point P of body A and the point Q of body B."""
    links = [link.attributes.get("name", "").strip() for link in robot.find_all("link")]
    places = []
    for body, point in (("body_A", "p_AP"), ("body_B", "p_BQ")):
        named, at = _child(element, body, fail), _child(element, point, fail)
        link = named.attributes.get("name", "").strip()
        if link not in links:
            raise fail(f"line {named.line}: <{named.tag}>: {unknown_name('link', link, links)}")
        places.append(FramePlace(link, attribute_vector(at, "value", f"<{at.tag}>", fail)))
    return places[0], places[1]


def _value(element: Element, what: str, fail: Fail) -> float:
    child = _child(element, what, fail)
    value = attribute_number(child, "value", f"<{child.tag}>", fail)
    if value < 0.0 or (what == "free_length" and value == 0.0):
        raise fail(f"line {child.line}: <{child.tag}>: expected a number above 0, found {value:g}")
    return value


def _child(element: Element, what: str, fail: Fail) -> Element:
    tag = f"{element.tag}_{what}"
    child = element.find(tag)
    if child is None:
        raise fail(f"line {element.line}: <{element.tag}> has no <{tag}>")
    return child


def _text_number(element: Element, fail: Fail) -> float:
    text = element.text.strip()
    if not NUMBER.fullmatch(text):
        raise fail(f"line {element.line}: <{element.tag}>: expected a number, found '{text:.40}'")
    return float(text)
