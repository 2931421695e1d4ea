"""A pinocchio.Model of a URDF, with payloads and added frames, cleaned of rounding residues."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.formats.extended_joints import has_extended_joints, with_extended_joints
from bellcrank.robot.model.rounding_cleanup import Cleaning, body_inertia, clean_model

if TYPE_CHECKING:
    from bellcrank.robot.formats.urdf_file import Urdf
    from bellcrank.robot.model.load_options import LoadOptions

LEAST_MASS = 2.3e-16  # kg: Pinocchio divides sums of inertias by their mass, or by the rounding of 1 where that is more
FREE_BASE = "root_joint"  # what Pinocchio names the joint of a free base
WORLD = "world"  # the world's own frame, to which frames may be added where no link has this name
_UNLIMITED = 1e299


def pinocchio_model(urdf: Urdf, options: LoadOptions, mimic: bool) -> tuple[Any, Cleaning]:
    """The pinocchio.Model of a URDF, cleaned; with `mimic` the followers are Pinocchio's mimic joints.

    Gravity and rotor inertias are not set. Raises InputError.
    """
    model = _built(urdf, options.floating_base, mimic)
    model.name = urdf.name
    _give_links_their_inertia(model, urdf)
    _add_frames(model, urdf, options)
    _add_payloads(model, options)
    for frame in model.frames:
        if 0.0 < frame.inertia.mass < LEAST_MASS:
            raise InputError(
                f"{urdf.source}: '{frame.name}' has a mass of {frame.inertia.mass:g} kg; masses below {LEAST_MASS:g} "
                "kg are not supported: write all masses, inertias and forces in a smaller unit, or 0 for no mass"
            )
    cleaning = clean_model(model) if options.clean else Cleaning()
    _remove_placeholder_limits(model)
    return model, cleaning


def model_frame_index(model: Any, name: str, kind: str) -> int:
    """The index of the frame of that name in a pinocchio.Model, a link before a joint. Raises InputError."""
    import pinocchio as pin

    found = [i for i, f in enumerate(model.frames) if f.name == name]
    if not found:
        raise InputError(unknown_name(kind, name, [f.name for f in model.frames][1:]))
    return min(found, key=lambda i: model.frames[i].type == pin.FrameType.JOINT)


def _built(urdf: Urdf, floating_base: bool, mimic: bool) -> Any:
    import pinocchio as pin

    for joint in urdf.joints.values():
        if joint.type == "planar" and tuple(joint.axis) != (0.0, 0.0, 1.0):
            raise InputError(
                f"{urdf.source}: planar joint '{joint.name}' moves in the plane normal to {list(joint.axis)}; only "
                "the normal 0 0 1 is supported: rotate the joint's origin instead"
            )
    if floating_base and FREE_BASE in urdf.joints:
        raise InputError(
            f"{urdf.source}: a joint has the name '{FREE_BASE}', which is reserved for the joint of a free base; "
            "rename it, or load the robot with a fixed base"
        )
    base = [pin.JointModelFreeFlyer()] if floating_base else []
    if mimic and has_extended_joints(urdf):
        raise InputError(
            f"{urdf.source}: mimic joints of Pinocchio beside spherical joints or screws are not supported"
        )
    try:
        return with_extended_joints(pin.buildModelFromXML(urdf.pinocchio_xml(), *base, mimic), urdf)
    except (RuntimeError, ValueError) as error:
        raise InputError(f"{urdf.source}: Pinocchio does not accept the robot: {error}") from error


def _give_links_their_inertia(model: Any, urdf: Urdf) -> None:
    """Keep each link's own inertia with its frame: Pinocchio's reader keeps only the sum over a joint's links."""
    import pinocchio as pin

    for frame in model.frames:
        frame.inertia = pin.Inertia.Zero()
        link = urdf.links.get(frame.name) if frame.type == pin.FrameType.BODY else None
        if link is not None and link.inertial is not None:
            i = link.inertial
            turn = pin.rpy.rpyToMatrix(*i.rpy)
            xx, xy, xz, yy, yz, zz = i.inertia
            about_cg = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            frame.inertia = body_inertia(i.mass, np.array(i.xyz), turn @ about_cg @ turn.T)


def _add_frames(model: Any, urdf: Urdf, options: LoadOptions) -> None:
    import pinocchio as pin

    for name, (link, xyz, rpy) in options.frames.items():
        if name in [f.name for f in model.frames]:
            raise InputError(f"{urdf.source} already has a frame '{name}'; choose another name")
        world = link == WORLD and not model.existFrame(WORLD)
        parent = 0 if world else model_frame_index(model, link, "link")
        placement = pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz, dtype=float))
        at = model.frames[parent]
        model.addFrame(pin.Frame(name, at.parentJoint, parent, at.placement * placement, pin.FrameType.OP_FRAME), False)


def _add_payloads(model: Any, options: LoadOptions) -> None:
    import pinocchio as pin

    for k, load in enumerate(options.payloads):
        parent = model_frame_index(model, load.frame, "frame")
        at = model.frames[parent]
        xx, xy, yy, xz, yz, zz = load.inertia
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        inertia = body_inertia(load.mass, np.array(load.cg, dtype=float), matrix)
        frame = pin.Frame(f"payload {k + 1}", at.parentJoint, parent, at.placement, pin.FrameType.BODY, inertia)
        model.addFrame(frame, True)


def _remove_placeholder_limits(model: Any) -> None:
    """Make limits infinite that stand for none: Pinocchio's reader takes no infinity (Urdf.pinocchio_xml)."""
    for name in ("lowerPositionLimit", "upperPositionLimit", "effortLimit", "velocityLimit"):
        values = np.array(getattr(model, name))
        values[np.abs(values) > _UNLIMITED] = math.copysign(math.inf, -1.0 if name.startswith("lower") else 1.0)
        setattr(model, name, values)
    for name in ("lowerEffortLimit", "lowerVelocityLimit"):
        if hasattr(model, name):
            values = np.array(getattr(model, name))
            values[np.abs(values) > _UNLIMITED] = -math.inf
            setattr(model, name, values)
