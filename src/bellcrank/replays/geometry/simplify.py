"""Fewer triangles for the same shape: collapsing edges where the surface moves least.

Costs and places after Garland and Heckbert, "Surface Simplification Using Quadric Error Metrics", SIGGRAPH 1997. Many
edges that are far apart collapse in one round, so that a round is a few array operations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

MOST_ROUNDS = 400
LEVELS = 6
SCATTER = 0x9E3779B97F4A7C15 % 2**61  # 2^64 over the golden ratio: products with it are spread evenly (Knuth, TAOCP 3)
BORDER = 10.0  # how much more a border's shift counts than a surface's
FOLD = -0.9  # two faces whose normals' cosine is below this are the two sides of a sheet, and their edge its border
MOST_TURN = 0.3  # a collapse must leave the cosine between a face's old and new normal above this


def weld(vertices: Array, faces: Numbers) -> tuple[Array, Numbers]:
    """The same surface with coincident vertices made one, and without degenerate faces and unused vertices.

    Vertices coincide in the cells of a grid of 2^20 to the largest extent.
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
    """The same surface without the vertices that no face uses."""
    used, faces = np.unique(faces, return_inverse=True)
    return vertices[used], faces.reshape(-1, 3)


class Simplifier:
    """A welded surface that gets simpler step by step, by `vertices` (k, 3) and `faces` (m, 3) as they are now.

    Borders, also those between the two sides of a thin sheet, hold as surfaces do; no face turns over.
    """

    def __init__(self, vertices: Array, faces: Numbers) -> None:
        self._vertices, self.faces = vertices.copy(), faces
        self._quadrics = _quadrics(vertices, faces)
        self._edges = _Edges(np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros(0))
        self._changed = np.ones(len(vertices), dtype=bool)

    def surface(self) -> tuple[Array, Numbers]:
        """Vertices and faces as they are now."""
        return compact(self._vertices, self.faces)

    def reduce(self, tolerance: float) -> None:
        """Take away the faces that a root-mean-square shift of up to `tolerance` (the vertices' unit) can spare."""
        for _ in range(MOST_ROUNDS):
            self._edges = self._edges.after(self._vertices, self._quadrics, self.faces, self._changed)
            self._changed[:] = False
            if not self._round(tolerance):
                return

    def _round(self, tolerance: float) -> bool:
        """One round of collapses; whether there was any to try."""
        edges, pairs = self._edges, self._edges.pairs
        allowed = np.flatnonzero(edges.costs <= tolerance**2)
        # cheap ones first, by powers of 4, and scattered among themselves: else they would wait in a row for each other
        cost = np.log2(np.maximum(edges.costs[allowed] / tolerance**2, 4.0**-LEVELS)) // 2.0
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
    """Edges by rising number, where each one's single vertex goes best, and the mean squared shift that this costs."""

    keys: Numbers
    places: Array
    costs: Array

    @property
    def pairs(self) -> Numbers:
        return np.stack([self.keys >> 32, self.keys & (2**32 - 1)], axis=1)

    def after(self, vertices: Array, quadrics: Array, faces: Numbers, changed: NDArray[np.bool_]) -> _Edges:
        """The edges of these faces; what is known already stays, but where an end has changed."""
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


def _proper(faces: Numbers) -> NDArray[np.bool_]:
    a, b, c = faces.T
    return (a != b) & (b != c) & (c != a)  # type: ignore[no-any-return]


def _normals(vertices: Array, faces: Numbers) -> Array:
    """Normals (m, 3) as long as twice the faces' areas."""
    a, b, c = (vertices[column] for column in faces.T)
    return np.cross(b - a, c - a)


def _edge_keys(faces: Numbers) -> tuple[Numbers, Numbers]:
    """A number for each face's edges (3 m,), the same for the same two vertices, and the face that it is of."""
    starts, ends = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    return np.minimum(starts, ends) * 2**32 + np.maximum(starts, ends), np.repeat(np.arange(len(faces)), 3)


def _quadrics(vertices: Array, faces: Numbers) -> Array:
    """Each vertex's (n, 11): the quadric's xx xy xz yy yz zz, x y z and 1, and the area behind it."""
    normals = _normals(vertices, faces)
    double = np.linalg.norm(normals, axis=1)
    normals /= np.maximum(double, 1e-300)[:, None]
    rows = np.repeat(_plane(normals, vertices[faces[:, 0]], double, double), 3, axis=0)
    total = np.zeros((len(vertices), 11))
    np.add.at(total, faces.ravel(), rows)

    keys, owner = _edge_keys(faces)
    unique, first, which, count = np.unique(keys, return_index=True, return_inverse=True, return_counts=True)
    other = np.zeros(len(unique), dtype=np.int64)
    other[which] = owner  # of two faces the last one, and `first` tells the first
    opposite = np.einsum("ij,ij->i", normals[owner[first]], normals[other]) < FOLD
    # a border has more faces on one side than on the other: they go along it more often one way than the other
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
    """Quadrics (k, 11) of planes: weight times the squared distance from each."""
    x, y, z = normals.T
    d = -np.einsum("ij,ij->i", normals, points)
    rows = np.stack([x * x, x * y, x * z, y * y, y * z, z * z, d * x, d * y, d * z, d * d], axis=1)
    return np.concatenate([rows * weights[:, None], areas[:, None]], axis=1)


def _collapses(vertices: Array, quadrics: Array, pairs: Numbers) -> tuple[Array, Array]:
    """Where each pair's one vertex goes best (k, 3), and the mean squared shift that this costs (k,)."""
    q = quadrics[pairs[:, 0]] + quadrics[pairs[:, 1]]
    first, second = vertices[pairs[:, 0]], vertices[pairs[:, 1]]
    middle = 0.5 * (first + second)
    xx, xy, xz, yy, yz, zz, x, y, z = q[:, :9].T
    # the least point solves a 3 by 3 system: by its adjugate, and only where it is well away from singular
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


def _apart(pairs: Numbers, faces: Numbers, count: int) -> NDArray[np.bool_]:
    """Which pairs, in order of merit, come first of all that touch the faces round them: these can go together."""
    rank = np.arange(len(pairs))
    lowest = np.full(count, len(pairs))
    for end in pairs.T:
        np.minimum.at(lowest, end, rank)
    of_face = lowest[faces].min(axis=1)
    around = np.full(count, len(pairs))
    for corner in faces.T:
        np.minimum.at(around, corner, of_face)
    return (around[pairs] == rank[:, None]).all(axis=1)  # type: ignore[no-any-return]


def _turns_nothing(vertices: Array, faces: Numbers, pairs: Numbers, places: Array) -> NDArray[np.bool_]:
    """Which collapses turn none of the faces that they leave over."""
    collapse = np.full(len(vertices), -1)
    collapse[pairs.ravel()] = np.repeat(np.arange(len(pairs)), 2)
    moved = collapse[faces]
    touched = np.flatnonzero((moved >= 0).sum(axis=1) == 1)  # with two of its vertices it vanishes
    near, moved = faces[touched], moved[touched]
    before = _normals(vertices, near)
    corners = np.where((moved >= 0)[..., None], places[moved], vertices[near])
    after = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    cosine = np.einsum("ij,ij->i", before, after)
    turned = cosine <= MOST_TURN * np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    kept = np.ones(len(pairs), dtype=bool)
    kept[moved.max(axis=1)[turned]] = False
    return kept
