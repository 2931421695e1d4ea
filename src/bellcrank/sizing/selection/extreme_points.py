"""Few points and blocks of samples that bound what a cycle asks of many motors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bellcrank.arrays import Array, Indices, Mask

Index = Indices
BLOCK = 64  # points that are compared with those that are kept, and with each other, at once
SIZE = 16  # samples


def not_dominated(points: Array) -> Index:
    """Numbers of the points that no other point equals or exceeds in all coordinates."""
    order = np.lexsort(-points.T)
    points = points[order]  # one that exceeds another stands before it; of equal points the first stays
    columns = np.ascontiguousarray(points.T)
    kept = np.zeros(0, dtype=np.intp)
    for start in range(0, len(points), BLOCK):
        block = np.arange(start, min(start + BLOCK, len(points)))
        block = block[~_exceeded(columns, kept, block)]  # by one that is kept, or by one that such a point exceeds
        kept = np.concatenate([kept, block[~np.triu(_pairs_exceeded(columns, block, block), 1).any(axis=0)]])
    return np.sort(order[kept])


def _exceeded(columns: Array, by: Index, which: Index) -> Mask:
    return np.asarray(_pairs_exceeded(columns, by, which).any(axis=0))


def _pairs_exceeded(columns: Array, by: Index, which: Index) -> Mask:
    """Which points (columns) the points `by` (rows) equal or exceed in all coordinates."""
    found = np.ones((len(by), len(which)), dtype=bool)
    for values in columns:
        found &= values[by, None] >= values[which]
    return found


def extreme_points(points: Array) -> Index:
    """Rows of points (n, 3) that are vertices of their convex hull, in however many dimensions they spread.

    Of points that are not all known (NaN) it is an unknown one, with which every largest value is unknown.
    """
    unknown = np.flatnonzero(np.isnan(points).any(axis=1))
    if len(unknown):
        return unknown[:1]
    if len(points) < 5:
        return np.arange(len(points))
    points, first = np.unique(points, axis=0, return_index=True)
    centred = points - points.mean(axis=0)
    centred /= np.maximum(np.max(np.abs(centred), axis=0), np.finfo(float).tiny)
    _, sizes, directions = np.linalg.svd(centred, full_matrices=False)
    rank = int(np.sum(sizes > 1e-13 * len(points) * sizes[0])) if sizes.size and sizes[0] > 0.0 else 0
    if rank == 0:
        return np.asarray(first[:1])
    spread = centred @ directions[:rank].T
    if rank == 1:
        return np.asarray(first[[int(np.argmin(spread)), int(np.argmax(spread))]])
    from scipy.spatial import ConvexHull, QhullError  # importing them takes longer than sizing most robots

    try:
        return np.asarray(first[ConvexHull(spread).vertices])
    except QhullError:  # thinner than Qhull's precision: every sample is kept, which is exact too
        return np.asarray(first)


class Blocks(NamedTuple):
    """Blocks of samples that follow each other in one interval.

    Attributes:
        maxima: (b, c) largest sizes of the samples' c features in each block, each feature for itself.
        weight: Weights (b,), s, of one pass.
        interval: Number (b,) of the interval of each block.
    """

    maxima: Array
    weight: Array
    interval: Index

    @classmethod
    def of(cls, features: Array, weight: Array, interval: Index) -> Blocks:
        """Blocks of samples with features (n, c), weights (n,) and interval numbers (n,), which rise."""
        number = np.arange(len(interval)) - np.searchsorted(interval, interval)  # in the interval
        first = np.flatnonzero(number % SIZE == 0)
        return cls(
            np.maximum.reduceat(np.abs(features), first, axis=0), np.add.reduceat(weight, first), interval[first]
        )
