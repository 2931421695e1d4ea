"""Criteria of the output bearing of a gear, or of a motor and gear sold as one: tilting moment and axial load.

They are judged where the gear states a limit. Otherwise another bearing of the joint may carry the load: a note.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.sizing.selection.axis_loads import Axis
from bellcrank.sizing.selection.criteria import Array, Bools, LimitCriterion, figure
from bellcrank.sizing.selection.load_reductions import ReducedCycle
from bellcrank.sizing.selection.pairs import Pairs


class BearingCriterion(LimitCriterion):
    """A load of the joint's wrench under the limit of the output bearing."""

    field: ClassVar[str]

    def limit(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """The limit that the gear states; without a gear, the motor and gear sold as one."""
        return self._stated(pairs)

    def judged(self, pairs: Pairs, axis: Axis, conditions: Conditions) -> Bools:
        """Pairs with a stated limit."""
        return np.asarray(~np.isnan(self._stated(pairs)))

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """The load and the limit, or that no limit is stated."""
        load = float(self.demand(pair, cycle, conditions)[0])
        if self.judged(pair, cycle.axis, conditions)[0]:
            unknown = f"{self.quantity} unknown: the reaction of a coupled axis is not computed"
            return unknown if math.isnan(load) else super().cycle_text(pair, cycle, conditions)
        need = "" if math.isnan(load) else f": another bearing must carry {figure(load)} {self.unit}"
        return f"no limit is stated{need}"

    def _stated(self, pairs: Pairs) -> Array:
        return np.where(pairs.of_gear("direct"), pairs.of_motor(self.field), pairs.of_gear(self.field))


class TiltingMoment(BearingCriterion):
    """The largest moment across the joint's axis under the permitted tilting moment."""

    name = "tilting moment"
    formula = "max |M across the axis| ≤ M_t"
    source = "the gear's data sheet (output bearing)"
    needs = (("gear.tilting_moment",), ("motor.tilting_moment",))
    quantity = "largest moment across the joint's axis"
    limit_name = "permitted tilting moment"
    unit = "N m"
    field = "tilting_moment"

    def demand(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Largest moment of the joint's wrench."""
        return np.full(len(pairs), cycle.tilting_moment)


class AxialLoad(BearingCriterion):
    """The largest force along the joint's axis under the permitted axial load."""

    name = "axial load"
    formula = "max |F along the axis| ≤ F_a"
    source = "the gear's data sheet (output bearing)"
    needs = (("gear.axial_load",), ("motor.axial_load",))
    quantity = "largest force along the joint's axis"
    limit_name = "permitted axial load"
    unit = "N"
    field = "axial_load"

    def demand(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Largest force of the joint's wrench."""
        return np.full(len(pairs), cycle.axial_force)
