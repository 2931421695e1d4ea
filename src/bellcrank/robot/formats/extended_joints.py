"""Joint types beyond URDF's own: spherical, universal and screw.

A spherical joint has a unit quaternion x y z w (child to parent) and the angular velocity of the child relative to the
parent, in the child's axes. A universal joint NAME is two revolute joints, NAME_1 about its `axis` and NAME_2 about its
`axis2`, with a massless link NAME_cross between them. A screw turns by its coordinate (rad) about its axis and advances
along it by pitch / 2π times that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.robot.formats.urdf_elements import Joint, Link

if TYPE_CHECKING:
    from bellcrank.errors import InputError
    from bellcrank.robot.formats.urdf_file import Urdf

PLAIN_TYPES = {"continuous": "revolute", "spherical": "floating", "screw": "revolute"}  # for Pinocchio's reader
_REPLACED = ("spherical", "screw")


def split_universal(
    links: Mapping[str, Link], joints: Mapping[str, Joint], fail: Callable[[str], InputError]
) -> tuple[dict[str, Link], dict[str, Joint]]:
    """The links and joints with every universal joint written as two revolute joints.

    Raises InputError, made by `fail`, where a name that this needs is taken.
    """
    new_links, new_joints = dict(links), {}
    for joint in joints.values():
        if joint.type != "universal":
            new_joints[joint.name] = joint
            continue
        first, second, cross = f"{joint.name}_1", f"{joint.name}_2", f"{joint.name}_cross"
        for kind, name, names in (("joint", first, joints), ("joint", second, joints), ("link", cross, links)):
            if name in names:
                raise fail(
                    f"there is a {kind} '{name}', a name that the universal joint '{joint.name}' needs for itself (its "
                    f"two axes are the joints '{first}' and '{second}'); rename one of them"
                )
        new_links[cross] = Link(cross, None, (), between_axes=True)
        revolute = "revolute" if joint.lower is not None or joint.upper is not None else "continuous"
        new_joints[first] = replace(joint, name=first, type=revolute, child=cross)
        new_joints[second] = replace(
            joint, name=second, type=revolute, parent=cross, xyz=(0.0, 0.0, 0.0), rpy=(0.0, 0.0, 0.0),
            axis=joint.axis_2, axis_length=1.0,
        )  # fmt: skip
    return new_links, new_joints


def has_extended_joints(urdf: Urdf) -> bool:
    """Whether a URDF has joints that Pinocchio's reader lacks."""
    return any(joint.type in _REPLACED for joint in urdf.joints.values())


def with_extended_joints(model: Any, urdf: Urdf) -> Any:
    """The pinocchio.Model of a URDF in which `PLAIN_TYPES` stood in for the joint types that Pinocchio's reader lacks.

    Joints, frames and inertias keep their numbers. The model must have no mimic joints.
    """
    import pinocchio as pin

    new: dict[str, Any] = {}
    for name, joint in urdf.joints.items():
        if joint.type == "screw":
            new[name] = pin.JointModelHelicalUnaligned(np.array(joint.axis), joint.pitch / (2.0 * math.pi))
        elif joint.type == "spherical":
            new[name] = pin.JointModelSpherical()
    return with_joint_models(model, new) if new else model


def with_joint_models(model: Any, new: Mapping[str, Any]) -> Any:
    """A copy of a pinocchio.Model in which some joints, by name, have other joint models; it has no mimic joints.

    A new model has as many coordinates as the former one, or the last of them: a spherical joint those of the rotation
    of a floating one. The copy's `nbodies`, which nothing here reads, counts no bodies.
    """
    import pinocchio as pin

    found = pin.Model()
    found.name, found.gravity = model.name, model.gravity
    for k in range(1, model.njoints):
        name, before = model.names[k], model.joints[k]
        made = new.get(name, before)
        q = slice(before.idx_q + before.nq - made.nq, before.idx_q + before.nq)
        v = slice(before.idx_v + before.nv - made.nv, before.idx_v + before.nv)
        index = found.addJoint(
            model.parents[k], made, model.jointPlacements[k], name,
            model.lowerEffortLimit[v], model.upperEffortLimit[v], model.lowerVelocityLimit[v],
            model.upperVelocityLimit[v], model.lowerPositionLimit[q], model.upperPositionLimit[q],
            model.lowerDryFrictionLimit[v], model.upperDryFrictionLimit[v], model.damping[v],
        )  # fmt: skip
        found.inertias[index] = model.inertias[k]
    found.inertias[0] = model.inertias[0]
    for frame in model.frames[1:]:
        found.addFrame(frame, False)
    return found
