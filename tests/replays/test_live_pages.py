"""A sample of the campaign that compares pages that compute with Python."""

import pytest

from tests.campaigns.live_pages import SIZINGS, worst_of

pytest_plugins = ("browser",)


@pytest.mark.tier2
@pytest.mark.parametrize("name", ["scara", "panda", "delta", "four_bar", "rolling_disk", "bricard"])
def test_a_page_differs_from_python_by_rounding(chromium, tmp_path, name):
    worst = worst_of(chromium, name, range(3), tmp_path)
    assert len(worst) >= 2
    for quantity, (off, seed) in worst.items():
        if name in SIZINGS:
            assert off < 1e-9, (quantity, seed)
        elif quantity == "state":
            assert off < 1e-7, seed
        elif quantity.startswith("time"):
            assert off < 1e-8, (quantity, seed)
