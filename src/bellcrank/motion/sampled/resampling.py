"""Times at which straight lines approximate functions of time to within a bound, jumps included.

A jump at t is represented by two times: the largest number below t, at which functions have their limit from before,
and t itself. So times always increase, and a function of time alone gives both sides.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bellcrank.arrays import Array, Indices

SHARE = 1.0 / 2000.0  # of a line's range: by how much a displayed value may be off
BETWEEN = 0.4  # of the bound: what lies between rows; the rest is what leaving rows out may take
FLAT = 1e-6  # of a line's size: a smaller range is rounding, and is taken to be this one
NOTHING = 1e-9  # of the largest value of lines that belong together: not distinguished from 0
OUTSTANDING = 30.0  # times the usual range: peaks that are higher are drawn on a logarithmic scale, and do not count
HALVINGS = 12  # of a step, at most
MOST_ADDED = 40_000  # rows, about, and
MOST_NUMBERS = 600_000  # in those rows
LOOK_EVERYWHERE = 3000  # rows: of more, only the steps are looked at between whose rows lines bend
MAY_BEND = 0.1  # of the bound, by second differences
_ULP = 1e-12  # of the span: a step so short is the two sides of a jump


def before(times: Array) -> Array:
    """The last numbers before times, at which functions of time have their limits from before a jump."""
    return np.asarray(np.nextafter(times, -np.inf))


def ranges(table: Array) -> Array:
    """The range (lines,) of each column of a table (n, lines), what is not finite apart, of which SHARE is the bound of
    what a shown value may be off; peaks that stand out do not count, and rounding is not a range.
    """
    if not table.shape[1]:
        return np.zeros(0)
    table = np.where(np.isfinite(table), table, np.nan)
    here = np.where(np.isnan(table).all(axis=0), 0.0, table)
    low, high = np.nanmin(here, axis=0), np.nanmax(here, axis=0)
    size = np.maximum(np.abs(low), np.abs(high))
    middle = np.nanpercentile(here, (2.5, 97.5), axis=0)
    usual = OUTSTANDING * (middle[1] - middle[0])
    full = high - low
    spread = np.where((usual > 0.0) & (usual < full), np.maximum(usual, FLAT * full), full)
    return np.asarray(np.maximum(np.maximum(spread, FLAT * size), (NOTHING / SHARE) * size.max(initial=0.0)))


def refined(time: Array, table: Array, at: Callable[[Array], Array], bound: Array) -> tuple[Array, Array, Array]:
    """Rows (m,), (m, lines) of functions of time: those of a table (n, lines) at increasing times (n,) s, and more that
    `at` gives at times between them, until lines that are straight between rows are off by `bound` (lines,) at most;
    and by how much each is off, which is the bound unless it took too many rows.

    Looks at the quarters of each step, and halves it where one is off; after HALVINGS, as at a jump, a step stays.
    """
    most = min(MOST_ADDED, MOST_NUMBERS // max(table.shape[1], 1))
    left = bound.copy()
    if len(time) < 2 or not table.shape[1]:
        return time, table, left
    first = np.flatnonzero(_suspects(time, table, bound))
    begin, end = time[first], time[first + 1]
    here, there = table[first], table[first + 1]
    times, rows = [time], [table]
    share = np.array([0.25, 0.5, 0.75])[:, None]
    added = 0
    for _ in range(HALVINGS):
        if not len(begin):
            break
        looks = begin + (end - begin) * share
        found = at(looks.ravel()).reshape(3, len(begin), -1)
        with np.errstate(all="ignore"):
            off = np.abs(found - (here + share[..., None] * (there - here)))
            bad = off > bound
        gap = np.isnan(found) != (np.isnan(here) | np.isnan(there))
        bent = np.flatnonzero((bad | gap).any(axis=(0, 2)))
        if added + len(bent) > most:  # the worst only
            worst = np.nan_to_num((off / np.where(bound > 0.0, bound, 1.0)).max(axis=(0, 2))[bent], posinf=0.0)
            order = np.argsort(-worst, kind="stable")
            bent, dropped = np.sort(bent[order[: most - added]]), bent[order[most - added :]]
            left = np.fmax(left, off[:, dropped].max(axis=(0, 1)))
        middle, value = looks[1][bent], found[1][bent]
        times.append(middle)
        rows.append(value)
        added += len(middle)
        begin, end = np.concatenate([begin[bent], middle]), np.concatenate([middle, end[bent]])
        here, there = np.concatenate([here[bent], value]), np.concatenate([value, there[bent]])
    every = np.concatenate(times)
    order = np.argsort(every, kind="stable")
    return every[order], np.concatenate(rows)[order], left


def _suspects(time: Array, table: Array, bound: Array) -> Array:
    """Whether lines may bend (n − 1,) between two rows by more than the bound: |y″| h²/8 by second differences."""
    h = np.diff(time)
    wide = h > _ULP * (time[-1] - time[0])
    if len(time) <= LOOK_EVERYWHERE:
        return np.asarray(wide)
    with np.errstate(all="ignore"):
        slope = np.diff(table, axis=0) / np.where(wide, h, np.nan)[:, None]
        curve = 2.0 * np.abs(np.diff(slope, axis=0)) / (h[1:] + h[:-1])[:, None]
        worst = (curve / np.where(bound > 0.0, bound, 1.0)).max(axis=1, initial=0.0)
        worst = np.where(np.isfinite(worst), worst, np.inf)  # beside a jump or a gap nothing is known
        either = np.maximum(np.append(worst[:1], worst), np.append(worst, worst[-1:]))
        return np.asarray(wide & (either * h * h / 8.0 > MAY_BEND))


def extreme_rows(table: Array, most: int) -> Indices:
    """Rows to keep of a table (n, lines), increasing: the first, the last, and in each of equal stretches of rows every
    line's least and largest, so that no peak is lost; at most `most`, or two a line and two where those are more. What
    lies between them is not told.
    """
    n, lines = table.shape
    if n <= most:
        return np.arange(n)
    buckets = max(1, (most - 2) // (2 * max(1, lines)))
    size = -(-n // buckets)
    buckets = -(-n // size)
    padded = np.concatenate([table, np.repeat(table[-1:], buckets * size - n, axis=0)]).reshape(buckets, size, lines)
    begin = size * np.arange(buckets)[:, None]
    low = np.where(np.isnan(padded), np.inf, padded).argmin(axis=1) + begin
    high = np.where(np.isnan(padded), -np.inf, padded).argmax(axis=1) + begin
    return np.unique(np.clip(np.concatenate([[0, n - 1], low.ravel(), high.ravel()]), 0, n - 1))
