"""Reads MJCF, the XML of MuJoCo: bodies and joints as a URDF, and beside it loops, springs, motors and the start.

The meaning of elements: MuJoCo's documentation, "XML Reference" and "Modeling". Constraints are exact here, where
MuJoCo's are soft; contacts, tendons and controllers are not modelled. What is not used is listed in the notes.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from bellcrank.files.access import FileAccess
from bellcrank.robot.mjcf_actuators import read_motors
from bellcrank.robot.mjcf_bodies import Body, BodyReader
from bellcrank.robot.mjcf_compiler import Compiler, Defaults, disabled_flags, gravity_of
from bellcrank.robot.mjcf_contacts import floors_of
from bellcrank.robot.mjcf_element import read_mjcf_elements
from bellcrank.robot.mjcf_equality import EqualityReader, fixed_tendons
from bellcrank.robot.mjcf_inertia import InertiaReader, total_scale
from bellcrank.robot.mjcf_meshes import Meshes
from bellcrank.robot.mjcf_names import named
from bellcrank.robot.mjcf_notes import notes_of
from bellcrank.robot.mjcf_passive_forces import joints_of, rotor_inertia, springs_of, with_passive_forces
from bellcrank.robot.mjcf_start import start_of
from bellcrank.robot.mjcf_urdf import UrdfWriter
from bellcrank.robot.mjcf_visuals import Visuals
from bellcrank.robot.robot_file import RobotFile


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
    meshes, disabled = Meshes(root, compiler, defaults, source, access), disabled_flags(root)
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
    urdf = UrdfWriter(bodies, visuals.of(bodies), efforts).text(root.attributes.get("model", "") or source.stem)
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


def _with_total_mass(bodies: list[Body], compiler: Compiler) -> list[Body]:
    scale = total_scale([body.inertia for body in bodies], compiler)
    return bodies if scale == 1.0 else [replace(body, inertia=body.inertia.scaled(scale)) for body in bodies]
