"""Decimation: the rows to keep so that interpolation between them stays within an error bound."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from bellcrank.arrays import Array, Indices

Rows = Indices
# rad: half of the turn of a body between frames; beyond it the shorter rotation may be the wrong one
MOST_HALF_TURN = 0.75
SAMPLES = np.arange(1, 8) / 8.0  # where an interval is examined before it is checked at every row
MOST_ROWS = 12_000  # of series within a bound; of longer ones only the extremes are kept
BLOCK = 500_000  # rows of series in memory at a time


def frame_rows(
    time: Array,
    points: Array,
    quaternions: Array,
    radii: Array,
    bound: float,
    keep: Iterable[int] = (),
    limit: int | None = None,
) -> Rows:
    """Rows to keep of the poses of k bodies at increasing times (n,) s, so that `interpolation_error` <= `bound` (m).

    Intervals that are not within the bound are split at the row with the largest error (D. Douglas and T. Peucker,
    Cartographica 10, 1973), until more than `limit` rows are kept.

    Args:
        time: Times (n,), increasing, s.
        points: Origins (n, k, 3) m of the bodies.
        quaternions: Orientations (n, k, 4) x y z w, with continuous signs.
        radii: Distances (k,) m of the bodies' points from their origins, at most.
        bound: Largest error at any row, m.
        keep: Rows to keep in any case, besides the first and the last.
        limit: Number of rows beyond which the search ends.

    Returns:
        Increasing row numbers.
    """
    n = len(time)
    kept = np.zeros(n, dtype=bool)
    kept[[0, n - 1, *keep]] = True
    rows = np.flatnonzero(kept)
    first, last = rows[:-1], rows[1:]
    while True:
        long = last - first > 1
        first, last = first[long], last[long]
        if not len(first) or (limit is not None and kept.sum() > limit):
            return np.flatnonzero(kept)
        samples = first[:, None] + np.rint(SAMPLES * (last - first)[:, None]).astype(np.intp)
        samples = np.clip(samples, first[:, None] + 1, last[:, None] - 1)
        error = interpolation_error(
            time, points, quaternions, radii, samples.ravel(), first.repeat(len(SAMPLES)), last.repeat(len(SAMPLES))
        ).reshape(samples.shape)
        worst = samples[np.arange(len(samples)), error.argmax(axis=1)]
        far = np.isinf(error).any(axis=1)  # the whole interval turns too far
        worst[far] = samples[far, len(SAMPLES) // 2]
        bad = error.max(axis=1) > bound
        for k in _batches(np.flatnonzero(~bad), last - first):
            inside = np.concatenate([np.arange(a + 1, b) for a, b in zip(first[k], last[k], strict=True)])
            count = last[k] - first[k] - 1
            every = interpolation_error(
                time, points, quaternions, radii, inside, first[k].repeat(count), last[k].repeat(count)
            )
            begin = np.concatenate([[0], np.cumsum(count)[:-1]])
            most = np.maximum.reduceat(every, begin)
            for at in np.flatnonzero(most > bound):
                part = slice(begin[at], begin[at] + count[at])
                worst[k[at]] = inside[part][every[part].argmax()]
                bad[k[at]] = True
        kept[worst[bad]] = True
        first, last = np.concatenate([first[bad], worst[bad]]), np.concatenate([worst[bad], last[bad]])


def interpolation_error(
    time: Array, points: Array, quaternions: Array, radii: Array, rows: Rows, first: Rows, last: Rows
) -> Array:
    """Bounds (m,) on the error of any point of the bodies at `rows` (m,), interpolated from `first` to `last` rows.

    Positions are interpolated linearly, orientations at a constant rate. The bound is |Δp| + 2 r |Δq|: a rotation by δ
    moves a point at the radius r by at most 2 r sin(δ/2), and |Δq| = 2 sin(δ/4). It is infinite if a body turns by more
    than twice MOST_HALF_TURN. Arrays as in `frame_rows`.
    """
    span = time[last] - time[first]
    share = np.divide(time[rows] - time[first], span, out=np.zeros(len(rows)), where=span > 0.0)[:, None]
    here = points[first]
    error = _length(points[rows] - here - share[..., None] * (points[last] - here))
    if np.any(radii):
        half_turn, interpolated = slerp(quaternions[first], quaternions[last], share)
        error += 2.0 * radii * _length(quaternions[rows] - interpolated)
        error[half_turn > MOST_HALF_TURN] = np.inf
    return np.asarray(error.max(axis=1, initial=0.0))


def slerp(begin: Array, end: Array, share: Array) -> tuple[Array, Array]:
    """Half of the angles (m, k) between quaternions (m, k, 4), and the quaternions interpolated at a share (m, 1).

    Source: K. Shoemake, "Animating rotation with quaternion curves", SIGGRAPH 1985.
    """
    half = 2.0 * np.arcsin(np.minimum(1.0, 0.5 * _length(end - begin)))
    size, small = np.sin(half), half < 1e-6
    size[small] = 1.0
    before = np.where(small, 1.0 - share, np.sin((1.0 - share) * half) / size)
    after = np.where(small, share, np.sin(share * half) / size)
    return half, before[..., None] * begin + after[..., None] * end


def _length(vectors: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("...c,...c->...", vectors, vectors)))


def _batches(which: Rows, length: Rows, most: int = 100_000) -> list[Rows]:
    """Batches of intervals with at most this number of rows in total, or one interval each, to limit memory."""
    if not len(which):
        return []
    groups = np.cumsum(length[which]) // most
    return np.split(which, np.flatnonzero(np.diff(groups)) + 1)


def series_rows(
    time: Array, table: Array, bound: Array, most: int = MOST_ROWS, keep: Rows | None = None
) -> Rows | None:
    """Rows to keep, common to all columns of a table (n, k), for linear interpolation within `bound` (k,).

    Times (n,) do not decrease. Gaps, where a column is not finite, keep their first and last row. Time may start again
    at a row of `keep`; these are kept. Returns increasing row numbers, or None if they are more than `most`.
    """
    there = np.isfinite(table)
    gaps = np.flatnonzero((there[1:] != there[:-1]).any(axis=1))
    scaled = np.where(there, table, 0.0) / np.where(bound > 0.0, bound, 1.0)
    wanted = np.concatenate([gaps, gaps + 1, np.zeros(0, dtype=np.intp) if keep is None else keep])
    no_rotation = np.zeros((0, 1, 4))
    kept: list[Rows] = []
    count = 0
    for a in range(0, max(len(time) - 1, 1), BLOCK):
        b = min(a + BLOCK, len(time) - 1)
        inside = wanted[(wanted >= a) & (wanted <= b)] - a
        rows = frame_rows(
            time[a : b + 1], scaled[a : b + 1, :, None], no_rotation, np.zeros(1), 1.0, inside, most - count
        )
        kept.append(rows + a)
        count += len(rows)
        if count > most:
            return None
    return np.unique(np.concatenate(kept))


def line_rows(time: Array, table: Array, bound: Array, most: int) -> list[Rows] | None:
    """Rows to keep of each column (n,) on its own, as in `series_rows`; None if they are more than `most` in total."""
    n, lines = table.shape
    found: list[Rows] = []
    at_once = max(1, BLOCK // max(n, 1))
    for a in range(0, lines, at_once):  # several lines in one series, one after the other
        some = table[:, a : a + at_once]
        count = some.shape[1]
        scaled = (some / np.where(bound > 0.0, bound, 1.0)[a : a + at_once]).T.reshape(-1, 1)
        ends = n * np.arange(count)
        kept = series_rows(np.tile(time, count), scaled, np.ones(1), most, np.concatenate([ends, ends + n - 1]))
        if kept is None:
            return None
        found += [part - end for part, end in zip(np.split(kept, np.searchsorted(kept, ends[1:])), ends, strict=True)]
        most -= len(kept)
    return found
