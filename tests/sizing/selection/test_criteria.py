"""Every criterion against its definition, sample by sample, on random motors, gears and cycles."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from brute_criteria import Brute
from random_catalogue import random_cycles, random_gears, random_motors

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.thermal import ThermalModel
from bellcrank.sizing.selection.judge import CRITERIA, NOT_EVALUATED, VERDICTS, in_words, judge
from bellcrank.sizing.selection.load_reductions import reduce_loads
from bellcrank.sizing.selection.motor_criteria import ContinuousTorqueCriterion
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.thermal_criteria import heat_cycle, peak_temperatures, temperature_bounds
from tests.campaigns.criteria_from_their_sources import CRITERIA as CASES
from tests.campaigns.criteria_from_their_sources import TARGETS, boundary_cases, differences

pytestmark = pytest.mark.tier2

BY_NAME = {criterion.name: criterion for criterion in CRITERIA}
DECIDED_BY_BOUNDS = {  # criteria that a stated bound of an unknown limit may decide
    "gear average torque",
    "gear repeated peak torque",
    "gear average input speed",
    "gear largest input speed",
    "gear life",
    "motor speed",
    "peak torque",
    "peak duration",
    "winding temperature",
    "housing temperature",
}
# Criteria that the least torque at the shaft may show to be exceeded, whatever the figures that are not stated.
EXCEEDED_BY_LEAST_TORQUE = {"continuous torque", "peak torque", "peak current", "voltage limit", "peak curve"}
SAMPLED = {"winding temperature": 2e-3, "housing temperature": 1e-4}  # the peak may lie between the moments compared


def compare(name: str, found: float, expected: float, full: float) -> str:
    """An error, or nothing: equal where known, else unknown or what the complete rows say too."""
    if not math.isnan(expected):
        tolerance = SAMPLED.get(name, 1e-9)
        if math.isinf(expected) or math.isinf(found):
            return "" if found == expected else f"{name}: {found} for {expected}"
        return "" if abs(found - expected) <= tolerance * max(1.0, abs(expected)) else f"{name}: {found} for {expected}"
    if math.isnan(found):
        return ""
    if name in EXCEEDED_BY_LEAST_TORQUE and found > 1.0:
        return "" if found <= full * (1.0 + 1e-9) else f"{name}: at least {found}, {full} from the complete rows"
    if name not in DECIDED_BY_BOUNDS:
        return f"{name}: {found} where it is unknown"
    if math.isnan(full) or (found <= 1.0) == (full <= 1.0):
        return ""
    return f"{name}: {found} from bounds, {full} from the complete rows"


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("missing", [0.0, 0.12])
def test_every_criterion_equals_its_definition(seed: int, missing: float) -> None:
    motors, gears = random_motors(12, seed), random_gears(6, seed)
    lacking_motors, lacking_gears = random_motors(12, seed, missing), random_gears(6, seed, missing)
    axes, cycles = random_cycles(2, seed, samples=120, parts=2 + seed % 2)
    conditions = Conditions(safety_factor=1.0 + 0.2 * (seed % 2), life=8000.0, brake=True)
    pairs = Pairs.possible(lacking_motors, lacking_gears)
    errors = []
    for number, loads in enumerate(reduce_loads(axes, cycles)):
        uses = {name: criterion.use(pairs, loads, conditions) for name, criterion in BY_NAME.items()}
        judged = {name: criterion.judged(pairs, loads.axis, conditions) for name, criterion in BY_NAME.items()}
        for pair in range(len(pairs)):
            motor, gear = pairs.rows(pair)
            index, gear_index = pairs.motor[pair], pairs.gear[pair] - 1
            brute = Brute(motor, gear, cycles[0], number, conditions)
            expected = full = brute.uses()
            if missing:
                full_gear = gear if gear.kind == "direct" else gears[gear_index]
                complete = Brute(motors[index], full_gear, cycles[0], number, conditions)
                full = complete.uses()
                now, then = brute.s1(brute.omega), complete.s1(complete.omega)
                if np.any((now != then) & ~np.isnan(now)):  # the nominal torque and thermal figures limit each other
                    full["peak duration"] = expected["peak duration"]
            for name, of_definition in expected.items():
                if judged[name][pair]:
                    error = compare(name, float(uses[name][pair]), of_definition, full.get(name, math.inf))
                    errors += [f"{motor.id} {gear.id} {loads.axis.name} {error}"] if error else []
    assert not errors, errors[:10]


def test_verdicts_are_those_of_the_sources_at_the_limits_too() -> None:
    kinds = set()
    for number in range(len(CASES) * len(TARGETS)):
        kind, name, case = boundary_cases(7_000_000 + number)
        assert differences(case)[0] == [], (number, kind, name)
        kinds.add(kind)
    assert kinds == set(TARGETS)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("missing", [0.0, 0.1])
def test_judgement_agrees_with_each_criterion_for_itself(
    seed: int, missing: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Many more pairs than `FEW`, so that extreme points and bounds are used; one pair at a time uses all samples.
    monkeypatch.setattr("bellcrank.sizing.selection.shaft_loads.FEW", 20)
    pairs = Pairs.possible(random_motors(40, seed, missing), random_gears(25, seed, missing))
    axes, cycles = random_cycles(1, seed, samples=200, parts=3)
    (loads,) = reduce_loads(axes, cycles)
    conditions = Conditions(voltage=48.0 if seed == 1 else None, ambient=25.0 + 10.0 * seed)
    found = judge(pairs, loads, conditions)
    kinds = set()
    for number in np.random.default_rng(seed).permutation(len(pairs))[:150]:
        results = {result.name: result for result in in_words(pairs.take(slice(number, number + 1)), loads, conditions)}
        known = [r.use for r in results.values() if r.use is not None]
        evaluated = found.verdict[:, number] != NOT_EVALUATED
        for row, criterion in enumerate(found.criteria):
            result = results[criterion.name]
            if evaluated[row]:
                assert result.verdict == VERDICTS[found.verdict[row, number]], (criterion.name, result)
                if not math.isnan(found.use[row, number]):
                    assert found.use[row, number] == pytest.approx(result.use, rel=1e-9), criterion.name
                elif result.use is not None:
                    assert result.use <= found.largest_use[number] * (1.0 + 1e-12), "left out, though it binds"
            else:
                assert found.tier[number] == 2, "only pairs that fail are left out"
        if evaluated.all():
            assert found.largest_use[number] == pytest.approx(max(known, default=0.0), rel=1e-9)
        fails = any(result.verdict == "exceeded" for result in results.values())
        unknown = any(result.verdict == "unknown" for result in results.values())
        assert found.tier[number] == (2 if fails else 1 if unknown else 0)
        kinds.add(int(found.tier[number]))
    assert len(kinds) >= 2


@pytest.mark.parametrize("seed", range(5))
def test_bounds_of_temperatures_hold_and_need_the_ripple(seed: int) -> None:
    # Windings that follow the losses within a cycle, so that the peak is well above the mean.
    quick = [replace(m, time_constant_winding=0.2, time_constant_motor=20.0) for m in random_motors(30, seed)]
    pairs = Pairs.possible(quick, random_gears(10, seed))
    axes, cycles = random_cycles(1, seed, samples=100, parts=3)
    (loads,) = reduce_loads(axes, cycles)
    (cycle,) = loads.cycles
    pairs = pairs.take(ContinuousTorqueCriterion().use(pairs, loads, Conditions()) < 1.2)
    pairs = pairs.take(~pairs.products.gear_arrays.efficiency_curve.known[pairs.gear])
    assumed = pairs.of_motor("max_winding_temperature") * 1.5
    exact = peak_temperatures(pairs, cycle, Conditions())
    winding, housing = temperature_bounds(pairs, cycle, Conditions(), assumed)
    holds = winding <= assumed
    assert holds.sum() > 20
    assert (exact[holds, 0] <= winding[holds] * (1.0 + 1e-9)).all()
    assert (exact[holds, 1] <= housing[holds] * (1.0 + 1e-9)).all()
    heat, model = heat_cycle(pairs, cycle), ThermalModel.of(pairs.motors, Conditions())
    mean = (heat.copper_loss @ heat.duration / heat.period) * (1.0 + 0.0039 * (assumed - 25.0))
    steady = 25.0 + (model.winding_resistance + model.housing_resistance) * mean
    assert (exact[:, 0] > steady + 1.0).any(), "the means alone bound nothing"
