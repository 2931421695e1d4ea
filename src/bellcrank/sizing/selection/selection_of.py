"""The result of a selection, made of what was chosen."""

from __future__ import annotations

from bellcrank.sizing.selection.advice import advice_for
from bellcrank.sizing.selection.candidates import axis_selection
from bellcrank.sizing.selection.choose import Chosen, system_results
from bellcrank.sizing.selection.joint_problem import Choice, masses_of
from bellcrank.sizing.selection.judged_axes import MAIN, JudgedAxes
from bellcrank.sizing.selection.pareto_search import pareto_front
from bellcrank.sizing.selection.selection import AxisSelection, Selection, pair_id


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
