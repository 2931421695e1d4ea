"""Everything of a URDF that a robot needs, checked; kept on disk so that the next time is quick."""

from __future__ import annotations

import importlib.metadata
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bellcrank.codegen import cache as disk
from bellcrank.messages import utf8
from bellcrank.robot.model.joints import KINDS
from bellcrank.robot.model.tree import Tree, TreeJoint

if TYPE_CHECKING:
    from bellcrank.robot.formats.robot_file import RobotFile
    from bellcrank.robot.formats.urdf_file import Joint, Urdf
    from bellcrank.robot.model.payload import LoadOptions, Payload

_LIMITS = ("lower", "upper", "effort", "velocity")


@dataclass(frozen=True, kw_only=True)
class JointLimits:
    """Limits of the independent joints: position (nq,), effort and velocity (nv,), infinite where there is none."""

    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    effort: list[float] = field(default_factory=list)
    velocity: list[float] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class RobotData:
    """What a URDF says, with the payloads and frames that were added.

    `friction` is (viscous, coulomb) by joint; `findings` are the errors that `check_urdf` finds in single elements;
    `inertia_warnings` are about links that move and have no mass; `singular_joints` maps each joint about whose axis
    nothing has inertia to a sentence that says so.
    """

    name: str
    tree: Tree
    limits: JointLimits
    friction: Mapping[str, tuple[float, float]]
    findings: tuple[str, ...]
    inertia_warnings: tuple[str, ...]
    singular_joints: Mapping[str, str]


def robot_data(file: RobotFile, options: LoadOptions) -> RobotData:
    """The data of a robot file, from the cache or made anew. Raises InputError, which names the file."""
    key = "robot-" + disk.digest(
        json.dumps(file.urdf, default=attrgetter("tag", "attributes", "text", "children")),  # quicker than its text
        utf8(file.source.stem),  # the name of a robot that has none
        repr(options.floating_base),
        repr([asdict(load) for load in options.payloads]),
        repr(sorted(options.frames.items())),
        repr(options.clean),
        _version(),
    )
    data = _stored(key)
    if data is None:
        data = _read(file.tree, options)
        disk.store(key, _to_json(data).encode())
    return data


# ---- the cache

_TREE = {
    "joints": [{str: object}],
    "frames": [{str: object}],
    "mimics": [(int, int, float, float)],
    "cleaned_entries": int,
    "cleaned_largest": float,
}
_STORED = {
    "name": str,
    "tree": _TREE,
    "limits": {name: [float | None] for name in _LIMITS},
    "friction": {str: (float, float)},
    "findings": [str],
    "inertia_warnings": [str],
    "singular_joints": {str: str},
}


def _version() -> str:
    """What the stored form depends on: Pinocchio's version and the sources of this room."""
    sources = sorted(Path(__file__).parents[1].rglob("*.py"))
    return importlib.metadata.version("libpinocchio") + disk.digest(*[p.read_bytes() for p in sources])


def _to_json(data: RobotData) -> str:
    limits = {name: [x if math.isfinite(x) else None for x in getattr(data.limits, name)] for name in _LIMITS}
    return json.dumps({**vars(data), "limits": limits}, default=vars)


def _stored(key: str) -> RobotData | None:
    """What is stored under a key, or None where nothing is, or nothing sound."""
    data: dict[str, Any] | None = disk.load_data(key, _STORED)
    if data is None:
        return None
    try:
        tree = Tree.from_data(data["tree"])
        sizes = [KINDS[joint.kind] for _, joint in _independent(tree)]
        sound = all((joint.nq, joint.nv) == KINDS[joint.kind] for joint in tree.joints)
    except (KeyError, TypeError, ValueError):
        return None
    limits = data["limits"]
    counts = [sum(nq for nq, _ in sizes)] * 2 + [sum(nv for _, nv in sizes)] * 2
    if not sound or [len(limits[name]) for name in _LIMITS] != counts:
        return None
    return RobotData(
        name=data["name"],
        tree=tree,
        limits=JointLimits(**{name: _with_infinities(limits[name], name) for name in _LIMITS}),
        friction={name: (b, c) for name, (b, c) in data["friction"].items()},
        findings=tuple(data["findings"]),
        inertia_warnings=tuple(data["inertia_warnings"]),
        singular_joints=data["singular_joints"],
    )


def _with_infinities(values: list[float | None], name: str) -> list[float]:
    infinity = -math.inf if name == "lower" else math.inf
    return [infinity if x is None else x for x in values]


# ---- reading


def _read(urdf: Urdf, options: LoadOptions) -> RobotData:
    from dataclasses import replace

    from bellcrank.robot.checks.element_checks import element_findings, moving_without_mass
    from bellcrank.robot.dynamics.articulated_inertia import articulated_inertias, vanishing_inertia
    from bellcrank.robot.model.pinocchio_model import pinocchio_model
    from bellcrank.robot.model.tree_layout import tree_of_model

    model, cleaning = pinocchio_model(urdf, options, mimic=False)
    tree = tree_of_model(model, urdf, cleaning, options.clean)
    # A free base does not change the tree beyond it, and the articulated inertias are those with the base fixed.
    fixed = model
    if options.floating_base:
        fixed = pinocchio_model(urdf, replace(options, floating_base=False), mimic=False)[0]
    inertias = articulated_inertias(urdf, fixed)
    return RobotData(
        name=urdf.name,
        tree=tree,
        limits=_limits(tree, urdf, model),
        friction=_friction(tree, urdf),
        findings=tuple(f"{f.where}: {f.message}" for f in element_findings(urdf) if f.severity == "error"),
        inertia_warnings=tuple(
            f"{f.where}: {f.message}" for f in moving_without_mass(urdf, _loaded_links(model, urdf, options.payloads))
        ),
        singular_joints={
            name: f"joint '{name}': {vanishing_inertia(urdf, name, least)}"
            for name, (least, threshold) in inertias.items()
            if abs(least) <= threshold
        },
    )


def _independent(tree: Tree) -> list[tuple[int, TreeJoint]]:
    """The joints that mimic no other, with their numbers from 1."""
    followers = tree.followers()
    return [(k, joint) for k, joint in enumerate(tree.joints, 1) if k not in followers]


def _limits(tree: Tree, urdf: Urdf, model: Any) -> JointLimits:
    """The limits of joints of one degree of freedom, none for others; a leader stops where its followers do."""
    limits, place = JointLimits(), {}
    for k, joint in _independent(tree):
        iq, iv = model.idx_qs[k], model.idx_vs[k]
        place[k] = (len(limits.lower), len(limits.velocity))
        if joint.nv == 1:
            limits.lower.append(float(model.lowerPositionLimit[iq]))
            limits.upper.append(float(model.upperPositionLimit[iq]))
            limits.effort.append(float(model.effortLimit[iv]))
            limits.velocity.append(float(model.velocityLimit[iv]))
        else:
            limits.lower.extend([-math.inf] * joint.nq)
            limits.upper.extend([math.inf] * joint.nq)
            limits.effort.extend([math.inf] * joint.nv)
            limits.velocity.extend([math.inf] * joint.nv)
    for follower, leader, multiplier, offset in tree.mimics:  # chains are resolved: each leader is independent
        if multiplier != 0.0 and leader in place:
            _tighten(limits, place[leader], urdf.joints[tree.joints[follower - 1].name], multiplier, offset)
    return limits


def _tighten(limits: JointLimits, place: tuple[int, int], follower: Joint, multiplier: float, offset: float) -> None:
    """Narrow a leader's range and speed, at this place in q and v, to what a follower allows."""
    iq, iv = place
    ends = sorted((x - offset) / multiplier for x in (follower.lower, follower.upper) if x is not None)
    if len(ends) == 2 and max(limits.lower[iq], ends[0]) <= min(limits.upper[iq], ends[1]):
        limits.lower[iq], limits.upper[iq] = max(limits.lower[iq], ends[0]), min(limits.upper[iq], ends[1])
    if follower.velocity is not None:
        limits.velocity[iv] = min(limits.velocity[iv], follower.velocity / abs(multiplier))


def _friction(tree: Tree, urdf: Urdf) -> dict[str, tuple[float, float]]:
    """(viscous, coulomb) of each joint of one degree of freedom, or spherical one, that has any, followers too."""
    friction = {}
    for tree_joint in tree.joints:
        joint = urdf.joints.get(tree_joint.name) if tree_joint.nv == 1 or tree_joint.kind == "spherical" else None
        if joint is not None and (joint.damping or joint.friction):
            friction[joint.name] = (float(joint.damping or 0.0), float(joint.friction or 0.0))
    return friction


def _loaded_links(model: Any, urdf: Urdf, payloads: Iterable[Payload]) -> list[str]:
    """The links that payloads are fixed to, directly or by frames that are no links."""
    from bellcrank.robot.model.pinocchio_model import model_frame_index

    found = []
    for load in payloads:
        frame = model_frame_index(model, load.frame, "frame")
        while frame and model.frames[frame].name not in urdf.links:
            frame = model.frames[frame].parentFrame
        if frame:
            found.append(model.frames[frame].name)
    return found
