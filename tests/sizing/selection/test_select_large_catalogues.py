"""What keeps large catalogues fast: bounds of ranks from tiny loads, and tiers that are counted when asked for."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from random_catalogue import random_cycles, random_gears, random_motors

from bellcrank.actuators.catalogue.catalogue import Catalogue
from bellcrank.actuators.conditions import Conditions
from bellcrank.sizing.selection.axis_loads import AxisLoads
from bellcrank.sizing.selection.axis_pairs import axis_pairs
from bellcrank.sizing.selection.candidates import axis_selection
from bellcrank.sizing.selection.joint_problem import NO_MASS
from bellcrank.sizing.selection.judge import TIERS, judge
from bellcrank.sizing.selection.judged_axes import JudgedAxes

AXES = 2
NONE = (NO_MASS,) * AXES
CONDITIONS = Conditions(safety_factor=1.2)


def problem(seed: int, missing: float, objective: str = "mass") -> JudgedAxes:
    catalogue = Catalogue(tuple(random_motors(60, seed, missing)), tuple(random_gears(15, seed, missing)))
    axes, cycles = random_cycles(AXES, seed)
    loads = AxisLoads(axes=axes, cycles=cycles, influence=np.zeros((AXES, AXES), dtype=bool), terms=())
    return JudgedAxes(loads, axis_pairs(axes, [catalogue] * AXES, {}), [CONDITIONS] * AXES, CONDITIONS, objective)


@pytest.mark.parametrize("objective", ["mass", "margin"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_bounds_at_tiny_loads_are_not_above_the_ranks(seed, objective):
    pairs = problem(seed, 0.15, objective)
    for axis in range(AXES):
        bounds, keys = pairs.bounds[axis].tolist(), pairs.keys(axis, NONE).tolist()
        passing = [(bound, key) for bound, key in zip(bounds, keys, strict=True) if key[0] == 0]
        assert passing and all(bound <= key for bound, key in passing)
        assert any(bound[:3] != [0, 0, 0] for bound, _ in passing)  # what is never known is in the bound
        assert all(key[0] == 1 for bound, key in zip(bounds, keys, strict=True) if bound[0] == 1)


def test_counts_are_those_of_all_pairs_and_of_copies():
    pairs = problem(4, 0.1)
    for axis in range(AXES):
        one = axis_selection(pairs, pairs, axis, None, NONE, 3)
        copied = pickle.loads(pickle.dumps(one.counts))
        tiers = judge(pairs.axes[axis].pairs, pairs.axis_loads(axis, NONE), CONDITIONS).tier
        expected = [(name, int(np.sum(tiers == number))) for number, name in enumerate(TIERS)]
        assert list(one.counts) == expected == list(copied) and one.counts == copied
        assert min(count for _, count in expected) > 0 and len(pickle.dumps(one.counts)) < 1000
