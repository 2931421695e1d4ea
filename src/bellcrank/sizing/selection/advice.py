"""What would help where nothing in the catalogue can drive an axis: computed for the nearest pair."""

from __future__ import annotations

from dataclasses import replace

from bellcrank.sizing.selection.joint_problem import Masses
from bellcrank.sizing.selection.judged_axes import JudgedAxes
from bellcrank.sizing.selection.selection import AxisSelection


def advice_for(problem: JudgedAxes, axis: int, masses: Masses, one: AxisSelection) -> AxisSelection:
    """The selection of an axis with advice where nothing passes."""
    if one.chosen is not None and one.chosen.tier != "fails":
        return one
    if not one.candidates:
        needed = "a screw or rack, which a linear axis takes" if one.axis.kind == "linear" else "a motor"
        return replace(one, advice=f"the catalogue has no pair for this axis: add {needed}")
    nearest = min(one.candidates, key=lambda each: each.largest_use)
    return replace(one, advice=f"nearest: {nearest.id}, {nearest.binding} at {nearest.largest_use:.0%}")
