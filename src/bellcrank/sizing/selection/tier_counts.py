"""How many pairs of an axis are in each tier: counted when first asked for, because it takes judging all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, overload

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.cached_values import cached_property
from bellcrank.sizing.selection.judge import TIERS, judge
from bellcrank.sizing.selection.judged_axes import without_unknown_masses
from bellcrank.sizing.selection.load_reductions import ReducedLoads
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.selection import Tier

TierCount = tuple[Tier, int]
AT_ONCE = 2**17  # pairs judged together, so that memory does not grow with the catalogue


class TierCounts(Sequence[TierCount]):
    """The number of pairs in each tier; a copy holds the numbers alone.

    Args:
        pairs: The pairs of the axis.
        loads: Its loads.
        conditions: What is assumed.
        unknown_masses: Whether masses that these loads depend on are not stated.
    """

    def __init__(self, pairs: Pairs, loads: ReducedLoads, conditions: Conditions, unknown_masses: bool) -> None:
        self._pairs, self._loads, self._conditions, self._unknown_masses = pairs, loads, conditions, unknown_masses

    @cached_property
    def _counts(self) -> tuple[TierCount, ...]:
        counts = np.zeros(len(TIERS), dtype=np.intp)
        for start in range(0, len(self._pairs), AT_ONCE):
            part = self._pairs.take(slice(start, start + AT_ONCE))
            judgement = judge(part, self._loads, self._conditions, exact=False)
            if self._unknown_masses:
                judgement = without_unknown_masses(judgement)
            counts += np.bincount(judgement.tier, minlength=len(TIERS))
        return tuple(zip(TIERS, counts.tolist(), strict=True))

    def __len__(self) -> int:
        return len(TIERS)

    @overload
    def __getitem__(self, place: int) -> TierCount: ...

    @overload
    def __getitem__(self, place: slice) -> Sequence[TierCount]: ...

    def __getitem__(self, place: int | slice) -> TierCount | Sequence[TierCount]:
        return self._counts[place]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash(self._counts)

    def __repr__(self) -> str:
        return repr(self._counts)

    def __reduce__(self) -> tuple[Any, ...]:
        return tuple, (self._counts,)
