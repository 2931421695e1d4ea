"""A selection whose drives keep limits when they are simulated along the motions.

The best combination is simulated (verification.py). Where an axis exceeds a limit, the next candidate of that axis is
given instead, and the other axes are chosen anew; a limit of all axes together moves each axis on. The first that keeps
all limits is the result.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from bellcrank.errors import InputError
from bellcrank.sizing.selection.selection import Selection
from bellcrank.sizing.verification import SelectionVerification, verify_selection

MOST = 24  # combinations that are simulated


def followed_selection(
    first: Selection, again: Callable[[Mapping[str, str]], Selection], limits: Mapping[str, float]
) -> Selection:
    """The best selection whose drives keep limits (`verify_selection`) in simulation.

    Where none of those that are tried does, the first one with its verification, and a warning.

    Args:
        first: The selection without limits.
        again: Selects with pairs "motor+gear" that are given by the name of the axis.
        limits: The limits, by name.

    Returns:
        The selection, with `verification` and a warning about what was passed over.

    Raises:
        InputError: A selection is refused.
    """
    left = {one.axis.name: [c.id for c in one.candidates if c.tier != "fails"] for one in first.axes if not one.kept}
    given, selection, passed, seen = dict[str, str](), first, list[str](), None
    for _ in range(MOST):
        if any(one.chosen is None for one in selection.axes):
            break
        found, why = _simulated(selection, limits)
        seen = seen or found
        if found is not None and found.kept:
            notes = [f"passed over in simulation: {text}" for text in dict.fromkeys(passed)]
            return replace(selection, verification=found, warnings=(*selection.warnings, *notes))
        failing = () if found is None else found.exceeding
        moved = False
        for one in selection.axes:
            name, chosen = one.axis.name, one.chosen
            if name not in left or chosen is None or (failing and name not in failing):
                continue
            left[name] = [pair for pair in left[name] if pair != chosen.id]
            passed += [f"{name}: {chosen.id} ({text})" for text in why if not failing or text.startswith(f"{name},")]
            if left[name]:
                given[name], moved = left[name][0], True
        if not moved:
            break
        selection = again(given)
    notes = [f"passed over in simulation: {text}" for text in dict.fromkeys(passed)]
    text = "no combination that was tried keeps the limits in simulation; the first one is shown"
    return replace(first, verification=seen, warnings=(*first.warnings, *notes, text))


def _simulated(
    selection: Selection, limits: Mapping[str, float]
) -> tuple[SelectionVerification | None, tuple[str, ...]]:
    """The verification of a selection, None where it cannot be simulated; and what is exceeded, or why not."""
    try:
        found = verify_selection(selection, limits=limits)
    except InputError as error:
        return None, (f"not simulated: {error}",)
    return found, found.exceeded
