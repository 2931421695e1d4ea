"""The camera of a film, which sees the whole motion from a suitable side, and the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bellcrank.arrays import Array
from bellcrank.motion.kinematics.rotations import conjugate, multiply
from bellcrank.replays.film.film import Camera, Ground
from bellcrank.replays.geometry.shapes import triple

HALF_VIEW = np.tan(np.deg2rad(20.0))  # tangent of half the vertical field of view
ASPECT = 4.0 / 3.0
MARGIN = 1.12  # factor on what must be visible
PLANAR = 1e-6  # of the size: a motion that leaves a plane by less is planar
TILT = np.deg2rad(9.0)  # from the normal of a planar scene, so that its bodies look solid
ELEVATION = np.deg2rad(22.0)  # of the camera above its target
AZIMUTH = np.deg2rad(35.0)  # from the direction in which the scene is broadest


@dataclass(frozen=True, eq=False, kw_only=True)
class CameraScene:
    """What a camera is chosen by.

    These are points (m, 3) m that must be visible, poses (n, k, 7) of the bodies, revolute axes (j, 3) in the world
    frame, and gravity (3,) m/s².
    """

    points: Array
    poses: Array
    axes: Array
    gravity: Array

    @property
    def up(self) -> Array:
        """The direction against gravity; z without gravity."""
        size = np.linalg.norm(self.gravity)
        return -self.gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])


def motion_plane_normal(scene: CameraScene) -> Array | None:
    """The unit normal (3,) of the plane of a planar motion; None if the motion is not planar.

    All rotations and joint axes are parallel to the normal, and no body's origin moves along it.
    """
    poses = scene.poses
    moves = poses[:, :, :3] - poses[:1, :, :3]
    back = conjugate(poses[:1, :, 3:])
    turns = multiply(poses[:, :, 3:], np.broadcast_to(back, poses[:, :, 3:].shape))[..., :3].reshape(-1, 3)
    directions = np.concatenate([turns, scene.axes])
    if not len(directions) or np.abs(directions).max() < 1e-9:
        return None
    normal = np.linalg.svd(directions.T @ directions)[0][:, 0]
    normal = normal * np.sign(normal[np.abs(normal).argmax()])
    across = np.linalg.norm(directions - np.outer(directions @ normal, normal), axis=1).max()
    size = max(float(np.ptp(scene.points, axis=0).max()), 1e-9)
    if across > PLANAR or np.abs(moves @ normal).max(initial=0.0) > PLANAR * size:
        return None
    return np.where(np.abs(normal) < PLANAR, 0.0, normal)


def choose_camera(scene: CameraScene) -> Camera:
    """A camera that sees all points: almost along the normal of a planar motion, else on the broadest side, from above.

    The direction against gravity is up; without gravity, y for a motion in the x-y plane, else z.
    """
    normal, up = motion_plane_normal(scene), scene.up
    if normal is not None and abs(float(normal @ up)) > 0.9:
        up = _across(np.array([0.0, 1.0, 0.0]), normal)
    if normal is not None and abs(float(normal @ up)) < 0.1:
        right = np.cross(up, normal)
        back = normal * (np.sign(right[np.abs(right).argmax()]) or 1.0)
        back = _tilted(back, up, TILT, TILT)
    else:
        back = _tilted(_broad_side(scene.points, up), up, AZIMUTH, ELEVATION)
    return fit_camera(scene.points, back, up)


def fit_camera(points: Array, back: Array, up: Array) -> Camera:
    """The nearest camera that looks along −back and has all points (m, 3) in view, with a margin.

    With x to the right and z towards the camera, a point is visible if |x − x₀| <= (d − z) tan(angle). Both conditions
    are linear in x₀ and d, so that the smallest d follows directly.
    """
    back = back / np.linalg.norm(back)
    right = _across(np.cross(up, back), back)
    above = np.cross(back, right)
    x, y, z = points @ right, points @ above, points @ back
    middle, distance = [], 0.0
    for side, tangent in ((x, HALF_VIEW * ASPECT / MARGIN), (y, HALF_VIEW / MARGIN)):
        high, low = (side + tangent * z).max(), (side - tangent * z).min()
        middle.append(0.5 * (high + low))
        distance = max(distance, 0.5 * (high - low) / tangent)
    depth = 0.5 * (z.max() + z.min())
    distance = max(distance, depth + 0.2 * max(float(np.ptp(z)), 1e-3), z.max() + 1e-2)
    base = middle[0] * right + middle[1] * above
    return Camera(triple(base + distance * back), triple(base + depth * back), triple(up))


def choose_ground(planes: Sequence[tuple[Array, float]], scene: CameraScene, fixed_base: bool) -> Ground | None:
    """The ground: the first of the planes (normal, height) that disks roll on, else a floor under the robot.

    A robot on a fixed base with gravity along −z has a floor at its lowest point, or at z = 0 if that is close; others
    have none.
    """
    if planes:
        normal, height = planes[0]
        return Ground(triple(normal), float(height))
    if not fixed_base or not np.allclose(scene.up, [0.0, 0.0, 1.0]) or not np.any(scene.gravity):
        return None
    lowest, size = float(scene.points[:, 2].min()), float(np.ptp(scene.points, axis=0).max())
    return Ground((0.0, 0.0, 1.0), 0.0 if -0.02 * size < lowest < 0.25 * size else lowest)


def _broad_side(points: Array, up: Array) -> Array:
    """The horizontal direction of the smallest extent of points, towards +x, or −y if it is across x."""
    level = points - np.outer(points @ up, up)
    level = level - level.mean(axis=0)
    spread = level.T @ level
    least = np.linalg.eigh(spread + np.outer(up, up) * (1.0 + np.trace(spread)))[1][:, 0]
    least = least - (least @ up) * up
    towards = np.array([0.8, -1.0, 0.3])
    return np.asarray(least * (np.sign(least @ towards) or 1.0) / np.linalg.norm(least))


def _tilted(back: Array, up: Array, azimuth: float, elevation: float) -> Array:
    right = np.cross(up, back)
    level = np.cos(azimuth) * back + np.sin(azimuth) * right
    return np.asarray(np.cos(elevation) * level + np.sin(elevation) * up)


def _across(vector: Array, direction: Array) -> Array:
    """The unit vector across a direction that is nearest to a vector; any one if the vector is parallel to it."""
    for choice in (vector, *np.eye(3)):
        rest = choice - (choice @ direction) * direction
        if np.linalg.norm(rest) > 1e-6:
            return np.asarray(rest / np.linalg.norm(rest))
    raise AssertionError("one of three axes is across any direction")
