"""The tutorials and the pages on the theory run, and print what they say."""

from pathlib import Path

import pytest
import tutorial
import tutorial_pages

DOCS = Path(tutorial.__file__).parents[1]
PAGES = sorted((DOCS / "tutorials").glob("*.md"))
THEORY = [page for page in sorted((DOCS / "theory").glob("*.md")) if "```python" in page.read_text(encoding="utf-8")]


@pytest.mark.tier2
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_tutorial_prints_what_it_says(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_with_pages(page, tmp_path)


def run_with_pages(page, folder):
    """Run a page in the current folder, which is given, and check the pages that it shows."""
    tutorial.run(page)
    for name in tutorial_pages.names(page.read_text(encoding="utf-8")):
        written = Path(name).read_text(encoding="utf-8")
        assert written.lower().startswith("<!doctype html>") and written.rstrip().endswith("</html>")
        assert str(DOCS.parent) not in written and str(folder) not in written  # no folders of this machine


@pytest.mark.parametrize("page", THEORY, ids=lambda page: page.stem)
def test_a_page_on_the_theory_prints_what_it_says(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_with_pages(page, tmp_path)


def test_the_tutorials_show_pages():
    shown = {page.stem for page in PAGES if tutorial_pages.names(page.read_text(encoding="utf-8"))}
    assert {"size-an-arm", "choose-the-motors", "simulate-and-trust", "close-a-loop", "tolerances", "fastest"} <= shown
    assert [page.stem for page in THEORY if tutorial_pages.names(page.read_text(encoding="utf-8"))] == ["baumgarte"]


def test_a_page_is_shown_in_a_frame():
    text = "before\n\n<!-- page: arm.html The arm's <motion> -->\n\nafter"
    shown = tutorial_pages.shown(text, "size")
    assert '<iframe src="size/arm.html" title="The arm&#x27;s &lt;motion&gt;"' in shown
    assert shown.startswith("before") and shown.endswith("after") and "<!--" not in shown


def test_numbers_of_a_page_are_compared_with_what_is_printed():
    printed = "joint   peak\nshoulder  172.28 N m  -0.5%\nerror 2.1e-10\n"
    tutorial.compare("shoulder 172.3 N m …\nerror 4e-10", printed)
    for wrong in ("shoulder 173.3 N m …", "error 2.1e-09", "error 2.1e-10\nshoulder 172.3 …", "elbow …"):
        with pytest.raises(AssertionError, match="not printed"):
            tutorial.compare(wrong, printed)
