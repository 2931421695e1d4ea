"""Fewer rows that show the same: rows between which straight lines, and even turns of bodies, stay within a bound."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
MOST_HALF_TURN = (
    0.75  # rad: half of how far a body turns between frames; beyond it the shorter way may be the other one
)
LOOKS = np.arange(1, 8) / 8.0  # where a stretch is looked at, before it is checked at every row
MOST_ROWS = 12_000  # of series that are to be right; of more only the extremes are kept
BLOCK = 500_000  # rows of series in memory at a time


def frame_rows(
    time: Array,
    points: Array,
    turns: Array,
    reach: Array,
    bound: float,
    keep: Iterable[int] = (),
    limit: int | None = None,
) -> Rows:
    """Rows to keep of poses at increasing times (n,) s: first, last, those of `keep`, and as many as it takes so that
    `interpolation_error` is at most `bound` (m) at every row; increasing.

    points (n, k, 3) m and turns (n, k, 4), quaternions x y z w of one sign along time, of k bodies, whose points are
    within `reach` (k,) m of their origins. A stretch that is not within the bound is split where it is worst
    (D. Douglas, T. Peucker, Cartographica 10, 1973). It gives up beyond `limit` rows.
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
        looks = first[:, None] + np.rint(LOOKS * (last - first)[:, None]).astype(np.intp)
        looks = np.clip(looks, first[:, None] + 1, last[:, None] - 1)
        error = interpolation_error(
            time, points, turns, reach, looks.ravel(), first.repeat(len(LOOKS)), last.repeat(len(LOOKS))
        ).reshape(looks.shape)
        worst = looks[np.arange(len(looks)), error.argmax(axis=1)]
        far = np.isinf(error).any(axis=1)  # it turns too far as a whole
        worst[far] = looks[far, len(LOOKS) // 2]
        bad = error.max(axis=1) > bound
        for k in _stretches(np.flatnonzero(~bad), last - first):
            inside = np.concatenate([np.arange(a + 1, b) for a, b in zip(first[k], last[k], strict=True)])
            count = last[k] - first[k] - 1
            every = interpolation_error(
                time, points, turns, reach, inside, first[k].repeat(count), last[k].repeat(count)
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
    time: Array, points: Array, turns: Array, reach: Array, rows: Rows, first: Rows, last: Rows
) -> Array:
    """How far (m,) any point of the bodies is, at most, from where it is at `rows` (m,) when the bodies go straight and
    turn evenly from rows `first` to rows `last`; infinite where one turns further than twice MOST_HALF_TURN.

    |Δp| + 2 reach |Δq|: a turn by an angle δ moves a point by at most 2 reach sin(δ/2), and |Δq| = 2 sin(δ/4).
    """
    span = time[last] - time[first]
    share = np.divide(time[rows] - time[first], span, out=np.zeros(len(rows)), where=span > 0.0)[:, None]
    here = points[first]
    error = _length(points[rows] - here - share[..., None] * (points[last] - here))
    if np.any(reach):
        halfway, turned = _turned(turns[first], turns[last], share)
        error += 2.0 * reach * _length(turns[rows] - turned)
        error[halfway > MOST_HALF_TURN] = np.inf
    return np.asarray(error.max(axis=1, initial=0.0))


def _turned(begin: Array, end: Array, share: Array) -> tuple[Array, Array]:
    """Half of the angles (m, k) between quaternions (m, k, 4), and the quaternions a share (m, 1) of the way.

    Source: K. Shoemake, Animating rotation with quaternion curves, SIGGRAPH 1985.
    """
    half = 2.0 * np.arcsin(np.minimum(1.0, 0.5 * _length(end - begin)))
    size, small = np.sin(half), half < 1e-6
    size[small] = 1.0
    before = np.where(small, 1.0 - share, np.sin((1.0 - share) * half) / size)
    after = np.where(small, share, np.sin(share * half) / size)
    return half, before[..., None] * begin + after[..., None] * end


def _length(vectors: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("...c,...c->...", vectors, vectors)))


def _stretches(which: Rows, length: Rows, most: int = 100_000) -> list[Rows]:
    """Groups of stretches of no more than so many rows together, or of one stretch, so that memory stays small."""
    if not len(which):
        return []
    groups = np.cumsum(length[which]) // most
    return np.split(which, np.flatnonzero(np.diff(groups)) + 1)


def series_rows(
    time: Array, table: Array, bound: Array, most: int = MOST_ROWS, keep: Rows | None = None
) -> Rows | None:
    """Rows to keep of columns (n, k) that belong together, at times (n,) that do not go back, increasing: as many as it
    takes so that straight lines between them are off by `bound` (k,) at most at every row, and gaps, where a column is
    not finite, begin and end where they do; `keep` among them, at which time may begin anew. None where
    that is more than `most`.
    """
    there = np.isfinite(table)
    gaps = np.flatnonzero((there[1:] != there[:-1]).any(axis=1))
    scaled = np.where(there, table, 0.0) / np.where(bound > 0.0, bound, 1.0)
    wanted = np.concatenate([gaps, gaps + 1, np.zeros(0, dtype=np.intp) if keep is None else keep])
    nothing = np.zeros((0, 1, 4))
    kept: list[Rows] = []
    count = 0
    for a in range(0, max(len(time) - 1, 1), BLOCK):
        b = min(a + BLOCK, len(time) - 1)
        mine = wanted[(wanted >= a) & (wanted <= b)] - a
        rows = frame_rows(time[a : b + 1], scaled[a : b + 1, :, None], nothing, np.zeros(1), 1.0, mine, most - count)
        kept.append(rows + a)
        count += len(rows)
        if count > most:
            return None
    return np.unique(np.concatenate(kept))


def line_rows(time: Array, table: Array, bound: Array, most: int) -> list[Rows] | None:
    """The same for each column (n,) on its own; None where that is more than `most` rows of all of them together."""
    n, lines = table.shape
    found: list[Rows] = []
    together = max(1, BLOCK // max(n, 1))
    for a in range(0, lines, together):  # several lines as one, end to end
        some = table[:, a : a + together]
        count = some.shape[1]
        scaled = (some / np.where(bound > 0.0, bound, 1.0)[a : a + together]).T.reshape(-1, 1)
        ends = n * np.arange(count)
        kept = series_rows(np.tile(time, count), scaled, np.ones(1), most, np.concatenate([ends, ends + n - 1]))
        if kept is None:
            return None
        found += [part - end for part, end in zip(np.split(kept, np.searchsorted(kept, ends[1:])), ends, strict=True)]
        most -= len(kept)
    return found
