"""Shapes of bodies: boxes, cylinders, spheres and triangle meshes, and the boxes around them.

Lengths are in m. A pose is seven numbers: position x y z and unit quaternion x y z w.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Array
from bellcrank.motion.kinematics.rotations import rotate

Colour = tuple[float, float, float, float]
GREY: Colour = (0.7, 0.7, 0.7, 1.0)  # in place of a texture that cannot be read
MOST_PIXELS, MOST_DECODED = 64_000_000, 256_000_000  # of one texture, and of all textures of one file
# excludes formats for which Pillow starts other programs, such as EPS
FORMATS = "PNG JPEG TGA BMP DIB GIF TIFF WEBP DDS PPM JPEG2000 PCX SGI PSD ICO".split()
Triple = tuple[float, float, float]
Pose = tuple[float, float, float, float, float, float, float]
IDENTITY: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


def texture_colour(data: bytes | None) -> Colour | None:
    """The mean colour of the opaque part of an image file; None if it cannot be read or is too large."""
    return _mean_colour(data, MOST_PIXELS)[0]


class Textures:
    """The mean colours of the textures of one file, by name; each is read once, up to MOST_DECODED pixels in total."""

    def __init__(self, content: Callable[[str], bytes | None]) -> None:
        self._content, self._left = content, MOST_DECODED
        self._known: dict[str, Colour | None] = {}

    def colour(self, name: str) -> Colour | None:
        """The mean colour of a texture; None if it cannot be read, or if those before it used up the pixels allowed."""
        if name not in self._known:
            self._known[name], pixels = _mean_colour(self._content(name), min(MOST_PIXELS, self._left))
            self._left -= pixels
        return self._known[name]


def _mean_colour(data: bytes | None, most: int) -> tuple[Colour | None, int]:
    """The mean colour of an image file, and the number of pixels decoded for it."""
    from PIL import Image, ImageStat

    pixels = 0
    try:
        with warnings.catch_warnings(action="ignore"):  # of Pillow, about large images
            image = Image.open(BytesIO(data or b""), formats=FORMATS)
            if image.width * image.height > most:
                return None, 0
            pixels = image.width * image.height
            image.draft("RGB", (64, 64))  # JPEG files can be read small
            whole = image.convert("RGBA")
            red, green, blue = ImageStat.Stat(whole.convert("RGB"), whole.getchannel("A")).mean
            return clip_colour((red / 255.0, green / 255.0, blue / 255.0, 1.0)), pixels
    except Exception:  # an invalid file may raise anything
        return None, pixels


def clip_colour(colour: Colour) -> Colour:
    """The colour with each number limited to 0 to 1; ValueError if one is not finite."""
    if not np.isfinite(colour).all():
        raise ValueError("a colour is not finite")
    red, green, blue, opacity = (round(min(max(float(x), 0.0), 1.0), 4) for x in colour)
    return red, green, blue, opacity


# None is further than 18° from the next: 5 % of a sphere's radius.
DIRECTIONS = np.array([each for each in product((-1.0, -0.5, 0.0, 0.5, 1.0), repeat=3) if max(map(abs, each)) == 1.0])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
RIM = np.stack([np.cos(angles := np.arange(24) * np.pi / 12), np.sin(angles), np.ones(24)], axis=1)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: vertices (k, 3) float32 in m, and faces (m, 3) int32, counter-clockwise seen from outside."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]


@dataclass(frozen=True, kw_only=True)
class DrawnShape:
    """One solid of a body, at a `pose` in the body's frame.

    `size` is (x, y, z) of a box, (radius, length along z) of a cylinder, (radius,) of a sphere, and the scale along x,
    y and z of a mesh. Several shapes may share a `mesh`. `placeholder` marks a shape that the URDF does not define as a
    visual and that only indicates where the body is.
    """

    kind: Literal["box", "cylinder", "sphere", "mesh"]
    size: tuple[float, ...]
    colour: Colour
    pose: Pose = IDENTITY
    mesh: Mesh | None = None
    placeholder: bool = False


@dataclass(frozen=True)
class DrawnBody:
    """Shapes that move together with the link or frame of this name."""

    name: str
    shapes: tuple[DrawnShape, ...]


def triple(vector: Array) -> Triple:
    """The numbers of an array (3,), without negative zeros."""
    x, y, z = (vector + 0.0).tolist()
    return x, y, z


# ---- bounding boxes


def bounding_boxes(bodies: Sequence[DrawnBody]) -> list[Array]:
    """Corners (8, 3) m, in each body's frame, of a box around all its shapes; the origin for a body without shapes."""
    meshes: dict[int, tuple[Array, Array]] = {}
    return [_box_around([_shape_corners(shape, meshes) for shape in body.shapes]) for body in bodies]


def body_radii(corners: Sequence[Array]) -> Array:
    """Largest distances (k,) m of the points of each body from its origin."""
    return np.array([np.linalg.norm(box, axis=1).max() for box in corners])


def outlines(bodies: Sequence[DrawnBody]) -> list[Array]:
    """The points (98, 3) m of each body, in its frame, that are farthest in as many directions: closer than its box."""
    return [_farthest(np.concatenate([np.zeros((0, 3)), *map(_surface_points, body.shapes)])) for body in bodies]


def _farthest(points: Array) -> Array:
    if not len(points):
        return np.zeros_like(DIRECTIONS)
    extent = np.ptp(points, axis=0)  # by which directions are stretched, so that a slender body keeps its girth
    return np.asarray(points[np.argmax(points / np.where(extent > 0.0, extent, 1.0) @ DIRECTIONS.T, axis=0)])


def _surface_points(shape: DrawnShape) -> Array:
    """Points (k, 3) m in the body's frame, among which are those of a shape that are farthest in any direction."""
    size = np.array(shape.size, dtype=np.float64)
    if shape.kind == "mesh":
        points = np.zeros((0, 3)) if shape.mesh is None else shape.mesh.vertices * size
    elif shape.kind == "cylinder":
        points = np.concatenate([RIM, -RIM]) * [size[0], size[0], 0.5 * size[1]]
    else:
        points = 0.5 * CORNERS * size if shape.kind == "box" else size[0] * DIRECTIONS
    pose = np.array(shape.pose)
    return np.asarray(pose[:3] + rotate(pose[3:], points))


def world_corners(poses: Array, corners: Sequence[Array]) -> Array:
    """Points (c, 3) m of each of k bodies, such as the corners of its box, in the world frame (n, c k, 3) m, for poses
    (n, k, 7).
    """
    boxes = np.stack(corners) if corners else np.zeros((0, 8, 3))
    points = poses[:, :, None, :3] + rotate(np.repeat(poses[:, :, None, 3:], boxes.shape[1], axis=2), boxes[None])
    return np.asarray(points.reshape(len(poses), -1, 3))


def _box_around(boxes: list[Array]) -> Array:
    if not boxes:
        return np.zeros((8, 3))
    points = np.concatenate(boxes)
    low, high = points.min(axis=0), points.max(axis=0)
    return np.asarray(0.5 * (low + high) + 0.5 * CORNERS * (high - low))


def _shape_corners(shape: DrawnShape, meshes: dict[int, tuple[Array, Array]]) -> Array:
    """Corners (8, 3) m of a box around a shape, in its body's frame; `meshes` caches the extents of meshes."""
    middle, size = np.zeros(3), np.array(shape.size, dtype=np.float64)
    if shape.kind == "mesh":
        low, high = _mesh_extent(shape.mesh, meshes)
        middle, half = 0.5 * (low + high) * size, 0.5 * (high - low) * size
    elif shape.kind == "cylinder":
        half = np.array([size[0], size[0], 0.5 * size[1]])
    else:
        half = 0.5 * size if shape.kind == "box" else np.full(3, size[0])
    pose = np.array(shape.pose)
    return np.asarray(pose[:3] + rotate(pose[3:], middle + CORNERS * half))


def _mesh_extent(mesh: Mesh | None, meshes: dict[int, tuple[Array, Array]]) -> tuple[Array, Array]:
    if mesh is None or not len(mesh.vertices):
        return np.zeros(3), np.zeros(3)
    if id(mesh) not in meshes:
        meshes[id(mesh)] = mesh.vertices.min(axis=0).astype(float), mesh.vertices.max(axis=0).astype(float)
    return meshes[id(mesh)]
