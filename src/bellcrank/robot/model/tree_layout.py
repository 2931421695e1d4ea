"""From a pinocchio.Model to the records of the tree (tree.py)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.errors import InputError
from bellcrank.robot.model.pinocchio_model import Cleaning, length_scale
from bellcrank.robot.model.tree import JointPlacement, Numbers, Tree, TreeFrame, TreeJoint, TreeMimic

if TYPE_CHECKING:
    from bellcrank.robot.formats.urdf_file import Urdf

# Pinocchio's joint types -> the tracer's numbers of them (JointKind in cpp/tracer/tree.hpp)
_TRACER_KINDS = {
    "JointModelRX": 0, "JointModelRY": 1, "JointModelRZ": 2, "JointModelRevoluteUnaligned": 3, "JointModelPX": 4,
    "JointModelPY": 5, "JointModelPZ": 6, "JointModelPrismaticUnaligned": 7, "JointModelFreeFlyer": 8,
    "JointModelPlanar": 9, "JointModelSpherical": 10, "JointModelHelicalUnaligned": 11,
}  # fmt: skip
_UNALIGNED = (3, 7)
_KINDS = ("revolute",) * 4 + ("prismatic",) * 4 + ("floating", "planar", "spherical", "screw")


def tree_of_model(model: Any, urdf: Urdf, cleaning: Cleaning, clean: bool) -> Tree:
    """The records of a model in which every joint, mimicking or not, is a joint of its own.

    `cleaning` is what cleaning changed in the model; with `clean` placements between frames are cleaned too.
    Raises InputError.
    """
    joints = tuple(_joint(model, urdf, j) for j in range(1, model.njoints))
    frames = _frames(model, urdf, clean)
    return Tree(joints, frames, _mimics(model, urdf), cleaning.entries, cleaning.largest)


def _joint(model: Any, urdf: Urdf, number: int) -> TreeJoint:
    joint = model.joints[number]
    short = joint.shortname()
    if short not in _TRACER_KINDS:
        raise InputError(f"{urdf.source}: joint '{model.names[number]}' is of a type that is not supported ({short})")
    kind, axis, sign = _TRACER_KINDS[short], _axis(joint), 1.0
    if kind in _UNALIGNED and sorted(axis)[:2] == [-1.0, 0.0] and max(axis) == 0.0:
        # about -z by q is about z by -q: the aligned joint folds to fewer operations
        sign, kind = -1.0, kind - 3 + axis.index(-1.0)
    return TreeJoint(
        name=model.names[number],
        kind=_KINDS[kind],
        tracer_kind=kind,
        sign=sign,
        parent=model.parents[number],
        nq=joint.nq,
        nv=joint.nv,
        axis=axis,
        placement=_placement(model.jointPlacements[number]),
        armature=(0.0,) * joint.nv,
        pitch=float(joint.extract().pitch) if _KINDS[kind] == "screw" else 0.0,
        **_inertia(model.inertias[number]),
    )


def _frames(model: Any, urdf: Urdf, clean: bool) -> tuple[TreeFrame, ...]:
    import pinocchio as pin

    again, size = Cleaning(), length_scale(model)
    frames = []
    for k, frame in enumerate(model.frames):
        moving = frame.parentJoint if k and frame.type == pin.FrameType.JOINT else -1
        before = model.frames[frame.parentFrame].placement
        if moving > 0:  # a joint's frame is its joint: placed in the parent link by the joint's placement
            relative = before.inverse() * model.jointPlacements[moving]
        else:
            relative = before.inverse() * frame.placement
        if clean:
            relative = pin.SE3(again.rotation(relative.rotation), again.numbers(relative.translation, size))
        written = urdf.joints.get(frame.name) if frame.type != pin.FrameType.BODY else None
        rpy = written.rpy if written is not None else pin.rpy.matrixToRpy(relative.rotation)
        frames.append(
            TreeFrame(
                name=frame.name,
                is_joint=frame.type == pin.FrameType.JOINT,
                is_body=frame.type == pin.FrameType.BODY,
                parent_frame=frame.parentFrame if k else -1,
                parent_joint=frame.parentJoint,
                moving_joint=moving,
                placement=_placement(frame.placement),
                in_parent=_placement(relative),
                rpy=tuple(float(x) for x in rpy),
                **_inertia(frame.inertia),
            )
        )
    return tuple(frames)


def _mimics(model: Any, urdf: Urdf) -> tuple[TreeMimic, ...]:
    index = {model.names[j]: j for j in range(1, model.njoints)}
    mimics = []
    for joint in urdf.joints.values():
        if joint.mimic is not None and joint.name in index:
            m = joint.mimic
            if m.joint not in index:
                raise InputError(
                    f"{urdf.source}: joint '{joint.name}' mimics '{m.joint}', which does not move; "
                    "remove the mimic element or make it mimic a moving joint"
                )
            mimics.append(TreeMimic(index[joint.name], index[m.joint], float(m.multiplier), float(m.offset)))
    return tuple(mimics)


def _placement(m: Any) -> JointPlacement:
    return JointPlacement(tuple(float(x) for x in m.rotation.ravel()), tuple(float(x) for x in m.translation))


def _inertia(i: Any) -> dict[str, Any]:
    m = i.inertia
    six = (m[0, 0], m[0, 1], m[1, 1], m[0, 2], m[1, 2], m[2, 2])
    lever, inertia = tuple(float(x) for x in i.lever), tuple(float(x) for x in six)
    return {"mass": float(i.mass), "lever": lever, "inertia": inertia}


def _axis(joint: Any) -> Numbers:
    """The joint's unit axis in its own frame, read off its motion subspace; zero for several degrees of freedom."""
    import pinocchio as pin

    if joint.nv != 1:
        return (0.0, 0.0, 0.0)
    one = pin.Model()
    index = one.addJoint(0, joint, pin.SE3.Identity(), "joint")
    scratch = one.createData()
    pin.computeJointJacobians(one, scratch, pin.neutral(one))
    column = pin.getJointJacobian(one, scratch, index, pin.ReferenceFrame.LOCAL).reshape(6, -1)[:, 0]
    return tuple(float(x) for x in (column[3:] if np.any(column[3:]) else column[:3]))
