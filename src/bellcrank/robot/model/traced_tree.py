"""Handing a robot's tree to the tracer, which runs Pinocchio's algorithms on symbols, with parameters in it.

The tracer numbers what a parameter sets in a frame (`Setting` in cpp/tracer/tree.hpp): 0 to 5 the origin (x, y, z,
roll, pitch, yaw), MASS, 7 to 9 the centre of mass, 10 to 15 the inertia, and SCALE, a factor on mass and inertia.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from bellcrank.codegen.tracer import extension
from bellcrank.errors import InputError
from bellcrank.messages import unknown_name

if TYPE_CHECKING:
    from bellcrank.robot.model.tree import JointPlacement, Tree, TreeFrame

ORIGIN = ("x", "y", "z", "roll", "pitch", "yaw")
INERTIA = ("xx", "xy", "yy", "xz", "yz", "zz")
MASS = 6
SCALE = 16


def setting(tree: Tree, target: str) -> tuple[int, int]:
    """What a parameter sets, as (frame, what) of the tracer.

    Targets: "joint.NAME.origin.x|y|z|roll|pitch|yaw" (m, rad, in the parent link), "link.NAME.mass" (kg),
    "link.NAME.cg.x|y|z" (m, link frame), "link.NAME.inertia.xx|xy|yy|xz|yz|zz" (kg m², about the centre of mass, link
    axes), "link.NAME.scale" (a factor on mass and inertia). Raises InputError for anything else.
    """
    kind, _, rest = target.partition(".")
    for tail, whats in (
        ("origin", {n: i for i, n in enumerate(ORIGIN)}),
        ("cg", {n: 7 + i for i, n in enumerate(ORIGIN[:3])}),
        ("inertia", {n: 10 + i for i, n in enumerate(INERTIA)}),
    ):
        name, dot, component = rest.rpartition(f".{tail}.")
        if dot and component in whats and (kind == "joint") == (tail == "origin"):
            return _frame_of(tree, kind, name), whats[component]
    name, dot, component = rest.rpartition(".")
    if kind == "link" and component in ("mass", "scale"):
        return _frame_of(tree, kind, name), MASS if component == "mass" else SCALE
    raise InputError(
        f"a parameter cannot set '{target}'; it can set joint.NAME.origin.x (y, z, roll, pitch, yaw), link.NAME.mass, "
        "link.NAME.cg.x, link.NAME.inertia.xx or link.NAME.scale"
    )


def _frame_of(tree: Tree, kind: str, name: str) -> int:
    def fits(frame: TreeFrame) -> bool:
        return frame.is_body if kind == "link" else not frame.is_body

    for k, frame in enumerate(tree.frames):
        if frame.name == name and fits(frame):
            return k
    raise InputError(unknown_name(kind, name, [frame.name for frame in tree.frames[1:] if fits(frame)]))


def trace_tree(tree: Tree, gravity: tuple[float, ...], settings: list[tuple[int, int, int]], parameters: int) -> Any:
    """The tracer's tree. settings: (frame, what, index into the parameter vector p)."""
    t = extension()

    def placed(placement: JointPlacement) -> Any:
        return t.Placement(placement.rotation, placement.translation)

    joints = [
        t.Joint(j.tracer_kind, j.sign, j.parent, j.axis, j.pitch, placed(j.placement), j.mass, j.lever, j.inertia,
                j.armature)
        for j in tree.joints
    ]  # fmt: skip
    frames = [
        t.Frame(f.parent_frame, f.parent_joint, f.moving_joint, placed(f.placement), placed(f.in_parent), f.rpy,
                f.mass, f.lever, f.inertia)
        for f in tree.frames
    ]  # fmt: skip
    mimics = [t.Mimic(*m) for m in tree.mimics]
    return t.Tree(joints, frames, mimics, [t.Setting(*s) for s in settings], list(gravity), parameters)
