"""Rotations as matrices (3, 3) and as unit quaternions x y z w.

scipy's Rotation does the same, but importing it takes longer than loading a robot.
"""

from __future__ import annotations

import numpy as np

from bellcrank.arrays import Array


def from_rpy(rpy: Array) -> Array:
    """The matrix of roll, pitch, yaw (3,) in rad about the fixed x, y, z axes in that order, as in a URDF."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def between(begin: Array, end: Array, part: float) -> Array:
    """The rotation at a part (0 to 1) of the shortest way from one rotation to another."""
    relative = begin.T @ end
    angle = float(angles_to(relative[None], np.eye(3))[0])
    if angle < 1e-12:
        return end if part >= 1.0 else begin
    if part >= 1.0:
        return end
    skew = np.array([relative[2, 1] - relative[1, 2], relative[0, 2] - relative[2, 0], relative[1, 0] - relative[0, 1]])
    size = np.linalg.norm(skew)  # zero at half a turn, where the axis is the eigenvector of 1
    axis = skew / size if size > 1e-6 else np.linalg.svd(relative - np.eye(3))[2][-1]
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + np.sin(part * angle) * cross + (1.0 - np.cos(part * angle)) * (cross @ cross)
    return np.asarray(begin @ turn)


def angles_to(rotations: Array, wanted: Array) -> Array:
    """The angles (n,) in rad between rotations (n, 3, 3) and one rotation (3, 3)."""
    relative = np.swapaxes(rotations, 1, 2) @ wanted
    skew = np.stack(
        [
            relative[:, 2, 1] - relative[:, 1, 2],
            relative[:, 0, 2] - relative[:, 2, 0],
            relative[:, 1, 0] - relative[:, 0, 1],
        ],
        axis=1,
    )
    return np.asarray(np.arctan2(np.linalg.norm(skew, axis=1), np.trace(relative, axis1=1, axis2=2) - 1.0))


def from_matrices(rotations: Array) -> Array:
    """Unit quaternions (…, 4) x y z w of rotation matrices (…, 3, 3).

    Divides by the largest of the four components, which keeps all digits. Source: S. Shepperd, Journal of Guidance and
    Control 1, 1978.
    """
    r = np.ascontiguousarray(rotations.reshape(-1, 9).T)
    out = _by_w(r)
    others = np.flatnonzero(r[0] + r[4] + r[8] <= 0.0)
    if len(others):
        out[:, others] = _by_largest(r[:, others])
    out /= np.sqrt(np.einsum("km,km->m", out, out))
    return np.ascontiguousarray(out.T).reshape(*rotations.shape[:-2], 4)


def _by_w(r: Array) -> Array:
    """4 w times the quaternions (4, m) of rotations (9, m), row major; w must not be small."""
    return np.stack([r[7] - r[5], r[2] - r[6], r[3] - r[1], 1.0 + r[0] + r[4] + r[8]])


def _by_largest(r: Array) -> Array:
    """4 times the largest component times the quaternions (4, m)."""
    xy, xz, yz = r[3] + r[1], r[2] + r[6], r[7] + r[5]
    wx, wy, wz, w = _by_w(r)
    x, y, z = 1.0 + r[0] - r[4] - r[8], 1.0 - r[0] + r[4] - r[8], 1.0 - r[0] - r[4] + r[8]
    choices = np.stack([[x, xy, xz, wx], [xy, y, yz, wy], [xz, yz, z, wz], [wx, wy, wz, w]])
    return np.asarray(choices[np.argmax([x, y, z, w], axis=0), :, np.arange(r.shape[1])].T)


def conjugate(quaternions: Array) -> Array:
    """Conjugates of quaternions (…, 4)."""
    return np.asarray(quaternions * np.array([-1.0, -1.0, -1.0, 1.0]))


def cross(left: Array, right: Array) -> Array:
    """Cross products (…, 3) of vectors (…, 3), as numpy's; without its overhead, which dominates for few vectors."""
    a, b, c = left[..., 0], left[..., 1], left[..., 2]
    x, y, z = right[..., 0], right[..., 1], right[..., 2]
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)


def multiply(left: Array, right: Array) -> Array:
    """Hamilton products (…, 4) of quaternions (…, 4)."""
    u, w, r, m = left[..., :3], left[..., 3:], right[..., :3], right[..., 3:]
    vector = w * r + m * u + cross(u, r)
    return np.concatenate([vector, w * m - np.sum(u * r, axis=-1, keepdims=True)], axis=-1)


def rotate(quaternions: Array, vectors: Array) -> Array:
    """Vectors (…, 3) rotated by unit quaternions (…, 4)."""
    u, w = quaternions[..., :3], quaternions[..., 3:]
    turned = 2.0 * cross(u, vectors)
    return np.asarray(vectors + w * turned + cross(u, turned))


def make_continuous(quaternions: Array) -> Array:
    """Quaternions (n, k, 4) with signs flipped in place so that each row continues the row before it."""
    against = np.einsum("nkc,nkc->nk", quaternions[1:], quaternions[:-1]) < 0.0
    quaternions[1:][np.logical_xor.accumulate(against, axis=0)] *= -1.0
    return quaternions
