"""Verdicts where figures are unknown, notes, sentences, and conditions."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from random_catalogue import random_cycles, random_gears, random_motors

from bellcrank.actuators.conditions import Conditions
from bellcrank.actuators.gear import Gear
from bellcrank.actuators.motor import Motor
from bellcrank.sizing.selection.criteria import CriterionResult, figure, lacks, worst
from bellcrank.sizing.selection.gear_criteria import average_torque
from bellcrank.sizing.selection.judge import CRITERIA, NOTES, VERDICTS, in_words, judge
from bellcrank.sizing.selection.load_reductions import ReducedLoads, reduce_loads
from bellcrank.sizing.selection.pairs import Pairs
from bellcrank.sizing.selection.shaft_loads import FEW

CONDITIONS = Conditions()


def load(seed: int = 2, axes: int = 1) -> ReducedLoads:
    return reduce_loads(*random_cycles(axes, seed, samples=100))[0]


def strong_motor(**more: object) -> Motor:
    return replace(max(random_motors(60, 1), key=lambda m: m.nominal_torque or 0.0), **more)  # type: ignore[arg-type]


def strong_gear(**more: object) -> Gear:
    gears = [gear for gear in random_gears(60, 1) if not gear.efficiency_curve and 8.0 < (gear.ratio or 0.0) < 40.0]
    return replace(max(gears, key=lambda g: g.rated_torque or 0.0), **more)  # type: ignore[arg-type]


def results(
    motor: Motor, gear: Gear, loads: ReducedLoads | None = None, conditions: Conditions = CONDITIONS
) -> dict[str, CriterionResult]:
    pairs = Pairs.possible([motor], [gear])
    pair = pairs.take(pairs.with_gear if gear.kind != "direct" else ~pairs.with_gear)
    return {one.name: one for one in in_words(pair, loads or load(), conditions)}


def test_a_complete_strong_pair_is_shown_by_every_criterion() -> None:
    found = results(strong_motor(), strong_gear())
    assert {one.verdict for one in found.values()} == {"inside", "note"}
    assert all(one.text and "nan" not in one.text for one in found.values()), found


def test_no_gear_has_no_criteria_of_gears() -> None:
    gear = Gear(id="none", maker="", model="", kind="direct", ratio=1.0)
    found = results(strong_motor(), gear)
    assert all(one.verdict == "note" for name, one in found.items() if name.startswith("gear "))


def test_unknown_efficiency_leaves_every_torque_of_the_motor_unknown() -> None:
    found = results(strong_motor(), strong_gear(efficiency=None, back_efficiency=None))
    for name in ("continuous torque", "peak torque", "peak current", "voltage limit", "winding temperature"):
        assert found[name].verdict == "unknown", name
        assert "the gear's efficiency" in found[name].text, found[name].text
    assert found["motor speed"].verdict == "inside"


@pytest.mark.parametrize(
    "unknown", [("gear", "efficiency"), ("gear", "inertia"), ("motor", "rotor_inertia")], ids=lambda one: one[1]
)
def test_far_too_weak_is_exceeded_whatever_the_figures_that_are_not_stated(unknown: tuple[str, str]) -> None:
    motor, gear, loads = strong_motor(), strong_gear(back_efficiency=None), load().with_safety_factor(300.0)
    lost = {unknown[1]: None}
    found = results(
        replace(motor, **lost) if unknown[0] == "motor" else motor,
        replace(gear, **lost) if unknown[0] == "gear" else gear,
        loads,
    )
    complete = results(motor, gear, loads)
    for name in ("continuous torque", "peak torque", "peak current", "voltage limit"):
        assert found[name].verdict == "exceeded", (name, found[name])
        assert 1.0 < found[name].use <= complete[name].use  # type: ignore[operator]
        assert "at least" in found[name].text


def test_with_a_curve_of_efficiency_and_no_rated_torque_the_bound_counts() -> None:
    gear = strong_gear(efficiency=None, back_efficiency=None, efficiency_curve=((0.1, 0.5), (1.0, 0.8)))
    gear = replace(gear, rated_torque=None)
    for factor, verdict in ((1.0, "unknown"), (300.0, "exceeded")):
        found = results(strong_motor(), gear, load().with_safety_factor(factor))["peak torque"]
        assert found.verdict == verdict, found


def test_many_motors_with_a_curve_of_efficiency_and_no_rated_torque_are_unknown() -> None:
    curve = ((0.1, 0.5), (1.0, 0.8))
    gear = strong_gear(efficiency=None, back_efficiency=None, rated_torque=None, efficiency_curve=curve)
    pairs = Pairs.possible(random_motors(300, 1), [gear])
    pairs = pairs.take(np.resize(np.flatnonzero(pairs.with_gear), FEW + 1))
    judgement = judge(pairs, load(), CONDITIONS)
    assert not (judgement.tier == 0).any() and (judgement.tier == 1).any()


def test_many_pairs_with_the_bound_are_judged_as_each_alone() -> None:
    loads = load().with_safety_factor(8.0)
    pairs = Pairs.possible(random_motors(60, 3, 0.2), random_gears(12, 3, 0.2))
    pairs = pairs.take(np.resize(np.arange(len(pairs)), FEW + 1))  # extreme points are used
    for criterion in CRITERIA:
        at_once = criterion.use(pairs, loads, CONDITIONS)
        for row in range(0, len(pairs), 7):
            alone = criterion.use(pairs.take(slice(row, row + 1)), loads, CONDITIONS)[0]
            assert at_once[row] == pytest.approx(alone, rel=1e-9, nan_ok=True), (criterion.name, row)


def test_of_cycles_with_unknown_use_the_one_of_the_largest_load_is_told() -> None:
    easy = load(2)
    hard = replace(load(2).with_safety_factor(2.0).cycles[0], name="hard")
    both = ReducedLoads(axis=easy.axis, cycles=(easy.cycles[0], hard, easy.cycles[0]))
    motor = strong_motor(peak_torque=None, peak_current=None, nominal_torque=None, nominal_speed=None)
    found = results(motor, strong_gear(), both)["peak torque"]
    assert found.verdict == "unknown" and "in 'hard'" in found.text and "the motor's peak torque" in found.text
    found = results(motor, strong_gear(efficiency=None, back_efficiency=None), both)["peak torque"]
    assert found.verdict == "unknown" and "in 'hard'" in found.text and "at least" in found.text


@pytest.mark.parametrize("criterion", CRITERIA, ids=lambda one: one.name)
def test_what_a_criterion_needs_is_enough_and_what_is_missing_is_named(criterion: object) -> None:
    motor, gear, loads = strong_motor(), strong_gear(), load()
    conditions = Conditions(voltage=motor.nominal_voltage, life=100.0, brake=True, momentary_loads={"joint0": 1.0})
    for needed in criterion.needs:  # type: ignore[attr-defined]
        for name in needed:
            side, field = name.split(".")
            row = motor if side == "motor" else gear
            assert hasattr(row, field), f"{name} is a field of a row"
    sufficient = [need for need in criterion.needs if not lacks(need, motor, gear)]  # type: ignore[attr-defined]
    if sufficient:  # keep only what it names
        kept = set(sufficient[0])
        bare_motor = Motor(id="m", maker="", model="", **_kept(motor, kept, "motor"))
        bare_gear = Gear(id="g", maker="", model="", kind="planetary", **_kept(gear, kept, "gear"))
        found = results(bare_motor, bare_gear, loads, conditions)[criterion.name]  # type: ignore[attr-defined]
        assert found.verdict == "inside", found
        for lost in kept - {"gear.ratio"}:
            bare_motor = Motor(id="m", maker="", model="", **_kept(motor, kept - {lost}, "motor"))
            bare_gear = Gear(id="g", maker="", model="", kind="planetary", **_kept(gear, kept - {lost}, "gear"))
            found = results(bare_motor, bare_gear, loads, conditions)[criterion.name]  # type: ignore[attr-defined]
            assert found.verdict != "exceeded", found


def _kept(row: object, names: set[str], side: str) -> dict[str, object]:
    fields = {name.split(".")[1] for name in names if name.startswith(f"{side}.")}
    fields |= {"back_efficiency"} & set() | ({"nominal_voltage"} if side == "motor" else set())
    return {field: getattr(row, field) for field in fields}


def test_an_average_torque_of_unknown_exponent_is_judged_by_its_bounds() -> None:
    loads = load()
    (cycle,) = loads.cycles
    mean, most = cycle.average_torque(1.0), cycle.max_torque
    for limit, verdict in ((1.01 * most, "inside"), (0.5 * (mean + most), "unknown"), (0.99 * mean, "exceeded")):
        gear = strong_gear(life_exponent=None, average_torque=limit, rated_torque=None)
        assert results(strong_motor(), gear, loads)["gear average torque"].verdict == verdict, limit


@pytest.mark.parametrize(("torque", "speed", "average"), [(0.0, 5.0, 0.0), (3.0, 0.0, 0.0), (3.0, 5.0, np.nan)])
def test_without_torque_or_turning_a_gear_has_no_average_torque_whatever_its_exponent(
    torque: float, speed: float, average: float
) -> None:
    pairs = Pairs.possible([strong_motor()], [strong_gear(life_exponent=None)])
    cycle = SimpleNamespace(max_torque=torque, mean_speed=speed)
    found = average_torque(pairs.take(pairs.with_gear), cycle)  # type: ignore[arg-type]
    np.testing.assert_array_equal(found, [average])


def test_bounds_of_an_unknown_limit_decide_on_their_side_only() -> None:
    loads = load()
    most = loads.cycles[0].max_torque
    gear = strong_gear(repeated_peak_torque=None, average_torque=None)
    for rated, momentary, verdict in ((1.1, 4.0, "inside"), (0.5, 4.0, "unknown"), (0.5, 0.9, "exceeded")):
        row = replace(gear, rated_torque=rated * most, momentary_torque=momentary * most)
        assert results(strong_motor(), row, loads)["gear repeated peak torque"].verdict == verdict


def test_momentary_torque_and_life_are_judged_where_the_conditions_ask() -> None:
    loads = load()
    gear = strong_gear(momentary_torque=200.0, life=7000.0)
    assert "no momentary load" in results(strong_motor(), gear, loads)["gear momentary torque"].text
    for torque, verdict in ((190.0, "inside"), (210.0, "exceeded")):
        conditions = Conditions(momentary_loads={"joint0": torque})
        found = results(strong_motor(), gear, loads, conditions)["gear momentary torque"]
        assert (found.verdict, found.use) == (verdict, pytest.approx(torque / 200.0))
    assert "no hours are required" in results(strong_motor(), gear, loads)["gear life"].text
    assert results(strong_motor(), gear, loads, Conditions(life=1e12))["gear life"].verdict == "exceeded"


def test_thermal_runaway_is_said_with_the_time_to_the_limit() -> None:
    found = results(strong_motor(resistance_housing_ambient=1e4), strong_gear())["winding temperature"]
    assert found.verdict == "exceeded" and found.use == np.inf
    assert "thermal runaway" in found.text and "s after a start at 25 °C" in found.text


def test_temperatures_without_time_constants_may_be_shown_by_their_bound() -> None:
    motor = strong_motor(time_constant_winding=None, time_constant_motor=None)
    found = results(motor, strong_gear())["winding temperature"]
    assert found.verdict == "inside" and "even if its largest losses lasted" in found.text
    hot = replace(motor, resistance_housing_ambient=1e4)
    assert results(hot, strong_gear())["winding temperature"].verdict == "unknown"


def test_the_worst_cycle_counts_and_is_named() -> None:
    easy, hard = load(2), load(3)
    both = ReducedLoads(axis=easy.axis, cycles=(replace(easy.cycles[0], name="a"), replace(hard.cycles[0], name="b")))
    motor, gear = strong_motor(), strong_gear()
    for name in ("peak torque", "continuous torque", "gear average torque"):
        apart = [results(motor, gear, one)[name].use for one in (easy, hard)]
        found = results(motor, gear, both)[name]
        assert found.use == max(apart)  # type: ignore[type-var]
        assert ("'a'" if apart[0] > apart[1] else "'b'") in found.text  # type: ignore[operator]


def test_a_safety_factor_multiplies_the_torques_of_the_load() -> None:
    motor, gear = strong_motor(), strong_gear()
    plain, safe = results(motor, gear), results(motor, gear, conditions=Conditions(safety_factor=1.5))
    assert safe["gear repeated peak torque"].use == pytest.approx(1.5 * plain["gear repeated peak torque"].use)
    assert safe["motor speed"].use == plain["motor speed"].use


def test_of_several_utilisations_a_failure_is_worst_then_the_unknown() -> None:
    uses = np.array([[0.5, np.nan, np.nan, 2.0], [0.7, 0.4, 1.5, 3.0]])
    np.testing.assert_array_equal(worst(uses), [0.7, np.nan, 1.5, 3.0])


def test_a_verdict_changes_at_the_tolerance_and_nowhere_else() -> None:
    gear, most = strong_gear(momentary_torque=1.0, repeated_peak_torque=None), 1.0 + 2e-5  # uses equal the loads
    pairs = Pairs.possible([strong_motor()], [gear])
    for use, verdict in (
        (1.0, "inside"),
        (np.nextafter(1.0, 2.0), "inside"),
        (np.nextafter(most, 0.0), "inside"),
        (most, "inside"),
        (np.nextafter(most, 2.0), "exceeded"),
    ):
        asked = Conditions(momentary_loads={"joint0": float(use)})
        one = results(strong_motor(), gear, conditions=asked)["gear momentary torque"]
        assert (one.use, one.verdict) == (use, verdict)
        many = judge(pairs, load(), asked)
        row = [each.name for each in many.criteria].index("gear momentary torque")
        assert [VERDICTS[each] for each in many.verdict[row]] == ["note", verdict]  # without the gear, and with it


def test_names_formulas_and_sources_are_there() -> None:
    named = [*CRITERIA, *NOTES]
    assert len({one.name for one in named}) == len(named)
    assert all(one.formula and one.source and one.needs for one in named)


def test_what_rounding_leaves_of_a_load_is_written_as_0() -> None:
    assert [figure(value) for value in (7.1e-17, -2e-15, 3.25e-6, 12.3456)] == ["0", "0", "3.25e-06", "12.35"]
