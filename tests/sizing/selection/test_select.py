"""`bellcrank.select`: unknown masses, given pairs, filters, advice, criteria of all axes, copies."""

from __future__ import annotations

import copy
import pickle
import re
from dataclasses import replace

import pytest
from sized_catalogue import sized_catalogue

import bellcrank as bc
from bellcrank.actuators.catalogue.catalogue import Catalogue
from bellcrank.actuators.conditions import Conditions
from bellcrank.errors import InputError
from bellcrank.sizing.selection.tables import percent

pytestmark = pytest.mark.tier2

CONDITIONS = Conditions(voltage=48.0)
OF_MOTION = {"motor speed", "gear average input speed", "gear largest input speed", "motor type", "nominal voltage"}


@pytest.fixture(scope="module")
def arm():
    return bc.load_robot("planar_2r")


@pytest.fixture(scope="module")
def motion(arm):
    return bc.waypoints(arm, [0.0, 1.5, 3.0], [{}, {"shoulder": 1.0, "elbow": -0.8}, {}], name="reach")


@pytest.fixture(scope="module")
def catalogue():
    return sized_catalogue(3, 6, 4, largest=100.0)


@pytest.fixture(scope="module")
def selection(arm, motion, catalogue):
    return bc.select(arm, motion, catalogue, conditions=CONDITIONS, candidates=6)


def without(catalogue, field):
    return Catalogue(
        tuple(replace(motor, **{field: None}) for motor in catalogue.motors),
        tuple(replace(gear, **{field: None}) for gear in catalogue.gears),
    )


def one_unweighed(catalogue, name):
    return Catalogue(
        tuple(replace(motor, mass=None if motor.id == name else motor.mass) for motor in catalogue.motors),
        catalogue.gears,
    )


def test_a_mass_that_is_not_stated_leaves_the_axes_that_it_loads_unknown(arm, motion, catalogue, selection):
    found = bc.select(arm, motion, without(catalogue, "mass"), conditions=CONDITIONS)
    shoulder, elbow = found.axes
    assert elbow.unknown_masses == () and elbow.chosen.tier == "all criteria shown"  # the shoulder's mass loads nothing
    assert shoulder.unknown_masses == ("elbow",) and shoulder.chosen.tier == "passes what is known"
    assert dict(shoulder.counts)["all criteria shown"] == 0
    inside = [result for result in shoulder.chosen.criteria if result.verdict == "inside"]
    assert {result.name for result in inside} <= OF_MOTION and inside
    unknown = [result for result in shoulder.chosen.criteria if result.verdict == "unknown"]
    assert all(result.use is None and 0.0 <= result.estimate <= 1.0 for result in unknown) and len(unknown) > 4
    assert all("without the mass of the actuator at 'elbow', which is not stated" in result.text for result in unknown)
    assert shoulder.chosen.loss is None and found.loss is None and found.mass is None
    assert any("the masses of the actuators at 'elbow' are not stated" in text for text in found.warnings)
    assert found.inside and not found.shown


def test_without_feedback_an_unknown_mass_changes_nothing(arm, motion, catalogue):
    unknown, known = (
        bc.select(arm, motion, one, "margin", conditions=CONDITIONS, feedback=False)
        for one in (without(catalogue, "mass"), catalogue)
    )
    assert [one.chosen.id for one in unknown.axes] == [one.chosen.id for one in known.axes]
    assert all(one.unknown_masses == () and one.chosen.tier == "all criteria shown" for one in unknown.axes)


def test_an_unknown_mass_never_wins_the_least_mass(arm, motion, catalogue, selection):
    best = selection.axis("elbow").chosen.motor.id
    found = bc.select(arm, motion, one_unweighed(catalogue, best), conditions=CONDITIONS)
    assert found.axis("elbow").chosen.motor.id != best
    assert found.mass > selection.mass


def test_an_assumed_mass_makes_the_loads_known_and_is_told(arm, motion, catalogue):
    conditions = replace(CONDITIONS, assume={"motor.mass": 2.0, "gear.mass": 1.0})
    found = bc.select(arm, motion, without(catalogue, "mass"), conditions=conditions)
    assert all(one.unknown_masses == () for one in found.axes)
    assert "motor.mass = 2 is assumed for 6 of 6 motors, which do not state it" in found.warnings


def test_a_body_without_a_size_is_told_to_be_a_point_mass(arm, motion, catalogue, selection):
    found = bc.select(arm, motion, without(catalogue, "length"), conditions=CONDITIONS)
    assert any("point mass" in text and "'elbow'" in text for text in found.warnings)
    assert not any("point mass" in text for text in selection.warnings)


def test_candidates_are_ranked_and_counted(selection):
    for one in selection.axes:
        order = [(candidate.tier != "all criteria shown", candidate.mass) for candidate in one.candidates]
        assert one.candidates[0] == one.chosen
        assert order[1:] == sorted(order[1:], key=lambda key: key[0]) or order == sorted(order)
        assert sum(count for _, count in one.counts) == 6 * 5
        passing = [candidate.mass for candidate in one.candidates if candidate.tier != "fails"]
        assert passing == sorted(passing)
        for candidate in one.candidates:
            uses = [result.use for result in candidate.criteria if result.use is not None]
            assert candidate.largest_use == pytest.approx(max(uses), rel=1e-12)
            assert candidate.binding in {r.name for r in candidate.criteria if r.use == max(uses)}
            assert (candidate.tier == "fails") == (max(uses) > 1.0)


def test_the_passes_end_with_what_is_chosen_where_the_search_finds_nothing_better(selection):
    assert selection.iterations[-1] == tuple(one.chosen.id for one in selection.axes)
    assert selection.proof == "optimal: every combination was excluded or tried"


def test_a_given_pair_is_kept(arm, motion, catalogue, selection):
    heavy = "motor_0000+gear_0000"
    found = bc.select(arm, motion, catalogue, conditions=CONDITIONS, keep={"elbow": heavy})
    assert found.axis("elbow").chosen.id == heavy and found.axis("elbow").kept
    motor = selection.axis("shoulder").chosen.motor.id
    found = bc.select(arm, motion, catalogue, conditions=CONDITIONS, keep={"shoulder": motor})
    assert found.axis("shoulder").chosen.motor.id == motor


def test_a_given_pair_that_fails_is_kept_and_told(arm, motion, catalogue):
    weak = min(catalogue.motors, key=lambda motor: motor.nominal_torque).id
    found = bc.select(arm, motion, catalogue, conditions=CONDITIONS, keep={"shoulder": weak})
    one = found.axis("shoulder")
    assert one.chosen.motor.id == weak and one.chosen.tier == "fails" and not found.inside
    assert one.advice.startswith("the given pair")


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"objective": "weight"}, "argument 'objective': unknown choice 'weight'"),
        ({"objective": "cost", "prices": False}, "no motor and gear that go together both state a price"),
        ({"keep": {"hip": "motor_0000"}}, "argument 'keep': unknown axis 'hip'"),
        ({"keep": {"elbow": "motor_9"}}, "argument 'keep': axis 'elbow': unknown motor 'motor_9'; did you mean"),
        ({"keep": {"elbow": "motor_0001+gear_7"}}, "argument 'keep': axis 'elbow': unknown gear 'gear_7'"),
        ({"exclude": ["motor_77"]}, "unknown product 'motor_77'"),
        ({"makers": ["mexon"]}, "unknown maker 'mexon'"),
        ({"effort": -1}, "argument 'effort': expected a whole number of at least 0"),
        ({"conditions": 48.0}, "argument 'conditions': expected Conditions"),
        ({"candidates": 0}, "argument 'candidates'"),
    ],
)
def test_bad_arguments_are_refused(arm, motion, catalogue, arguments, text):
    given = dict(arguments)
    products = catalogue if given.pop("prices", True) else without(catalogue, "price")
    with pytest.raises(InputError) as error:
        bc.select(arm, motion, products, **given)
    assert text in str(error.value)


def test_prices_in_two_currencies_are_refused(arm, motion, catalogue):
    mixed = Catalogue((replace(catalogue.motors[0], currency="USD"), *catalogue.motors[1:]), catalogue.gears)
    with pytest.raises(InputError, match=r"several currencies \(EUR, USD\)"):
        bc.select(arm, motion, mixed, "cost", conditions=CONDITIONS)


def test_a_catalogue_without_motors_is_refused(arm, motion, catalogue):
    with pytest.raises(InputError, match="no motor is left to choose from"):
        bc.select(arm, motion, Catalogue((), catalogue.gears))


def strongest(catalogue):
    """The ids of the strongest motor and gear."""
    motor = max(catalogue.motors, key=lambda one: one.nominal_torque)
    return f"{motor.id}+{max(catalogue.gears, key=lambda one: one.rated_torque).id}"


def reach(arm, factor, name):
    return bc.waypoints(arm, [0.0, 0.5 * factor, factor], [{}, {"shoulder": 1.0, "elbow": -0.8}, {}], name=name)


def test_where_nothing_fits_the_advice_names_what_would_help(arm, catalogue):
    keep = {"elbow": strongest(catalogue)}
    found = bc.select(arm, reach(arm, 0.7, "fast"), catalogue, conditions=CONDITIONS, keep=keep)
    one = found.axis("shoulder")
    assert one.chosen is None and not found.inside and found.mass is None
    assert one.advice.startswith(f"nearest to the limits is {one.candidates[0].id}: ")
    worst = max(one.candidates[0].criteria, key=lambda result: result.use or 0.0)
    assert f"{worst.name} {percent(worst.use)}" in one.advice
    factor = float(re.search(r"motions that last about ([\d.]+) times", one.advice)[1])
    for duration, fits in ((1.01 * factor, True), (0.9 * factor, False)):
        slower = reach(arm, 0.7 * duration, "slower")
        then = bc.select(arm, slower, catalogue, conditions=CONDITIONS, keep=keep)
        assert (then.axis("shoulder").chosen is not None) == fits  # the advice holds, and asks for no more


def test_a_ratio_that_the_advice_names_passes(arm, motion, catalogue):
    gear = replace(max(catalogue.gears, key=lambda one: one.rated_torque), id="low", ratio=4.0)
    found = bc.select(arm, motion, Catalogue(catalogue.motors, (gear,)), conditions=CONDITIONS, feedback=False)
    one = found.axis("shoulder")
    assert one.chosen is None
    numbers = re.search(r"a ratio of ([\d.]+) to ([\d.]+) in place of 4 \(of (\w+)\+low\)", one.advice).groups()
    lowest, highest = map(float, numbers[:2])
    assert 4.0 < lowest < highest
    named = catalogue.motor(numbers[2])
    for ratio, fits in ((1.03 * lowest, True), (0.97 * highest, True), (0.9 * lowest, False)):
        other = Catalogue((named,), (replace(gear, ratio=ratio),))
        then = bc.select(arm, motion, other, conditions=CONDITIONS, feedback=False)
        assert (then.axis("shoulder").chosen is not None) == fits


def test_supply_power_is_judged_for_all_axes_together(arm, motion, catalogue, selection):
    supply = selection.system[0]
    assert supply.name == "supply power" and supply.verdict == "note"
    needed = float(supply.text.split("up to ")[1].split()[0])
    enough = bc.select(arm, motion, catalogue, conditions=replace(CONDITIONS, supply_power=1.1 * needed))
    assert enough.system[0].verdict == "inside" and enough.system[0].use == pytest.approx(1.0 / 1.1, rel=1e-3)
    none = bc.select(arm, motion, catalogue, conditions=replace(CONDITIONS, supply_power=1.0), effort=20_000)
    assert none.system[0].verdict == "exceeded" and not none.inside
    assert any("supply power of all axes together is exceeded" in text for text in none.warnings)


def test_the_next_best_combination_keeps_the_supply_where_the_best_does_not(arm, motion, catalogue, selection):
    needed = float(selection.system[0].text.split("up to ")[1].split()[0])
    conditions = replace(CONDITIONS, supply_power=0.97 * needed)
    found = bc.select(arm, motion, catalogue, conditions=conditions, effort=10**6)
    assert found.system[0].verdict == "inside"
    assert found.mass > selection.mass and found.inside
    assert any("the chosen ones are the best that keep it" in text for text in found.warnings)


def test_a_selection_is_the_same_each_time_and_after_copies(arm, motion, catalogue, selection):
    again = bc.select(
        arm, motion, Catalogue(catalogue.motors[::-1], catalogue.gears[::-1]), conditions=CONDITIONS, candidates=6
    )
    for other in (again, pickle.loads(pickle.dumps(selection)), copy.deepcopy(selection)):
        assert other.pareto == selection.pareto and other.iterations == selection.iterations
        assert [one.candidates for one in other.axes] == [one.candidates for one in selection.axes]
        assert str(other) == str(selection)
