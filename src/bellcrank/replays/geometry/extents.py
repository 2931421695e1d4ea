"""How large bodies are: the corners of boxes around their shapes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from bellcrank.replays.film.film import Body, Mesh, Shape
from bellcrank.replays.geometry.rotations import turned

Array = NDArray[np.float64]
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


def body_corners(bodies: Sequence[Body]) -> list[Array]:
    """For each body the corners (8, 3) m, in its frame, of a box around its shapes; its origin where it has none."""
    meshes: dict[int, tuple[Array, Array]] = {}
    return [_around([_corners(shape, meshes) for shape in body.shapes]) for body in bodies]


def reaches(corners: Sequence[Array]) -> Array:
    """How far (k,) m the points of each body are from its origin, at most."""
    return np.array([np.linalg.norm(box, axis=1).max() for box in corners])


def cloud(poses: Array, corners: Sequence[Array]) -> Array:
    """The corners (n, 8 k, 3) m of all bodies in the world, for poses (n, k, 7)."""
    boxes = np.stack(corners) if corners else np.zeros((0, 8, 3))
    points = poses[:, :, None, :3] + turned(np.repeat(poses[:, :, None, 3:], 8, axis=2), boxes[None])
    return np.asarray(points.reshape(len(poses), -1, 3))


def _around(boxes: list[Array]) -> Array:
    if not boxes:
        return np.zeros((8, 3))
    points = np.concatenate(boxes)
    low, high = points.min(axis=0), points.max(axis=0)
    return np.asarray(0.5 * (low + high) + 0.5 * CORNERS * (high - low))


def _corners(shape: Shape, meshes: dict[int, tuple[Array, Array]]) -> Array:
    """A box around a shape, in its body's frame."""
    middle, size = np.zeros(3), np.array(shape.size, dtype=np.float64)
    if shape.kind == "mesh":
        low, high = _span(shape.mesh, meshes)
        middle, half = 0.5 * (low + high) * size, 0.5 * (high - low) * size
    elif shape.kind == "cylinder":
        half = np.array([size[0], size[0], 0.5 * size[1]])
    else:
        half = 0.5 * size if shape.kind == "box" else np.full(3, size[0])
    pose = np.array(shape.pose)
    return np.asarray(pose[:3] + turned(pose[3:], middle + CORNERS * half))


def _span(mesh: Mesh | None, meshes: dict[int, tuple[Array, Array]]) -> tuple[Array, Array]:
    if mesh is None or not len(mesh.vertices):
        return np.zeros(3), np.zeros(3)
    if id(mesh) not in meshes:
        meshes[id(mesh)] = mesh.vertices.min(axis=0).astype(float), mesh.vertices.max(axis=0).astype(float)
    return meshes[id(mesh)]
