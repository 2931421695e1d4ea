"""No link of the README or the pages is dead: files, anchors, and names of the Python interface."""

import functools
import re
import tomllib
from pathlib import Path

import api_pages
import pytest
import yaml
import yaml_page

import bellcrank as bc

ROOT = Path(yaml_page.__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [*sorted(DOCS.rglob("*.md")), *(ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md"))]
LINK = re.compile(r"\[(?:[^\]\[]|\[[^\]]*\])*\]\(([^)\s]+)\)")
REFERENCE = re.compile(r"\[[^\]\[]+\]\[(bellcrank[\w.]*)\]")
FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)


@functools.cache
def generated():
    """Path -> text of the pages that the build adds."""
    return {DOCS / path: text for path, text in api_pages.pages().items()}


def text_of(page):
    return FENCE.sub("", generated().get(page) or page.read_text(encoding="utf-8"))


def anchors(page):
    """The anchors of a page's headings, as both GitHub and MkDocs make them."""
    titles = re.findall(r"^#+ (.+)$", text_of(page), re.MULTILINE)
    return {re.sub(r"[^\w\s-]", "", title.lower()).strip().replace(" ", "-") for title in titles}


def check(page):
    for link in LINK.findall(text_of(page)):
        if link.startswith(("https://", "mailto:")):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target in generated() or target.exists(), f"{page.name}: there is no {link}"
        assert not anchor or anchor in anchors(target), f"{page.name}: {link}: there is no such heading"
    for name in REFERENCE.findall(api_pages.linked(text_of(page))):
        found = bc
        for part in name.split(".")[1:]:
            found = getattr(found, part)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_of_a_page_lead_somewhere(page):
    check(page)


def test_links_of_generated_pages_lead_somewhere():
    for page in generated():
        check(page)


def test_a_dead_link_is_found(tmp_path):
    for text in ("[a](nothing.md)", "# Here\n[a](#there)", "[`a`][bellcrank.nothing]"):
        (tmp_path / "page.md").write_text(text)
        with pytest.raises((AssertionError, AttributeError)):
            check(tmp_path / "page.md")


def test_public_names_become_links_and_nothing_else_does():
    text = "`bc.size(robot)` `bc.nothing` [`bc.size`](a.md)\n```python\n`bc.size`\n```"
    assert api_pages.linked(text) == "[`bc.size(robot)`][bellcrank.size]" + text[len("`bc.size(robot)`") :]


def test_every_page_is_in_the_navigation():
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    found = set(re.findall(r"[\w/-]+\.md", yaml.safe_dump(yaml.safe_load(text)["nav"])))
    pages = {str(page.relative_to(DOCS)) for page in (*DOCS.rglob("*.md"), *generated())}
    assert found == pages | {"changelog.md", "contributing.md", "license.md"}


def test_the_pages_load_nothing_from_other_hosts():
    config = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))
    assert config["theme"]["font"] is False
    assert not any("://" in str(value) for key in ("extra_css", "extra_javascript") for value in config.get(key, []))


def test_the_changelog_and_the_citation_tell_the_version():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert f"\n## {version}\n" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["version"] == version


def test_the_files_that_pages_name_exist():
    named = {name for page in PAGES for name in re.findall(r"`([\w/]+\.(?:py|hpp))`", text_of(page))}
    there = {
        str(path) for folder in ("src", "examples", "docs/tools", "tests") for path in (ROOT / folder).rglob("*.*")
    }
    assert named
    for name in named:
        assert any(path.endswith(f"/{name}") for path in there), name


def test_contributing_draws_the_ladder_of_the_linter():
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = config["tool"]["importlinter"]["contracts"][0]["layers"]
    drawn = re.findall(r"^([a-z]+(?:, [a-z]+)*)  +\S", (ROOT / "CONTRIBUTING.md").read_text("utf-8"), re.MULTILINE)
    rooms = [room for line in drawn for room in line.split(", ")]
    assert rooms == [layer for layer in layers if layer in rooms]
    folders = {path.name for path in (ROOT / "src" / "bellcrank").iterdir() if (path / "__init__.py").exists()}
    assert folders <= set(rooms)
