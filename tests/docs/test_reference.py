"""The reference pages say all that there is to say: keys, commands, public names."""

import re

import api_pages
import cli_page
import pytest
import reference
import yaml_page
from yaml_recorder import recorded

import bellcrank as bc
from tests.support.public_names import NAMES


@pytest.mark.parametrize("path", reference.pages(), ids=lambda path: path.name)
def test_a_page_in_the_repository_is_what_the_sources_say(path):
    """`python docs/tools/reference.py` writes them."""
    assert path.read_text(encoding="utf-8") == reference.pages()[path]


def test_every_key_that_readers_ask_for_is_described_and_no_other():
    assert yaml_page.differences() == []


@pytest.mark.tier2
def test_the_samples_have_every_kind():
    for section, keys in recorded().items():
        group, colon, _ = section.partition(": ")
        if colon and "kind" in keys:
            kinds = set(re.findall(r"`(\w+)`", keys["kind"].value))
            assert kinds == {name.partition(": ")[2] for name in recorded() if name.startswith(f"{group}: ")}


def test_units_and_defaults_are_those_of_the_readers():
    page = yaml_page.page()
    assert "| `stiffness` | number, N m/rad or N/m |" in page
    assert "| `gravity` | 3 numbers, m/s^2 | [0, 0, -9.81] |" in page
    assert f"| `rtol` | number > 0 | {bc.results.Settings().rtol:g} |" in page


def test_every_command_and_option_is_on_the_page():
    page, commands = cli_page.page(), cli_page.commands()
    assert {"size", "simulate", "bench", "verify"} <= commands.keys()
    for name, parser in commands.items():
        part = page.split(f"## bellcrank {name}\n")[1].split("\n## ")[0]
        options = {option for action in parser._actions for option in action.option_strings} - {"-h", "--help"}
        assert options == set(re.findall(r"(?<=`| )--?[a-z][\w-]*(?=[`, ])", part.split("|---|---|")[1])) & options


def test_every_public_name_is_on_a_page():
    text = "\n".join(api_pages.pages().values())
    for name in NAMES:
        place = f"results.{name}" if name in bc.results.__all__ else name
        assert len(re.findall(rf"^::: bellcrank\.{place}$", text, re.MULTILINE)) == 1
        assert f"| `bc.{place}` | " in api_pages.index()


def test_type_checkers_are_told_all_public_names():
    assert sorted(bc.__all__) == sorted(["__version__", "results", *bc._HOME])
    assert sorted(bc.results.__all__) == sorted(bc.results._HOME)
    assert not {*bc.__all__} & {*bc.results.__all__} and len(bc.__all__) <= 65
