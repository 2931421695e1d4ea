"""Imports closed loops from the files of other tools. The tree of the mechanism comes from a URDF.

gepetto: YAML files of Gepetto's parallel robots (example-parallel-robots). `closed_loop` lists pairs of frames, `type`
is 3d (the origins coincide) or 6d (the frames coincide), and `name_mot` lists the joints with motors.

mjcf: the elements under <equality> in MuJoCo's XML. Pinocchio reads <connect> and <weld>; a <joint> with a linear
polynomial becomes a coupling. The joints must have the same names and placements as in the URDF.

sdf: joints of SDFormat whose child link already is the child of another joint: revolute, ball or fixed. Released wheels
of Pinocchio do not read SDFormat, so these files are read here: poses of links in the model and of joints in their
child link, without `relative_to`.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from bellcrank.config.fields import Fields
from bellcrank.config.numbers import decimal_number
from bellcrank.elements.constraint import Constraint, ReadContext
from bellcrank.elements.joint_constraints import Coupling
from bellcrank.elements.loop_constraints import WORLD, Hinge, Point, Weld
from bellcrank.errors import InputError
from bellcrank.files.access import read_bytes
from bellcrank.messages import unknown_name
from bellcrank.robot.gepetto_file import read_gepetto
from bellcrank.robot.robot import Robot
from bellcrank.robot.xml_tree import decoded

Array = NDArray[np.float64]
APART = 1e-6  # m, and for entries of rotation matrices: largest difference from the placement of a joint in the URDF
ORIGIN = (0.0, 0.0, 0.0)


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


# ---- MJCF


def _mjcf(path: Path, name: str, read: Fields, robot: Robot) -> list[Constraint]:
    import pinocchio as pin

    root = _xml(path)
    if root.tag != "mujoco":
        raise InputError(f"{path}: expected an MJCF file with the root element <mujoco>")
    if root.find(".//include") is not None:
        raise InputError(f"{path}: <include> is not supported; replace it by the contents of the included file")
    try:
        model, loops = pin.buildModelAndLegacyConstraintsFromMJCF(str(path))[:2]
    except Exception as error:  # Pinocchio passes on the exceptions of its parsers
        raise InputError(f"{path}: Pinocchio cannot read it: {' '.join(str(error).split())[:150]}") from None
    constraints: list[Constraint] = []
    for loop in loops:
        title = f"{name}_{len(constraints) + 1}"
        kind = Point if loop.type == pin.ContactType.CONTACT_3D else Weld
        sides = [_at_joint(path, robot, model, loop.joint1_id, loop.joint1_placement)]
        sides.append(_at_joint(path, robot, model, loop.joint2_id, loop.joint2_placement))
        (a, at_a), (b, at_b) = sides if sides[0][0] != WORLD else sides[::-1]
        constraints.append(kind(title, read, a, b, ORIGIN, at_a=at_a, at_b=at_b))
    for element in root.iterfind("equality/*"):
        if element.get("active") == "false":
            raise InputError(f"{path}: <{element.tag}> under <equality> is inactive; remove it from the file")
        if element.tag == "joint":
            constraints.append(_mjcf_coupling(path, f"{name}_{len(constraints) + 1}", element, read, robot))
        elif element.tag not in ("connect", "weld"):
            raise InputError(f"{path}: unknown <{element.tag}> under <equality>; expected: connect, weld, joint")
    return constraints


def _mjcf_coupling(path: Path, name: str, element: ET.Element, read: Fields, robot: Robot) -> Coupling:
    """joint1 = c₀ + c₁ joint2, or joint1 = c₀."""
    numbers = [decimal_number(x) for x in element.get("polycoef", "0 1 0 0 0").split()] + [0.0, 0.0]
    if any(numbers[2:]) or element.get("joint2") is None:
        raise InputError(f"{path}: <joint> under <equality> must couple two joints linearly (polycoef c0 c1 0 0 0)")
    first, second = (_one_joint(path, robot, element.get(key, "")) for key in ("joint1", "joint2"))
    return Coupling(name, read, second, first, numbers[1], numbers[0])


def _one_joint(path: Path, robot: Robot, name: str) -> Any:
    if name not in robot.joint_names:
        raise InputError(f"{path}: {unknown_name('joint', name, robot.joint_names)}")
    return robot.joint(name)


def _at_joint(path: Path, robot: Robot, model: Any, joint: int, placement: Any) -> tuple[str, tuple[float, ...]]:
    """The frame of this robot at a joint of another model, and a placement in it (origin, rotation by rows)."""
    import pinocchio as pin

    at = (*placement.translation.tolist(), *placement.rotation.ravel().tolist())
    if joint == 0:
        return WORLD, at
    name = model.names[joint]
    if name not in robot.all_joint_names:
        raise InputError(f"{path}: {unknown_name('joint', name, robot.all_joint_names)}")
    placed = []
    for each in (model, robot.model):
        data = each.createData()
        pin.forwardKinematics(each, data, pin.neutral(each))
        placed.append(data.oMi[each.getJointId(name)].homogeneous)
    if np.abs(placed[0] - placed[1]).max() > APART:
        raise InputError(
            f"{path}: the placement of joint '{name}' differs from {robot.source.name} by "
            f"{np.abs(placed[0] - placed[1]).max():.3g}; both files must have the same origin and axes for it"
        )
    return robot.urdf.joints[name].child, at


# ---- SDF


def _sdf(path: Path, name: str, read: Fields, robot: Robot) -> list[Constraint]:
    model = next(iter(_xml(path).iter("model")), None)
    if model is None:
        raise InputError(f"{path}: expected an SDFormat file with a <model>")
    links = {link.get("name", ""): _pose(path, link) for link in model.iterfind("link")}
    taken: set[str] = set()
    constraints: list[Constraint] = []
    for joint in model.iterfind("joint"):
        parent, child = ((joint.findtext(key) or "").strip() for key in ("parent", "child"))
        if child not in taken:
            taken.add(child)
            continue
        for link in (parent, child):
            if link not in links or link not in robot.frame_names:
                raise InputError(
                    f"{path}: joint '{joint.get('name')}': {unknown_name('link', link, robot.frame_names)}"
                )
        kind, title = joint.get("type", ""), f"{name}_{len(constraints) + 1}"
        in_child = _pose(path, joint)
        in_parent = np.linalg.inv(links[parent]) @ links[child] @ in_child
        at = {"at_a": _twelve(in_child), "at_b": _twelve(in_parent)}
        if kind in ("revolute", "continuous"):
            axis = np.array([decimal_number(x) for x in (joint.findtext("axis/xyz") or "0 0 1").split()])
            axis /= np.linalg.norm(axis)
            constraints.append(Hinge(title, read, child, parent, ORIGIN, tuple(axis.tolist()), **at))
        elif kind in ("ball", "fixed"):
            constraints.append((Point if kind == "ball" else Weld)(title, read, child, parent, ORIGIN, **at))
        else:
            raise InputError(
                f"{path}: joint '{joint.get('name')}' closes a loop: unknown type '{kind}'; expected: revolute, ball, "
                "fixed"
            )
    return constraints


def _pose(path: Path, element: ET.Element) -> Array:
    """The pose (4, 4) of a link or joint, written as x y z roll pitch yaw (m, rad)."""
    pose = element.find("pose")
    if pose is None:
        return np.eye(4)
    if pose.get("relative_to"):
        raise InputError(
            f"{path}: the pose of '{element.get('name')}' has a relative_to, which is not supported; remove it"
        )
    x, y, z, roll, pitch, yaw = (decimal_number(value) for value in (pose.text or "0 0 0 0 0 0").split())
    import pinocchio as pin

    return np.asarray(pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), np.array([x, y, z])).homogeneous)


def _twelve(pose: Array) -> tuple[float, ...]:
    return (*pose[:3, 3].tolist(), *pose[:3, :3].ravel().tolist())


def _xml(path: Path) -> ET.Element:
    text = decoded(read_bytes(path), path)
    if "<!ENTITY" in text:
        raise InputError(f"{path}: declares an XML entity, which is not supported; write its text instead")
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        line, _ = error.position
        raise InputError(f"{path}: line {line}: not valid XML ({expat.ErrorString(error.code)})") from None
    except UnicodeError:
        raise InputError(f"{path}: contains characters that are not valid in XML; save it as UTF-8") from None


IMPORTERS: Final[Mapping[str, Callable[[Path, str, Fields, Robot], list[Constraint]]]] = {
    "gepetto": _gepetto, "mjcf": _mjcf, "sdf": _sdf,
}  # fmt: skip
