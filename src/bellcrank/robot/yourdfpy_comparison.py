"""Comparison of a URDF as it was read with what yourdfpy, an independent reader, reads."""

from __future__ import annotations

import io
import logging
from typing import Any

from bellcrank.robot.urdf_file import Joint, Link, Urdf

TOLERANCE = 1e-9  # of a rotation or translation entry; everything else is compared exactly


def differences_from_yourdfpy(urdf: Urdf) -> list[str]:
    """The values that yourdfpy reads differently: one phrase each.

    Masses, centres of gravity, inertias, joint types, parents, placements, axes, limits, friction and mimics are
    compared (yourdfpy does not read transmissions). That yourdfpy cannot read the file is a difference too.
    """
    import numpy as np
    import pinocchio as pin
    import yourdfpy

    log = logging.getLogger("yourdfpy.urdf")
    level = log.level
    log.setLevel(logging.CRITICAL)
    try:
        with np.errstate(all="ignore"):  # shapes, which are not compared, may overflow
            robot: Any = yourdfpy.URDF.load(
                io.BytesIO(urdf.text.lstrip("\ufeff").encode("utf-8")),
                build_scene_graph=False,
                build_collision_scene_graph=False,
                load_meshes=False,
                load_collision_meshes=False,
            ).robot
    except Exception as error:
        return [f"yourdfpy does not read the file ({type(error).__name__}: {' '.join(str(error).split())})"]
    finally:
        log.setLevel(level)
    differences: list[str] = []

    def compare(where: str, ours: object, theirs: object) -> None:
        if ours != theirs:
            differences.append(f"{where} is {ours}, but {theirs} as yourdfpy reads it")

    def compare_poses(where: str, ours: Link | Joint, theirs: Any) -> None:
        part = ours.inertial if isinstance(ours, Link) else ours
        assert part is not None
        pose = np.eye(4) if theirs is None else np.asarray(theirs)
        if np.abs(pose[:3, :3] - pin.rpy.rpyToMatrix(*part.rpy)).max() > TOLERANCE:
            differences.append(f"{where}: the rotation differs from yourdfpy's")
        if np.abs(pose[:3, 3] - part.xyz).max() > TOLERANCE:
            differences.append(f"{where}: the position differs from yourdfpy's")

    # a universal joint is one joint there, two joints and a link here
    between = {link.name for link in urdf.links.values() if link.between_axes}
    links = [name for name in urdf.links if name not in between]
    joints = [joint.name for joint in urdf.joints.values() if not between & {joint.parent, joint.child}]
    compare("the list of links", sorted(links), sorted(link.name.strip() for link in robot.links))
    others = [joint.name.strip() for joint in robot.joints if joint.type != "universal"]
    compare("the list of joints", sorted(joints), sorted(others))
    for theirs in robot.links:
        link = urdf.links.get(theirs.name.strip())
        if link is None or (link.inertial is None) != (theirs.inertial is None):
            differences.append(f"link '{theirs.name}': only one of the two readers finds its mass")
            continue
        if link.inertial is None:
            continue
        where = f"link '{link.name}'"
        ixx, ixy, ixz, iyy, iyz, izz = link.inertial.inertia
        compare(f"{where}: the mass", link.inertial.mass, theirs.inertial.mass)
        compare(
            f"{where}: the inertia",
            [[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]],
            theirs.inertial.inertia.tolist(),
        )
        compare_poses(where, link, theirs.inertial.origin)
    for theirs in robot.joints:
        joint = urdf.joints.get(theirs.name.strip())
        if joint is not None and theirs.type != "universal":
            differences.extend(_joint_differences(joint, theirs))
            compare_poses(f"joint '{joint.name}'", joint, theirs.origin)
    return differences


def _joint_differences(joint: Joint, theirs: Any) -> list[str]:
    import numpy as np

    ours: dict[str, object] = {"type": joint.type, "parent": joint.parent, "child": joint.child}
    other: dict[str, object] = {"type": theirs.type, "parent": theirs.parent, "child": theirs.child}
    limit, dynamics = theirs.limit, theirs.dynamics
    for key in ("effort", "velocity", "lower", "upper"):
        value = getattr(joint, key)
        if value is not None and (value != 0.0 or getattr(limit, key, None) is not None):
            ours[key], other[key] = value, getattr(limit, key, None)
    for key in ("damping", "friction"):
        value = getattr(joint, key)
        if value is not None:
            ours[key], other[key] = value, float(getattr(dynamics, key))
    if joint.mimic is not None:
        ours["mimic"], other["mimic"] = True, theirs.mimic is not None
    found = [
        f"joint '{joint.name}': {key} is {ours[key]}, but {other[key]} as yourdfpy reads it"
        for key in ours
        if ours[key] != other[key]
    ]
    if joint.type in ("revolute", "continuous", "prismatic"):
        axis = np.asarray(theirs.axis) / np.linalg.norm(theirs.axis)
        if np.abs(axis - joint.axis).max() > TOLERANCE:
            found.append(f"joint '{joint.name}': the axis differs from yourdfpy's")
    return found
