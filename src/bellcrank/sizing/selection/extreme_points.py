"""The points of a set at which linear functions take their largest values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

Array = NDArray[np.float64]
Index = NDArray[np.intp]


def not_dominated(points: Array) -> Index:
    """Numbers of the points that no other point equals or exceeds in all coordinates."""
    order = np.lexsort(-points.T)
    points = points[order]
    exceeds = (points[:, None, :] >= points[None, :, :]).all(axis=2)
    before = np.triu(exceeds, 1)  # of equal points the first stays
    return np.sort(order[~before.any(axis=0)])


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
    try:
        return np.asarray(first[ConvexHull(spread).vertices])
    except QhullError:  # thinner than Qhull's precision: every sample is kept, which is exact too
        return np.asarray(first)
