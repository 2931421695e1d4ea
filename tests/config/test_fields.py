"""Reading of YAML: units, and one sentence for whatever is wrong."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bellcrank.config.fields import Fields, parse_number
from bellcrank.errors import BellcrankError, InputError


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("30 deg", "rad", math.pi / 6),
        ("-30deg", "rad", -math.pi / 6),
        ("1e-3", "m", 1e-3),
        ("5 mm", "m", 0.005),
        (2, "kg", 2.0),
        ("3000 rpm", "rad/s", 100 * math.pi),
        ("10%", "", 0.1),
        ("250 g", "kg", 0.25),
        ("1.5 N m", "N m", 1.5),
        (".5", "", 0.5),
    ],
)
def test_numbers_come_in_si(text: object, unit: str, value: float) -> None:
    assert parse_number(text, unit) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("value", "unit", "message"),
    [
        ("30 kg", "rad", "expected an angle in rad .* found '30 kg'"),
        (True, "m", "expected a length in m, found true"),
        (float("nan"), "m", "finite"),
        (float("inf"), "kg", "finite"),
        (10**400, "m", "finite"),
        (None, "m", "found nothing"),
        ([1], "m", "found a list of 1"),
        ({}, "m", "found a mapping"),
        ("deg", "rad", "found 'deg'"),
        ("", "m", "found ''"),
    ],
)
def test_what_is_no_number_is_named(value: object, unit: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parse_number(value, unit)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "found an empty file"),
        ("- 1\n- 2\n", "found a list of 2"),
        ("just text", "found a text"),
        ("a: 1\nb: [1, 2\n", r"\(line \d\): not valid YAML"),
        ("a: 1\na: 2\n", r"\(line 2\): .*duplicate key 'a' \(first on line 1\)"),
        ("b:\n  c: 1\n  c: 2\n", "duplicate key 'c'"),
        ("1: 2\n", "expected a string key, found 1"),
        ("on: 2\n", "put it in quotes"),
        ("a: !!python/object:os.system x\n", "not valid YAML"),
        ("a: *nowhere\n", "not valid YAML"),
        ("a: \x01\n", "not valid YAML"),
        ("? [1, 2]\n: 3\n", "not valid YAML"),
        ("[" * 3000, "not valid YAML"),
        ("a:\n\tb: 1\n", r"\(line 2\): .*a tab is used for indentation; use spaces"),
        ("a: @x\n", "a value cannot begin with '@'; put it in quotes"),
        ("a:\n  - 1\n - 2\n", r"\(line 3\): .*the indentation differs from the lines above"),
        ("- 1\na: 2\n", r"\(line 2\): .*the indentation differs from the lines above"),
        ("a: b: c\n", "unexpected ': '; check the indentation"),
        ("a: 1\nb\n", "the ':' after the key is missing"),
        ("a: [1, 2\n", "the ']' that closes a list or mapping is missing"),
        ("a: {b: 1\n", "the '}' that closes a list or mapping is missing"),
        ("a: 'x\n", "the closing quote of a text is missing"),
        ('a: "\\q"\n', "unknown escape sequence after a backslash"),
        ("a: 1\n---\nb: 2\n", "a second document begins here"),
        ("a: *nowhere\n", "an alias .* repeats a value that no anchor"),
        ("a: &x 1\nb: &x 2\n", "the same anchor .* is used twice"),
        ("a: !foo 1\n", "unknown tag"),
    ],
)
def test_broken_files_are_one_sentence(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "broken.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        Fields.from_file(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    (tmp_path / "latin.yaml").write_bytes(b"name: \xe9\n")
    for name, message in (
        ("missing.yaml", "there is no such file"),
        ("latin.yaml", "UTF-8"),
        (".", "is a folder"),
    ):
        with pytest.raises(InputError, match=message):
            Fields.from_file(tmp_path / name)


def test_messages_carry_file_key_and_line(tmp_path: Path) -> None:
    path = tmp_path / "card.yaml"
    path.write_text("outer:\n  length: 3 kg\n")
    with pytest.raises(InputError, match=r"card.yaml: outer.length \(line 2\): expected a length in m .*found '3 kg'"):
        Fields.from_file(path).mapping("outer").number("length", "m")


def test_keys_that_nobody_asked_for_are_refused() -> None:
    fields = Fields({"radius": 1.0, "radus": 2.0}, "x.yaml")
    assert fields.number("radius", "m") == 1.0
    with pytest.raises(InputError, match="unknown key 'radus'; did you mean 'radius'"):
        fields.done()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda f: f.number("missing"), "the key 'missing' is missing"),
        (lambda f: f.number("n", positive=True), "more than 0"),
        (lambda f: f.number("n", nonnegative=True), "0 or more"),
        (lambda f: f.number("big", maximum=1.0), "at most 1"),
        (lambda f: f.vector("list", 3), "a list of 3 numbers"),
        (lambda f: f.vector("words", 2, "m"), "expected a length"),
        (lambda f: f.text("n"), "expected a text"),
        (lambda f: f.flag("n", True), "true or false"),
        (lambda f: f.choice("word", ("alpha", "beta")), "did you mean 'alpha'"),
        (lambda f: f.mapping("n"), "expected a mapping"),
        (lambda f: f.mappings("n"), "list of mappings"),
        (lambda f: f.mappings("list"), "entry 1"),
        (lambda f: f.rows("list", 2), "2 numbers"),
        (lambda f: f.integer("big"), "whole number"),
        (lambda f: f.integer("n", minimum=0), "whole number of 0 or more"),
    ],
)
def test_each_kind_of_value_is_checked(call: Any, message: str) -> None:
    fields = Fields({"n": -1, "big": 2.5, "list": [1, 2], "words": ["a", "b"], "word": "alpa"}, "x.yaml")
    with pytest.raises(InputError, match=message):
        call(fields)


def test_merge_keys_and_anchors_work(tmp_path: Path) -> None:
    path = tmp_path / "anchors.yaml"
    path.write_text("a: &base {x: 1, y: 2}\nb:\n  <<: *base\n  y: 3\n")
    fields = Fields.from_file(path).mapping("b")
    assert (fields.number("x"), fields.number("y")) == (1.0, 3.0)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.binary(max_size=200) | st.text(alphabet="ab:{}[]&*!?|>-#'\"%@,<.0\n \t", max_size=80).map(str.encode))
def test_no_file_raises_anything_else(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "any.yaml"
    path.write_bytes(content)
    try:
        fields = Fields.from_file(path)
    except BellcrankError as error:
        assert "\n" not in str(error)
    else:
        assert isinstance(fields.keys(), list)
