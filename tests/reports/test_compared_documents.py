"""Two results in one page: every cell of both tables stands in it, and those are marked that differ."""

import re

import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.replays.replay import film_of
from bellcrank.reports.document import Document, Facts, Still, Table
from bellcrank.reports.report import BOTH, compared_documents
from bellcrank.reports.sizing_report import sizing_document


def document(*parts, status="OK", warnings=()):
    """A document of these parts."""
    return Document(
        title="robot", status=status, success=status == "OK", verdict=("inside",), about=("sizing",),
        warnings=warnings, notes=(), still=Still(0.0, "start"), parts=parts,
    )  # fmt: skip


def test_rows_that_differ_stand_one_below_the_other_and_their_cells_are_marked():
    one = Table("Joints", ("joint", "torque", "speed"), (("a", "1", "2"), ("b", "3", "4"), ("only here", "5", "6")))
    two = Table("Joints", ("joint", "torque", "speed"), (("b", "3", "7"), ("a", "1", "2")))
    [table] = compared_documents(document(one), document(two), ("A", "B")).parts
    assert table.header == ("joint", "of", "torque", "speed")
    assert table.rows == (
        ("a", BOTH, "1", "2"), ("b", "A", "3", "4"), ("b", "B", "3", "7"), ("only here", "A", "5", "6"),
    )  # fmt: skip
    assert table.marked == {(1, 3), (2, 3), (3, 2), (3, 3)}


def test_rows_of_one_name_are_compared_in_their_order_and_columns_by_their_name():
    one = Table("Loads", ("joint", "cycle", "peak"), (("a", "up", "1"), ("a", "down", "2")))
    two = Table("Loads", ("joint", "peak", "new", "cycle"), (("a", "1", "", "up"), ("a", "3", "", "down")))
    [table] = compared_documents(document(one), document(two), ("A", "B")).parts
    assert table.header == ("joint", "of", "cycle", "peak", "new")
    assert table.rows == (("a", BOTH, "up", "1", ""), ("a", "A", "down", "2", ""), ("a", "B", "down", "3", ""))
    assert table.marked == {(1, 3), (2, 3)}


def test_facts_that_differ_become_a_table_and_equal_ones_stay():
    made, ours, theirs = Facts("Made", (("with", "x"),)), (("payload", "1 kg"), ("g", "9.81")), (("payload", "2 kg"),)
    parts = compared_documents(
        document(made, Facts("For", ours)), document(made, Facts("For", theirs)), ("A", "B")
    ).parts
    assert parts[0] == made
    assert parts[1].rows == (("payload", "1 kg", "2 kg"), ("g", "9.81", ""))
    assert parts[1].marked == {(0, 1), (0, 2), (1, 1), (1, 2)}


def test_what_only_one_says_or_has_is_under_its_name():
    table = Table("Springs", ("spring", "force"), (("s", "1"),))
    first, second = document(warnings=("same", "mine")), document(table, status="Exceeded", warnings=("same", "other"))
    both = compared_documents(first, second, ("A", "B"))
    assert both.warnings == ("same", "A: mine", "B: other")
    assert both.verdict[:2] == ("A: inside", "B: inside")
    assert (both.status, both.success) == ("OK and Exceeded", False)
    assert [part.title for part in both.parts] == ["Springs, B only"]


@pytest.fixture(scope="module")
def sizings():
    """A pendulum, and the same with a payload."""
    return bc.size("geared_pendulum"), bc.size("geared_pendulum", overrides={"conditions.safety_factor": 2.0})


def test_a_sizing_against_itself_has_no_mark(sizings):
    film = film_of(sizings[0])
    one = sizing_document(sizings[0], film, pictures=False)
    both = compared_documents(one, one, ("A", "B"))
    assert not any(part.marked for part in both.parts if isinstance(part, Table))
    assert both.verdict[-1] == "No row differs."


@pytest.mark.parametrize("make", ["size", "select"])
def test_the_page_of_two_holds_the_figures_of_both(make, tmp_path):
    other = {"safety_factor": 2.0}
    if make == "size":
        one = bc.size("geared_pendulum")
        two = bc.size("geared_pendulum", overrides={"motions.lift_and_return.parts.waypoints.times": [0.0, 0.5]})
        figures = [f"{each.joints[0].shaft.rms_torque:.4g}" for each in (one, two)]
    else:
        one, two = (bc.select("geared_pendulum", makers=["maxon"], conditions=each) for each in (None, other))
        figures = [f"{each.mass:.4g} kg" for each in (one, two)]
    assert figures[0] != figures[1]
    page = bc.report(one, tmp_path / "two.html", over=two).read_text()
    for figure in figures:
        assert figure in page
    assert "<mark>" in page and "first: " in page and "second: " in page


def test_the_command_compares_two_and_names_them_by_their_files(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, duration in (("fast", 1), ("slow", 2)):
        motion = f"{{kind: waypoints, times: [0, {duration}], positions: [[0, 0], [1, 0]]}}"
        (tmp_path / f"{name}.yaml").write_text(f"name: arm\nurdf: planar_2r\nmotions: {{up: {motion}}}\n")
    assert main(["replay", "fast.yaml", "slow.yaml", "--out", "two.html"]) == 0
    page = (tmp_path / "two.html").read_text()
    assert "<title>fast and slow</title>" in page
    assert re.search(r"<td[^>]*>fast</td>.*<mark>", page) and re.search(r"<td[^>]*>slow</td>.*<mark>", page)
    assert main(["report", "fast.yaml", "slow.yaml", "--out", "report.html"]) == 0
    assert "<mark>" in (tmp_path / "report.html").read_text()
    capsys.readouterr()


def test_a_sweep_is_not_compared(tmp_path):
    sweep = bc.sweep("four_bar", {"crank_length": [1.22, 1.23]})
    with pytest.raises(bc.InputError, match="argument 'over': a sweep has no motion"):
        bc.report(sweep, tmp_path / "x.html", over=bc.simulate("pendulum", duration=0.1))
