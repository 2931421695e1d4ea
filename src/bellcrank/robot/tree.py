"""From a URDF to the tree that is traced: Pinocchio reads it, the rotations are cleaned, the numbers laid out.

Real URDFs write a quarter turn as 1.5708 or 1.57079632679. The residues of their sines and cosines keep
operations alive that the robot does not have, so entries within 1e-11 of -1, 0 and 1 become exact, and
body inertias are gathered anew over the cleaned placements.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from bellcrank.errors import InputError
from bellcrank.messages import unknown_name
from bellcrank.robot.payload import Payload

if TYPE_CHECKING:
    from bellcrank.robot.urdf_file import Urdf

NEAR = 1e-11  # a rotation entry this close to -1, 0 or 1 is taken for it
LEAST_MASS = 2.3e-16  # kg: Pinocchio divides sums of inertias by their mass, or by the rounding of 1 where that is more
FREE_BASE = "root_joint"  # what Pinocchio names the joint of a free base
_UNLIMITED = 1e299
_KINDS = {
    "JointModelRX": 0, "JointModelRY": 1, "JointModelRZ": 2, "JointModelRevoluteUnaligned": 3, "JointModelPX": 4,
    "JointModelPY": 5, "JointModelPZ": 6, "JointModelPrismaticUnaligned": 7, "JointModelFreeFlyer": 8,
    "JointModelPlanar": 9,
}  # fmt: skip
_NAMES = ("revolute",) * 4 + ("prismatic",) * 4 + ("floating", "planar")

FrameTable = dict[str, tuple[str, tuple[float, ...], tuple[float, ...]]]  # name: (link, xyz, rpy)


@dataclass
class Cleaning:
    """What cleaning changed: how many matrix entries, and the largest change."""

    entries: int = 0
    largest: float = 0.0

    def rotation(self, r: Any) -> Any:
        """The rotation with its near-misses of -1, 0, 1 made exact, orthonormal again."""
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
        """Entries below NEAR times the scale made zero."""
        near = (np.abs(x) <= NEAR * scale) & (x != 0.0)
        if not near.any():
            return x
        self.entries += int(near.sum())
        self.largest = max(self.largest, float(np.abs(x[near]).max()))
        return np.where(near, 0.0, x)


@dataclass
class Tree:
    """A robot's tree as plain data, in the layout of the tracer (cpp/tracer/tree.hpp); JSON can hold it."""

    joints: list[dict[str, Any]] = field(default_factory=list)  # without the world; mimicking joints too
    frames: list[dict[str, Any]] = field(default_factory=list)
    mimics: list[tuple[int, int, float, float]] = field(default_factory=list)
    cleaned_entries: int = 0
    cleaned_largest: float = 0.0

    def massive_frames(self) -> list[int]:
        """The frames of moving links and payloads that have mass or inertia of their own."""
        return [
            k
            for k, f in enumerate(self.frames)
            if f["parent_joint"] > 0 and (f["mass"] > 0.0 or any(x != 0.0 for x in f["inertia"]))
        ]

    def moved_with(self, joints: list[int], set_masses: Mapping[int, float] | None = None) -> tuple[list[str], float]:
        """The body frames that move when these joints (numbered from 1) do, their followers too, and their mass, kg.
        `set_masses` are masses that frames have instead of their own, kg.
        """
        moving = {*joints, *(f for f, leader, ratio, _ in self.mimics if leader in joints and ratio != 0.0)}
        mass = 0.0
        for k, joint in enumerate(self.joints, 1):  # a parent comes before its children
            if k in moving or joint["parent"] in moving:
                moving.add(k)
                mass += joint["mass"]
        names = [f["name"] for f in self.frames if f["is_body"] and f["parent_joint"] in moving]
        if not set_masses:
            return names, mass
        masses = [set_masses.get(k, f["mass"]) for k, f in enumerate(self.frames) if f["parent_joint"] in moving]
        return names, float(sum(masses))


def pinocchio_model(
    urdf: Urdf, floating_base: bool, payloads: tuple[Payload, ...], frames: FrameTable, clean: bool, mimic: bool
) -> tuple[Any, Cleaning]:
    """The pinocchio.Model of a URDF, cleaned; with `mimic` the followers are Pinocchio's mimic joints."""
    import pinocchio as pin

    for joint in urdf.joints.values():
        if joint.type == "planar" and tuple(joint.axis) != (0.0, 0.0, 1.0):
            raise InputError(
                f"{urdf.source}: planar joint '{joint.name}' moves in the plane normal to {list(joint.axis)}; only "
                "0 0 1 can be simulated: turn the joint's origin instead"
            )
    if floating_base and FREE_BASE in urdf.joints:
        raise InputError(
            f"{urdf.source}: a joint is named '{FREE_BASE}', as the joint of a free base is; rename it, or load "
            "the robot with a fixed base"
        )
    arguments: list[Any] = [urdf.pinocchio_xml()]
    if floating_base:
        arguments.append(pin.JointModelFreeFlyer())
    try:
        model = pin.buildModelFromXML(*arguments, mimic)
    except (RuntimeError, ValueError) as error:
        raise InputError(f"{urdf.source}: Pinocchio refuses it: {error}") from error
    model.name = urdf.name
    _give_links_their_inertia(model, urdf)
    for name, (link, xyz, rpy) in frames.items():
        if name in [f.name for f in model.frames]:
            raise InputError(f"frame '{name}' is in {urdf.source} already; choose another name")
        parent = frame_index(model, link, "link")
        placement = pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz, dtype=float))
        at = model.frames[parent]
        model.addFrame(pin.Frame(name, at.parentJoint, parent, at.placement * placement, pin.FrameType.OP_FRAME), False)
    for k, load in enumerate(payloads):
        parent = frame_index(model, load.frame, "frame")
        at = model.frames[parent]
        xx, xy, yy, xz, yz, zz = load.inertia
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        inertia = _body(load.mass, np.array(load.cg, dtype=float), matrix)
        frame = pin.Frame(f"payload {k + 1}", at.parentJoint, parent, at.placement, pin.FrameType.BODY, inertia)
        model.addFrame(frame, True)
    for frame in model.frames:
        if 0.0 < frame.inertia.mass < LEAST_MASS:
            raise InputError(
                f"{urdf.source}: '{frame.name}' has a mass of {frame.inertia.mass:g} kg; bodies below {LEAST_MASS:g} "
                "kg cannot be computed with: write all masses, inertias and forces in a smaller unit, or 0 for no mass"
            )
    cleaning = Cleaning()
    if clean:
        _clean(model, cleaning)
    for name in ("lowerPositionLimit", "upperPositionLimit", "effortLimit", "velocityLimit"):
        values = np.array(getattr(model, name))
        values[np.abs(values) > _UNLIMITED] = math.copysign(math.inf, -1.0 if name.startswith("lower") else 1.0)
        setattr(model, name, values)
    for name in ("lowerEffortLimit", "lowerVelocityLimit"):
        if hasattr(model, name):
            values = np.array(getattr(model, name))
            values[np.abs(values) > _UNLIMITED] = -math.inf
            setattr(model, name, values)
    return model, cleaning


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
            frame.inertia = _body(i.mass, np.array(i.xyz), turn @ about_cg @ turn.T)


def _body(mass: float, lever: Any, about_cg: Any) -> Any:
    """A pinocchio.Inertia; its own constructor refuses what real URDFs hold (check_urdf is there to say so)."""
    import pinocchio as pin

    inertia = pin.Inertia.Zero()
    inertia.mass, inertia.lever, inertia.inertia = float(mass), lever, about_cg
    return inertia


def frame_index(model: Any, name: str, kind: str) -> int:
    """The index of the frame of that name, links before joints; InputError where there is none."""
    import pinocchio as pin

    found = [i for i, f in enumerate(model.frames) if f.name == name]
    if not found:
        raise InputError(unknown_name(kind, name, [f.name for f in model.frames][1:]))
    return min(found, key=lambda i: model.frames[i].type == pin.FrameType.JOINT)


def _clean(model: Any, cleaning: Cleaning) -> None:
    import pinocchio as pin

    size = _size(model)

    def placed(m: Any) -> Any:
        return pin.SE3(cleaning.rotation(m.rotation), cleaning.numbers(m.translation, size))

    def inertia(i: Any) -> Any:
        spread = float(np.trace(i.inertia))
        return _body(i.mass, cleaning.numbers(i.lever, size), cleaning.numbers(i.inertia, spread))

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


def _size(model: Any) -> float:
    """What lengths of a model are compared with, m: its longest one, and 1 m where it is larger."""
    lengths = [p.translation for p in model.jointPlacements] + [f.placement.translation for f in model.frames]
    return min(1.0, float(np.abs(lengths).max(initial=0.0)) or 1.0)


def _placement(m: Any) -> dict[str, list[float]]:
    return {"rotation": [float(x) for x in m.rotation.ravel()], "translation": [float(x) for x in m.translation]}


def _inertia(i: Any) -> dict[str, Any]:
    m = i.inertia
    six = [m[0, 0], m[0, 1], m[1, 1], m[0, 2], m[1, 2], m[2, 2]]
    return {"mass": float(i.mass), "lever": [float(x) for x in i.lever], "inertia": [float(x) for x in six]}


def _axis(joint: Any) -> list[float]:
    """The joint's unit axis in its own frame, read off its motion subspace; zero for a free or planar joint."""
    import pinocchio as pin

    if joint.nv != 1:
        return [0.0, 0.0, 0.0]
    one = pin.Model()
    index = one.addJoint(0, joint, pin.SE3.Identity(), "joint")
    scratch = one.createData()
    pin.computeJointJacobians(one, scratch, pin.neutral(one))
    column = pin.getJointJacobian(one, scratch, index, pin.ReferenceFrame.LOCAL).reshape(6, -1)[:, 0]
    return [float(x) for x in (column[3:] if np.any(column[3:]) else column[:3])]


def lay_out(model: Any, urdf: Urdf, cleaning: Cleaning, clean: bool) -> Tree:
    """The tracer's plain data of a model in which every joint, mimicking or not, is a joint of its own."""
    import pinocchio as pin

    tree = Tree(cleaned_entries=cleaning.entries, cleaned_largest=cleaning.largest)
    again, size = Cleaning(), _size(model)
    for j in range(1, model.njoints):
        joint = model.joints[j]
        short = joint.shortname()
        if short not in _KINDS:
            raise InputError(f"{urdf.source}: joint '{model.names[j]}' is of a kind that cannot be traced ({short})")
        kind = _KINDS[short]
        axis = _axis(joint)
        sign = 1.0
        if kind in (3, 7) and sorted(axis)[:2] == [-1.0, 0.0] and max(axis) == 0.0:
            # about -z by q is about z by -q: the aligned joint folds to fewer operations
            sign, kind = -1.0, kind - 3 + axis.index(-1.0)
        tree.joints.append(
            {
                "name": model.names[j], "kind": kind, "what": _NAMES[kind], "sign": sign, "parent": model.parents[j],
                "axis": axis, "nq": joint.nq, "nv": joint.nv, "armature": [0.0] * joint.nv,
                **_placement(model.jointPlacements[j]), **_inertia(model.inertias[j]),
            }
        )  # fmt: skip
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
        tree.frames.append(
            {
                "name": frame.name, "parent_frame": frame.parentFrame if k else -1,
                "parent_joint": frame.parentJoint, "moving_joint": moving,
                "is_joint": frame.type == pin.FrameType.JOINT, "is_body": frame.type == pin.FrameType.BODY,
                "placement": _placement(frame.placement), "in_parent": _placement(relative),
                "rpy": [float(x) for x in rpy],
                **_inertia(frame.inertia),
            }
        )  # fmt: skip
    index = {model.names[j]: j for j in range(1, model.njoints)}
    for joint in urdf.joints.values():
        if joint.mimic is not None and joint.name in index:
            m = joint.mimic
            if m.joint not in index:
                raise InputError(
                    f"{urdf.source}: joint '{joint.name}' mimics '{m.joint}', which does not move; "
                    "remove the mimic element or make it mimic a moving joint"
                )
            tree.mimics.append((index[joint.name], index[m.joint], float(m.multiplier), float(m.offset)))
    return tree
