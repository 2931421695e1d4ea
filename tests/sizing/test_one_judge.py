"""Random arms and linkages whose drives all commands judge alike: a sample of the campaign."""

import pytest

from tests.campaigns.one_judge import differences, random_case


@pytest.mark.tier2
@pytest.mark.parametrize("seed", [3, 11, 24, 58, 71, 90])
def test_every_command_gives_each_criterion_of_a_random_drive_the_same_use(seed: int, tmp_path) -> None:
    assert not differences(*random_case(seed, tmp_path), tmp_path)
