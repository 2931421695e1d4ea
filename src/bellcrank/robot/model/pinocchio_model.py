"""A pinocchio.Model of a URDF, with payloads and added frames, cleaned of rounding residues.

It equals the model of Pinocchio's reader of URDF in bits, before cleaning. The residues of the sines and cosines of
angles such as 1.5708 keep operations alive that the robot does not have: entries of rotation matrices within 1e-11 of
−1, 0 and 1 become exact, and the joints' inertias are gathered anew over the cleaned placements.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

if TYPE_CHECKING:
    from bellcrank.robot.formats.urdf_elements import Vector3
    from bellcrank.robot.formats.urdf_file import Joint, Link, Urdf
    from bellcrank.robot.model.payload import LoadOptions

LEAST_MASS = 2.3e-16  # kg: Pinocchio divides sums of inertias by their mass, or by the rounding of 1 where that is more
FREE_BASE = "root_joint"  # what Pinocchio names the joint of a free base
WORLD = "world"  # the world's own frame, to which frames may be added where no link has this name
ALIGNED = 1e-12  # an axis this close to x, y or z is that one, as for Pinocchio's reader
NEAR = 1e-11  # a rotation entry this close to -1, 0 or 1 is taken to be that number
_UNLIMITED = 1e299


def pinocchio_model(urdf: Urdf, options: LoadOptions, mimic: bool) -> tuple[Any, Cleaning]:
    """The pinocchio.Model of a URDF, cleaned; with `mimic` the followers are Pinocchio's mimic joints.

    Where a leader comes after its follower, which Pinocchio does not accept, every joint is one of its own. Gravity and
    rotor inertias are not set. Raises InputError.
    """
    for joint in urdf.joints.values():
        if joint.type == "planar" and tuple(joint.axis) != (0.0, 0.0, 1.0):
            raise InputError(
                f"{urdf.source}: planar joint '{joint.name}' moves in the plane normal to {list(joint.axis)}; only "
                "the normal 0 0 1 is supported: rotate the joint's origin instead"
            )
    if options.floating_base and FREE_BASE in urdf.joints:
        raise InputError(
            f"{urdf.source}: a joint has the name '{FREE_BASE}', which is reserved for the joint of a free base; "
            "rename it, or load the robot with a fixed base"
        )
    model = plain_model(urdf, options.floating_base)
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
    return _with_mimics(model, urdf) if mimic else model, cleaning


def model_frame_index(model: Any, name: str, kind: str) -> int:
    """The index of the frame of that name in a pinocchio.Model, a link before a joint. Raises InputError."""
    import pinocchio as pin

    found = [i for i, f in enumerate(model.frames) if f.name == name]
    if not found:
        raise InputError(unknown_name(kind, name, [f.name for f in model.frames][1:]))
    return min(found, key=lambda i: model.frames[i].type == pin.FrameType.JOINT)


# ---- the tree


def plain_model(urdf: Urdf, floating_base: bool = False) -> Any:
    """The links and joints alone, every joint one of its own; a limit that the file does not give is infinite.

    As with Pinocchio's reader, joints are numbered depth first, children in the order of their joints' names.
    """
    import pinocchio as pin

    below: dict[str, list[Joint]] = {name: [] for name in urdf.links}
    for joint in sorted(urdf.joints.values(), key=lambda joint: joint.name, reverse=True):
        below[joint.parent].append(joint)
    model = pin.Model()
    above = 0
    if floating_base:
        free = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), FREE_BASE)
        above = model.addJointFrame(free, 0)
    frames = {urdf.root: _add_link(model, above, urdf.links[urdf.root])}  # of links, by name
    waiting = list(below[urdf.root])
    while waiting:
        joint = waiting.pop()
        waiting.extend(below[joint.child])
        parent = frames[joint.parent]
        at = model.frames[parent]
        place = at.placement * pin.SE3(_rotation(joint.rpy), np.array(joint.xyz))
        if joint.type == "fixed":
            fixed = pin.Frame(joint.name, at.parentJoint, parent, place, pin.FrameType.FIXED_JOINT)
            above = model.addFrame(fixed, False)
        else:
            above = model.addJointFrame(_add_joint(model, joint, at.parentJoint, place), parent)
        frames[joint.child] = _add_link(model, above, urdf.links[joint.child])
    return model


def _add_joint(model: Any, joint: Joint, parent: int, place: Any) -> int:
    """Add a joint; components of unit vectors are limited to ±1.01, as in Pinocchio's reader."""
    made = _joint_model(joint)
    effort, velocity = np.full((2, made.nv), math.inf)
    lower, upper = np.full(made.nq, -math.inf), np.full(made.nq, math.inf)
    damping, friction = np.zeros((2, made.nv))
    if made.nv == 1:
        terms = ((lower, joint.lower), (upper, joint.upper), (effort, joint.effort), (velocity, joint.velocity))
        for array, value in (*terms, (damping, joint.damping), (friction, joint.friction)):
            if value is not None:
                array[0] = value
    else:
        unit = slice(-2, None) if joint.type == "planar" else slice(-4, None)
        lower[unit], upper[unit] = -1.01, 1.01
    return int(
        model.addJoint(
            parent, made, place, joint.name, -effort, effort, -velocity, velocity, lower, upper, -friction, friction,
            damping,
        )
    )  # fmt: skip


def _joint_model(joint: Joint) -> Any:
    import pinocchio as pin

    axis = np.array(joint.axis)
    if joint.type == "screw":
        return pin.JointModelHelicalUnaligned(axis, joint.pitch / (2.0 * math.pi))
    several = {
        "floating": pin.JointModelFreeFlyer, "planar": pin.JointModelPlanar, "spherical": pin.JointModelSpherical,
    }  # fmt: skip
    if joint.type in several:
        return several[joint.type]()
    aligned = [pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ]
    unaligned = pin.JointModelRevoluteUnaligned
    if joint.type == "prismatic":
        aligned = [pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ]
        unaligned = pin.JointModelPrismaticUnaligned
    for made, unit in zip(aligned, np.eye(3), strict=True):
        if (axis - unit) @ (axis - unit) <= ALIGNED**2:
            return made()
    return unaligned(axis / np.sqrt(axis @ axis))


def _add_link(model: Any, above: int, link: Link) -> int:
    """Add a link at a frame, that of its joint; the frame's number."""
    import pinocchio as pin

    frame, i = model.frames[above], link.inertial
    if i is not None:
        turn = _rotation(i.rpy)
        about_cg = _product(_product(turn, _matrix(i.inertia)), turn.T)
        model.appendBodyToJoint(frame.parentJoint, body_inertia(i.mass, np.array(i.xyz), about_cg), frame.placement)
    elif frame.type != pin.FrameType.JOINT:  # a sum with nothing rounds; so it does in Pinocchio's reader
        model.appendBodyToJoint(frame.parentJoint, pin.Inertia.Zero(), frame.placement)
    body = pin.Frame(link.name, frame.parentJoint, above, frame.placement, pin.FrameType.BODY)
    return int(model.addFrame(body, above > 0))


def _product(a: Any, b: Any) -> Any:
    """The product of two matrices (3, 3), summed as in Pinocchio's reader for the same rounding."""
    terms = a[:, :, None] * b
    return terms[:, 0] + (terms[:, 1] + terms[:, 2])


def _rotation(rpy: Vector3) -> Any:
    """The rotation matrix (3, 3) of angles about fixed axes, by a unit quaternion as in urdfdom."""
    import pinocchio as pin

    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(0.5 * angle), math.sin(0.5 * angle)) for angle in rpy)
    x, y, z = sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy
    w = cr * cp * cy + sr * sp * sy
    length = math.sqrt(x * x + y * y + z * z + w * w)
    return pin.Quaternion(w / length, x / length, y / length, z / length).matrix()


def _matrix(entries: tuple[float, ...]) -> Any:
    xx, xy, xz, yy, yz, zz = entries
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _with_mimics(model: Any, urdf: Urdf) -> Any:
    """The model with Pinocchio's mimic joints; unchanged where a leader comes after its follower, which those lack."""
    import pinocchio as pin

    mimics = [
        (model.getJointId(joint.mimic.joint), model.getJointId(joint.name), joint.mimic)
        for joint in urdf.joints.values()
        if joint.mimic is not None
    ]
    for leader, follower, mimic in mimics if all(leader < follower for leader, follower, _ in mimics) else ():
        model = pin.transformJointIntoMimic(model, leader, follower, mimic.multiplier, mimic.offset)
    return model


# ---- what is added to it


def _give_links_their_inertia(model: Any, urdf: Urdf) -> None:
    """Keep each link's own inertia with its frame, as the model has only the sum over a joint's links."""
    import pinocchio as pin

    for frame in model.frames:
        if frame.type == pin.FrameType.BODY and (i := urdf.links[frame.name].inertial) is not None:
            turn = pin.rpy.rpyToMatrix(*i.rpy)
            frame.inertia = body_inertia(i.mass, np.array(i.xyz), turn @ _matrix(i.inertia) @ turn.T)


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
    """Make limits infinite that stand for none, such as those of the free base."""
    for name in (
        "lowerPositionLimit", "upperPositionLimit", "effortLimit", "velocityLimit", "lowerEffortLimit",
        "lowerVelocityLimit",
    ):  # fmt: skip
        values = np.array(getattr(model, name))
        values[np.abs(values) > _UNLIMITED] = -math.inf if name.startswith("lower") else math.inf
        setattr(model, name, values)


# ---- rounding residues: a quarter turn written as 1.5708 becomes exact


@dataclass
class Cleaning:
    """What cleaning changed: how many matrix entries, and the largest change."""

    entries: int = 0
    largest: float = 0.0

    def rotation(self, r: Any) -> Any:
        """The rotation (3, 3) with entries near −1, 0 and 1 made exact, orthonormal again."""
        out = np.where(np.abs(r) <= NEAR, 0.0, r)
        for i, k in zip(*np.nonzero(np.abs(out) >= 1.0 - NEAR), strict=True):
            # 1 - 7e-12 beside 3.7e-6 is no residue but a rotation: only an entry alone in row and column is one
            if np.count_nonzero(out[i]) == 1 and np.count_nonzero(out[:, k]) == 1:
                out[i, k] = np.sign(out[i, k])
        if np.array_equal(out, r):
            return r
        if np.abs(out @ out.T - np.eye(3)).max() > 0.0:
            u, _, vt = np.linalg.svd(out)
            polar = u @ vt
            alone = np.abs(out) * (np.abs(polar - out) < 1e-15)
            out = np.where((np.abs(polar) < 1e-15) | (alone == 1.0), out, polar)
        self.entries += int(np.count_nonzero(out != r))
        self.largest = max(self.largest, float(np.abs(out - r).max()))
        return out

    def numbers(self, x: Any, scale: float) -> Any:
        """The numbers, those below NEAR times the scale set to zero."""
        near = (np.abs(x) <= NEAR * scale) & (x != 0.0)
        if not near.any():
            return x
        self.entries += int(near.sum())
        self.largest = max(self.largest, float(np.abs(x[near]).max()))
        return np.where(near, 0.0, x)


def clean_model(model: Any) -> Cleaning:
    """Clean a pinocchio.Model in place, its frames holding the inertias of their links; what was changed."""
    import pinocchio as pin

    cleaning, size = Cleaning(), length_scale(model)

    def placed(m: Any) -> Any:
        return pin.SE3(cleaning.rotation(m.rotation), cleaning.numbers(m.translation, size))

    def inertia(i: Any) -> Any:
        spread = float(np.trace(i.inertia))
        return body_inertia(i.mass, cleaning.numbers(i.lever, size), cleaning.numbers(i.inertia, spread))

    for j in range(1, model.njoints):
        model.jointPlacements[j] = placed(model.jointPlacements[j])
    bodies: list[Any] = [None] * model.njoints
    for frame in model.frames:
        frame.placement = placed(frame.placement)
        frame.inertia = inertia(frame.inertia)
        if frame.inertia.mass > 0.0 or np.any(frame.inertia.inertia):
            part, before = frame.placement.act(frame.inertia), bodies[frame.parentJoint]
            # a sum with nothing would round the lever, and equal numbers would no longer fold
            bodies[frame.parentJoint] = part if before is None else before + part
    for j in range(1, model.njoints):
        model.inertias[j] = pin.Inertia.Zero() if bodies[j] is None else inertia(bodies[j])
    return cleaning


def length_scale(model: Any) -> float:
    """What lengths of a model are compared with, m: its longest one, or 1 m where it is longer."""
    lengths = [p.translation for p in model.jointPlacements] + [f.placement.translation for f in model.frames]
    return min(1.0, float(np.abs(lengths).max(initial=0.0)) or 1.0)


def body_inertia(mass: float, lever: Any, about_cg: Any) -> Any:
    """A pinocchio.Inertia of any numbers; its own constructor refuses some of real URDFs, which check_urdf reports."""
    import pinocchio as pin

    inertia = pin.Inertia.Zero()
    inertia.mass, inertia.lever, inertia.inertia = float(mass), lever, about_cg
    return inertia
