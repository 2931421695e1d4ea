"""Mesh simplification by collapsing edges in the order of the quadric error metric.

Source: M. Garland and P. Heckbert, "Surface Simplification Using Quadric Error Metrics", SIGGRAPH 1997. Edges without
common neighbours collapse in one round, so that a round is a few array operations. trimesh passes this
on to another package, which bellcrank would need for pictures alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Array, Mask

Numbers = NDArray[np.int64]

MOST_ROUNDS = 400
LEVELS = 6
SCATTER = 0x9E3779B97F4A7C15 % 2**61  # 2^64 over the golden ratio: products with it are spread evenly (Knuth, TAOCP 3)
BORDER = 10.0  # weight of a shift of a border, relative to that of a surface
FOLD = -0.9  # below this cosine between the normals two faces are the sides of a sheet, and their edge is its border
MOST_TURN = 0.3  # least cosine between the old and the new normal of a face


def weld(vertices: Array, faces: Numbers) -> tuple[Array, Numbers]:
    """The same surface with coincident vertices merged, without degenerate faces and unused vertices.

    Vertices coincide if they are in the same cell of a grid with 2^20 cells along the largest extent.
    """
    used, faces = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], faces.reshape(-1, 3)
    low = vertices.min(axis=0)
    extent = float((vertices.max(axis=0) - low).max()) or 1.0
    cell = np.round((vertices - low) * (2**20 / extent)).astype(np.int64)
    _, first, which = np.unique(cell @ np.array([2**42, 2**21, 1]), return_index=True, return_inverse=True)
    vertices, faces = vertices[first], which[faces]
    twice = np.linalg.norm(_normals(vertices, faces), axis=1)
    return compact(vertices, faces[_proper(faces) & (twice > 1e-14 * extent**2)])


def compact(vertices: Array, faces: Numbers) -> tuple[Array, Numbers]:
    """The same surface without unused vertices."""
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


class Simplifier:
    """Simplifies a welded surface step by step; `faces` (m, 3) are the current ones.

    Borders, including those between the two sides of a thin sheet, are preserved like surfaces; no face turns over.
    """

    def __init__(self, vertices: Array, faces: Numbers) -> None:
        self._vertices, self.faces = vertices.copy(), faces
        self._quadrics = _quadrics(vertices, faces)
        self._edges = _Edges(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros(0))
        self._changed = np.ones(len(vertices), dtype=bool)

    def surface(self) -> tuple[Array, Numbers]:
        """The current vertices (k, 3) and faces (m, 3)."""
        return compact(self._vertices, self.faces)

    def reduce(self, tolerance: float) -> None:
        """Remove faces while the surface shifts by at most `tolerance` (root mean square, in the vertices' unit)."""
        for _ in range(MOST_ROUNDS):
            self._edges = self._edges.after(self._vertices, self._quadrics, self.faces, self._changed)
            self._changed[:] = False
            if not self._round(tolerance):
                return

    def _round(self, tolerance: float) -> bool:
        """Collapse one set of independent edges; False if no edge is within the tolerance."""
        edges, pairs = self._edges, self._edges.pairs
        allowed = np.flatnonzero(edges.costs <= tolerance**2)
        # by cost in powers of 4, and scattered within one power: else neighbours would wait for each other in a row
        share = edges.costs[allowed] / (tolerance**2 or 1.0)  # without a tolerance, edges that cost nothing
        cost = np.log2(np.maximum(share, 4.0**-LEVELS)) // 2.0
        allowed = allowed[np.lexsort((edges.keys[allowed] * SCATTER % 2**61, cost))]
        chosen = allowed[_apart(pairs[allowed], self.faces, len(self._vertices))]
        kept = _turns_nothing(self._vertices, self.faces, pairs[chosen], edges.places[chosen])
        edges.costs[chosen[~kept]] = np.inf  # until one of its ends moves
        stays, goes = pairs[chosen[kept]].T
        self._vertices[stays] = edges.places[chosen[kept]]
        self._quadrics[stays] += self._quadrics[goes]
        target = np.arange(len(self._vertices))
        target[goes] = stays
        faces = target[self.faces]
        self.faces = faces[_proper(faces)]
        self._changed[stays] = True
        return len(chosen) > 0


@dataclass(frozen=True, eq=False)
class _Edges:
    """Edges by increasing key, the best place of each merged vertex, and the mean squared shift that it costs."""

    keys: Numbers
    places: Array
    costs: Array

    @property
    def pairs(self) -> Numbers:
        return np.stack([self.keys >> 32, self.keys & (2**32 - 1)], axis=1)

    def after(self, vertices: Array, quadrics: Array, faces: Numbers, changed: Mask) -> _Edges:
        """The edges of these faces; places and costs are computed again only where an end has changed."""
        keys = np.sort(_edge_keys(faces)[0])
        keys = keys[np.diff(keys, prepend=-1) > 0]
        edges = _Edges(keys, np.empty((len(keys), 3)), np.empty(len(keys)))
        pairs = edges.pairs
        new = changed[pairs].any(axis=1)
        if len(self.keys):
            before = np.minimum(np.searchsorted(self.keys, keys), len(self.keys) - 1)
            new |= self.keys[before] != keys
            edges.places[~new], edges.costs[~new] = self.places[before[~new]], self.costs[before[~new]]
        edges.places[new], edges.costs[new] = _collapses(vertices, quadrics, pairs[new])
        return edges


def _proper(faces: Numbers) -> Mask:
    a, b, c = faces.T
    return (a != b) & (b != c) & (c != a)  # type: ignore[no-any-return]


def _normals(vertices: Array, faces: Numbers) -> Array:
    """Normals (m, 3) with the length of twice the faces' areas."""
    a, b, c = (vertices[column] for column in faces.T)
    return np.cross(b - a, c - a)


def _edge_keys(faces: Numbers) -> tuple[Numbers, Numbers]:
    """Keys (3 m,) of the edges of all faces, equal for equal pairs of vertices, and the face of each."""
    starts, ends = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    return np.minimum(starts, ends) * 2**32 + np.maximum(starts, ends), np.repeat(np.arange(len(faces)), 3)


def _quadrics(vertices: Array, faces: Numbers) -> Array:
    """For each vertex (n, 11): the quadric's terms xx xy xz yy yz zz x y z 1, and the area that it covers."""
    normals = _normals(vertices, faces)
    double = np.linalg.norm(normals, axis=1)
    normals /= np.maximum(double, 1e-300)[:, None]
    rows = np.repeat(_plane(normals, vertices[faces[:, 0]], double, double), 3, axis=0)
    total = np.zeros((len(vertices), 11))
    np.add.at(total, faces.ravel(), rows)

    keys, owner = _edge_keys(faces)
    unique, first, which, count = np.unique(keys, return_index=True, return_inverse=True, return_counts=True)
    other = np.zeros(len(unique), dtype=np.int64)
    other[which] = owner  # the last of two faces; `first` gives the first
    opposite = np.einsum("ij,ij->i", normals[owner[first]], normals[other]) < FOLD
    # at a border the faces run along the edge more often in one direction than in the other
    way = np.where(faces.ravel() < faces[:, [1, 2, 0]].ravel(), 1.0, -1.0)
    border = ((np.bincount(which, way) != 0.0) | ((count == 2) & opposite))[which]
    ends = np.stack(np.divmod(keys[border], 2**32), axis=1)
    along = vertices[ends[:, 1]] - vertices[ends[:, 0]]
    across = np.cross(along, normals[owner[border]])
    length = np.linalg.norm(across, axis=1)
    across /= np.maximum(length, 1e-300)[:, None]
    rows = _plane(across, vertices[ends[:, 0]], BORDER * length**2, np.zeros(len(ends)))
    for end in ends.T:
        np.add.at(total, end, rows)
    return total


def _plane(normals: Array, points: Array, weights: Array, areas: Array) -> Array:
    """Quadrics (k, 11) of planes: weight times the squared distance from each plane."""
    x, y, z = normals.T
    d = -np.einsum("ij,ij->i", normals, points)
    rows = np.stack([x * x, x * y, x * z, y * y, y * z, z * z, d * x, d * y, d * z, d * d], axis=1)
    return np.concatenate([rows * weights[:, None], areas[:, None]], axis=1)


def _collapses(vertices: Array, quadrics: Array, pairs: Numbers) -> tuple[Array, Array]:
    """The best place (k, 3) of the merged vertex of each pair, and the mean squared shift (k,) that it costs."""
    q = quadrics[pairs[:, 0]] + quadrics[pairs[:, 1]]
    first, second = vertices[pairs[:, 0]], vertices[pairs[:, 1]]
    middle = 0.5 * (first + second)
    xx, xy, xz, yy, yz, zz, x, y, z = q[:, :9].T
    # the minimum solves a 3 by 3 system: by the adjugate, if the system is far from singular
    ca, cb, cc = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    cd, ce, cf = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    determinant = xx * ca + xy * cb + xz * cc
    regular = determinant > 1e-4 * (xx + yy + zz) ** 3
    least = -np.stack([ca * x + cb * y + cc * z, cb * x + cd * y + ce * z, cc * x + ce * y + cf * z], axis=1)
    least /= np.where(regular, determinant, 1.0)[:, None]
    near = np.linalg.norm(least - middle, axis=1) <= 2.0 * np.linalg.norm(second - first, axis=1)
    candidates = np.stack([np.where((regular & near)[:, None], least, middle), first, second, middle])
    costs = np.stack([_cost(q, place) for place in candidates])
    best = costs.argmin(axis=0)
    rows = np.arange(len(pairs))
    return candidates[best, rows], np.maximum(costs[best, rows], 0.0) / np.maximum(q[:, 10], 1e-300)


def _cost(q: Array, p: Array) -> Array:
    x, y, z = p.T
    squares = q[:, 0] * x * x + q[:, 3] * y * y + q[:, 5] * z * z
    products = q[:, 1] * x * y + q[:, 2] * x * z + q[:, 4] * y * z + q[:, 6] * x + q[:, 7] * y + q[:, 8] * z
    return squares + 2.0 * products + q[:, 9]  # type: ignore[no-any-return]


def _apart(pairs: Numbers, faces: Numbers, count: int) -> Mask:
    """Which pairs (k,), sorted by cost, come first among all pairs at the faces around them: these are independent."""
    rank = np.arange(len(pairs))
    lowest = np.full(count, len(pairs))
    for end in pairs.T:
        np.minimum.at(lowest, end, rank)
    of_face = lowest[faces].min(axis=1)
    around = np.full(count, len(pairs))
    for corner in faces.T:
        np.minimum.at(around, corner, of_face)
    return (around[pairs] == rank[:, None]).all(axis=1)  # type: ignore[no-any-return]


def _turns_nothing(vertices: Array, faces: Numbers, pairs: Numbers, places: Array) -> Mask:
    """Which collapses turn over none of the remaining faces."""
    collapse = np.full(len(vertices), -1)
    collapse[pairs.ravel()] = np.repeat(np.arange(len(pairs)), 2)
    moved = collapse[faces]
    touched = np.flatnonzero((moved >= 0).sum(axis=1) == 1)  # faces with two collapsing vertices vanish
    near, moved = faces[touched], moved[touched]
    before = _normals(vertices, near)
    corners = np.where((moved >= 0)[..., None], places[moved], vertices[near])
    after = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    cosine = np.einsum("ij,ij->i", before, after)
    rotate = cosine <= MOST_TURN * np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    kept = np.ones(len(pairs), dtype=bool)
    kept[moved.max(axis=1)[rotate]] = False
    return kept
