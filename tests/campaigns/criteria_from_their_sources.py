"""Verdicts of every criterion of the judge against formulas written again from their sources, at the limits too.

Each case is a random motor and gear on an axis of a random cycle, with conditions of its own. `brute_criteria` writes
each criterion again, sample by sample, and asks nothing of the judge. Besides the case as it is drawn, one limit of it
is set to where its criterion is exactly met, and to just within and just beyond the tolerance of a verdict.

PYTHONPATH=tests/support python -m tests.campaigns.criteria_from_their_sources --cases 2000 --seed 1
"""

import argparse
import math
from collections import Counter
from dataclasses import replace

import numpy as np
from brute_criteria import Brute
from random_catalogue import random_cycles, random_gears, random_motors
from scipy.optimize import brentq

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import DIRECT
from bellcrank.sizing.selection.judge import EXCEEDED, INSIDE, NOTE, in_words, judge
from bellcrank.sizing.selection.load_reductions import reduce_loads
from bellcrank.sizing.selection.pairs import Pairs

TOLERANCE = 2e-5  # of a limit: the documented one of a verdict
EQUAL = 1e-9
SAMPLED = 3e-3  # temperatures are the largest of 20 moments an interval
# The limit of a criterion, as a field of the motor, the gear or the conditions to which the load is related.
LIMITS = {
    "motor speed": ("motor", "max_speed"),
    "peak torque": ("motor", "peak_torque"),
    "peak current": ("motor", "peak_current"),
    "peak duration": ("motor", "peak_time"),
    "holding brake": ("motor", "brake_torque"),
    "gear average torque": ("gear", "average_torque"),
    "gear repeated peak torque": ("gear", "repeated_peak_torque"),
    "gear momentary torque": ("gear", "momentary_torque"),
    "gear average input speed": ("gear", "average_speed"),
    "gear largest input speed": ("gear", "max_speed"),
    "tilting moment": ("gear", "tilting_moment"),
    "axial load": ("gear", "axial_load"),
    "inertia ratio": ("conditions", "inertia_ratio"),
}
BY_FACTOR = ("continuous torque", "voltage limit", "peak curve", "winding temperature", "housing temperature")
OTHERS = ("gear life", "nominal voltage")
CRITERIA = (*LIMITS, *BY_FACTOR, *OTHERS)
TARGETS = {"drawn": None, "at the limit": 1.0, "within": 1.0 + TOLERANCE - 1e-8, "beyond": 1.0 + TOLERANCE + 1e-8}
ASSUMED = {"within": 1.0 - 2 * SAMPLED, "beyond": 1.0 + 2 * SAMPLED}  # of temperatures


def random_case(seed):
    """A motor, a gear, a cycle with its axis, and conditions."""
    rng = np.random.default_rng(seed)
    motor = random_motors(1, seed)[0]
    gear = random_gears(1, seed)[0] if rng.random() < 0.85 else DIRECT
    if rng.random() < 0.8:
        motor = replace(motor, commutation=str(rng.choice(["brushed", "brushless"])))
    axes, cycles = random_cycles(1, seed, samples=120, parts=int(rng.integers(2, 4)), scale=float(gear.ratio) *
                                 float(motor.nominal_torque) * float(rng.uniform(0.2, 2.5)))  # fmt: skip
    conditions = Conditions(
        voltage=float(motor.nominal_voltage) * float(rng.uniform(0.45, 2.2)) if rng.random() < 0.7 else None,
        voltage_ratio=float(rng.uniform(1.2, 3.0)), voltage_reserve=float(rng.uniform(0.0, 0.3)),
        winding_temperature=float(rng.uniform(20.0, 120.0)), ambient=float(rng.uniform(15.0, 45.0)),
        altitude=float(rng.choice([0.0, rng.uniform(0.0, 3000.0)])), safety_factor=float(rng.uniform(1.0, 2.0)),
        inertia_ratio=float(rng.uniform(1.0, 30.0)), life=float(rng.uniform(1e3, 4e4)), brake=True,
        commutation=None if rng.random() < 0.5 else str(rng.choice(["brushed", "brushless"])),
        momentary_loads={axes[0].name: float(rng.uniform(0.2, 5.0)) * float(gear.rated_torque or 1.0)},
    )  # fmt: skip
    return motor, gear, axes, cycles, conditions


def uses(motor, gear, cycle, conditions, temperatures=True):
    """Use by criterion, from the sources."""
    found = Brute(motor, gear, cycle, 0, conditions).uses(temperatures)
    load = dict(conditions.momentary_loads)["joint0"] * conditions.safety_factor
    found["gear momentary torque"] = load / (gear.momentary_torque or math.nan)
    wanted = conditions.commutation
    unknown = motor.commutation is None
    found["motor type"] = math.nan if unknown else 0.0 if motor.commutation == wanted else math.inf
    return found


class WithoutUnknownTorque(Brute):
    """As `Brute`, with a continuous torque of 0 where it is unknown: no longer time above it is possible."""

    def s1(self, speed):
        return np.nan_to_num(super().s1(speed))


def moved(case, name, target):
    """The case with one limit moved so that the use of a criterion is the target; None where it cannot be."""
    motor, gear, axes, cycles, conditions = case
    rows = {"motor": motor, "gear": gear, "conditions": conditions}
    if name in LIMITS:
        side, field = LIMITS[name]
        use = uses(motor, gear, cycles[0], conditions, temperatures=False)[name]
        if not 0.0 < use < math.inf or (side == "gear" and gear.kind == "direct"):
            return None
        rows[side] = replace(rows[side], **{field: getattr(rows[side], field) * use / target})
    elif name == "gear life":
        use = uses(motor, gear, cycles[0], conditions, temperatures=False)[name]
        if not 0.0 < use < math.inf:
            return None
        rows["conditions"] = replace(conditions, life=conditions.life * target / use)
    elif name == "nominal voltage":
        if conditions.voltage is None:
            return None
        ratio = abs(math.log(conditions.voltage / motor.nominal_voltage))
        rows["conditions"] = replace(conditions, voltage_ratio=math.exp(ratio / target))
    else:

        def over(factor):
            found = uses(motor, gear, cycles[0], replace(conditions, safety_factor=factor), "temp" in name)
            use = found.get(name, math.inf)
            return min(use, 10.0) - target if not math.isnan(use) else math.nan

        ends = over(1.0), over(30.0)
        if not ends[0] < 0.0 < ends[1]:
            return None
        rows["conditions"] = replace(conditions, safety_factor=brentq(over, 1.0, 30.0, xtol=1e-14, rtol=1e-14))
    return rows["motor"], rows["gear"], axes, cycles, rows["conditions"]


def differences(case):
    """What the judge says otherwise than the sources, and how many verdicts were compared."""
    motor, gear, axes, cycles, conditions = case
    pairs = Pairs.possible([motor], [] if gear.kind == "direct" else [gear])
    pairs = pairs.take(slice(len(pairs) - 1, len(pairs)))  # the gear, where there is one
    (loads,) = reduce_loads(axes, cycles)
    found = judge(pairs, loads, conditions)
    results = {result.name: result for result in in_words(pairs, loads, conditions)}
    expected = uses(motor, gear, cycles[0], conditions)
    wrong, compared = [], 0
    for row, criterion in enumerate(found.criteria):
        name, verdict = criterion.name, results[criterion.name].verdict
        assert name in expected or "temperature" in name, name
        use = expected.get(name, math.inf)
        if verdict == "note":
            continue
        compared += 1
        if math.isnan(use) and name == "peak duration" and verdict == "inside":  # shown by a bound
            use = WithoutUnknownTorque(motor, gear, cycles[0], 0, conditions).longest_above() / motor.peak_time
        right = "unknown" if math.isnan(use) else "exceeded" if use > 1.0 + TOLERANCE else "inside"
        near = SAMPLED if "temperature" in name else EQUAL
        if verdict != right and not abs(use - 1.0 - TOLERANCE) <= near:
            wrong.append(f"{name}: {verdict}, use {results[name].use}, where the sources give {use}")
        if math.isfinite(use) and results[name].use is not None and abs(results[name].use - use) > near * max(1.0, use):
            wrong.append(f"{name}: use {results[name].use} where the sources give {use}")
        quick = found.verdict[row, 0]  # of the judge of many, which leaves out what does not matter
        if quick in (INSIDE, EXCEEDED) and (quick == EXCEEDED) != (verdict == "exceeded"):
            wrong.append(f"{name}: of many {quick}, of one {verdict}")
        if quick == NOTE:
            wrong.append(f"{name}: a note of many, {verdict} of one")
    return wrong, compared


def boundary_cases(seed):
    """Cases by what was moved where: one as drawn, and one criterion's limit at each target."""
    case = random_case(seed)
    name = CRITERIA[seed % len(CRITERIA)]
    targets = list(TARGETS)
    target = targets[(seed // len(CRITERIA)) % len(targets)]
    use = ASSUMED.get(target, 1.0) if "temperature" in name else TARGETS[target]
    if TARGETS[target] is None or ("temperature" in name and target == "at the limit"):
        return "drawn", "", case
    found = moved(case, name, use)
    return ("drawn", "", case) if found is None else (target, name, found)


def main():
    """Run the campaign and print what it found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    kinds, moved_limits, compared, differ = Counter(), Counter(), 0, 0
    for number in range(given.cases):
        kind, name, case = boundary_cases(given.seed * 100_000 + number)
        wrong, count = differences(case)
        kinds[kind] += 1
        moved_limits[name] += bool(name)
        compared += count
        differ += bool(wrong)
        for each in wrong:
            print(number, kind, name, each, flush=True)
    print(f"{given.cases} cases, {dict(kinds)}, {compared} verdicts: {differ} cases differ; limits moved: "
          f"{dict(moved_limits)}")  # fmt: skip


if __name__ == "__main__":
    main()
