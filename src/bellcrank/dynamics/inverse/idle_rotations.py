"""Idle rotations of a closed linkage: turns of links about the line through their connections that no motor drives.

Such is the turn of a rod between two balls; all other links stay at rest.

A motion n of the joints, J n = 0, with all prescribed joints at rest, is an idle rotation where all links that move
have one twist, a rotation about a line, and at least two joints or constraints connect them to links at rest. A link
with one connection, such as a pendulum, is none: its weight decides how it moves.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bellcrank.arrays import Array, Mask
from bellcrank.dynamics.constraints.constraint_rows import characteristic_length, velocity_units
from bellcrank.elements.symbols import Symbols

if TYPE_CHECKING:
    import casadi

    from bellcrank.scene.scene import Scene

SMALL = 1e-7  # of the largest singular value or entry: below this, a number counts as 0


@dataclass(frozen=True, eq=False)
class IdleRotation:
    """A rotation that no motor drives.

    Attributes:
        rates: The rates (nv,) of all joints; the largest is 1.
        joints: The joints that move.
        links: The links with mass that turn.
    """

    rates: Array
    joints: tuple[str, ...]
    links: tuple[str, ...]

    def __str__(self) -> str:
        links = ", ".join(f"'{name}'" for name in self.links) or "without mass"
        return (
            f"link{'s' * (len(self.links) > 1)} {links} (joint{'s' * (len(self.joints) > 1)} {', '.join(self.joints)})"
        )


def idle_rotations(scene: Scene, q: Array, jacobian: Array, prescribed: Collection[int]) -> tuple[IdleRotation, ...]:
    """The idle rotations at a posture q (nq,) among the motions that leave the joints `prescribed` at rest.

    Args:
        scene: The scene, whose constraints connect links beside the joints of the tree.
        q: The posture, which satisfies the constraints.
        jacobian: J (rows, nv) of the constraints there, in rad and characteristic lengths.
        prescribed: The velocity coordinates whose motion is prescribed.

    Returns:
        Those of a basis of these motions, of as few joints a vector as elimination finds.
    """
    robot = scene.robot
    free = np.setdiff1d(np.arange(robot.nv), list(prescribed))
    basis = null_space(jacobian[:, free])
    if not basis.shape[1]:
        return ()
    rates = np.zeros((basis.shape[1], robot.nv))
    rates[:, free] = _sparse(basis)
    rates *= velocity_units(scene)
    rates /= rates[np.arange(len(rates)), np.abs(rates).argmax(axis=1)][:, None]
    twists = _joint_twists(scene, q, rates)
    found = []
    for row, twist in zip(rates, twists, strict=True):
        moving = _turning(twist, characteristic_length(scene))
        if moving.any() and _connections(scene, moving) >= 2:
            used = [j.name for j in robot.joints if np.abs(row[j.v : j.v + j.nv]).max() > SMALL]
            joints = np.concatenate([[False], moving])
            links = [f.name for f in robot.equations.tree.frames if f.is_body and joints[f.parent_joint] and f.mass]
            found.append(IdleRotation(row, tuple(used), tuple(links)))
    return tuple(found)


def null_space(matrix: Array) -> Array:
    """An orthonormal basis (n, k) of the null space of a matrix (m, n)."""
    _, singular, rows = np.linalg.svd(matrix)
    kept = int(np.count_nonzero(singular > SMALL * singular.max(initial=0.0)))
    return np.asarray(rows[kept:].T)


def _turning(twist: Array, length: float) -> Mask:
    """The joints (k,) whose links move, where all have one twist (k, 6), a rotation about a line; else none.

    Twists are the velocity of the point at the world's origin, m/s, and the angular velocity, rad/s.
    """
    twist = twist / np.repeat([max(length, np.abs(twist[:, :3]).max()), 1.0], 3)
    size = np.abs(twist).max()
    moving = np.abs(twist).max(axis=1) > SMALL * size
    one = twist[moving][0] if moving.any() else np.zeros(6)
    alike = np.abs(twist[moving] - one).max(initial=0.0) <= 10 * SMALL * size
    line = abs(float(one[:3] @ one[3:])) <= 10 * SMALL * size * np.abs(one[3:]).max()
    return moving if alike and line and one[3:].any() else np.zeros(len(twist), dtype=bool)


def _connections(scene: Scene, moving: Mask) -> int:
    """The number of joints and constraints between links that move and links at rest."""
    robot = scene.robot
    tree = robot.equations.tree
    moves = np.concatenate([[False], moving])  # by the number of the joint, 0 for the world
    count = sum(moves[k] != moves[joint.parent] for k, joint in enumerate(tree.joints, 1))
    for constraint in scene.constraints:
        a, b, *_ = [*(tree.frames[robot.frame_index(name)].parent_joint for name in constraint.frames), 0, 0]
        count += moves[a] != moves[b]
    return int(count)


def _joint_twists(scene: Scene, q: Array, rates: Array) -> Array:
    """The twists (n, joints, 6) of the links that joints carry at one posture, at n rates (n, nv), in world axes.

    They are the velocity, m/s, of the point at the world's origin, and the angular velocity, rad/s.
    """

    def build() -> casadi.Function:
        import casadi

        s = Symbols(scene.robot, scene.parameters)
        rows = [
            casadi.vertcat(frame.linear + casadi.cross(frame.position, frame.angular), frame.angular)
            for frame in s.joint_frames()
        ]
        return casadi.Function("twists", [s.q, s.v, s.p], [casadi.densify(casadi.vertcat(*rows))])

    code = scene.robot.compiled(f"joint twists {_settings(scene)}", build)
    flat = np.asarray(code(np.tile(q, (len(rates), 1)), rates, scene.parameter_values))
    return flat.reshape(len(rates), -1, 6)


def _settings(scene: Scene) -> str:
    return repr([parameter.sets for parameter in scene.parameters.values()])


def _sparse(basis: Array) -> Array:
    """The same space as that of the columns (n, k), as rows (k, n) that Gauss-Jordan elimination makes sparse."""
    rows = basis.T.copy()
    for k in range(len(rows)):
        rest = np.abs(rows[k:])
        row, column = divmod(int(rest.argmax()), rest.shape[1])
        rows[[k, k + row]] = rows[[k + row, k]]
        rows[k] /= rows[k, column]
        others = np.arange(len(rows)) != k
        rows[others] -= np.outer(rows[others, column], rows[k])
    return np.where(np.abs(rows) > SMALL, rows, 0.0)
