"""The guides' files open, their Python runs, and the options of their commands exist."""

import contextlib
import io
import re
import shlex
from pathlib import Path
from typing import get_args

import pytest
import tutorial

import bellcrank as bc
from bellcrank import cli
from bellcrank.sizing.selection.judge import CRITERIA, NOTES, TIERS
from bellcrank.sizing.selection.judged_axes import Objective
from bellcrank.sizing.selection.system_criteria import REGENERATION, SUPPLY

GUIDES = sorted((Path(tutorial.__file__).parents[1] / "guide").glob("*.md"))
COMMANDS = "size|select|simulate|sweep|optimise|synthesise|replay|report|plot|check|catalogue|verify|bench|robots"
BELLCRANK = re.compile(rf"bellcrank (?:{COMMANDS})\b[^`\n#&|)]*")


def blocks(page):
    return list(tutorial.FENCE.finditer(page.read_text(encoding="utf-8")))


LONG = ("fastest-motions",)  # several seconds
PAGES = [pytest.param(page, id=page.stem, marks=[pytest.mark.tier2] if page.stem in LONG else []) for page in GUIDES]


@pytest.mark.parametrize("page", PAGES)
def test_the_python_of_a_guide_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for block in blocks(page):
        if block["title"]:
            Path(block["title"]).write_text(block["text"], encoding="utf-8")
            if block["language"] == "yaml":
                assert bc.load_scene(block["title"]).robot.nq
        elif block["language"] == "python":
            with contextlib.redirect_stdout(io.StringIO()) as out:
                exec(compile(block["text"], page.name, "exec"), {})
            assert "print" not in block["text"] or out.getvalue()


def test_the_motions_of_the_guide_are_sized(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    by_title = {block["title"]: block["text"] for page in GUIDES for block in blocks(page) if block["title"]}
    for name in ("arm.yaml", "motion.csv"):
        Path(name).write_text(by_title[name], encoding="utf-8")
    assert cli.main(["size", "arm.yaml", "--no-plots"]) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in ("circle", "reach", "swing", "cycle"))
    assert cli.main(["size", "planar_2r", "--motion", "motion.csv", "--no-plots"]) == 1
    assert "Not known: peaks that the rows of a motion do not determine" in capsys.readouterr().out
    assert Path("planar_2r_sizing/history_motion.csv").exists()


def test_the_scene_of_the_guide_takes_the_options_that_it_shows(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (page,) = [page for page in GUIDES if page.stem == "scenes"]
    for block in blocks(page):
        if block["title"]:
            Path(block["title"]).write_text(block["text"], encoding="utf-8")
        elif block["language"] == "sh":
            for line in block["text"].splitlines():
                assert cli.main([*shlex.split(line)[1:], "--no-plots"]) == 0
    assert "event" in capsys.readouterr().out


def test_the_commands_that_pages_name_have_these_options():
    pages = [*GUIDES, *(GUIDES[0].parents[1]).glob("*.md")]
    lines = {line.strip() for page in pages for line in BELLCRANK.findall(page.read_text(encoding="utf-8"))}
    checked = 0
    for line in lines:
        command = line.split()[1]
        options = set(re.findall(r"--[a-z-]+", line))
        with contextlib.redirect_stdout(io.StringIO()) as out, pytest.raises(SystemExit):
            cli.main([command, "--help-all" if command == "select" else "--help"])
        assert all(option in out.getvalue() for option in options), line
        checked += len(options)
    assert checked > 10


def test_the_guide_to_the_selection_has_every_criterion_with_its_formula_and_source():
    (page,) = [page for page in GUIDES if page.stem == "selection"]
    rows = [re.split(r" (?<!\\)\| ", line[2:-2]) for line in page.read_text("utf-8").splitlines() if line[:2] == "| "]
    told = {row[0]: (row[1].replace("\\|", "|"), row[-1]) for row in rows}
    for criterion in (*CRITERIA, *NOTES):
        assert told[criterion.name] == (criterion.formula, criterion.source)
    assert {SUPPLY, REGENERATION} <= told.keys()
    plain = {name.partition(" (")[0] for name in told}
    assert set(TIERS) | {f"`{name}`" for name in get_args(Objective)} <= plain
