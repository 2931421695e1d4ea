"""The search over all axes equals the exhaustive search: on random pairs whose loads depend on the others' masses."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
import pytest

from bellcrank.sizing.selection.joint_problem import components, judge_choice, search_order
from bellcrank.sizing.selection.joint_search import best_combination, fixed_point
from bellcrank.sizing.selection.pairs import NOT_JUDGED, NOTHING, PairVerdicts, as_key, rank_keys, total

CHAIN = np.triu(np.ones((3, 3), dtype=bool), 1)  # axis 0 is the base
TWO_ARMS = np.array([[0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, 0, 0]], dtype=bool)
RING = np.array([[0, 1, 1], [1, 0, 1], [0, 0, 0]], dtype=bool)
ITSELF = np.array([[1, 1], [0, 0]], dtype=bool)


@dataclass
class Pairs:
    """Pairs with a mass, a price and a strength; the use of an axis is its load over the strength."""

    influence: np.ndarray
    masses: list[np.ndarray]
    prices: list[np.ndarray]
    strength: list[np.ndarray]
    objective: str
    gain: np.ndarray
    kept: tuple[bool, ...] = ()
    effort: int = 0
    classes: list[np.ndarray] = field(init=False)

    def __post_init__(self):
        self.kept = self.kept or (False,) * len(self.masses)
        found = [np.unique(mass, return_inverse=True) for mass in self.masses]
        self.values = [values for values, _ in found]
        self.classes = [inverse for _, inverse in found]

    @property
    def largest(self):
        return self.objective == "margin"

    @property
    def bounds(self):
        return [self._keys(axis, np.zeros(len(mass))) for axis, mass in enumerate(self.masses)]

    def _keys(self, axis, use):
        value = {"mass": self.masses[axis], "cost": self.prices[axis], "margin": use}[self.objective]
        fails = np.where(use > 1.0, 2, 0).astype(np.int8)
        return rank_keys(PairVerdicts(tier=fails, main_unknown=np.zeros_like(fails), objective=value, use=use))

    def keys(self, axis, masses, rows=None):
        self.effort += 1
        load = 1.0
        for j, one in enumerate(masses):
            if self.influence[axis, j] and one >= 0:
                load += self.gain[axis, j] * self.values[j][one]
        found = self._keys(axis, np.abs(load) / self.strength[axis])
        if rows is not None:
            found[~rows] = NOT_JUDGED
        return found


def random_pairs(rng, influence, count, objective, counterweights=False):
    k = len(influence)
    masses = [rng.choice([0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0], count) for _ in range(k)]
    strength = [0.6 + rng.uniform(0.3, 2.0, count) * mass for mass in masses]
    prices = [np.round(rng.uniform(1.0, 5.0, count), 1) for _ in range(k)]
    gain = rng.uniform(-0.4 if counterweights else 0.1, 0.5, (k, k))
    return Pairs(influence, masses, prices, strength, objective, gain)


def exhaustive(pairs):
    """The smallest total of all combinations that satisfy their own loads, and how many of them there are."""
    found = []
    for choice in itertools.product(*(range(len(mass)) for mass in pairs.masses)):
        keys = judge_choice(pairs, choice)
        if not any(key[0] for key in keys):
            found.append((total(keys, pairs.largest), choice))
    return min(found, default=None), len(found)


@pytest.mark.tier2
@pytest.mark.parametrize("influence", [CHAIN, TWO_ARMS, RING, ITSELF], ids=["chain", "two arms", "ring", "itself"])
@pytest.mark.parametrize("objective", ["mass", "cost", "margin"])
def test_the_search_equals_the_exhaustive_search(influence, objective):
    solved = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        pairs = random_pairs(rng, influence, 7 if len(influence) < 4 else 4, objective, counterweights=seed % 2 == 1)
        best, _ = exhaustive(pairs)
        found = best_combination(pairs, 10**6)
        if best is None:
            assert found is None or any(key[0] for key in judge_choice(pairs, found.choice))
            continue
        solved += 1
        assert found.open == 0
        assert total(judge_choice(pairs, found.choice), pairs.largest) == best[0]
    assert solved >= 6


@pytest.mark.tier2
def test_equal_combinations_are_decided_by_the_ranks_of_the_axes_from_the_tip_to_the_base():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        pairs = random_pairs(rng, CHAIN, 6, "cost")
        pairs.prices = [np.round(price) for price in pairs.prices]  # many ties
        found = best_combination(pairs, 10**6)

        def key(choice, pairs=pairs):
            keys = judge_choice(pairs, choice)
            return total(keys, False), [(keys[axis], choice[axis]) for axis in (2, 1, 0)]

        every = itertools.product(*(range(6) for _ in range(3)))
        passing = [choice for choice in every if not any(one[0] for one in judge_choice(pairs, choice))]
        if passing:
            assert found.choice == min(passing, key=key)


def test_the_search_finds_what_feedback_misses():
    """The cheapest tip is heavy and needs a dear base."""
    pairs = Pairs(
        np.array([[0, 1], [0, 0]], dtype=bool),
        masses=[np.array([1.0, 2.0]), np.array([1.0, 5.0])],
        prices=[np.array([10.0, 100.0]), np.array([20.0, 15.0])],
        strength=[np.array([3.0, 9.0]), np.array([2.0, 2.0])],
        objective="cost",
        gain=np.ones((2, 2)),
    )
    greedy = fixed_point(pairs)
    assert greedy.choice == (1, 1) and greedy.satisfied and not greedy.cycle
    assert greedy.passes == ((1, 1),)
    assert best_combination(pairs, 100).choice == (0, 0)


def test_passes_that_repeat_without_end_are_a_cycle_and_its_best_combination_is_taken():
    """Two axes load each other: a light one suffices only where the other is light."""
    pairs = Pairs(
        np.array([[0, 1], [1, 0]], dtype=bool),
        masses=[np.array([1.0, 4.0]), np.array([1.0, 4.0])],
        prices=[np.array([1.0, 2.0]), np.array([1.0, 2.0])],
        strength=[np.array([3.0, 9.0]), np.array([3.0, 9.0])],
        objective="mass",
        gain=np.array([[0.0, 1.0], [-0.25, 0.0]]),
    )
    pairs.strength = [np.array([2.5, 9.0]), np.array([0.5, 9.0])]  # 0 wants heavy where 1 is heavy; 1 light where 0 is
    found = fixed_point(pairs)
    assert len(found.cycle) > 1
    assert found.choice in found.cycle
    best, _ = exhaustive(pairs)
    assert best is None or total(judge_choice(pairs, best_combination(pairs, 100).choice), False) == best[0]


def test_the_fixed_point_of_a_chain_is_its_own_choice_under_its_own_masses():
    for seed in range(10):
        pairs = random_pairs(np.random.default_rng(seed), CHAIN, 9, "mass")
        found = fixed_point(pairs)
        assert not found.cycle
        for axis, pair in enumerate(found.choice):
            keys = pairs.keys(axis, tuple(-1 if p is None else pairs.classes[j][p] for j, p in enumerate(found.choice)))
            passing = [as_key(row) for row in keys if row[0] == 0]
            assert (NOTHING if pair is None else as_key(keys[pair])) == min(passing, default=NOTHING)


def test_a_search_with_few_judgements_says_how_many_combinations_are_open():
    pairs = random_pairs(np.random.default_rng(3), CHAIN, 40, "cost")
    complete = best_combination(pairs, 10**6)
    pairs.effort = 0
    short = best_combination(pairs, 5)
    assert complete.open == 0
    assert 0 < short.open < 40**3
    assert total(judge_choice(pairs, short.choice), False) >= total(judge_choice(pairs, complete.choice), False)


def test_open_combinations_are_those_that_may_be_better_of_pairs_that_hold_without_the_others():
    """Each pair is dearer than the one before; the cheapest tip is heavy, so that it needs the dearest base."""

    class Loaded(Pairs):
        @property
        def bounds(self):
            return [self._keys(axis, 1.0 / strength) for axis, strength in enumerate(self.strength)]

    pairs = Loaded(
        np.array([[0, 1], [0, 0]], dtype=bool),
        masses=[np.array([1.0, 2.0, 3.0]), np.array([5.0, 1.0, 2.0, 3.0])],
        prices=[np.array([1.0, 5.0, 100.0]), np.array([1.0, 2.0, 3.0, 200.0])],
        strength=[np.array([0.5, 4.0, 9.0]), np.full(4, 2.0)],
        objective="cost",
        gain=np.ones((2, 2)),
    )
    found = best_combination(pairs, 1)
    assert found.choice == (2, 0)  # 101; less may be with tip 1 or 2, and base 1 or 2
    assert found.open == 2 * 2


def test_a_combination_that_is_not_accepted_is_passed_over():
    pairs = random_pairs(np.random.default_rng(5), CHAIN, 6, "mass")
    best = best_combination(pairs, 10**6).choice
    other = best_combination(pairs, 10**6, accept=lambda choice: choice != best)
    every = itertools.product(*(range(6) for _ in range(3)))
    passing = [c for c in every if c != best and not any(key[0] for key in judge_choice(pairs, c))]
    least = min(total(judge_choice(pairs, choice), False) for choice in passing)
    assert total(judge_choice(pairs, other.choice), False) == least


def test_a_given_pair_is_chosen_even_where_it_fails():
    pairs = random_pairs(np.random.default_rng(5), CHAIN, 6, "mass")
    pairs.masses[1], pairs.strength[1], pairs.prices[1] = np.array([2.0]), np.array([0.01]), np.array([1.0])
    pairs.__post_init__()
    assert best_combination(pairs, 100).choice[1] is None
    pairs.kept = (False, True, False)
    assert best_combination(pairs, 100).choice[1] == 0


def test_axes_are_ordered_from_the_tip_to_the_base():
    assert search_order(CHAIN) == [[2], [1], [0]]
    assert search_order(RING) == [[2], [0, 1]]
    assert components(TWO_ARMS) == [[0, 1], [2, 3]]
