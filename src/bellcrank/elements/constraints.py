"""Reads the constraints of a scene, and closed loops from the files of other tools.

Each entry of the list `constraints` has a `kind`, an optional `name`, and the keys of its kind. To add a kind, derive a
class from `Constraint` (constraint.py) and add it to `KINDS`. A file of another tool is an entry too, for all loops in
that file:

gepetto: YAML files of Gepetto's parallel robots (example-parallel-robots). `closed_loop` lists pairs of frames, `type`
is 3d (the origins coincide) or 6d (the frames coincide), and `name_mot` lists the joints with motors.

mjcf, sdf: the closed loops and couplings of a robot file (robot/formats/robot_file.py). The joints that carry their
frames must have the same names and placements as in the URDF.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from bellcrank.arrays import Array
from bellcrank.config.fields import Fields
from bellcrank.elements.constraint import Constraint, ReadContext
from bellcrank.elements.element import named_entries
from bellcrank.elements.expression import parse_expression
from bellcrank.elements.expression_constraint import ExpressionConstraint
from bellcrank.elements.joint_constraints import Coupling, PrescribedMotion
from bellcrank.elements.loop_constraints import WORLD, Distance, Hinge, Loop, Planar, Point, Prismatic, Universal, Weld
from bellcrank.elements.pin_friction import allow_friction
from bellcrank.elements.rolling_constraint import RollingDisk
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.formats.file_readers import READERS, root_tag
from bellcrank.robot.formats.gepetto_file import read_gepetto, without_motor
from bellcrank.robot.formats.robot_file import FrameLoop, FramePlace, JointCoupling, JointRelation, relation_text
from bellcrank.robot.formats.xml_tree import read_text
from bellcrank.robot.load import default_options, robot_of
from bellcrank.robot.robot import Robot

APART = 1e-6  # m, and for entries of rotation matrices: largest difference from the placement of a joint in the URDF
ORIGIN = (0.0, 0.0, 0.0)
AXIAL: Final = {"hinge": Hinge, "prismatic": Prismatic, "planar": Planar}  # kinds with one axis
PLAIN: Final[Mapping[str, type[Loop]]] = {"point": Point, "weld": Weld}  # kinds without further keys
ROOTS: Final = {"mjcf": "mujoco", "sdf": "sdf"}  # the root element of the files of a kind
Reader = Callable[[str, Fields, ReadContext], Sequence[Constraint]]  # called with a name, an entry and its context


def import_constraints(kind: str, name: str, read: Fields, context: ReadContext) -> list[Constraint]:
    """Read the file under the key `file`; constraints are named NAME_1, NAME_2, … Raises InputError naming the key."""
    path = read.file("file")
    try:
        found = IMPORTERS[kind](path, name, read, context.robot)
    except InputError as error:
        raise read.error("file", str(error)) from None
    except ValueError as error:
        raise read.error("file", f"{path}: expected a number: {error}") from None
    if not found:
        raise read.error("file", f"{path}: no closed loops found")
    return found


def imported_motors(constraints: Sequence[Constraint], robot: Robot) -> tuple[str, ...]:
    """The joints with motors (`name_mot`) in the Gepetto files of constraints. Raises InputError naming the file."""
    files = {c.place.raw("file"): c.place for c in constraints if c.place.raw("kind", None) == "gepetto"}
    found: list[str] = []
    for place in files.values():
        path = place.file("file")
        for name in read_gepetto(path).motors:
            if name in without_motor(robot.file.urdf, [name]):
                continue  # a note says so
            if name not in robot.joint_names:
                raise place.error("file", f"{path}: name_mot: {unknown_name('joint', name, robot.joint_names)}")
            found.append(name)
    return tuple(dict.fromkeys(found))


# ---- Gepetto


def _gepetto(path: Path, name: str, read: Fields, robot: Robot) -> list[Constraint]:
    constraints: list[Constraint] = []
    for k, (a, b, kind) in enumerate(read_gepetto(path).loops):
        for frame in (a, b):
            if frame not in robot.frame_names:
                raise InputError(f"{path}: closed_loop: {unknown_name('frame', frame, robot.frame_names)}")
        constraints.append((Point if kind == "3d" else Weld)(f"{name}_{k + 1}", read, a, b, ORIGIN))
    return constraints


# ---- MJCF and SDFormat


def _robot_file(path: Path, name: str, read: Fields, robot: Robot) -> list[Constraint]:
    """The loops of a robot file, between the links of this robot."""
    kind = read.text("kind")
    text = read_text(path)
    if (tag := root_tag(text)) not in ("", ROOTS[kind]):
        other = f"<{tag}>" if tag in READERS else "another"  # nothing of a file that is no robot's is shown
        raise InputError(f"{path}: expected a file with the root element <{ROOTS[kind]}>, found {other}")
    access = read.access.by(path)
    file = READERS[ROOTS[kind]](text, path, access)
    own = robot_of(file, default_options(), access)
    from bellcrank.robot.formats.mjcf_equality import UNMODELLED

    if unmodelled := [note for note in file.notes if UNMODELLED in note]:
        raise InputError(f"{path}: {unmodelled[0]}")
    found: list[Constraint] = []
    for k, loop in enumerate(file.loops, 1):
        found.append(_constraint(f"{name}_{k}", loop, read, (path, robot, own)))
    return found


def _constraint(
    name: str, loop: FrameLoop | JointCoupling | JointRelation, read: Fields, robots: tuple[Path, Robot, Robot]
) -> Constraint:
    path, robot, _ = robots
    if isinstance(loop, FrameLoop):
        sides = [_side(loop.a, robots), _side(loop.b, robots)]
        (a, at_a), (b, at_b) = sides if sides[0][0] != WORLD else sides[::-1]
        if loop.kind == "universal":
            axes = (loop.axis, loop.axis_2) if sides[0][0] != WORLD else (loop.axis_2, loop.axis)
            return Universal(name, read, a, b, ORIGIN, *axes, at_a=at_a, at_b=at_b)
        if loop.kind in AXIAL:
            return AXIAL[loop.kind](name, read, a, b, ORIGIN, loop.axis, at_a=at_a, at_b=at_b)
        if loop.length is not None:
            return Distance(name, read, a, b, ORIGIN, loop.length, at_a=at_a, at_b=at_b)
        return PLAIN[loop.kind](name, read, a, b, ORIGIN, at_a=at_a, at_b=at_b)
    joints = [loop.joint, loop.leader] if isinstance(loop, JointCoupling) else [joint for joint, _ in loop.terms]
    for joint in joints:
        if joint is not None and joint not in robot.joint_names:
            raise InputError(f"{path}: {unknown_name('joint', joint, robot.joint_names)}")
    if isinstance(loop, JointCoupling) and loop.leader is not None and len(loop.coefficients) == 2:
        offset, ratio = loop.coefficients
        return Coupling(name, read, robot.joint(loop.leader), robot.joint(loop.joint), ratio, offset)
    return ExpressionConstraint(name, read, parse_expression(relation_text(loop), robot, {}), read.unit())


def _side(place: FramePlace, robots: tuple[Path, Robot, Robot]) -> tuple[str, tuple[float, ...]]:
    """The frame of the scene's robot at a place of the other one, and the placement in it (origin, rotation by rows).

    Both robots must have the joint that carries the place, with the same origin and axes.
    """
    from scipy.spatial.transform import Rotation  # importing it takes as long as simulating most scenes

    path, robot, other = robots
    at = _pose(Rotation.from_euler("xyz", place.rpy).as_matrix(), place.xyz)
    if place.frame == WORLD:
        return WORLD, _twelve(at)
    frame = other.equations.tree.frames[other.frame_index(place.frame)]
    if frame.parent_joint == 0 and place.frame in robot.frame_names:
        return place.frame, _twelve(at)
    at = _pose(np.array(frame.placement.rotation).reshape(3, 3), frame.placement.translation) @ at
    if frame.parent_joint == 0:
        return WORLD, _twelve(at)
    joint = other.equations.tree.joints[frame.parent_joint - 1].name
    if joint not in robot.all_joint_names:
        raise InputError(f"{path}: {unknown_name('joint', joint, robot.all_joint_names)}")
    apart = float(np.abs(_joint_place(other, joint) - _joint_place(robot, joint)).max())
    if apart > APART:
        raise InputError(
            f"{path}: the placement of joint '{joint}' differs from {robot.source.name} by {apart:.3g}; both files "
            "must have the same origin and axes for it"
        )
    return robot.urdf.joints[joint].child, _twelve(at)


def _joint_place(robot: Robot, name: str) -> Array:
    """The pose (4, 4) of a joint in the world where all joints before it are at 0, and its axis in a fifth column."""
    joints = robot.equations.tree.joints
    chain = [next(joint for joint in joints if joint.name == name)]
    while chain[-1].parent:
        chain.append(joints[chain[-1].parent - 1])
    pose = np.eye(4)
    for joint in reversed(chain):
        pose = pose @ _pose(np.array(joint.placement.rotation).reshape(3, 3), joint.placement.translation)
    return np.column_stack([pose, pose @ [*chain[0].axis, 0.0]])


def _pose(rotation: Array, translation: Sequence[float]) -> Array:
    """A placement as a matrix (4, 4)."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, translation
    return pose


def _twelve(pose: Array) -> tuple[float, ...]:
    return (*pose[:3, 3].tolist(), *pose[:3, :3].ravel().tolist())


IMPORTERS: Final[Mapping[str, Callable[[Path, str, Fields, Robot], list[Constraint]]]] = {
    "gepetto": _gepetto, "mjcf": _robot_file, "sdf": _robot_file,
}  # fmt: skip


def _reader(kind: type[Constraint]) -> Reader:
    return lambda name, read, context: [kind.read(name, read, context)]


KINDS: Final[dict[str, Reader]] = {
    **{
        cls.kind: _reader(cls)
        for cls in (
            Point,
            Hinge,
            Weld,
            Distance,
            Universal,
            Prismatic,
            Planar,
            Coupling,
            PrescribedMotion,
            RollingDisk,
            ExpressionConstraint,
        )
    },
    **{kind: partial(import_constraints, kind) for kind in IMPORTERS},
}


def read_constraints(read: Fields, context: ReadContext) -> tuple[Constraint, ...]:
    """Read the list `constraints` of a scene. Raises InputError naming file and key."""
    constraints: list[Constraint] = []
    for name, entry in named_entries(read, "constraints"):
        kind = entry.choice("kind", tuple(KINDS))
        allow_friction(entry, kind)
        constraints += KINDS[kind](name, entry, context)
        entry.done()
    taken = [constraint.name for constraint in constraints]
    for name in taken:
        if taken.count(name) > 1:
            raise read.error("constraints", f"two constraints are named '{name}'; give each entry a unique name")
    return tuple(constraints)
