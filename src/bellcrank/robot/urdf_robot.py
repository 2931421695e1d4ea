"""A URDF as a RobotFile: its tree, the loops that it writes itself, and those of a Gepetto YAML beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from bellcrank.errors import InputError
from bellcrank.files.access import FileAccess
from bellcrank.messages import unknown_name
from bellcrank.robot.gepetto_file import gepetto_beside, gepetto_of_others, read_gepetto
from bellcrank.robot.joint_types import motor_notes, with_joint_names, with_joint_types, without_motor
from bellcrank.robot.robot_file import JointMotor, RobotFile
from bellcrank.robot.urdf_extensions import ball_constraints, gazebo_balls, refuse_unread, rotor_inertias, springs
from bellcrank.robot.urdf_loops import loops_of
from bellcrank.robot.urdf_notes import unused
from bellcrank.robot.xacro_text import expanded
from bellcrank.robot.xml_tree import Element, parse_xml


def read_urdf_robot(
    text: str, source: Path, access: FileAccess, xacro_args: Mapping[str, str] | None = None
) -> RobotFile:
    """The contents of a URDF, given as text, and of a Gepetto YAML beside it; the tree itself is not checked here.

    `xacro_args` are values of the arguments of a xacro file.

    Raises InputError, one sentence, where a loop is wrong.
    """
    if source.suffix == ".xacro":
        text = expanded(text, source, access, xacro_args or {})
    beside = gepetto_beside(source, access)
    text, unnamed = with_joint_names(text, source)
    robot = parse_xml(text, source)

    def fail(message: str) -> InputError:
        return InputError(f"{source}: " + "".join(c if c.isprintable() else " " for c in message))

    refuse_unread(robot, fail)
    file = RobotFile(
        source=source,
        urdf=text,
        loops=(*loops_of(robot, fail), *ball_constraints(robot, fail), *gazebo_balls(robot, fail)),
        springs=springs(robot, fail),
        rotor_inertia=rotor_inertias(robot, fail),
        notes=(*unnamed, *unused(robot), *(gepetto_of_others(source, access) if beside is None else ())),
    )
    return file if beside is None else _with_gepetto(file, robot, beside)


def _with_gepetto(file: RobotFile, robot: Element, path: Path) -> RobotFile:
    if file.loops:
        raise InputError(
            f"{file.source}: has loops of its own, and {path.name} beside it closes loops too; keep one of them"
        )
    found = read_gepetto(path)
    joints = [joint.attributes.get("name", "").strip() for joint in robot.find_all("joint")]
    links = [link.attributes.get("name", "").strip() for link in robot.find_all("link")]
    for frame in (name for a, b, _ in found.loops for name in (a, b)):
        if frame not in links and frame not in joints:
            raise InputError(f"{path}: closed_loop: {unknown_name('frame', frame, [*links, *joints])}")
    for name in found.motors:
        if name not in joints:
            raise InputError(f"{path}: name_mot: {unknown_name('joint', name, joints)}")
    urdf, notes = with_joint_types(file.urdf, found.joint_types, path)
    still = without_motor(urdf, file.source, found.motors)
    return replace(
        file,
        urdf=urdf,
        loops=found.frame_loops("loop"),
        loop_file=path.resolve(),
        motors=tuple(JointMotor(name=name, joint=name) for name in dict.fromkeys(found.motors) if name not in still),
        notes=(*file.notes, *found.notes, *notes, *motor_notes(path, still)),
    )
