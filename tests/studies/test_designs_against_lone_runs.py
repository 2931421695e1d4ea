"""Every design of an ensemble against `simulate` of that design alone, in units of what the run may be wrong by.

A sample of the campaign in `tests/campaigns/designs_against_lone_runs.py`.
"""

import numpy as np
import pytest
from study_scenes import STUDY_SCENES

import bellcrank as bc
from tests.campaigns.designs_against_lone_runs import TIMES, differences, finer

pytestmark = pytest.mark.tier2


@pytest.mark.parametrize("name", STUDY_SCENES)
def test_designs_agree_with_their_lone_runs(name):
    found = differences(name, 12, seed=1)
    assert max(found.values()) <= TIMES, {key: value for key, value in found.items() if value > TIMES}


@pytest.mark.parametrize("name", STUDY_SCENES)
def test_threads_and_blocks_change_no_bit(name):
    found, values = STUDY_SCENES[name].runner(), STUDY_SCENES[name].designs(37, seed=3)
    whole = found.run(values)
    for threads in (2, 3):
        assert_same(found.run(values, threads=threads), whole, slice(None))
    for part in (slice(0, 1), slice(1, 20), slice(20, 37)):
        assert_same(found.run(values[part], threads=2), whole, part)


def assert_same(columns, whole, part):
    np.testing.assert_array_equal(columns.status, whole.status[part])
    first = part.start or 0
    assert columns.reasons == {k - first: text for k, text in whole.reasons.items() if 0 <= k - first < len(columns)}
    for name, column in columns.measures.items():
        np.testing.assert_array_equal(column, whole.measures[name][part], err_msg=name)


def test_the_error_that_differences_are_measured_by_is_that_of_the_run():
    """The estimate of `error_estimate` and the difference from a finer run are of one size."""
    run = bc.simulate(STUDY_SCENES["planar_2r_swing"].load())
    better = bc.simulate(finer(run.scene), samples=run.settings.samples)
    difference = np.abs(run.position - better.position).max()
    assert 0.3 < difference / run.error_estimate() < 3.0
