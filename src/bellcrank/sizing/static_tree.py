"""The joints of a robot's tree with the masses that move with them, for statics in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bellcrank.robot.robot import Robot, RobotJoint

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TreeLink:
    """A joint of the tree: its placement in the parent, its axis, and the masses that move with it."""

    parent: int  # -1: the world
    turn: Array
    shift: Array
    axis: Array
    kind: str
    column: int  # among the joints with one degree of freedom; -1: another, which stays at its neutral posture
    mass: Array  # (bodies,)
    lever: Array  # (bodies, 3), in the joint's frame


def tree_links(robot: Robot, joints: tuple[RobotJoint, ...]) -> list[TreeLink]:
    """The joints of the tree in its order, parents first; `joints` are those with one degree of freedom."""
    tree, columns = robot.equations.tree, {joint.name: k for k, joint in enumerate(joints)}
    bodies: list[list[tuple[float, Array]]] = [[] for _ in tree.joints]
    for frame in (tree.frames[k] for k in tree.massive_frames()):
        turn = np.array(frame.placement.rotation).reshape(3, 3)
        lever = turn @ np.array(frame.lever) + np.array(frame.placement.translation)
        bodies[frame.parent_joint - 1].append((frame.mass, lever))
    return [
        TreeLink(
            joint.parent - 1,
            np.array(joint.placement.rotation).reshape(3, 3),
            np.array(joint.placement.translation),
            np.array(joint.axis),
            joint.kind if joint.name in columns else "held",
            columns.get(joint.name, -1),
            np.array([mass for mass, _ in carried]),
            np.array([lever for _, lever in carried]).reshape(-1, 3),
        )
        for joint, carried in zip(tree.joints, bodies, strict=True)
    ]


def cross(axis: Array, vectors: Array) -> Array:
    """axis (3,) × vectors (3, r)."""
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ vectors


def rotated(axis: Array, vectors: Array, cosine: Array, sine: Array) -> Array:
    """Vectors (3, r) rotated about an axis by angles of these cosines and sines (r,) (Rodrigues' formula)."""
    along = np.outer(axis, (axis @ vectors) * (1.0 - cosine))
    return np.asarray(vectors * cosine + cross(axis, vectors) * sine + along)
