"""Reads MJCF, the XML of MuJoCo: bodies and joints as a URDF, and beside it loops, springs, motors and the start.

The meaning of elements: MuJoCo's documentation, "XML Reference" and "Modeling". Constraints are exact here, where
MuJoCo's are soft; contacts, tendons and controllers are not modelled. What is not used is listed in the notes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from bellcrank.files.access import FileAccess
from bellcrank.notes import Note
from bellcrank.robot.formats.mjcf_bodies import BodyReader, MjcfBody, Start, named, reference_posture
from bellcrank.robot.formats.mjcf_compiler import Compiler, Defaults, disabled_flags, gravity_of
from bellcrank.robot.formats.mjcf_element import MjcfElement, read_mjcf_elements
from bellcrank.robot.formats.mjcf_equality import EqualityReader, fixed_tendons
from bellcrank.robot.formats.mjcf_forces import joints_of, read_motors, rotor_inertia, springs_of, with_passive_forces
from bellcrank.robot.formats.mjcf_meshes import MjcfMeshes
from bellcrank.robot.formats.mjcf_notes import notes_of
from bellcrank.robot.formats.mjcf_shapes import SIZES, InertiaReader, MjcfShape, total_scale
from bellcrank.robot.formats.mjcf_urdf import BodyWriter, Visuals
from bellcrank.robot.formats.robot_file import ContactShape, Floor, RobotFile


def read_mjcf(text: str, source: Path, access: FileAccess) -> RobotFile:
    """Read an MJCF text.

    Args:
        text: Contents of the file.
        source: Its path, for messages.
        access: Which files it may name.

    Returns:
        The robot. Coordinates of joints are MuJoCo's, but quaternions are x y z w.

    Raises:
        InputError: The file is not valid MJCF, or has bodies that cannot be read; the message names file and line.
    """
    root = read_mjcf_elements(text, source, access)
    if root.tag != "mujoco":
        raise root.fail("is the root element; an MJCF file's <mujoco> was expected")
    compiler, defaults = Compiler.of(root.find_all("compiler")), Defaults(root)
    meshes, disabled = MjcfMeshes(root, compiler, defaults, source, access), disabled_flags(root)
    bodies = _with_total_mass(
        named(BodyReader(compiler, defaults, InertiaReader(compiler, meshes)).read(root)), compiler
    )
    actuators = [defaults.resolved(each, "actuator") for part in root.find_all("actuator") for each in part.children]
    motors = read_motors(actuators, {joint.name: joint for joint in joints_of(bodies)}, compiler.autolimits)
    bodies = with_passive_forces(bodies, motors, disabled, source)
    equalities = [defaults.resolved(each, "equality") for part in root.find_all("equality") for each in part.children]
    loops, loop_notes = EqualityReader(bodies, fixed_tendons(root)).read(equalities)
    if "equality" in disabled and loops:
        loops, loop_notes = [], ["the constraints under <equality> are disabled by <option><flag> and left out."]
    start, keyframe, start_notes = start_of(bodies, root)
    visuals = Visuals(root, defaults, meshes)
    joints = joints_of(bodies)
    efforts = {joint.name: effort for joint in joints if (effort := motors.effort(joint)) is not None}
    urdf = BodyWriter(bodies, visuals, efforts).robot(root.attributes.get("model", "") or source.stem)
    floors, contacts = floors_of(bodies)
    return RobotFile(
        source=source,
        urdf=urdf,
        floors=floors,
        contacts=contacts,
        loops=tuple(loops),
        springs=tuple(springs_of(joints)),
        motors=motors.motors,
        rotor_inertia=rotor_inertia(joints, motors),
        start=start,
        keyframe=keyframe,
        gravity=gravity_of(root),
        notes=(*start_notes, *loop_notes, *motors.notes, *notes_of(root, bodies, visuals, meshes)),
    )


def _with_total_mass(bodies: list[MjcfBody], compiler: Compiler) -> list[MjcfBody]:
    scale = total_scale([body.inertia for body in bodies], compiler)
    return bodies if scale == 1.0 else [replace(body, inertia=body.inertia.scaled(scale)) for body in bodies]


KINDS: Final = ("sphere", "capsule", "cylinder", "box", "ellipsoid")  # whose lowest points are computed


def floors_of(bodies: Sequence[MjcfBody]) -> tuple[tuple[Floor, ...], tuple[ContactShape, ...]]:
    """The planes fixed in the world, and the shapes of moving bodies that MuJoCo lets collide with one of them.

    Two shapes collide where the bits of `contype` of one and `conaffinity` of the other have one in common. Source:
    MuJoCo, Computation, collision detection. Meshes and shapes fitted to them are not looked at.
    """
    places: list[np.ndarray] = []
    for body in bodies:
        places.append(places[body.parent] @ body.place if places else np.eye(4))
    planes = [
        (shape, places[k] @ shape.place)
        for k, body in enumerate(bodies)
        if not body.moves
        for shape in body.shapes
        if shape.kind == "plane"
    ]
    touching: list[ContactShape] = []
    touched: set[int] = set()
    for body in bodies:
        for shape in body.shapes if body.moves else ():
            if shape.kind not in KINDS or shape.mesh is not None or len(shape.size) != SIZES[shape.kind][0]:
                continue
            met = [k for k, (plane, _) in enumerate(planes) if _collide(shape, plane)]
            if met:
                touched.update(met)
                named = shape.element.name or shape.kind
                touching.append(ContactShape(named, body.name, shape.kind, shape.size, _rows(shape.place), tuple(met)))
    floors = tuple(
        Floor(plane.element.name or f"plane in line {plane.element.line}", tuple(place[:3, 3]), tuple(place[:3, 2]))
        for plane, place in planes
    )
    return (floors, tuple(touching)) if touched else ((), ())


def _collide(one: MjcfShape, other: MjcfShape) -> bool:
    (type_1, affinity_1), (type_2, affinity_2) = (
        tuple(int(each.element.number(key, 1.0)) for key in ("contype", "conaffinity")) for each in (one, other)
    )
    return bool(type_1 & affinity_2 or type_2 & affinity_1)


def _rows(place: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in place.tolist())


# ---- Where the joints of an MJCF file start: at a keyframe, or where the file places the bodies.


HOME = "home"
COORDINATES = {"free": 7, "ball": 4, "hinge": 1, "slide": 1}


def start_of(bodies: Sequence[MjcfBody], root: MjcfElement) -> tuple[Start, str, list[str]]:
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
    count = sum(COORDINATES[joint.kind] for body in bodies for joint in body.joints)
    values = list(chosen.numbers("qpos", count, count) or ())
    for body in bodies:
        for joint in body.joints:
            own, values = values[: COORDINATES[joint.kind]], values[COORDINATES[joint.kind] :]
            start[joint.name] = own[0] if len(own) == 1 else (*own[:-4], *_quaternion(chosen, own[-4:]))
    title = f"the keyframe '{chosen.name}'" if chosen.name else "the first keyframe"
    notes = [f"line {chosen.line}: the start is {title}."]
    if any(chosen.numbers("qvel", 1, count) or ()):
        text = f"line {chosen.line}: the velocities (qvel) of {title} are not used; the start is at rest."
        notes.append(Note(text, "changes"))
    return start, title, notes


def _quaternion(key: MjcfElement, values: Sequence[float]) -> tuple[float, ...]:
    """A unit quaternion x y z w from w x y z."""
    if not any(values):
        raise key.fail("qpos: a quaternion is zero; expected a unit quaternion w x y z")
    return tuple(Rotation.from_quat([*values[1:], values[0]]).as_quat().tolist())
