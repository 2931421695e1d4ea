"""Criteria of temperature: winding and housing in the periodic state of the two-body model, and thermal runaway."""

from __future__ import annotations

import math
from typing import ClassVar, Literal

import numpy as np

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.electrical import loss_per_squared_torque
from bellcrank.actuators.thermal import HeatCycle, ThermalModel
from bellcrank.actuators.thermal_cycle import periodic_temperatures
from bellcrank.actuators.time_to_limit import time_to_limit
from bellcrank.sizing.selection.axis_loads import Axis
from bellcrank.sizing.selection.criteria import Array, Bools, Criterion
from bellcrank.sizing.selection.load_reductions import DIRECTION, SPEED, ReducedCycle
from bellcrank.sizing.selection.motor_criteria import TRAIN
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.shaft_loads import electrical_coefficients

MOST_VALUES = 2**20  # of pairs times intervals at once
_THERMAL = (
    *TRAIN,
    "motor.torque_constant",
    "motor.torque_constant_basis",
    "motor.resistance",
    "motor.no_load_current",
    "motor.resistance_winding_housing",
    "motor.resistance_housing_ambient",
    "motor.time_constant_winding",
    "motor.time_constant_motor",
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
            ("peak temperatures", cycle, conditions), lambda: peak_temperatures(pairs, cycle, conditions)
        )
        permitted = self.limit(pairs) - conditions.ambient
        use, bound = (
            np.where(permitted > 0.0, (peak[self.body == "housing"] - conditions.ambient) / permitted, np.inf)
            + 0.0 * permitted
            for peak in peaks
        )
        return np.where(np.isnan(use) & (bound <= 1.0), bound, use)

    def cycle_text(self, pair: Pairs, cycle: ReducedCycle, conditions: Conditions) -> str:
        """The temperature and its limit; from the ambient temperature, when the winding reaches it."""
        exact, bound = peak_temperatures(pair, cycle, conditions)
        number = int(self.body == "housing")
        limit, peak, most = float(self.limit(pair)[0]), float(exact[number][0]), float(bound[number][0])
        of = "" if math.isnan(limit) else f" of {limit:.4g} °C"
        if math.isinf(peak):
            return f"thermal runaway in '{cycle.name}': the losses grow faster than the heat that is given off{self._when(pair, cycle, conditions)}"
        if not math.isnan(peak):
            return f"{self.body} up to {peak:.1f} °C{of} in the periodic state of '{cycle.name}'{self._when(pair, cycle, conditions)}"
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
    needs = ((*_THERMAL, "motor.max_winding_temperature"),)
    body = "winding"


class HousingTemperature(Temperature):
    """The housing's temperature; a note where no limit is stated."""

    name = "housing temperature"
    needs = ((*_THERMAL, "motor.max_housing_temperature"),)
    body = "housing"

    def judged(self, pairs: Pairs, axis: Axis, conditions: Conditions) -> Bools:
        """Pairs whose motor states a limit."""
        return np.asarray(~np.isnan(self.limit(pairs)))


def heat_cycle(pairs: Pairs, cycle: ReducedCycle) -> HeatCycle:
    """The mean losses of each pair's motor over the intervals of a cycle, in their order and with all passes."""
    factors = electrical_coefficients(pairs, cycle)
    moments = cycle.interval_moments
    squares = (factors[:, :, None] * factors[:, None, :]).reshape(-1, 25) @ moments.reshape(-1, 25).T
    copper = loss_per_squared_torque(pairs.motors)[:, None] * np.maximum(squares, 0.0)
    ratio = pairs.of_gear("ratio")[:, None]
    friction = ratio * (
        pairs.of_motor("coulomb_torque")[:, None] * moments[:, DIRECTION, SPEED]
        + pairs.of_motor("viscous_coefficient")[:, None] * ratio * moments[:, SPEED, SPEED]
    )
    order = cycle.interval_order
    return HeatCycle(
        duration=cycle.interval_duration[order], copper_loss=copper[:, order], friction_loss=friction[:, order]
    )


def peak_temperatures(
    pairs: Pairs, cycle: ReducedCycle, conditions: Conditions
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Largest temperatures of winding and housing (m,), °C, in the periodic state; and bounds of them.

    The bounds are the steady state under the largest losses of any interval. Infinite on thermal runaway, NaN unknown.
    """
    exact, bound = np.empty((2, len(pairs))), np.empty((2, len(pairs)))
    step = max(1, MOST_VALUES // len(cycle.interval_order))
    for start in range(0, len(pairs), step):
        rows = slice(start, start + step)
        part = pairs.take(rows)
        heat = heat_cycle(part, cycle)
        model = ThermalModel.of(part.motors, conditions)
        periodic = periodic_temperatures(model, heat)
        exact[:, rows] = periodic.winding_peak, periodic.housing_peak
        bound[:, rows] = model.steady_temperatures(heat.copper_loss.max(axis=1), heat.friction_loss.max(axis=1))
    return (exact[0], exact[1]), (bound[0], bound[1])
