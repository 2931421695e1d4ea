"""Criteria of all axes together: the power of the supply at one instant, and the energy that comes back to the bus.

The axes share a bus. Where they give back more power than the others take, the bus capacitor stores the energy
(1/2) C (U_max² - U²); what it cannot take goes to the brake resistor. The stored energy is used first when power is
taken again. The order of the cycle counts, so the stored energy is followed along it, in the periodic state.
(Energies: Yaskawa, Sigma-7 manual SGM7D, regenerative resistor: E_K = E_S - (E_L + E_M + E_C).)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bellcrank.actuators import electrical
from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.copper import REFERENCE
from bellcrank.arrays import Array
from bellcrank.sizing.selection.criteria import CriterionResult, Verdict, cycles_of, exceeds
from bellcrank.sizing.selection.load_reductions import ReducedCycle, ReducedLoads
from bellcrank.sizing.selection.matching_criteria import common_bus
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.shaft_loads import electrical_coefficients

SUPPLY, REGENERATION = "supply power", "regenerated energy"


def judge_system(
    pairs: Sequence[Pairs], loads: Sequence[ReducedLoads], conditions: Conditions
) -> tuple[CriterionResult, ...]:
    """Judge the chosen motors and gears of all axes together.

    Args:
        pairs: One pair for each axis.
        loads: The loads of the axes; their cycles have the same samples.
        conditions: The supply, the bus and the brake resistor.

    Returns:
        Supply power and regenerated energy, each of the worst cycle, and whether one bus suits all motors.
    """
    own = [cycles_of(pair, load, conditions)[0][2] for pair, load in zip(pairs, loads, strict=True)]
    cycles = list(zip(*own, strict=True))
    supply = [_supply(pairs, axes, conditions) for axes in cycles]
    energy = [_regeneration(pairs, axes, conditions) for axes in cycles]
    return _worst(supply), _worst(energy), common_bus(pairs, conditions)


def _worst(results: list[CriterionResult]) -> CriterionResult:
    order = {"note": 0, "inside": 1, "unknown": 2, "exceeded": 3}
    return max(results, key=lambda one: (order[one.verdict], one.use or 0.0))


def bus_power(pairs: Sequence[Pairs], axes: Sequence[ReducedCycle], temperatures: Sequence[float]) -> Array:
    """Power (n,), W, that all axes take from the bus at each sample; negative where they give it back.

    Args:
        pairs: One pair for each axis.
        axes: The same cycle of each axis.
        temperatures: Winding temperature of each axis, °C.

    Returns:
        Shaft power, friction and copper losses of all motors; NaN where a figure is unknown.
    """
    total = np.zeros(len(axes[0].torque))
    for pair, cycle, temperature in zip(pairs, axes, temperatures, strict=True):
        torque = (electrical_coefficients(pair, cycle) @ cycle.features.T)[0]
        speed = pair.of_gear("ratio")[0] * cycle.speed
        total = total + electrical.electrical_power(pair.motors, torque, speed, temperature)
    return total


def _supply(pairs: Sequence[Pairs], axes: Sequence[ReducedCycle], conditions: Conditions) -> CriterionResult:
    """The largest power that all axes take at one instant, with the windings at their largest temperature."""
    limits = [float(pair.of_motor("max_winding_temperature")[0]) for pair in pairs]
    cold = float(np.max(bus_power(pairs, axes, [conditions.winding_temperature] * len(pairs))))
    hot = float(np.max(bus_power(pairs, axes, limits)))
    name, limit = axes[0].name, conditions.supply_power
    if math.isnan(cold):
        return _unknown(SUPPLY, pairs)
    text = f"up to {cold if math.isnan(hot) else hot:.4g} W of all axes at one instant in '{name}', windings at "
    text += (
        f"{conditions.winding_temperature:g} °C, their limits are not all stated" if math.isnan(hot) else "their limits"
    )
    if limit is None:
        return CriterionResult(name=SUPPLY, use=None, verdict="note", text=f"{text}; no power of the supply is given")
    if math.isnan(hot) and cold <= limit:
        return CriterionResult(name=SUPPLY, use=None, verdict="unknown", text=f"{text}; the supply has {limit:.4g} W")
    return _judged(SUPPLY, (cold if math.isnan(hot) else hot) / limit, f"{text}; the supply has {limit:.4g} W")


def _regeneration(pairs: Sequence[Pairs], axes: Sequence[ReducedCycle], conditions: Conditions) -> CriterionResult:
    """What comes back to the bus, with the windings at 25 °C, where they lose least."""
    power = bus_power(pairs, axes, [min(REFERENCE, conditions.ambient)] * len(pairs))
    cycle, name = axes[0], f"in '{axes[0].name}'"
    if np.isnan(power).any():
        return _unknown(REGENERATION, pairs)
    energy = -power * cycle.pass_weight
    if not (energy > 0.0).any():
        return _judged(REGENERATION, 0.0, f"the axes together never give power back {name}")
    given_back = float(np.sum(np.maximum(-power, 0.0) * cycle.weight))
    text = f"{given_back:.4g} J are regenerated into the bus {name}"
    capacity, resistor = bus_capacity(pairs, conditions), conditions.brake_resistor_power
    peaks = _resistor_peaks(conditions)
    if resistor is None and not peaks:
        if math.isnan(capacity):
            missing = "neither a brake resistor nor the bus capacitance with both voltages is given"
            return CriterionResult(name=REGENERATION, use=None, verdict="note", text=f"{text}; not judged: {missing}")
        needed = stored_energy(energy, cycle, math.inf).largest
        text = f"{text}, the capacitor must take up to {needed:.4g} J of {capacity:.4g} J"
        return _judged(REGENERATION, needed / capacity if capacity > 0.0 else math.inf, text)
    stored = stored_energy(energy, cycle, 0.0 if math.isnan(capacity) else capacity)
    overflow, largest = stored.overflow / cycle.duration, stored.overflow_power
    text += f"; the brake resistor takes {overflow:.4g} W{_of(resistor)} on average"
    text += f", {largest:.4g} W{_of(min(peaks))} at most" if peaks else ""
    text += ", without a capacitor (its capacitance or voltages are not given)" if math.isnan(capacity) else ""
    limits = [(overflow, math.nan if resistor is None else resistor), *((largest, peak) for peak in peaks)]
    uses = [0.0 if power == 0.0 else power / limit if limit != 0.0 else math.inf for power, limit in limits]
    use = max((one for one in uses if not math.isnan(one)), default=0.0)
    if math.isnan(capacity) if exceeds(use) else any(map(math.isnan, uses)):
        return CriterionResult(name=REGENERATION, use=None, verdict="unknown", text=text)
    return _judged(REGENERATION, use, text)


def _of(limit: float | None) -> str:
    return " (its limit is not known)" if limit is None or math.isnan(limit) else f" of {limit:.4g} W"


def _resistor_peaks(conditions: Conditions) -> list[float]:
    """What limits the power of the brake resistor at one instant, W: U_max²/R, NaN without U_max, and its pulse power.

    Source: P = U²/R at the voltage that switches it on.
    """
    voltage = math.nan if conditions.bus_max_voltage is None else conditions.bus_max_voltage
    resistance, pulse = conditions.brake_resistance, conditions.brake_resistor_peak_power
    return [
        *([] if resistance is None else [voltage**2 / resistance]),
        *([] if pulse is None else [pulse]),
    ]


def bus_capacity(pairs: Sequence[Pairs], conditions: Conditions) -> float:
    """The energy (1/2) C (U_max² - U²), J, that the bus capacitor takes; NaN where a figure is not given."""
    voltages = {float(pair.of_motor("nominal_voltage")[0]) for pair in pairs}
    voltage = (
        conditions.voltage if conditions.voltage is not None else voltages.pop() if len(voltages) == 1 else math.nan
    )
    if conditions.bus_capacitance is None or conditions.bus_max_voltage is None:
        return math.nan
    return max(0.5 * conditions.bus_capacitance * (conditions.bus_max_voltage**2 - voltage**2), 0.0) + 0.0 * voltage


class StoredEnergy(NamedTuple):
    """The bus capacitor over one cycle in the periodic state.

    Attributes:
        largest: Largest stored energy, J.
        overflow: Energy that it could not take, J.
        overflow_power: Largest power that comes back while it cannot take it, W.
    """

    largest: float
    overflow: float
    overflow_power: float


class _Store(NamedTuple):
    """What a stretch of the cycle does to the stored energy: e becomes e + change, at least `least`, at most `most`."""

    change: float
    least: float
    most: float

    def after(self, energy: float) -> float:
        """The energy at the end."""
        return min(max(energy + self.change, self.least), self.most)

    def then(self, other: _Store) -> _Store:
        """Two stretches, one after the other."""
        return _Store(self.change + other.change, other.after(self.least), other.after(self.most))


def stored_energy(energy: Array, cycle: ReducedCycle, capacity: float) -> StoredEnergy:
    """Follow the energy in the bus capacitor along a cycle that repeats.

    Args:
        energy: Energy (n,), J, that comes back at each sample of one pass; negative where it is taken.
        cycle: The cycle.
        capacity: What the capacitor takes, J; infinite to find what it must take.

    Returns:
        Largest stored energy, infinite where it grows from cycle to cycle, and overflow.
    """
    places = [slice(*np.searchsorted(cycle.interval, [a, b])) for a, b, _ in cycle.sequence]
    parts = [energy[place].tolist() for place in places]
    with np.errstate(divide="ignore", invalid="ignore"):
        powers = [np.nan_to_num(energy[place] / cycle.pass_weight[place]).tolist() for place in places]
    whole = _Store(0.0, 0.0, capacity)
    for part, (_, _, passes) in zip(parts, cycle.sequence, strict=True):
        whole = whole.then(_repeated(part, passes, capacity))
    if math.isinf(capacity) and whole.change > 0.0:
        return StoredEnergy(math.inf, 0.0, 0.0)
    state = whole.most if whole.change > 0.0 else whole.least if whole.change < 0.0 else whole.after(0.0)
    largest, overflow, highest = state, 0.0, 0.0
    for part, power, (_, _, passes) in zip(parts, powers, cycle.sequence, strict=True):
        for number in range(passes):
            before, spilled = state, 0.0
            for change, rate in zip(part, power, strict=True):
                state = max(state + change, 0.0)
                if state > capacity:
                    spilled, state, highest = spilled + state - capacity, capacity, max(highest, rate)
                largest = max(largest, state)
            overflow += spilled
            if state == before:  # the passes that follow are the same
                overflow += spilled * (passes - number - 1)
                break
    return StoredEnergy(largest, overflow, highest)


def _repeated(part: list[float], passes: int, capacity: float) -> _Store:
    one = _Store(0.0, 0.0, capacity)
    for change in part:
        one = one.then(_Store(change, 0.0, capacity))
    result = _Store(0.0, 0.0, capacity)
    while passes:
        result, one, passes = result.then(one) if passes % 2 else result, one.then(one), passes // 2
    return result


def _judged(name: str, use: float, text: str) -> CriterionResult:
    verdict: Verdict = "exceeded" if exceeds(use) else "inside"
    return CriterionResult(name=name, use=use, verdict=verdict, text=text)


def _unknown(name: str, pairs: Sequence[Pairs]) -> CriterionResult:
    """Unknown, because of motors and gears whose losses are unknown."""
    lossy = [
        pair.rows(0)
        for pair in pairs
        if np.isnan(electrical.loss_per_squared_torque(pair.motors) + pair.coefficients.sum(axis=1)).any()
    ]
    named = [motor.id if gear.kind == "direct" else f"{motor.id} with {gear.id}" for motor, gear in lossy]
    text = f"the losses are not known of: {', '.join(dict.fromkeys(named))}"
    return CriterionResult(name=name, use=None, verdict="unknown", text=text)
