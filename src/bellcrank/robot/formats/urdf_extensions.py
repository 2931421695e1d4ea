"""What other programs write into a URDF beside its tree: what is read of it, and what is refused.

Read: Drake's `<drake:ball_constraint>`, `<drake:linear_spring_damper>` and `<drake:linear_bushing_rpy>`, its rotor
inertia and gear ratio in a transmission (Drake's documentation, "Parsing Models for Multibody Dynamics"), and Gazebo's
`<springStiffness>` and `<springReference>` of a joint, and its joints of type `ball` that close loops. Refused: other
elements that close a loop or add a force or a joint, because the motion would be wrong without them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from bellcrank.arrays import Array
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.formats.robot_file import FileJointSpring, FrameBushing, FrameLoop, FramePlace, FrameSpring
from bellcrank.robot.formats.urdf_elements import NUMBER, Vector3, attribute_number, attribute_vector
from bellcrank.robot.formats.xml_tree import XmlElement

Fail = Callable[[str], InputError]
BALL, SPRING, BUSHING = "drake:ball_constraint", "drake:linear_spring_damper", "drake:linear_bushing_rpy"
UNUSED = ("drake:collision_filter_group",)  # of Drake's, without effect on the motion
REFUSED = {  # what an element does that is not modelled
    "drake:tendon_constraint": "couples joints by a tendon",
    "drake:joint": "adds a joint",
    "constraint": "closes a loop",
    "loop_joints": "closes a loop",
}


def refuse_unread(robot: XmlElement, fail: Fail) -> None:
    """Raise InputError where an element closes a loop, or adds a force or a joint, and is not read."""
    for element in robot.children:
        does = REFUSED.get(element.tag)
        if does is None and element.tag.startswith("drake:") and element.tag not in (BALL, SPRING, BUSHING, *UNUSED):
            does = "is not known"
        for joint in element.find_all("joint") if element.tag == "gazebo" else ():
            name, kind = (joint.attributes.get(key, "").strip() for key in ("name", "type"))
            if kind != "ball":
                raise fail(
                    f'line {joint.line}: <gazebo> closes a loop with <joint name="{name}">, '
                    f"type {kind!r}, of which only 'ball' is read; write it as <loop_joint>, or under 'constraints' of "
                    "a scene, and remove it here"
                )
        if does is not None:
            raise fail(
                f"line {element.line}: <{element.tag}> {does}, and is not read; write it under 'constraints' or "
                "'forces' of a scene, and remove it here"
            )


def ball_constraints(robot: XmlElement, fail: Fail) -> tuple[FrameLoop, ...]:
    """Drake's ball constraints: a point of one link coincides with a point of another."""
    return tuple(
        FrameLoop(name=f"ball_constraint_{k}", kind="point", a=a, b=b)
        for k, (a, b) in enumerate((_ends(element, robot, fail) for element in robot.find_all(BALL)), start=1)
    )


def springs(robot: XmlElement, fail: Fail) -> tuple[FileJointSpring | FrameSpring | FrameBushing, ...]:
    """Drake's linear springs with dampers and bushings, and Gazebo's springs at joints."""
    found: list[FileJointSpring | FrameSpring | FrameBushing] = [*_bushings(robot, fail)]
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
            found.append(FileJointSpring(joint=name, stiffness=stiffness, reference=reference))
    return tuple(found)


def _bushings(robot: XmlElement, fail: Fail) -> Iterator[FrameBushing]:
    """Drake's bushings, between links or its <frame> elements."""
    for k, element in enumerate(robot.find_all(BUSHING), start=1):
        numbers = dict[str, Vector3]()
        for key in ("torque_stiffness", "torque_damping", "force_stiffness", "force_damping"):
            child = _child(element, key, fail, "drake:bushing")
            numbers[key] = attribute_vector(child, "value", f"<{child.tag}>", fail)
            if min(numbers[key]) < 0.0:
                raise fail(
                    f"line {child.line}: <{child.tag}>: expected numbers of 0 or more, found {min(numbers[key]):g}"
                )
        a, b = (_drake_frame(_child(element, key, fail, "drake:bushing"), robot, fail) for key in ("frameA", "frameC"))
        yield FrameBushing(name=f"bushing_{k}", a=a, b=b, **numbers)


def _drake_frame(named: XmlElement, robot: XmlElement, fail: Fail) -> FramePlace:
    """The place of a frame that an element names: a link, or one of Drake's <frame name link xyz rpy>."""
    name = named.attributes.get("name", "").strip()
    links = [link.attributes.get("name", "").strip() for link in robot.find_all("link")]
    frames = {each.attributes.get("name", "").strip(): each for each in robot.find_all("frame")}
    if name in links:
        return FramePlace(name)
    if name not in frames:
        raise fail(f"line {named.line}: <{named.tag}>: {unknown_name('frame', name, [*frames, *links])}")
    frame = frames[name]
    link = frame.attributes.get("link", "").strip()
    if link not in links:
        raise fail(f"line {frame.line}: <frame name={name!r}>: {unknown_name('link', link, links)}")
    xyz, rpy = (attribute_vector(frame, key, f"<frame name={name!r}>", fail) for key in ("xyz", "rpy"))
    return FramePlace(link, xyz, rpy)


def rotor_inertias(robot: XmlElement, fail: Fail) -> dict[str, float]:
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


def gazebo_balls(robot: XmlElement, fail: Fail) -> tuple[FrameLoop, ...]:
    """Gazebo's ball joints between links of the tree: a point of the child stays where the parent has it at first.

    The pose of the joint is one in its child link, as in SDFormat; where it is in the parent follows from the positions
    0 of all joints. Source: sdformat.org, "URDF extensions".
    """
    joints = [joint for element in robot.find_all("gazebo") for joint in element.find_all("joint")]
    if not joints:
        return ()
    from bellcrank.robot.formats.mjcf_placement import inverse
    from bellcrank.robot.formats.sdf_poses import read_pose

    links = [link.attributes.get("name", "").strip() for link in robot.find_all("link")]
    found = []
    for k, joint in enumerate(joints, start=1):
        name = joint.attributes.get("name", "").strip() or f"gazebo_joint_{k}"
        where, ends = f"joint '{name}'", list[str]()
        for tag in ("parent", "child"):
            end = joint.find(tag)
            if end is None or end.text.strip() not in links:
                told = "" if end is None else end.text.strip()
                raise fail(f"line {joint.line}: {where}, <{tag}>: {unknown_name('link', told, links)}")
            ends.append(end.text.strip())
        place, base = read_pose(joint, where, fail)
        if base not in ("", ends[1]):
            raise fail(
                f"line {joint.line}: {where}, <pose>: expected a pose in the child link '{ends[1]}', found '{base}'"
            )
        parent, child = (_at_zero(robot, link, fail) for link in ends)
        at = inverse(parent) @ child @ place
        found.append(
            FrameLoop(
                name=name,
                kind="point",
                a=FramePlace(ends[1], _vector3(place)),
                b=FramePlace(ends[0], _vector3(at)),
            )
        )
    return tuple(found)


def _at_zero(robot: XmlElement, link: str, fail: Fail) -> Array:
    """The placement (4, 4) of a link in the root link where all joints are at 0."""
    from scipy.spatial.transform import Rotation  # importing it takes as long as simulating most scenes

    from bellcrank.robot.formats.mjcf_placement import placement

    above = {}
    for joint in robot.find_all("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        if parent is not None and child is not None:
            above[child.attributes.get("link", "").strip()] = (parent.attributes.get("link", "").strip(), joint)
    place, passed = np.eye(4), set[str]()
    while link in above and link not in passed:
        passed.add(link)
        link, joint = above[link]
        origin = joint.find("origin")
        if origin is not None:
            xyz, rpy = (attribute_vector(origin, key, "<origin>", fail) for key in ("xyz", "rpy"))
            place = placement(np.array(xyz), Rotation.from_euler("xyz", rpy)) @ place
    return place


def _vector3(place: Array) -> Vector3:
    x, y, z = place[:3, 3].tolist()
    return x, y, z


def _ends(element: XmlElement, robot: XmlElement, fail: Fail) -> tuple[FramePlace, FramePlace]:
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


def _value(element: XmlElement, what: str, fail: Fail) -> float:
    child = _child(element, what, fail)
    value = attribute_number(child, "value", f"<{child.tag}>", fail)
    if value < 0.0 or (what == "free_length" and value == 0.0):
        raise fail(f"line {child.line}: <{child.tag}>: expected a number above 0, found {value:g}")
    return value


def _child(element: XmlElement, what: str, fail: Fail, stem: str = "") -> XmlElement:
    tag = f"{stem or element.tag}_{what}"
    child = element.find(tag)
    if child is None:
        raise fail(f"line {element.line}: <{element.tag}> has no <{tag}>")
    return child


def _text_number(element: XmlElement, fail: Fail) -> float:
    text = element.text.strip()
    if not NUMBER.fullmatch(text):
        raise fail(f"line {element.line}: <{element.tag}>: expected a number, found '{text:.40}'")
    return float(text)
