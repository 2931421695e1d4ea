"""Criteria of temperature: winding and housing in the periodic state of the two-body model, and thermal runaway."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.electrical import loss_per_squared_torque, resistance_factor
from bellcrank.actuators.thermal import HeatCycle, ThermalModel
from bellcrank.actuators.thermal_cycle import periodic_temperatures, time_to_limit
from bellcrank.arrays import Array, Mask
from bellcrank.sizing.selection.axis_loads import DrivenAxis
from bellcrank.sizing.selection.criteria import FRICTION, SHAFT, TORQUE_CONSTANT, Criterion, alternatives
from bellcrank.sizing.selection.load_reductions import DIRECTION, SPEED, ReducedCycle
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.shaft_loads import electrical_coefficients

MOST_VALUES = 2**20  # of pairs times intervals at once
_THERMAL = alternatives(
    SHAFT,
    FRICTION,
    TORQUE_CONSTANT,
    (("motor.resistance", "motor.resistance_winding_housing", "motor.resistance_housing_ambient"),),
    (("motor.time_constant_winding", "motor.time_constant_motor"),),
)
_SOURCE = "two-body model: maxon, motor data lines 17 to 20; A. M. Johnson, Motor Thermal Calculator, CMU"


class Temperature(Criterion):
    """The largest temperature of a body over the cycle once it repeats itself, under its limit.

    Use is the rise above the ambient over the permitted rise; infinite on thermal runaway. Where the time constants are
    unknown, the steady state under the largest losses of any interval may show a pass.
    """

    formula = "(max T - T_a) / (T_max - T_a) ≤ 1 in the periodic state of the cycle, copper's resistance rise included"
    source = _SOURCE
    body: ClassVar[Literal["winding", "housing"]]

    def limit(self, pairs: Pairs) -> Array:
        """The largest permitted temperature (m,), °C."""
        return pairs.of_motor(f"max_{self.body}_temperature")

    def cycle_use(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
        """Rise over permitted rise."""
        peaks = pairs.once(
            ("limited temperatures", cycle, conditions), lambda: _limited_temperatures(pairs, cycle, conditions)
        )
        permitted = self.limit(pairs) - conditions.ambient
        rise = peaks[:, self._columns].T - conditions.ambient
        use, bound = np.where(permitted > 0.0, rise / permitted, np.inf + 0.0 * permitted)
        return np.asarray(np.where(np.isnan(use) & (bound <= 1.0), bound, use))

    def cycle_below(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions, level: Array) -> Mask:
        """By the mean losses and the largest energy above the mean; see `temperature_bounds`."""
        shown = np.zeros(len(pairs), dtype=bool)
        limits = pairs.of_motor("max_winding_temperature") + self.limit(pairs)
        known = np.nonzero(~np.isnan(limits + _needed(pairs, cycle)))[0]
        if len(known):
            shown[known] = self._below(pairs.take(known), cycle, conditions, level[known])
        return shown

    def _below(self, pairs: Pairs, cycle: ReducedCycle, conditions: Conditions, level: Array) -> Mask:
        number = int(self.body == "housing")
        winding = pairs.of_motor("max_winding_temperature")
        if not number:
            winding = conditions.ambient + level * (winding - conditions.ambient)
        bounds = temperature_bounds(pairs, cycle, conditions, winding)
        limit = conditions.ambient + level * (self.limit(pairs) - conditions.ambient)
        return np.asarray((bounds[0] <= winding) & (bounds[number] <= limit))

    @property
    def _columns(self) -> list[int]:
        """Columns of `peak_temperatures`: the temperature and its bound."""
        return [0, 2] if self.body == "winding" else [1, 3]

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """The temperature and its limit; from the ambient temperature, when the winding reaches it."""
        limit = float(self.limit(pair)[0])
        peak, most = map(float, _peaks_once(pair, cycle, conditions)[0, self._columns])
        of = "" if math.isnan(limit) else f" of {limit:.4g} °C"
        # the periodic state is warmer than any time after a start at the ambient temperature
        when = "" if peak <= limit else self._when(pair, cycle, conditions)
        if math.isinf(peak):
            return (
                f"thermal runaway in '{cycle.name}': heat grows faster with the temperature than it is given off{when}"
            )
        if not math.isnan(peak):
            return f"{self.body} up to {peak:.1f} °C{of} in the periodic state of '{cycle.name}'{when}"
        if most <= limit:
            return f"{self.body} not above {most:.1f} °C{of} in '{cycle.name}', even if its largest losses lasted"
        return self.missing(pair)

    def _when(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """When the winding reaches its limit from the ambient temperature; empty where it does not."""
        if self.body == "housing" or math.isnan(float(self.limit(pair)[0])):
            return ""
        model = ThermalModel.of(pair.motors, conditions)
        time = float(time_to_limit(model, heat_cycle(pair, cycle), self.limit(pair))[0])
        return (
            f"; its limit is reached {time:.4g} s after a start at {conditions.ambient:g} °C" if time < math.inf else ""
        )


class WindingTemperature(Temperature):
    """The winding's temperature."""

    name = "winding temperature"
    needs = alternatives(_THERMAL, (("motor.max_winding_temperature",),))
    body = "winding"


class HousingTemperature(Temperature):
    """The housing's temperature; a note where no limit is stated."""

    name = "housing temperature"
    needs = alternatives(_THERMAL, (("motor.max_housing_temperature",),))
    body = "housing"

    def judged(self, pairs: Pairs, axis: DrivenAxis, conditions: Conditions) -> Mask:
        """Pairs whose motor states a limit."""
        return np.asarray(~np.isnan(self.limit(pairs)))


def heat_cycle(pairs: Pairs, cycle: ReducedCycle) -> HeatCycle:
    """The mean losses of each pair's motor over the intervals of a cycle, in their order and with all passes."""
    copper, friction = interval_losses(pairs, cycle)
    order = cycle.interval_order
    return HeatCycle(
        duration=cycle.interval_duration[order], copper_loss=copper[order].T, friction_loss=friction[order].T
    )


def interval_losses(pairs: Pairs, cycle: ReducedCycle) -> tuple[Array, Array]:
    """Mean copper loss at 25 °C, and friction and iron loss (K, m), W, of each interval and pair."""
    return _losses(pairs, cycle, cycle.interval_moments)


def _losses(pairs: Pairs, cycle: ReducedCycle, moments: Array) -> tuple[Array, Array]:
    """Copper loss at 25 °C, and friction and iron loss (k, m), of each pair and k matrices of second moments."""
    factors = electrical_coefficients(pairs, cycle).T
    row, column = np.triu_indices(5)
    twice = np.where(row == column, 1.0, 2.0)
    squares = (moments[:, row, column] * twice) @ (factors[row] * factors[column])
    ratio = pairs.of_gear("ratio")
    constant, viscous = ratio * pairs.of_motor("coulomb_torque"), ratio**2 * pairs.of_motor("viscous_coefficient")
    friction = moments[:, [DIRECTION, SPEED], SPEED] @ np.stack([constant, viscous])
    return loss_per_squared_torque(pairs.motors) * np.maximum(squares, 0.0), friction


def _peaks_once(pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
    """The peak temperatures, computed once for both bodies and for their texts."""
    return pairs.once(("peak temperatures", cycle, conditions), lambda: peak_temperatures(pairs, cycle, conditions))


def _limited_temperatures(pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
    """The peak temperatures of those pairs whose motor states a limit; NaN of the others, which most are."""
    limits = np.stack([pairs.of_motor("max_winding_temperature"), pairs.of_motor("max_housing_temperature")])
    rows = np.nonzero(~np.isnan(limits).all(axis=0))[0]
    if len(rows) == len(pairs):
        return _peaks_once(pairs, cycle, conditions)
    found = np.full((len(pairs), 4), np.nan)
    if len(rows):
        found[rows] = peak_temperatures(pairs.take(rows), cycle, conditions)
    return found


def peak_temperatures(pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
    """Largest temperatures (m, 4), °C: winding and housing in the periodic state, and bounds of the two.

    The bounds are the steady state under the largest losses of any interval. Infinite on thermal runaway, NaN unknown.
    """
    found = np.full((len(pairs), 4), np.nan)
    known = np.nonzero(~np.isnan(_needed(pairs, cycle)))[0]
    step = max(1, MOST_VALUES // len(cycle.interval_order))
    for start in range(0, len(known), step):
        rows = known[start : start + step]
        found[rows] = _peak_temperatures(pairs.take(rows), cycle, conditions)
    return found


def _needed(pairs: Pairs, cycle: ReducedCycle) -> Array:
    """A sum (m,) that is NaN where a figure is unknown that every temperature needs."""
    resistances = pairs.of_motor("resistance_winding_housing") + pairs.of_motor("resistance_housing_ambient")
    return resistances + loss_per_squared_torque(pairs.motors) + electrical_coefficients(pairs, cycle) @ np.ones(5)


def _peak_temperatures(pairs: Pairs, cycle: ReducedCycle, conditions: Conditions) -> Array:
    heat = heat_cycle(pairs, cycle)
    model = ThermalModel.of(pairs.motors, conditions)
    complete = ~np.isnan(heat.copper_loss @ heat.duration + model.winding_capacity + model.housing_capacity)
    periodic = periodic_temperatures(model[complete], heat[complete])
    settled = np.column_stack([periodic.winding_peak, periodic.housing_peak])
    settled[np.isnan(settled)] = np.inf  # only a runaway overflows
    peaks = np.full((len(pairs), 2), np.nan)
    peaks[complete] = settled
    bounds = model.steady_temperatures(heat.copper_loss.max(axis=1), heat.friction_loss.max(axis=1))
    return np.column_stack([peaks, *bounds])


def temperature_bounds(
    pairs: Pairs, cycle: ReducedCycle, conditions: Conditions, winding: Array
) -> tuple[Array, Array]:
    """Bounds (m,), °C, of winding and housing temperature, if the winding is at most as warm as assumed (m,), °C.

    With the copper's resistance held at the assumed temperature the model is linear. Its response h to an impulse of
    heat falls from 1/C where the heat enters; elsewhere it rises from 0 to at most 1/C_h and falls again. Integration
    by parts of ∫ h q, q the heat above its mean P, gives at most (largest h) (max Q - min Q), Q = ∫ q over the cycle:

        T_w - T_a ≤ (R_wh + R_ha) P_cu + R_ha P_f + ΔQ_cu/C_w + ΔQ_f/C_h,
        T_h - T_a ≤ R_ha (P_cu + P_f) + (ΔQ_cu + ΔQ_f)/C_h.

    Where the bound of the winding is not above the assumed temperature, both hold with the resistance rise too: heat
    grows with the temperature, so from the ambient temperature the true solution stays below the linear one. (Derived
    here.)
    """
    model = ThermalModel.of(pairs.motors, conditions)
    factor = resistance_factor(winding)
    mean_copper, copper_range, mean_friction, friction_range = pairs.once(
        ("means and ranges", cycle), lambda: _means_and_ranges(pairs, cycle)
    ).T
    mean_copper, copper_range = factor * mean_copper, factor * copper_range
    mean_friction, friction_range = model.friction_share * mean_friction, model.friction_share * friction_range
    base = model.ambient + model.housing_resistance * (mean_copper + mean_friction)
    base = base + friction_range / model.housing_capacity
    return (
        base + model.winding_resistance * mean_copper + copper_range / model.winding_capacity,
        base + copper_range / model.housing_capacity,
    )


def _means_and_ranges(pairs: Pairs, cycle: ReducedCycle) -> Array:
    """Mean copper loss, W, a bound of the range of the energy above it along the cycle, J, and of friction, (m, 4).

    Inside a stretch of several intervals the energy above the mean rises by at most the stretch's heat, and falls by at
    most what the mean gives off meanwhile, because losses are not negative.
    """
    columns: list[Array] = []
    stretches = cycle.stretches
    for heat in _losses(pairs, cycle, stretches.moments):
        mean = heat.sum(axis=0) / cycle.duration
        given = mean * stretches.duration[:, None]
        after = np.cumsum(heat - given, axis=0)
        highest, lowest = (after + given, after - heat) if stretches.several else (after, after)
        columns += [mean, np.maximum(highest.max(axis=0), 0.0) - np.minimum(lowest.min(axis=0), 0.0)]
    return np.column_stack(columns)
