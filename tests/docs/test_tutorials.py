"""The tutorials run, and print what they say."""

from pathlib import Path

import pytest
import tutorial

PAGES = sorted((Path(tutorial.__file__).parents[1] / "tutorials").glob("*.md"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_tutorial_prints_what_it_says(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    tutorial.run(page)


def test_there_are_the_two_tutorials():
    assert {"size-an-arm", "simulate-and-trust"} <= {page.stem for page in PAGES}


def test_numbers_of_a_page_are_compared_with_what_is_printed():
    printed = "joint   peak\nshoulder  172.28 N m  -0.5%\nerror 2.1e-10\n"
    tutorial.compare("shoulder 172.3 N m …\nerror 4e-10", printed)
    for wrong in ("shoulder 173.3 N m …", "error 2.1e-09", "error 2.1e-10\nshoulder 172.3 …", "elbow …"):
        with pytest.raises(AssertionError, match="not printed"):
            tutorial.compare(wrong, printed)
