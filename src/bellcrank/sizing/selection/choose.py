"""Choosing one pair an axis: feedback of masses, then the search for something better, and what is proven."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bellcrank.arrays import Indices, Mask
from bellcrank.cached_values import cached_property
from bellcrank.sizing.selection.advice import advice_for
from bellcrank.sizing.selection.candidates import axis_selection, without_mass
from bellcrank.sizing.selection.criteria import CriterionResult
from bellcrank.sizing.selection.joint_problem import Choice, JointProblem, Masses, judge_choice, masses_of
from bellcrank.sizing.selection.joint_search import SearchResult, best_combination, fixed_point
from bellcrank.sizing.selection.judged_axes import MAIN, JudgedAxes
from bellcrank.sizing.selection.matching_criteria import COMMON_BUS
from bellcrank.sizing.selection.pairs import NOT_JUDGED, RankKeys, total
from bellcrank.sizing.selection.pareto_search import pareto_front
from bellcrank.sizing.selection.selection import AxisSelection, Selection, pair_id
from bellcrank.sizing.selection.system_criteria import judge_system

OPTIMAL = "optimal: every combination was excluded or tried"


@dataclass(frozen=True, kw_only=True)
class Chosen:
    """What was chosen.

    Attributes:
        choice: Number of the pair of each axis; None where nothing can drive it.
        passes: What each pass of the feedback chose.
        proof: How far the choice is proven to be the best.
        notes: Sentences about how it was found.
    """

    choice: Choice
    passes: tuple[Choice, ...]
    proof: str
    notes: tuple[str, ...]


def choose(problem: JudgedAxes, effort: int) -> Chosen:
    """Choose one pair an axis.

    Args:
        problem: The pairs.
        effort: How many pairs the search may judge.
    """
    greedy = fixed_point(problem)
    found = best_combination(problem, effort, greedy.choice if greedy.satisfied else None)
    choice = greedy.choice if found is None else found.choice
    notes = []
    permitted: JointProblem = problem
    if found is not None and COMMON_BUS in _exceeded(problem, choice):
        on_one_bus = best_on_one_bus(problem, effort)
        if on_one_bus is not None:
            permitted, found = on_one_bus
            choice = found.choice
            notes.append("the best pairs of the axes need different buses; the chosen ones are the best for one bus")
    if found is not None and not system_kept(problem, choice):
        exceeded = " and ".join(_exceeded(problem, choice))
        other = best_combination(permitted, effort, accept=lambda each: system_kept(problem, each))
        if other is None:
            notes.append(f"{exceeded} of all axes together is exceeded, and no combination that was tried keeps it")
        else:
            notes.append(
                f"the best pairs of the axes exceed {exceeded} of all axes together; the chosen ones are the best that "
                "keep it"
            )
            found, choice = other, other.choice
    if greedy.cycle:
        notes.append(
            f"feedback of the actuators' masses does not settle: {len(greedy.cycle)} combinations repeat; "
            + ("the best of all combinations was searched for" if found else "none of them satisfies its own loads")
        )
    if found is None:
        proof = "no combination was found in which every axis passes with the masses of its own actuators"
    elif found.open:
        proof = f"best found: {found.open:.4g} combinations were neither tried nor excluded"
    else:
        proof = OPTIMAL
    before = total(judge_choice(problem, greedy.choice), problem.largest)
    if found is not None and greedy.satisfied and total(judge_choice(problem, choice), problem.largest) < before:
        notes.append("the search over all axes found a better combination than choosing each axis for itself")
    return Chosen(choice=choice, passes=greedy.passes, proof=proof, notes=tuple(notes))


def system_results(problem: JudgedAxes, choice: Choice) -> tuple[CriterionResult, ...]:
    """The criteria of all axes together; none where nothing can drive an axis."""
    masses = masses_of(problem, choice)
    pairs = [
        one.pairs.take(np.array([pair])) for one, pair in zip(problem.axes, choice, strict=True) if pair is not None
    ]
    if len(pairs) < len(choice):
        return ()
    loads = [problem.axis_loads(axis, masses) for axis in range(len(choice))]
    results = judge_system(pairs, loads, problem.common)
    unknown = sorted({name for axis in range(len(choice)) for name in problem.unknown_masses(axis, masses)})
    return tuple(without_mass(result, unknown) for result in results) if unknown else results


def _exceeded(problem: JudgedAxes, choice: Choice) -> list[str]:
    """Names of the criteria of all axes together that are exceeded."""
    return [one.name for one in system_results(problem, choice) if one.verdict == "exceeded"]


def system_kept(problem: JudgedAxes, choice: Choice) -> bool:
    """Whether no criterion of all axes together is exceeded."""
    return not _exceeded(problem, choice)


# ---- The result of a selection, made of what was chosen.


def selection_of(problem: JudgedAxes, final: JudgedAxes, chosen: Chosen, candidates: int, effort: int) -> Selection:
    """The result, without the names of the robot and its inputs.

    Args:
        problem: The pairs.
        final: The same pairs under loads that are sampled at the largest uses of what was chosen too, as when these
            actuators are given.
        chosen: What was chosen.
        candidates: How many pairs to list of each axis.
        effort: How many pairs may be judged for an exact Pareto front.
    """
    masses = masses_of(problem, chosen.choice)
    axes = tuple(
        advice_for(problem, axis, masses, axis_selection(problem, final, axis, pair, masses, candidates))
        for axis, pair in enumerate(chosen.choice)
    )
    points, proof = pareto_front(problem, chosen.choice, effort)
    return Selection(
        robot="",
        objective=problem.objective,
        axes=axes,
        cycles=final.cycles(masses),
        conditions=problem.common,
        system=system_results(final, chosen.choice),
        iterations=tuple(labels(problem, choice) for choice in chosen.passes),
        proof=chosen.proof,
        pareto=points,
        pareto_proof=proof,
        warnings=(*chosen.notes, *_unknown_notes(axes), *_mass_notes(problem, axes)),
    )


def labels(problem: JudgedAxes, choice: Choice) -> tuple[str, ...]:
    """The ids of a choice's pairs by axis, "" for none."""
    return tuple(
        "" if pair is None else pair_id(*one.pairs.rows(pair)) for one, pair in zip(problem.axes, choice, strict=True)
    )


def _unknown_notes(axes: tuple[AxisSelection, ...]) -> list[str]:
    """A sentence for each chosen pair of which a main criterion is unknown."""
    notes = []
    for one in axes:
        if one.chosen is not None:
            names = [name for name in one.chosen.unknown if name in MAIN]
            if names:
                notes.append(
                    f"it is not shown that {one.chosen.id} can drive '{one.axis.name}': unknown are {', '.join(names)}"
                )
    return notes


def _mass_notes(problem: JudgedAxes, axes: tuple[AxisSelection, ...]) -> list[str]:
    """Sentences about masses that are not stated, and bodies whose size is not."""
    notes = []
    unknown = sorted({name for one in axes for name in one.unknown_masses})
    if unknown:
        loaded = [one.axis.name for one in axes if one.unknown_masses]
        notes.append(
            f"the masses of the actuators at {_names(unknown)} are not stated, so the loads of {_names(loaded)} are "
            "not known: criteria that depend on them are unknown, or exceeded without these masses already; "
            "exclude products without a mass, assume a mass (conditions.assume), or, where the URDF contains the "
            "actuators' masses, switch the feedback off"
        )
    points = []
    for number, one in enumerate(axes):
        if one.chosen and problem.influence[:, number].any() and not _sized(one):
            points.append(one.axis.name)
    if points:
        notes.append(
            f"the diameter or length of the actuators at {_names(points)} is not stated: what has no size counts as a "
            "point mass"
        )
    return notes


def _sized(one: AxisSelection) -> bool:
    """Whether the chosen motor and gear have a size, or an unknown mass, or none to be placed."""
    assert one.chosen is not None
    bodies = [one.chosen.motor] + ([] if one.chosen.gear.kind == "direct" else [one.chosen.gear])
    return one.chosen.mass is None or all(body.diameter is not None and body.length is not None for body in bodies)


def _names(names: list[str]) -> str:
    quoted = [f"'{name}'" for name in names]
    return quoted[0] if len(quoted) == 1 else f"{', '.join(quoted[:-1])} and {quoted[-1]}"


# ---- The best combination whose motors suit one bus, where the voltage of the bus is not given.

ROUNDING = 1e-12  # of a voltage


@dataclass(eq=False)
class OneBus:
    """A problem of whose pairs only those are permitted whose nominal voltages lie in one window; implements
    `JointProblem`. Given pairs, and motors whose nominal voltage is not stated, are permitted.

    Attributes:
        problem: The pairs of all axes.
        lowest: The lowest nominal voltage of the window, V; the highest is `voltage_ratio`² times as high.
    """

    problem: JudgedAxes
    lowest: float

    @property
    def influence(self) -> Mask:
        """As of all pairs."""
        return self.problem.influence

    @property
    def classes(self) -> Sequence[Indices]:
        """As of all pairs."""
        return self.problem.classes

    @property
    def kept(self) -> Sequence[bool]:
        """As of all pairs."""
        return self.problem.kept

    @property
    def largest(self) -> bool:
        """As of all pairs."""
        return self.problem.largest

    @property
    def effort(self) -> int:
        """As of all pairs."""
        return self.problem.effort

    @cached_property
    def permitted(self) -> list[Mask]:
        """Per axis whether (m,) each pair is permitted."""
        highest = self.lowest * self.problem.common.voltage_ratio**2 * (1.0 + ROUNDING)
        found = []
        for axis in self.problem.axes:
            volts = axis.pairs.of_motor("nominal_voltage")
            found.append(np.isnan(volts) | ((volts >= self.lowest * (1.0 - ROUNDING)) & (volts <= highest)) | axis.kept)
        return found

    @cached_property
    def bounds(self) -> list[RankKeys]:
        """As of all pairs; those that are not permitted come last."""
        return [
            np.where(permitted[:, None], bounds, np.array(NOT_JUDGED))
            for permitted, bounds in zip(self.permitted, self.problem.bounds, strict=True)
        ]

    def keys(self, axis: int, masses: Masses, rows: Mask | None = None) -> RankKeys:
        """As of all pairs; those that are not permitted are not judged."""
        permitted = self.permitted[axis]
        found = self.problem.keys(axis, masses, permitted if rows is None else rows & permitted)
        return np.where(permitted[:, None], found, np.array(NOT_JUDGED))


def lowest_voltages(problem: JudgedAxes) -> list[float]:
    """The nominal voltages at which a window may begin: those of all motors that may drive an axis."""
    volts = [axis.pairs.of_motor("nominal_voltage")[bounds[:, 0] == 0]
             for axis, bounds in zip(problem.axes, problem.bounds, strict=True)]  # fmt: skip
    every = np.unique(np.concatenate(volts))
    return [float(one) for one in every if not np.isnan(one)]


def best_on_one_bus(problem: JudgedAxes, effort: int) -> tuple[OneBus, SearchResult] | None:
    """The best combination of those that suit one bus.

    Args:
        problem: The pairs of all axes.
        effort: How many pairs the search may judge.

    Returns:
        The window of voltages with its best combination; None where no window has one.
    """
    best: tuple[OneBus, SearchResult] | None = None
    opened, voltages = 0, lowest_voltages(problem)
    for lowest in voltages:
        window = OneBus(problem, lowest)
        start = fixed_point(window)
        found = best_combination(window, effort // len(voltages), start.choice if start.satisfied else None)
        if found is None or any(pair is None for pair in found.choice):
            continue
        opened += found.open
        if best is None or _total(window, found) < _total(window, best[1]):
            best = window, found
    return best and (best[0], SearchResult(best[1].choice, opened))


def _total(window: OneBus, found: SearchResult) -> tuple[int, ...]:
    return total(judge_choice(window.problem, found.choice), window.largest)
