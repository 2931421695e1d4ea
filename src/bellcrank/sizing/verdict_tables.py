"""The tables and the verdict of judged motors and gears, as text for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bellcrank.present.tables import wrapped
from bellcrank.sizing.selection.criteria import CriterionResult
from bellcrank.sizing.selection.tables import (
    exceeded_limits,
    not_verified,
    percent,
    reserve_note,
    selected_for,
    undetermined_lines,
    unknown_limits,
)

if TYPE_CHECKING:
    from bellcrank.sizing.drive_verdicts import DriveVerdict, DriveVerdicts


def table(verdicts: DriveVerdicts) -> str:
    """Every criterion of each drive, and those of all axes together."""
    parts = [wrapped(f"{verdicts.robot}, motors and gears along {', '.join(verdicts.cycles)}")]
    for one in verdicts.drives:
        parts += ["", wrapped(_title(one)), *_criteria_lines(one.judged)]
    if verdicts.system:
        parts += ["", "All axes together:", *_criteria_lines(verdicts.system)]
    return "\n".join(parts)


def _criteria_lines(criteria: Sequence[CriterionResult]) -> list[str]:
    """Use, verdict and sentence of each criterion, those with the largest use first, and what is unknown last."""
    ordered = sorted(criteria, key=lambda one: (one.use is None, -(one.use or 0.0)))
    lines = []
    for one in ordered:
        use = "-" if one.use is None else percent(one.use)
        lines.append(wrapped(f"{one.name}: {one.text}", f"{use:>9}  {one.verdict:<8}  ", " " * 21))
    return lines


def verdict(verdicts: DriveVerdicts) -> str:
    """Which limits are exceeded or that none is, which motors are not verified, and what is unknown."""
    exceeded = [f"{one.axis}: {each.name}: {each.text}" for one in verdicts.drives for each in one.exceeded]
    exceeded += [f"all axes together: {one.name}: {one.text}" for one in verdicts.system if one.verdict == "exceeded"]
    weak = [f"{one.axis}: {_names(one.main_unknown)} unknown" for one in verdicts.drives if one.main_unknown]
    lines = [*exceeded_limits(exceeded), *not_verified(weak), *undetermined_lines(verdicts.undetermined)]
    if verdicts.inside:
        lines.append(_kept(verdicts))
    if verdicts.axes_without:
        lines.append(wrapped(f"Without an actuator, and not judged: {', '.join(verdicts.axes_without)}"))
    lines += unknown_limits([f"{one.axis}: {_names(one.unknown)}" for one in verdicts.drives if one.unknown])
    return "\n".join(lines)


def _kept(verdicts: DriveVerdicts) -> str:
    known = [(one.binding.use or 0.0, one.binding.name, one.axis) for one in verdicts.drives if one.binding]
    if not known:
        return "Nothing could be compared: the limits of the motors and gears are unknown."
    use, name, axis = max(known)
    state = "Inside as far as known" if any(one.unknown for one in verdicts.drives) else "All inside"
    return f"{state}: the largest use is {percent(use)}, {axis}'s {name}.{reserve_note(use)}"


def _title(one: DriveVerdict) -> str:
    """The axis, its motor and gear, and the conditions."""
    motor, gear = one.actuator.rows
    if motor.by_ratings:
        factor = one.actuator.safety_factor
        return f"{one.axis}: ratings" + (f"; safety factor {factor:g}" if factor != 1.0 else "")
    name = motor.id if gear.kind == "direct" else f"{motor.id} + {gear.id}"
    stated = selected_for(one.actuator.conditions)
    return f"{one.axis}: {name}; {', '.join(f'{key} {value}' for key, value in stated)}"


def _names(criteria: Sequence[CriterionResult]) -> str:
    return ", ".join(one.name for one in criteria)
