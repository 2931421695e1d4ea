"""The points of a load that a plot shows: some of all samples, and those that decide limits.

A limit a T + b ω ≤ 1 at a motor's shaft is linear in the axis's torque, acceleration and speed, for the samples where
the motor drives and for those where the load drives apart. So the corners of the convex hulls of both decide it. A
smooth motion has most of its samples on the hull; of these so many are kept that every sample is within TOLERANCE of
the hull of what is kept, so that no limit is off by more.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from bellcrank.sizing.selection.load_reductions import ACCELERATION, DIRECTION, DRIVEN, DRIVING, SPEED, ReducedCycle

Array = NDArray[np.float64]
MOST_SAMPLES = 400  # besides the corners
TOLERANCE = 5e-4  # of the largest magnitude of each quantity
FEW = 12  # points of which a hull is not worth its while
MOST_ROUNDS = 60


def load_points(cycle: ReducedCycle) -> Array:
    """Points (n, 3) of torque, speed and acceleration of an axis along a cycle.

    The first are samples, as they are. The others, those that decide limits, are turned to speeds that are not
    negative: the signs of all three together change no limit.
    """
    samples = np.column_stack([cycle.torque, cycle.speed, cycle.features[:, ACCELERATION]])
    hull = cycle.hull
    corners = np.column_stack([hull[:, DRIVING] + hull[:, DRIVEN], hull[:, SPEED], hull[:, ACCELERATION]])
    groups = 2 * (hull[:, DIRECTION] == 0.0) + (hull[:, DRIVEN] != 0.0)
    kept = [corners[groups == group] for group in np.unique(groups)]
    return np.concatenate([samples[thinned(samples, MOST_SAMPLES)], *(points[corner_rows(points)] for points in kept)])


def thinned(table: Array, most: int) -> NDArray[np.intp]:
    """About `most` rows of a table (n, m), evenly spread, and those of the extremes of each column."""
    even = np.linspace(0, len(table) - 1, min(most, len(table))).astype(np.intp)
    return np.unique(np.concatenate([even, np.argmin(table, axis=0), np.argmax(table, axis=0)]))


def corner_rows(points: Array) -> NDArray[np.intp]:
    """Rows of points (n, 3) of whose convex hull no other point is further outside than TOLERANCE.

    The points farthest outside are added until there are none, each column measured by its largest magnitude. Points
    whose hull is too thin to be computed are all kept.
    """
    everything = np.arange(len(points))
    spread = _spread(points)
    dimensions = spread.shape[1]
    kept = np.unique(np.concatenate([spread.argmin(axis=0), spread.argmax(axis=0), everything[:1]]))
    if dimensions < 2:
        return kept
    if len(points) <= FEW:
        return everything
    diagonals = np.array(list(product((-1.0, 1.0), repeat=dimensions)))
    kept = np.union1d(kept, np.argmax(spread @ diagonals.T, axis=0))
    for _ in range(MOST_ROUNDS):
        try:
            facets = ConvexHull(spread[kept]).equations
        except QhullError:
            return everything
        outside = spread @ facets[:, :-1].T + facets[:, -1]
        farther = np.setdiff1d(outside.argmax(axis=0)[outside.max(axis=0) > TOLERANCE], kept)
        if not len(farther):
            return kept
        kept = np.union1d(kept, farther)
    return everything


def _spread(points: Array) -> Array:
    """Points (n, 3), each column over its largest magnitude, in the one to three directions in which they spread."""
    largest = np.abs(points).max(axis=0)
    scaled = points / np.where(largest > 0.0, largest, 1.0)
    centred = scaled - scaled.mean(axis=0)
    _, sizes, directions = np.linalg.svd(centred, full_matrices=False)
    rank = max(int(np.sum(sizes > 0.1 * TOLERANCE)), 1)  # no point is further off than the singular value
    return np.asarray(centred @ directions[:rank].T)
