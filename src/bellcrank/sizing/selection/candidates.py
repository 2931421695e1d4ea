"""The pairs of an axis that a selection lists, with every criterion in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bellcrank.sizing.selection.axis_pairs import AxisPairs
from bellcrank.sizing.selection.joint_problem import Masses
from bellcrank.sizing.selection.judge import TIERS, Judgement
from bellcrank.sizing.selection.judged_axes import OF_MOTION, JudgedAxes
from bellcrank.sizing.selection.ranking import RankKeys, failing_order, order_of
from bellcrank.sizing.selection.selection import AxisSelection, Candidate, CriterionResult, Tier

Indices = NDArray[np.intp]
MOST_FAILING = 3  # failing pairs that are listed beside others


def axis_selection(problem: JudgedAxes, axis: int, chosen: int | None, masses: Masses, most: int) -> AxisSelection:
    """The candidates of one axis under the masses of the chosen actuators.

    Args:
        problem: The pairs.
        axis: Number of the axis.
        chosen: Number of the chosen pair.
        masses: Classes of the chosen actuators.
        most: How many candidates to list.
    """
    keys = problem.keys(axis, masses)
    rows = listed_rows(keys, chosen, most)
    unknown = problem.unknown_masses(axis, masses)
    judgement = problem.judgement(axis, masses, rows)
    made = [candidate(problem.axes[axis], judgement, place, int(row), unknown) for place, row in enumerate(rows)]
    tiers = np.where(keys[:, 0] > 0, 2, keys[:, 1])
    counts: list[tuple[Tier, int]] = [(tier, int(np.sum(tiers == number))) for number, tier in enumerate(TIERS)]
    return AxisSelection(
        axis=problem.axes[axis].axis,
        chosen=None if chosen is None else made[rows.tolist().index(chosen)],
        candidates=tuple(made),
        counts=tuple(counts),
        unknown_masses=tuple(unknown),
        kept=problem.kept[axis],
    )


def listed_rows(keys: RankKeys, chosen: int | None, most: int) -> Indices:
    """The chosen pair, the best others, and the failing ones nearest to the limits."""
    order = order_of(keys)
    passing = order[keys[order, 0] == 0]
    failing = np.flatnonzero(keys[:, 0] != 0)
    failing = failing[failing_order(keys[failing])]
    best = passing[: max(most - min(MOST_FAILING, len(failing)), 1)]
    if chosen is not None:
        best = np.concatenate([[chosen], best[best != chosen]]).astype(np.intp)
        failing = failing[failing != chosen]
    return np.concatenate([best, failing[: max(most - len(best), 0)]]).astype(np.intp)


def candidate(one: AxisPairs, judgement: Judgement, place: int, row: int, unknown_masses: Sequence[str]) -> Candidate:
    """One pair in words.

    Args:
        one: The pairs of the axis.
        judgement: The judgement that contains the pair.
        place: Its number in the judgement.
        row: Its number in `one`.
        unknown_masses: The axes whose actuators load this one and have no known mass.
    """
    results = judgement.results(place)
    if unknown_masses:
        results = tuple(_without_mass(result, unknown_masses) for result in results)
    motor, gear = one.pairs.rows(row)
    known = [result for result in results if result.use is not None or result.estimate is not None]
    binding = max(known, key=_use, default=None)
    exceeded = any(result.verdict == "exceeded" for result in results)
    unknown = any(result.verdict == "unknown" for result in results)
    return Candidate(
        motor=motor,
        gear=gear,
        tier=TIERS[2 if exceeded else 1 if unknown else 0],
        criteria=results,
        binding=binding.name if binding else "",
        mass=_known(one.bodies.mass[row]),
        cost=_known(one.cost[row]),
        loss=_known(judgement.loss[place]),
        largest_use=_use(binding) if binding else 0.0,
        fit="fits" if one.pairs.fits[row] else "fit not checked",
    )


def _without_mass(result: CriterionResult, unknown_masses: Sequence[str]) -> CriterionResult:
    """A criterion whose loads lack the masses of some actuators: inside is not shown."""
    if result.name in OF_MOTION or result.verdict not in ("inside", "exceeded"):
        return result
    names = " and ".join(f"'{name}'" for name in unknown_masses)
    text = f"{result.text}; without the mass of the actuator at {names}, which is not stated"
    if result.verdict == "exceeded":
        return replace(result, text=text)
    return replace(result, use=None, verdict="unknown", text=text, estimate=result.use)


def _use(result: CriterionResult) -> float:
    return result.use if result.use is not None else result.estimate or 0.0


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
