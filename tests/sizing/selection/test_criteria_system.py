"""Supply power and regenerated energy of all axes together, against a plain simulation of the bus."""

from __future__ import annotations

import math

import numpy as np
import pytest
from random_catalogue import random_cycles, random_gears, random_motors

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.powertrain import PowerTrains
from bellcrank.sizing.selection.criteria import CriterionResult
from bellcrank.sizing.selection.load_reductions import ReducedLoads, reduce_loads
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.system_criteria import bus_power, judge_system, stored_energy


def chosen(axes: int, seed: int, missing: float = 0.0) -> tuple[list[Pairs], tuple[ReducedLoads, ...]]:
    """One pair for each axis, with a gear, and the loads."""
    motors, gears = random_motors(axes, seed, missing), random_gears(axes, seed, missing)
    pairs = Pairs.possible(motors, gears)
    one = [pairs.take(np.flatnonzero((pairs.motor == k) & (pairs.gear == k + 1))) for k in range(axes)]
    return one, reduce_loads(*random_cycles(axes, seed, samples=60, parts=3))


def powers(pairs: list[Pairs], loads: tuple[ReducedLoads, ...], temperatures: list[float]) -> np.ndarray:
    """Electrical power of all axes (n,) by the power train of each."""
    total = 0.0
    for pair, load, temperature in zip(pairs, loads, temperatures, strict=True):
        motor, gear = pair.rows(0)
        cycle = load.cycles[0]
        shaft = PowerTrains.of(motor, gear).load(cycle.torque, cycle.speed, cycle.features[:, 2])
        hot = 1.0 + 0.0039 * (temperature - 25.0)
        total = total + shaft.electrical_torque * shaft.speed + shaft.copper_loss * hot
    return np.asarray(total)


def plain_bus(energy: np.ndarray, order: np.ndarray, capacity: float, cycles: int = 400) -> tuple[float, float]:
    """Largest stored energy and overflow of the last of many cycles from an empty store."""
    state = 0.0
    for _ in range(cycles):
        largest, overflow = state, 0.0
        for number in order:
            state = max(state + energy[number], 0.0)
            if state > capacity:
                overflow += state - capacity
                state = capacity
            largest = max(largest, state)
    return largest, overflow


def result(results: tuple[CriterionResult, ...], name: str) -> CriterionResult:
    return next(one for one in results if one.name == name)


@pytest.mark.parametrize("seed", range(4))
def test_the_power_of_the_bus_is_that_of_all_power_trains(seed: int) -> None:
    pairs, loads = chosen(3, seed)
    cycles = [load.cycles[0] for load in loads]
    found = bus_power(pairs, cycles, [25.0, 80.0, 120.0])
    np.testing.assert_allclose(found, powers(pairs, loads, [25.0, 80.0, 120.0]), rtol=1e-10, atol=1e-9)
    limits = [float(pair.of_motor("max_winding_temperature")[0]) for pair in pairs]
    most = powers(pairs, loads, limits).max()
    for supply in (0.9 * most, 1.1 * most):
        supplied = result(judge_system(pairs, loads, Conditions(supply_power=supply)), "supply power")
        assert supplied.use == pytest.approx(most / supply, rel=1e-9)
        assert supplied.verdict == ("inside" if supply > most else "exceeded")
    assert result(judge_system(pairs, loads, Conditions()), "supply power").verdict == "note"


@pytest.mark.tier2
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("capacity", [0.0, 0.3, 3.0, math.inf])
def test_stored_energy_equals_a_plain_simulation_of_many_cycles(seed: int, capacity: float) -> None:
    _, loads = chosen(1, seed)
    (cycle,) = loads[0].cycles
    rng = np.random.default_rng(seed)
    energy = rng.normal(loc=(-0.05, 0.02, 0.0)[seed % 3], scale=0.3, size=len(cycle.torque))
    if capacity == math.inf and seed % 3:
        energy -= energy @ cycle.passes[cycle.interval] / cycle.passes[cycle.interval].sum() + 1e-3  # it must settle
    parts = [np.flatnonzero((cycle.interval >= a) & (cycle.interval < b)) for a, b, _ in cycle.sequence]
    order = np.concatenate([np.tile(part, passes) for part, (_, _, passes) in zip(parts, cycle.sequence, strict=True)])
    found = stored_energy(energy, cycle, capacity)
    largest, overflow = plain_bus(energy, order, capacity)
    assert found.largest == pytest.approx(largest, rel=1e-9, abs=1e-12)
    assert found.overflow == pytest.approx(overflow, rel=1e-9, abs=1e-12)


def test_energy_that_grows_from_cycle_to_cycle_needs_an_infinite_capacitor() -> None:
    _, loads = chosen(1, 0)
    (cycle,) = loads[0].cycles
    energy = np.full(len(cycle.torque), 0.1)
    energy[::2] = -0.05
    assert math.isinf(stored_energy(energy, cycle, math.inf).largest)


@pytest.mark.parametrize("seed", range(4))
def test_capacitor_and_brake_resistor(seed: int) -> None:
    pairs, loads = chosen(2, seed)
    (cycle,) = loads[0].cycles
    energy = -powers(pairs, loads, [25.0, 25.0]) * cycle.pass_weight
    assert (energy > 0.0).any(), "the axes give energy back"
    bus = {"voltage": 48.0, "bus_capacitance": 0.05, "bus_max_voltage": 60.0}
    capacity = 0.5 * 0.05 * (60.0**2 - 48.0**2)
    alone = result(judge_system(pairs, loads, Conditions(**bus)), "regenerated energy")  # type: ignore[arg-type]
    needed = stored_energy(energy, cycle, math.inf).largest
    assert alone.use == pytest.approx(needed / capacity, rel=1e-8)
    for most, room in ((48.01, 0.5 * 0.05 * (48.01**2 - 48.0**2)), (48.0, 0.0)):  # far below 1 J, and none
        less = result(judge_system(pairs, loads, Conditions(**bus | {"bus_max_voltage": most})), "regenerated energy")  # type: ignore[arg-type]
        assert less.verdict == "exceeded"
        assert less.use == (pytest.approx(needed / room, rel=1e-8) if room else math.inf)
    if seed == 0:  # a capacitor that is too small
        bus["bus_capacitance"], capacity = 0.25 * needed / capacity * 0.05, 0.25 * needed
    overflow = stored_energy(energy, cycle, capacity).overflow / cycle.duration
    with_resistor = Conditions(**bus, brake_resistor_power=40.0)  # type: ignore[arg-type]
    resisted = result(judge_system(pairs, loads, with_resistor), "regenerated energy")
    assert resisted.use == pytest.approx(overflow / 40.0, rel=1e-8, abs=1e-12)
    assert overflow > 0.0 or seed != 0
    # Without a capacitor's figures the resistor is taken to bear everything: a pass is shown, a failure is not.
    everything = stored_energy(energy, cycle, 0.0).overflow / cycle.duration
    for power, verdict in ((1.1 * everything, "inside"), (0.9 * everything, "unknown")):
        unknown = result(judge_system(pairs, loads, Conditions(brake_resistor_power=power)), "regenerated energy")
        assert unknown.verdict == verdict
    assert result(judge_system(pairs, loads, Conditions()), "regenerated energy").verdict == "note"


@pytest.mark.parametrize("seed", range(3))
def test_the_brake_resistor_bears_the_largest_power_that_comes_back_while_the_capacitor_is_full(seed: int) -> None:
    pairs, loads = chosen(2, seed)
    (cycle,) = loads[0].cycles
    power = -powers(pairs, loads, [25.0, 25.0])
    mean = float(np.sum(np.maximum(power, 0.0) * cycle.weight)) / cycle.duration
    largest = float(power.max())
    assert largest > 2.0 * mean > 0.0, "a resistor for the mean power does not bear the peak"
    bus = {"voltage": 48.0, "bus_max_voltage": 60.0, "bus_capacitance": 1e-9}  # takes nothing worth the name
    for given, limit in (
        ({"brake_resistance": 60.0**2 / (1.25 * largest)}, 1.25 * largest),  # U²/R
        ({"brake_resistor_peak_power": 0.5 * largest}, 0.5 * largest),
        ({"brake_resistance": 60.0**2 / largest, "brake_resistor_peak_power": 0.8 * largest}, 0.8 * largest),
    ):
        both = Conditions(**bus, **given, brake_resistor_power=100.0 * mean)  # type: ignore[arg-type]
        found = result(judge_system(pairs, loads, both), "regenerated energy")
        assert found.use == pytest.approx(largest / limit, rel=1e-6)
        assert found.verdict == ("exceeded" if largest > limit else "inside")
        alone = Conditions(**bus, **given)  # type: ignore[arg-type]
        judged = result(judge_system(pairs, loads, alone), "regenerated energy")
        assert judged.verdict == ("exceeded" if largest > limit else "unknown"), "its continuous power is not given"
    unknown = Conditions(voltage=48.0, brake_resistance=1.0, brake_resistor_power=100.0 * mean)
    assert result(judge_system(pairs, loads, unknown), "regenerated energy").verdict == "unknown", "U_max is not given"


def test_unknown_losses_are_unknown_powers() -> None:
    pairs, loads = chosen(2, 1, missing=0.5)
    found = judge_system(pairs, loads, Conditions(supply_power=1e6, brake_resistor_power=1e6))
    assert [one.verdict for one in found[:2]] == ["unknown", "unknown"]
    assert "m0000 with g0000" in found[0].text
