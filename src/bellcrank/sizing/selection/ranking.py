"""The order of pairs of a motor and gear, and of combinations of one pair an axis.

A pair is ranked by its tier, then by the number of main criteria that are unknown, then by the objective (a known value
before an unknown one), then by its largest utilisation, then by the ids. A combination is ranked by the sums of these
over its axes; utilisations, and the objective "margin", count by their maximum. Values are compared after rounding to
`RESOLUTION`, so that the order does not depend on rounding errors.

Each step of the order keeps its meaning when the same pairs are added to two combinations, so the sums of lower bounds
are lower bounds; `joint_search` uses this.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bellcrank.arrays import Array, Indices, Mask

RankKeys = NDArray[np.int64]  # (m, 6), see COLUMNS
RankKey = tuple[int, int, int, int, int, int]
COLUMNS = ("fails", "not all shown", "main criteria unknown", "objective unknown", "objective", "largest utilisation")
RESOLUTION = 1e-9  # of a mass in kg, a cost, a loss in W, and a utilisation
LARGEST = 10**8  # values above are equal, so that sums over all axes stay integers of 64 bits
NOTHING: RankKey = (1, 0, 0, 0, 0, 0)  # an axis that nothing can drive
NOT_JUDGED: RankKey = (2, 0, 0, 0, 0, 0)  # a pair that is left out beforehand
ALL_SHOWN, PASSES_KNOWN, FAILS = range(3)


@dataclass(frozen=True, kw_only=True, eq=False)
class PairVerdicts:
    """Verdicts on m pairs under one set of loads, in the order of their ids.

    Attributes:
        tier: (m,) 0 all criteria shown, 1 passes what is known, 2 fails.
        main_unknown: (m,) number of main criteria that are unknown.
        objective: (m,) what is minimised; NaN where unknown.
        use: (m,) largest known utilisation.
    """

    tier: NDArray[np.int8]
    main_unknown: NDArray[np.int8]
    objective: Array
    use: Array


def rank_keys(verdicts: PairVerdicts) -> RankKeys:
    """The keys (m, 6) by which pairs are ranked: the smaller one comes first, compared column by column."""
    unknown = np.isnan(verdicts.objective)
    return np.column_stack(
        [
            verdicts.tier == FAILS,
            verdicts.tier == PASSES_KNOWN,
            verdicts.main_unknown,
            unknown,
            rounded(np.where(unknown, 0.0, verdicts.objective)),
            rounded(np.nan_to_num(verdicts.use, nan=0.0)),
        ]
    ).astype(np.int64)


def rounded(values: Array) -> NDArray[np.int64]:
    """Values as multiples of `RESOLUTION`."""
    return np.rint(np.clip(values, -LARGEST, LARGEST) / RESOLUTION).astype(np.int64)


def order_of(keys: RankKeys) -> Indices:
    """Row numbers of the keys, best first; equal keys in the order of the rows, that is of the ids."""
    return np.lexsort(keys.T[::-1])


def failing_order(keys: RankKeys) -> Indices:
    """Row numbers of failing pairs, the nearest to the limits first."""
    return np.lexsort((keys[:, 4], keys[:, 3], keys[:, 5]))


def as_key(row: Iterable[int]) -> RankKey:
    """A row of keys as a tuple, which Python compares column by column."""
    fails, partial, unknown, unvalued, value, use = map(int, row)
    return (fails, partial, unknown, unvalued, value, use)


def total(keys: Sequence[RankKey], largest: bool) -> RankKey:
    """The key of a combination; `largest` where its objective is the largest of its pairs' (margin), not the sum."""
    if not keys:
        return (0, 0, 0, 0, 0, 0)
    fails, partial, unknown, unvalued, values, uses = zip(*keys, strict=True)
    value = max(values) if largest else sum(values)
    return (sum(fails), sum(partial), sum(unknown), sum(unvalued), value, max(uses))


def less_than(keys: RankKeys, others: Sequence[RankKey], best: RankKey, largest: bool) -> Mask:
    """Whether (m,) the total of each key with some others is less than the best one."""
    rest = np.array(total(others, largest), dtype=np.int64)
    totals = keys + rest
    totals[:, 5] = np.maximum(keys[:, 5], rest[5])
    if largest:
        totals[:, 4] = np.maximum(keys[:, 4], rest[4])
    found, equal = np.zeros(len(keys), dtype=bool), np.ones(len(keys), dtype=bool)
    for column, limit in zip(totals.T, best, strict=True):
        found |= equal & (column < limit)
        equal &= column == limit
    return found


def smallest(keys: RankKeys) -> RankKey:
    """The smallest of some keys; that of an axis that nothing can drive where there is none."""
    return as_key(keys[order_of(keys)[0]]) if len(keys) else NOTHING
