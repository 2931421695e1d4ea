"""Where the joints of an MJCF file start: at a keyframe, or where the file places the bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from scipy.spatial.transform import Rotation

from bellcrank.notes import Note
from bellcrank.robot.mjcf_bodies import Body
from bellcrank.robot.mjcf_element import MjcfElement
from bellcrank.robot.mjcf_placement import Array

HOME = "home"
SIZES = {"free": 7, "ball": 4, "hinge": 1, "slide": 1}
Start = Mapping[str, float | tuple[float, ...]]


def start_of(bodies: Sequence[Body], root: MjcfElement) -> tuple[Start, str, list[str]]:
    """Positions by joint (rad or m; quaternions x y z w), the title of their keyframe ("" without one), and notes.

    The keyframe "home", else the first one; without keyframes MuJoCo's qpos0, in which joints are at their `ref` and a
    free body is where the file places it. Raises InputError.
    """
    keys = [key for section in root.find_all("keyframe") for key in section.find_all("key")]
    given = [key for key in keys if "qpos" in key.attributes]
    start = reference_posture(bodies)
    if not given:
        return start, "", []
    chosen = next((key for key in given if key.attributes.get("name") == HOME), given[0])
    count = sum(SIZES[joint.kind] for body in bodies for joint in body.joints)
    values = list(chosen.numbers("qpos", count, count) or ())
    for body in bodies:
        for joint in body.joints:
            own, values = values[: SIZES[joint.kind]], values[SIZES[joint.kind] :]
            start[joint.name] = own[0] if len(own) == 1 else (*own[:-4], *_quaternion(chosen, own[-4:]))
    title = f"the keyframe '{chosen.name}'" if chosen.name else "the first keyframe"
    notes = [f"line {chosen.line}: the start is {title}."]
    if any(chosen.numbers("qvel", 1, count) or ()):
        text = f"line {chosen.line}: the velocities (qvel) of {title} are not used; the start is at rest."
        notes.append(Note(text, "changes"))
    return start, title, notes


def reference_posture(bodies: Sequence[Body]) -> dict[str, float | tuple[float, ...]]:
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


def _quaternion(key: MjcfElement, values: Sequence[float]) -> tuple[float, ...]:
    """A unit quaternion x y z w from w x y z."""
    if not any(values):
        raise key.fail("qpos: a quaternion is zero; expected a unit quaternion w x y z")
    return tuple(Rotation.from_quat([*values[1:], values[0]]).as_quat().tolist())
