"""Programs of robot files that grow are read or refused within the budget; tests/campaigns/growth.py runs more."""

import pytest

from tests.campaigns import growth

pytestmark = pytest.mark.tier2


@pytest.mark.parametrize("seed", range(24))
def test_random_programs_are_read_or_refused_within_the_budget(tmp_path, seed):
    said, _ = growth.fault(tmp_path, seed)
    assert not said
