"""Criteria of gears: torques at the output, speeds at the input, life, and loads of the output bearing.

They depend on the gear and the load alone, so each gear is judged once. A pair without a gear has none of these limits.
The torque at the output is that of the load, without the actuator's own inertia, which accelerates on the gear's input.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.arrays import Array, Mask
from bellcrank.config.units import RPM
from bellcrank.numerics import floats
from bellcrank.sizing.selection.axis_loads import DrivenAxis
from bellcrank.sizing.selection.criteria import LimitCriterion, UseBound, exceeds, figure, share, within
from bellcrank.sizing.selection.load_reductions import ReducedCycle
from bellcrank.sizing.selection.pairs import Pairs

_HARMONIC_DRIVE = "Harmonic Drive, HFUS-2A manual, p. 19"


class GearCriterion(LimitCriterion):
    """A limit that a gear states; motors without a gear are not judged."""

    of_gear = True

    def judged(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
        """Pairs with a gear."""
        return pairs.with_gear

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """The load and the gear's limit."""
        return "no gear" if pair.of_gear("direct")[0] else super().cycle_text(pair, cycle, conditions)


class GearAverageTorque(GearCriterion):
    """The average torque of the gear's life law under its limit.

    The average grows with the exponent, from the mean of |τ| over the travel (p = 1) up to the largest torque. Where
    the exponent is unknown, these two bounds may decide; the limit is not below the rated torque and not above that of
    repeated peaks.
    """

    name = "gear average torque"
    formula = "T_av = (∫ |q̇| |τ|^p dt / ∫ |q̇| dt)^(1/p) ≤ T_A"
    source = f"{_HARMONIC_DRIVE}, with p = 3; p is the maker's"
    needs = (("gear.average_torque", "gear.life_exponent"), ("gear.rated_torque", "gear.life_exponent"))
    quantity = "average torque"
    limit_name = "limit of the gear's average torque"
    unit = "axis torque"
    stated = "gear.average_torque"
    lower_bound: ClassVar[UseBound] = UseBound("rated torque", ("gear.rated_torque",))  # which may act all the time
    upper_bound: ClassVar[UseBound] = UseBound(
        "limit of repeated peaks", ("gear.repeated_peak_torque",)
    )  # which may act at times only

    def demand(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Average torque with the gear's exponent."""
        return average_torque(pairs, cycle)

    def cycle_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """With an unknown exponent, that of the largest torque where it passes, that of the mean where it does not."""
        use = super().cycle_use(pairs, cycle, conditions)
        limit = self.limit(pairs, cycle, conditions)
        pass_limit = np.where(np.isnan(limit), self._largest(pairs, self.lower_bound.fields), limit)
        fail_limit = np.where(np.isnan(limit), self._largest(pairs, self.upper_bound.fields), limit)
        for torque, bound, decides in (
            (cycle.max_torque, pass_limit, within),
            (cycle.average_torque(1.0), fail_limit, exceeds),
        ):
            instead = share(torque, bound)
            use = np.where(np.isnan(use) & decides(instead), instead, use)
        return use

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """The load and its limit; bounds of the load where the exponent is unknown."""
        exponent = pair.rows(0)[1].life_exponent
        text = super().cycle_text(pair, cycle, conditions)
        if pair.of_gear("direct")[0] or cycle.mean_speed == 0.0:
            return text
        if exponent is not None:
            return f"{text} (exponent {exponent:g})"
        use, unit = float(self.cycle_use(pair, cycle, conditions)[0]), "N m" if cycle.axis.kind == "rotary" else "N"
        between = f"average torque between {cycle.average_torque(1.0):.4g} {unit} and {cycle.max_torque:.4g} {unit}"
        between += " (the exponent is not stated)"
        if np.isnan(use):
            return f"{between}; {self.missing(pair)}"
        limit, name = float(self.limit(pair, cycle, conditions)[0]), self.limit_name
        if np.isnan(limit):
            bound = self.lower_bound if use <= 1.0 else self.upper_bound
            limit, name = (
                float(self._largest(pair, bound.fields)[0]),
                f"{bound.name} (the {self.limit_name} is not stated)",
            )
        return f"{between} of {limit:.4g} {unit}, {name}, in '{cycle.name}'"


class GearRepeatedPeak(GearCriterion):
    """The largest torque of the cycle under the limit of repeated peaks."""

    name = "gear repeated peak torque"
    formula = "max |τ| ≤ T_R"
    source = _HARMONIC_DRIVE
    needs = (("gear.repeated_peak_torque",),)
    quantity = "largest torque at the output"
    limit_name = "limit of repeated peaks"
    unit = "axis torque"
    stated = "gear.repeated_peak_torque"
    # What may act all the time may act as a peak; the momentary torque is not for repetition.
    lower_bound = UseBound("limit of the average torque", ("gear.average_torque", "gear.rated_torque"))
    upper_bound = UseBound("limit of momentary torque", ("gear.momentary_torque",))

    def demand(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Largest load torque."""
        return cycle.max_torque + np.zeros(len(pairs))


class GearMomentaryTorque(GearCriterion):
    """A torque that happens rarely, such as an emergency stop, under the momentary limit; judged where one is given."""

    name = "gear momentary torque"
    formula = "T_k ≤ T_M"
    source = _HARMONIC_DRIVE
    needs = (("gear.momentary_torque",),)
    quantity = "momentary torque"
    limit_name = "limit of momentary torque"
    unit = "axis torque"
    stated = "gear.momentary_torque"
    lower_bound = UseBound("limit of repeated peaks", ("gear.repeated_peak_torque",))

    def judged(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
        """Pairs with a gear, where the conditions name a momentary load of the axis."""
        given = axis.name in dict(conditions.momentary_loads)
        return np.asarray(pairs.with_gear & given)

    def demand(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """The momentary load that the conditions name."""
        load = dict(conditions.momentary_loads).get(cycle.axis.name, np.nan)
        return np.full(len(pairs), load * conditions.safety_factor)

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """The load and its limit, or that no load is given."""
        if cycle.axis.name in dict(conditions.momentary_loads) or pair.of_gear("direct")[0]:
            return super().cycle_text(pair, cycle, conditions)
        return "not judged: no momentary load (such as an emergency stop) of this axis is given"


class GearAverageSpeed(GearCriterion):
    """The mean input speed under its limit."""

    name = "gear average input speed"
    formula = "N mean |q̇| ≤ n_av"
    source = _HARMONIC_DRIVE
    needs = (("gear.average_speed", "gear.ratio"),)
    quantity = "mean input speed"
    limit_name = "limit of the gear's average input speed"
    unit = "rpm"
    stated = "gear.average_speed"
    lower_bound = UseBound("rated speed", ("gear.rated_speed",))  # at which the rated life is given
    upper_bound = UseBound("largest input speed", ("gear.max_speed",))

    def demand(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Mean input speed."""
        return pairs.of_gear("ratio") * cycle.mean_speed * RPM


class GearMaxSpeed(GearCriterion):
    """The largest input speed under its limit."""

    name = "gear largest input speed"
    formula = "N max |q̇| ≤ n_max"
    source = _HARMONIC_DRIVE
    needs = (("gear.max_speed", "gear.ratio"),)
    quantity = "largest input speed"
    limit_name = "limit of the gear's input speed"
    unit = "rpm"
    stated = "gear.max_speed"
    lower_bound = UseBound("limit of the average speed", ("gear.average_speed", "gear.rated_speed"))

    def demand(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Largest input speed."""
        return pairs.of_gear("ratio") * cycle.max_speed * RPM


class GearLife(GearCriterion):
    """The life that 90 % of the gears reach, against the hours required; a note where none are required.

    With an unknown exponent p: (T_r/T_av)^p is at least 1 where even the largest torque is below the rated one, and at
    most T_r/T_1 where the mean over the travel T_1 (p = 1) is above it.
    """

    name = "gear life"
    formula = "L10 = L_r (n_r / N mean |q̇|) (T_r / T_av)^p ≥ required hours"
    source = f"{_HARMONIC_DRIVE}; L10 about L50 / 5 there"
    needs = (("gear.life", "gear.rated_speed", "gear.rated_torque", "gear.life_exponent", "gear.ratio"),)
    quantity = "required life"
    limit_name = "L10 life"
    unit = "h"

    def judged(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
        """Pairs with a gear, where hours are required."""
        return np.asarray(pairs.with_gear & (conditions.life is not None))

    def demand(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """The hours required."""
        return np.full(len(pairs), np.nan if conditions.life is None else conditions.life)

    def limit(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """L10 in hours; infinite where the axis does not move or carries nothing."""
        ratio = pairs.of_gear("rated_torque") / average_torque(pairs, cycle)
        return floats(_life_at_rated_torque(pairs, cycle) * ratio ** pairs.of_gear("life_exponent"))

    def at_least(self, pairs: Pairs, cycle: ReducedCycle) -> tuple[Array, str]:
        """The life at rated torque, where no torque is above it."""
        below = cycle.max_torque <= pairs.of_gear("rated_torque")
        return np.where(below, _life_at_rated_torque(pairs, cycle), np.nan), "L10 life at rated torque"

    def at_most(self, pairs: Pairs, cycle: ReducedCycle) -> tuple[Array, str]:
        """The life with an exponent of 1, where the mean torque is above the rated one."""
        ratio = pairs.of_gear("rated_torque") / cycle.average_torque(1.0)
        life = np.where(ratio <= 1.0, _life_at_rated_torque(pairs, cycle) * ratio, np.nan)
        return life, "L10 life with exponent 1"

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """The hours required and those expected."""
        life = float(self.limit(pair, cycle, conditions)[0])
        if pair.of_gear("direct")[0] or conditions.life is not None:
            return super().cycle_text(pair, cycle, conditions)
        expected = self.missing(pair) if np.isnan(life) else f"L10 life {life:.4g} h in '{cycle.name}'"
        return f"{expected}; not judged: no hours are required"


def average_torque(pairs: Pairs, cycle: ReducedCycle) -> Array:
    """The average torque (m,) with each gear's exponent; NaN where that is unknown and decides."""
    exponents = pairs.of_gear("life_exponent")
    idle = (np.abs(cycle.max_torque) == 0.0) | (np.abs(cycle.mean_speed) == 0.0)
    torque = np.where(idle, 0.0, np.nan) + np.zeros(len(pairs))
    for exponent in np.unique(exponents[~np.isnan(exponents)]):
        torque = np.where(exponents == exponent, cycle.average_torque(float(exponent)), torque)
    return torque


def _life_at_rated_torque(pairs: Pairs, cycle: ReducedCycle) -> Array:
    """Hours (m,) at the mean speed and the rated torque."""
    speed = pairs.of_gear("ratio") * cycle.mean_speed
    return floats(pairs.of_gear("life") * pairs.of_gear("rated_speed") / speed)


class BearingCriterion(LimitCriterion):
    """A load of the joint's wrench under the limit of the output bearing, of a gear or of a motor and gear sold as one.

    It is judged where a limit is stated. Otherwise another bearing of the joint may carry the load: a note.
    """

    field: ClassVar[str]

    def limit(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """The limit that the gear states; without a gear, the motor and gear sold as one."""
        return self._stated(pairs)

    def judged(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
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
