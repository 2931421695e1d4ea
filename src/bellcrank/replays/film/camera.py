"""Where to look from: a camera that sees the whole motion from a good side, and the ground under it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bellcrank.replays.film.film import Camera, Ground, Triple
from bellcrank.replays.geometry.rotations import multiplied

Array = NDArray[np.float64]
HALF_VIEW = np.tan(np.deg2rad(20.0))  # up and down
ASPECT = 4.0 / 3.0
MARGIN = 1.12  # of what must be seen
FLAT = 1e-6  # of the size: a motion that leaves a plane by less is planar
TILT = np.deg2rad(9.0)  # from square on, so that a planar scene is seen to be made of bodies
HEIGHT = np.deg2rad(22.0)  # of the eye above what it looks at
ASIDE = np.deg2rad(35.0)  # from the side on which most is seen


class Scenery(NamedTuple):
    """What a camera must know: points (m, 3) to be seen, poses (n, k, 7) of the bodies, joint axes (j, 3) in the world,
    and gravity (3,) m/s².
    """

    points: Array
    poses: Array
    axes: Array
    gravity: Array

    @property
    def up(self) -> Array:
        """Away from gravity; z without any."""
        size = np.linalg.norm(self.gravity)
        return -self.gravity / size if size > 0.0 else np.array([0.0, 0.0, 1.0])


def plane_normal(scenery: Scenery) -> Array | None:
    """The unit normal (3,) of the one plane that everything moves along; None where there is no such plane.

    All turns, and all joint axes, are about it, and no body's origin moves along it.
    """
    poses = scenery.poses
    moves = poses[:, :, :3] - poses[:1, :, :3]
    back = poses[:1, :, 3:] * np.array([-1.0, -1.0, -1.0, 1.0])
    turns = multiplied(poses[:, :, 3:], np.broadcast_to(back, poses[:, :, 3:].shape))[..., :3].reshape(-1, 3)
    directions = np.concatenate([turns, scenery.axes])
    if not len(directions) or np.abs(directions).max() < 1e-9:
        return None
    normal = np.linalg.svd(directions.T @ directions)[0][:, 0]
    normal = normal * np.sign(normal[np.abs(normal).argmax()])
    across = np.linalg.norm(directions - np.outer(directions @ normal, normal), axis=1).max()
    size = max(float(np.ptp(scenery.points, axis=0).max()), 1e-9)
    if across > FLAT or np.abs(moves @ normal).max(initial=0.0) > FLAT * size:
        return None
    return np.where(np.abs(normal) < FLAT, 0.0, normal)


def camera_for(scenery: Scenery) -> Camera:
    """A camera that sees all points: square on, nearly, for a planar motion, otherwise from the side on which most is
    seen, from a little above. Away from gravity is up; without any, y in a planar scene in the x-y plane, else z.
    """
    normal, up = plane_normal(scenery), scenery.up
    if normal is not None and abs(float(normal @ up)) > 0.9:
        up = _across(np.array([0.0, 1.0, 0.0]), normal)
    if normal is not None and abs(float(normal @ up)) < 0.1:
        right = np.cross(up, normal)
        back = normal * (np.sign(right[np.abs(right).argmax()]) or 1.0)
        back = _tilted(back, up, TILT, TILT)
    else:
        back = _tilted(_broad_side(scenery.points, up), up, ASIDE, HEIGHT)
    return fitted(scenery.points, back, up)


def fitted(points: Array, back: Array, up: Array) -> Camera:
    """The nearest camera that looks along −back and has all points (m, 3) in view, with a margin.

    With x to the right and z towards the eye, a point is seen where |x − x₀| <= (d − z) tan(angle): both edges are
    linear in x₀ and d, so the least d is found at once.
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
    return Camera(_triple(base + distance * back), _triple(base + depth * back), _triple(up))


def ground_for(planes: Sequence[tuple[Array, float]], scenery: Scenery, fixed_base: bool) -> Ground | None:
    """The plane that a disk rolls on; else, for a robot on a fixed base under gravity along −z, the level of its lowest
    point, or z = 0 where it is no lower; None where there is no ground to think of.
    """
    if planes:
        normal, height = planes[0]
        return Ground(_triple(normal), float(height))
    if not fixed_base or not np.allclose(scenery.up, [0.0, 0.0, 1.0]) or not np.any(scenery.gravity):
        return None
    lowest, size = float(scenery.points[:, 2].min()), float(np.ptp(scenery.points, axis=0).max())
    return Ground((0.0, 0.0, 1.0), 0.0 if -0.02 * size < lowest < 0.25 * size else lowest)


def _broad_side(points: Array, up: Array) -> Array:
    """The horizontal direction in which points differ least, towards +x or, failing that, −y."""
    level = points - np.outer(points @ up, up)
    level = level - level.mean(axis=0)
    spread = level.T @ level
    least = np.linalg.eigh(spread + np.outer(up, up) * (1.0 + np.trace(spread)))[1][:, 0]
    least = least - (least @ up) * up
    towards = np.array([0.8, -1.0, 0.3])
    return np.asarray(least * (np.sign(least @ towards) or 1.0) / np.linalg.norm(least))


def _tilted(back: Array, up: Array, aside: float, above: float) -> Array:
    right = np.cross(up, back)
    level = np.cos(aside) * back + np.sin(aside) * right
    return np.asarray(np.cos(above) * level + np.sin(above) * up)


def _across(vector: Array, direction: Array) -> Array:
    """The unit vector perpendicular to a direction that is nearest to a vector, or any where that is along it."""
    for choice in (vector, *np.eye(3)):
        rest = choice - (choice @ direction) * direction
        if np.linalg.norm(rest) > 1e-6:
            return np.asarray(rest / np.linalg.norm(rest))
    raise AssertionError("one of three axes is across any direction")


def _triple(vector: Array) -> Triple:
    x, y, z = (float(c) + 0.0 for c in vector)
    return (x, y, z)
