"""Rotations that spherical joints can make while all other joints stand still, such as that of a rod about its axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bellcrank.robot.robot import Robot

Array = NDArray[np.float64]
SMALL = 1e-7  # of the largest singular value or entry: below this, a number counts as 0


def idle_rotations(robot: Robot, jacobian: Array) -> list[str]:
    """A sentence for each rotation of spherical joints alone that the constraints J v = 0 (rows, nv) admit.

    They are a basis of the null space of the columns of the spherical joints, of as few joints a vector as elimination
    finds.
    """
    balls = [joint for joint in robot.joints if joint.kind == "spherical"]
    columns = [joint.v + k for joint in balls for k in range(joint.nv)]
    if not columns:
        return []
    sentences = []
    for rates in _sparse(null_space(jacobian[:, columns])):
        moving = []
        rates = rates * np.sign(rates[np.abs(rates) > SMALL][0])
        for k, joint in enumerate(balls):
            turn = rates[3 * k : 3 * k + 3]
            if np.abs(turn).max() > SMALL:
                axis = turn / np.linalg.norm(turn) + 0.0
                child = robot.urdf.joints[joint.name].child
                moving.append(f"joint '{joint.name}' about ({', '.join(f'{x:.3g}' for x in axis)}) of link '{child}'")
        sentences.append(" with ".join(moving) + (" turns by itself" if len(moving) == 1 else " turn by themselves"))
    return sentences


def null_space(matrix: Array) -> Array:
    """An orthonormal basis (n, k) of the null space of a matrix (m, n)."""
    _, singular, rows = np.linalg.svd(matrix)
    kept = int(np.count_nonzero(singular > SMALL * singular.max(initial=0.0)))
    return np.asarray(rows[kept:].T)


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
