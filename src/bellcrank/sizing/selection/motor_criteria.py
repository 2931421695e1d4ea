"""Criteria of motors: torque and speed of short-time operation, continuous torque, and the holding brake."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import reduce

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.continuous_torque import continuous_torque, continuous_torque_text
from bellcrank.actuators.short_time_limits import voltage_limit_source
from bellcrank.arrays import Array, Mask
from bellcrank.config.units import RPM
from bellcrank.sizing.selection.axis_loads import DrivenAxis
from bellcrank.sizing.selection.criteria import (
    AT_LEAST,
    FRICTION,
    SHAFT,
    TORQUE_CONSTANT,
    Criterion,
    LimitCriterion,
    UseBound,
    alternatives,
    exceeds,
    figure,
)
from bellcrank.sizing.selection.load_reductions import ReducedCycle
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.shaft_loads import (
    electrical_coefficients,
    largest,
    largest_shaft_torque,
    least_coefficients,
    most_shaft_torque,
    not_above,
    rms_shaft_torque,
    root_mean_square,
    shaft_coefficients,
    speed_coefficients,
)

THERMAL_LIMIT = (
    "motor.resistance",
    "motor.resistance_winding_housing",
    "motor.resistance_housing_ambient",
    "motor.max_winding_temperature",
)
_MAXON = "maxon, motor data and operating ranges"
_YASKAWA = "Yaskawa, Sigma-II user's manual, servomotor selection examples"


class MotorSpeed(LimitCriterion):
    """The largest speed of the shaft under the permitted one."""

    name = "motor speed"
    of_ratings = True
    formula = "N max |q̇| ≤ n_max"
    source = _MAXON
    needs = (("motor.max_speed", "gear.ratio"),)
    quantity = "largest motor speed"
    limit_name = "largest permitted speed"
    unit = "rpm"
    stated = "motor.max_speed"
    lower_bound = UseBound("nominal speed", ("motor.nominal_speed",))  # at which the motor may run all the time

    def demand(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Largest speed of the shaft."""
        return pairs.of_gear("ratio") * cycle.max_speed * RPM


class ContinuousTorqueCriterion(LimitCriterion):
    """The root mean square of the shaft torque under the continuous (S1) torque at the mean speed."""

    name = "continuous torque"
    of_ratings = True
    formula = "√(1/t ∫ T² dt) ≤ T_S1(mean |ω|), T = τ/(N η) or τ η_b/N, + (J_rotor + J_gear) N q̈"
    source = f"{_YASKAWA} (T_rms ≤ rated torque); {_MAXON} (at mean speed)"
    needs = alternatives(SHAFT, (("motor.nominal_torque", "motor.nominal_speed"), ("motor.continuous_curve",))) + (
        alternatives(SHAFT, FRICTION, TORQUE_CONSTANT, (THERMAL_LIMIT,))
    )
    quantity = "RMS torque"
    limit_name = "continuous torque at the mean speed"
    unit = "N m"

    def demand(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """RMS of the shaft torque."""
        return rms_shaft_torque(pairs, cycle)

    def least_demand(self, pairs: Pairs, cycle: ReducedCycle, over: Array | None = None) -> Array:
        """RMS of the bound of the shaft torque in `shaft_loads.least_coefficients`."""
        return root_mean_square(least_coefficients(pairs, cycle, electrical=False), cycle.aligned)

    def limit(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Continuous torque at the mean speed."""
        speed = pairs.of_gear("ratio") * cycle.mean_speed
        return continuous_torque(pairs.motors, speed, conditions).torque

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """RMS torque, mean speed, and where the continuous torque is from."""
        motor, gear = pair.rows(0)
        demand = float(self.demand(pair, cycle, conditions)[0])
        speed = math.nan if gear.ratio is None else gear.ratio * cycle.mean_speed
        load = f"RMS torque {figure(demand)} N m"
        if math.isnan(demand):
            least = float(self.least_demand(pair, cycle)[0])
            shown = bool(exceeds(self.cycle_use(pair, cycle, conditions)[0]))
            bound = f"RMS torque at least {figure(least)} N m, {AT_LEAST},"
            load = bound if shown else "RMS torque unknown: " + self.missing(pair)
        limit = "unknown" if math.isnan(speed) else continuous_torque_text(motor, speed, conditions)
        return f"{load} at mean speed {speed * RPM:.4g} rpm in '{cycle.name}'; continuous torque {limit}"


class PeakTorque(LimitCriterion):
    """The largest shaft torque under the peak torque; not judged where only a peak current is stated."""

    name = "peak torque"
    of_ratings = True
    formula = "max |T| ≤ T_peak"
    source = f"{_YASKAWA} (instantaneous peak torque)"
    needs = alternatives(SHAFT, (("motor.peak_torque",), ("motor.peak_current", *TORQUE_CONSTANT[0])))
    quantity = "largest shaft torque"
    limit_name = "peak torque"
    unit = "N m"
    stated = "motor.peak_torque"
    lower_bound = UseBound("nominal torque", ("motor.nominal_torque",))  # which may act all the time

    def judged(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
        """Pairs but those whose motor states a peak current instead."""
        stated, current = pairs.of_motor("peak_torque"), pairs.of_motor("peak_electrical_torque")
        return np.asarray(~np.isnan(stated) | np.isnan(current))

    def demand(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Largest shaft torque; a bound where no limit is known."""
        limits = np.fmax(pairs.of_motor("peak_torque"), pairs.of_motor("nominal_torque"))
        return largest_shaft_torque(pairs, cycle, np.where(np.isnan(limits), np.inf, -np.inf))

    def least_demand(self, pairs: Pairs, cycle: ReducedCycle, over: Array | None = None) -> Array:
        """Largest bound of the shaft torque in `shaft_loads.least_coefficients`."""
        return largest(least_coefficients(pairs, cycle, electrical=False), cycle.aligned, over)

    def most_demand(self, pairs: Pairs, cycle: ReducedCycle) -> Array:
        """Bound of the shaft torque."""
        return most_shaft_torque(pairs, cycle)


class PeakCurrent(LimitCriterion):
    """The largest electrical torque under that of the peak current; a note where no peak current is stated."""

    name = "peak current"
    formula = "max |T_e| ≤ k_t I_peak, T_e = T + T_c sign ω + c_v ω"
    source = f"{_MAXON} (M = k_M I)"
    needs = alternatives(SHAFT, FRICTION, TORQUE_CONSTANT, (("motor.peak_current",),))
    quantity = "largest electrical torque"
    limit_name = "that of the peak current"
    unit = "N m"
    stated = "motor.peak_electrical_torque"

    def judged(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
        """Pairs whose motor states a peak current."""
        return np.asarray(~np.isnan(pairs.of_motor("peak_electrical_torque")))

    def demand(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Largest electrical torque."""
        return largest(electrical_coefficients(pairs, cycle), cycle)

    def least_demand(self, pairs: Pairs, cycle: ReducedCycle, over: Array | None = None) -> Array:
        """Largest bound of the electrical torque in `shaft_loads.least_coefficients`."""
        return largest(least_coefficients(pairs, cycle, electrical=True), cycle.aligned, over)

    def most_demand(self, pairs: Pairs, cycle: ReducedCycle) -> Array:
        """Bound of the electrical torque."""
        return not_above(electrical_coefficients(pairs, cycle), cycle)

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """The load and its limit, or that none is stated."""
        if self.judged(pair, cycle.axis, conditions)[0]:
            return super().cycle_text(pair, cycle, conditions)
        return "no peak current is stated, or the torque constant is not: the peak torque counts"


class VoltageLimit(Criterion):
    """Every point of the cycle under the voltage line, in four quadrants.

    Where the torque constant or the resistance is unknown, the line through stall torque and no-load speed stands in.
    """

    name = "voltage limit"
    formula = "max |R/k T_e + k ω| ≤ U (1 - reserve), k the torque constant of the DC equivalent, k ω the back-EMF"
    source = f"{_MAXON} (U = R I + k ω)"
    needs = (
        *alternatives(SHAFT, FRICTION, TORQUE_CONSTANT, (("motor.resistance",),)),
        *alternatives(SHAFT, (("motor.stall_torque", "motor.no_load_speed", "motor.nominal_voltage"),)),
    )

    def cycle_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Largest voltage over the usable one; where it is unknown, the bound by `least_coefficients` if it exceeds.

        Torque and speed have the same sign in the samples of that bound, so R/k T_e and k ω add up.
        """
        use = self._known_use(pairs, cycle, conditions)
        rows = np.nonzero(np.isnan(use))[0]
        if len(rows):
            least = self._least_use(pairs.take(rows), cycle, conditions)
            use[rows] = np.where(exceeds(least), least, np.nan)
        return use

    def _least_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """What the use is not below (m,), of the limits that are known; NaN where none is."""
        found = np.full(len(pairs), np.nan)
        for limit in pairs.products.short_time_limits(conditions):
            if limit.name == "voltage limit":
                torque, speed = limit.torque[pairs.motor], limit.speed[pairs.motor]
                factors = torque[:, None] * least_coefficients(pairs, cycle, electrical=limit.basis == "electrical")
                factors += speed_coefficients(pairs, speed)
                found = np.fmax(found, largest(factors, cycle.aligned, over=1.0))
        return found

    def _known_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        uses = (largest(factors, cycle) for factors in self._factors(pairs, cycle, conditions))
        return reduce(np.fmax, uses, np.full(len(pairs), np.nan))

    def cycle_below(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions, level: Array) -> Mask:
        """By the largest torque and the largest speed at once."""
        shown = np.zeros(len(pairs), dtype=bool)
        for factors in self._factors(pairs, cycle, conditions):
            shown |= not_above(factors, cycle) <= level
        return shown

    def _factors(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Iterator[Array]:
        """Factors (m, 5) of the cycle's features whose sum is the use, of each line that any motor has."""
        for limit in pairs.products.short_time_limits(conditions):
            torque, speed = limit.torque[pairs.motor], limit.speed[pairs.motor]
            if limit.name == "voltage limit" and not np.isnan(torque).all():
                of = shaft_coefficients if limit.basis == "shaft" else electrical_coefficients
                yield torque[:, None] * of(pairs, cycle) + speed_coefficients(pairs, speed)

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """Share of the voltage, its line's origin and the voltage."""
        motor, _ = pair.rows(0)
        use = float(self.cycle_use(pair, cycle, conditions)[0])
        if math.isnan(use):
            return self.missing(pair)
        bus = motor.nominal_voltage if conditions.voltage is None else conditions.voltage
        bound = "at least " if math.isnan(self._known_use(pair, cycle, conditions)[0]) else ""
        return (
            f"{bound}{use:.1%} of {bus:.4g} V less {conditions.voltage_reserve:.0%} reserve in '{cycle.name}', "
            f"from {voltage_limit_source(motor)}"
        )


class HoldingBrake(LimitCriterion):
    """The brake of the motor against the worst static torque; a note where no brake is asked for.

    What friction and the gear's efficiency help is left out: the brake alone holds τ/N.
    """

    name = "holding brake"
    formula = "max |τ_static| / N ≤ T_brake"
    source = "static equilibrium of the axis; losses of the gear, which help to hold, are left out"
    needs = (("motor.brake_torque", "gear.ratio"),)
    quantity = "largest static torque at the shaft"
    limit_name = "holding torque of the brake"
    unit = "N m"
    stated = "motor.brake_torque"

    def judged(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
        """All pairs, where a brake is asked for."""
        return np.full(len(pairs), conditions.brake)

    def demand(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Largest static torque over the ratio."""
        return cycle.static_torque / pairs.of_gear("ratio")
