"""The pairs of an axis that a selection lists, with every criterion in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, overload

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.arrays import Indices
from bellcrank.cached_values import Portable, cached_property
from bellcrank.sizing.selection.axis_pairs import AxisPairs
from bellcrank.sizing.selection.criteria import CriterionResult
from bellcrank.sizing.selection.joint_problem import Masses, best_pairs
from bellcrank.sizing.selection.judge import (
    CRITERIA,
    NOT_EVALUATED,
    NOTES,
    TIERS,
    UNKNOWN,
    Judgement,
    Tier,
    in_words,
    judge,
    verdicts,
)
from bellcrank.sizing.selection.judged_axes import OF_MOTION, JudgedAxes, without_unknown_masses
from bellcrank.sizing.selection.load_reductions import ReducedLoads
from bellcrank.sizing.selection.pairs import Pairs, failing_order
from bellcrank.sizing.selection.selection import AxisSelection, Candidate

TierCount = tuple[Tier, int]
AT_ONCE = 2**17  # pairs judged together, so that memory does not grow with the catalogue


class TierCounts(Sequence[TierCount]):
    """The number of pairs in each tier, counted when first asked for, because it takes judging all of them; a copy
    holds the numbers alone.

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


def axis_selection(
    problem: JudgedAxes, final: JudgedAxes, axis: int, chosen: int | None, masses: Masses, most: int
) -> AxisSelection:
    """The candidates of one axis under the masses of the chosen actuators.

    Args:
        problem: The pairs.
        final: The same pairs under the loads by which those that are listed are judged.
        axis: Number of the axis.
        chosen: Number of the chosen pair.
        masses: Classes of the chosen actuators.
        most: How many candidates to list.
    """
    rows = listed_rows(problem, axis, chosen, masses, most)
    unknown = problem.unknown_masses(axis, masses)
    judgement = completed(final.judgement(axis, masses, rows))
    under = JudgedUnder(judgement.loads, judgement.conditions, tuple(unknown))
    made = [candidate(problem.axes[axis], judgement, place, int(row), under) for place, row in enumerate(rows)]
    return AxisSelection(
        axis=problem.axes[axis].axis,
        conditions=judgement.conditions,
        chosen=None if chosen is None else made[rows.tolist().index(chosen)],
        candidates=tuple(made),
        counts=TierCounts(problem.axes[axis].pairs, judgement.loads, judgement.conditions, bool(unknown)),
        unknown_masses=tuple(unknown),
        kept=problem.kept[axis],
    )


def listed_rows(problem: JudgedAxes, axis: int, chosen: int | None, masses: Masses, most: int) -> Indices:
    """The chosen pair, the best others, and where these are few, the failing ones nearest to the limits."""
    rows = best_pairs(problem, axis, masses, most)
    if len(rows) < most:
        keys = problem.keys(axis, masses)
        failing = np.flatnonzero(keys[:, 0] != 0)
        rows = np.concatenate([rows, failing[failing_order(keys[failing])[: most - len(rows)]]])
    return rows if chosen is None else np.concatenate([[chosen], rows[rows != chosen][: most - 1]])


def candidate(one: AxisPairs, judgement: Judgement, place: int, row: int, under: JudgedUnder) -> Candidate:
    """One pair of an axis.

    Args:
        one: The pairs of the axis.
        judgement: The judgement that contains the pair.
        place: Its number in the judgement.
        row: Its number in `one`.
        under: What it was judged under.
    """
    motor, gear = one.pairs.rows(row)
    uses = judgement.use[:, place]
    known = np.isfinite(uses) | np.isinf(uses)
    binding = int(np.argmax(np.where(known, uses, -1.0)))
    return Candidate(
        motor=motor,
        gear=gear,
        tier=TIERS[judgement.tier[place]],
        criteria=CriteriaInWords(motor, gear, under),
        binding=judgement.criteria[binding].name if known.any() else "",
        mass=_known(one.bodies.mass[row]),
        cost=_known(one.cost[row]),
        loss=_known(judgement.loss[place]),
        largest_use=float(judgement.largest_use[place]),
        fit="fits" if one.pairs.fits[row] else "fit not checked",
        unknown=tuple(
            criterion.name
            for criterion, verdict in zip(judgement.criteria, judgement.verdict[:, place], strict=True)
            if verdict == UNKNOWN
        ),
    )


def completed(judgement: Judgement) -> Judgement:
    """A judgement of few pairs with every criterion evaluated, also of pairs that fail another one."""
    use, verdict = judgement.use.copy(), judgement.verdict.copy()
    for row, criterion in enumerate(judgement.criteria):
        rest = np.flatnonzero(verdict[row] == NOT_EVALUATED)
        if len(rest):
            pairs = judgement.pairs.take(rest)
            use[row, rest], verdict[row, rest] = verdicts(criterion, pairs, judgement.loads, judgement.conditions)
    return replace(judgement, use=use, verdict=verdict)


class JudgedUnder(NamedTuple):
    """What a pair was judged under: its loads, the conditions, and the axes whose actuators' masses are not stated."""

    loads: ReducedLoads
    conditions: Conditions
    unknown_masses: tuple[str, ...]


class CriteriaInWords(Sequence[CriterionResult], Portable):
    """Every criterion and note of one pair in words, computed when first looked at: most pairs never are."""

    def __init__(self, motor: Motor, gear: Gear, under: JudgedUnder) -> None:
        self.motor, self.gear, self.under = motor, gear, under

    @cached_property
    def results(self) -> tuple[CriterionResult, ...]:
        """The results."""
        loads, conditions, unknown_masses = self.under
        found = in_words(Pairs.of((self.motor, self.gear)), loads, conditions)
        return tuple(without_mass(result, unknown_masses) for result in found) if unknown_masses else found

    def __len__(self) -> int:
        return len(CRITERIA) + len(NOTES)

    @overload
    def __getitem__(self, place: int) -> CriterionResult: ...

    @overload
    def __getitem__(self, place: slice) -> Sequence[CriterionResult]: ...

    def __getitem__(self, place: int | slice) -> CriterionResult | Sequence[CriterionResult]:
        return self.results[place]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and tuple(self) == tuple(other)

    def __hash__(self) -> int:
        return hash((self.motor.id, self.gear.id))

    def __repr__(self) -> str:
        return repr(self.results)


def without_mass(result: CriterionResult, unknown_masses: Sequence[str]) -> CriterionResult:
    """A criterion whose loads lack the masses of some actuators: inside is not shown."""
    if result.name in OF_MOTION or result.verdict not in ("inside", "exceeded"):
        return result
    names = " and ".join(f"'{name}'" for name in unknown_masses)
    text = f"{result.text}; without the mass of the actuator at {names}, which is not stated"
    if result.verdict == "exceeded":
        return replace(result, text=text)
    return replace(result, use=None, verdict="unknown", text=text, estimate=result.use)


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
