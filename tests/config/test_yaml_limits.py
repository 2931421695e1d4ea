"""What a YAML text may hold: entries, also those that aliases repeat, depth, numbers; and joins of motions in joins."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from typing import Any

import pytest
import yaml

import bellcrank as bc
from bellcrank.config.fields import Fields
from bellcrank.config.yaml_file import MOST_DEPTH, MOST_REPEATED, read_value, read_yaml
from bellcrank.errors import InputError
from bellcrank.motion.entry_kinds import MOST_PARTS
from bellcrank.scene.overrides import parse_assignment
from bellcrank.studies.designs.axes import parse_axis


def nested(levels: int, width: int = 9, flow: str = "[{}]") -> str:
    """Lists (or merged mappings) of aliases of lists …, width to the power of levels entries."""
    lines = ["a0: &a0 " + ("[1, 2, 3]" if flow == "[{}]" else "{k: 1, l: 2}")]
    lines += [f"a{k}: &a{k} {flow.format(', '.join([f'*a{k - 1}'] * width))}" for k in range(1, levels)]
    return "\n".join(lines) + "\n"


BOMBS = {
    "aliases of aliases": (nested(9), r"\(line 6\): .*aliases repeat more than 100000 entries"),
    "aliases 300 levels deep": (nested(300, 1), f"nested more than {MOST_DEPTH} deep by aliases"),
    "merge keys": (nested(9, flow="{{<<: [{}]}}"), "aliases repeat more than"),
    "an alias of itself": (
        "a: &a {b: [*a]}\n",
        r"\(line 1\): .*an alias repeats a value that contains the alias itself",
    ),
    "flow lists": ("a: " + "[" * 50_000, f"nested more than {MOST_DEPTH} deep"),
    "flow mappings": ("a: " + "{a: " * 50_000, f"nested more than {MOST_DEPTH} deep"),
    "block mappings": ("\n".join(" " * k + "a:" for k in range(1000)), f"nested more than {MOST_DEPTH} deep"),
    "block lists": ("a:\n" + "\n".join(" " * k + "-" for k in range(1000)), f"nested more than {MOST_DEPTH} deep"),
    "a decimal number": ("a: " + "9" * 2000, "a number of more than 400 characters"),
    "a hexadecimal number": ("a: 0x" + "f" * 2000, "a number of more than 400 characters"),
    "a number to the base 60": ("a: 1" + ":59" * 1000, "a number of more than 400 characters"),
    "a text": ("a: " + "x" * 100_010, "a text of more than 100000 characters"),
    "a wrong integer": ("a: !!int ''", r"\(line 1\): .*does not fit its type"),
    "a wrong truth": ("a: 1\nb: !!bool secret", r"\(line 2\): .*does not fit its type"),
    "a list that is called a mapping": ("a: !!map [secret]", "does not fit its type"),
}


@pytest.mark.parametrize("what", BOMBS)
def test_what_expands_beyond_the_limits_is_refused_in_one_sentence(tmp_path: Path, what: str) -> None:
    text, message = BOMBS[what]
    path = tmp_path / "bomb.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_yaml(path)
    assert (
        str(caught.value).startswith(str(path)) and "\n" not in str(caught.value) and "secret" not in str(caught.value)
    )


@pytest.mark.parametrize("flow", ["[{}]", "{{<<: [{}]}}"])
def test_bombs_are_refused_at_little_memory(tmp_path: Path, flow: str) -> None:
    """A thousand levels would have 9^1000 entries; those written take some megabytes."""
    path = tmp_path / "bomb.yaml"
    path.write_text(nested(1000, flow=flow))
    tracemalloc.start()
    with pytest.raises(InputError, match="aliases repeat more than"):
        read_yaml(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 10e6


@pytest.mark.parametrize("value", [BOMBS[key][0].partition(": ")[2] for key in ("flow lists", "a decimal number")])
def test_values_of_arguments_have_the_limits_of_files(value: str) -> None:
    with pytest.raises(InputError, match=r"override 'urdf'.*(nested more than|a number of more than)"):
        parse_assignment(f"urdf={value}")
    with pytest.raises(InputError, match="--vary"):
        parse_axis(f"load={value}")
    with pytest.raises(InputError, match="does not fit its type"):
        parse_assignment("name=!!int ''")
    assert parse_axis("load=2020-99-99,1e3,fast") == ("load", ("2020-99-99", "1e3", "fast"))


@pytest.mark.tier2
def test_aliases_and_merge_keys_within_the_limits_read_as_ever(tmp_path: Path) -> None:
    """Against PyYAML's own safe loader, up to the last entry that aliases may repeat."""
    texts = [
        "a: &a {x: 1, y: [1, 2]}\nb: {<<: *a, y: 3}\nc: [*a, *a]\n",
        "base: &b {k: 1}\nmore: &m {<<: *b, l: 2}\nboth: {<<: [*b, *m], k: 7}\n",
        nested(5),
        "a: [1, 2.5, 1e3, .inf, true, null, 0x1F, 1_000, '1', 12:30]\n",
    ]
    for text in texts:
        path = tmp_path / "fine.yaml"
        path.write_text(text)
        assert read_yaml(path) == yaml.safe_load(text)
    row = "- &r [" + ", ".join(["1"] * 9) + "]\n"  # ten entries
    path.write_text("rows:\n" + row + "- *r\n" * (MOST_REPEATED // 10))
    assert len(read_yaml(path)["rows"]) == MOST_REPEATED // 10 + 1
    path.write_text("rows:\n" + row + "- *r\n" * (MOST_REPEATED // 10 + 1))
    with pytest.raises(InputError, match="aliases repeat more than"):
        read_yaml(path)
    assert read_value("[1, {a: 2}]", "x") == [1, {"a": 2}]


def test_depth_up_to_the_limit_is_read(tmp_path: Path) -> None:
    def deep(levels: int) -> Any:
        return read_value("[" * levels + "]" * levels, "x")

    value = deep(MOST_DEPTH)
    for _ in range(MOST_DEPTH - 1):
        (value,) = value
    assert value == []
    with pytest.raises(InputError, match="nested more than"):
        deep(MOST_DEPTH + 1)


@pytest.mark.tier2
def test_a_table_of_waypoints_with_many_numbers_is_read(tmp_path: Path) -> None:
    rows = 1500
    motion = {
        "kind": "waypoints",
        "times": [0.1 * k for k in range(rows)],
        "positions": [[1e-4 * k] * 6 for k in range(rows)],
    }
    path = tmp_path / "card.yaml"
    path.write_text(yaml.safe_dump({"urdf": "ur5", "motions": {"go": motion}}, default_flow_style=None))
    assert len(bc.load_scene(path).config.motions["go"].times) == rows


def joins(levels: int, width: int) -> str:
    lines = ["urdf: planar_2r", "motions:", "  j0: {kind: dwell, position: [0, 0], duration: 1}"]
    lines += [f"  j{k}: {{kind: join, parts: [{', '.join([f'j{k - 1}'] * width)}]}}" for k in range(1, levels + 1)]
    return "\n".join(lines) + "\n"


@pytest.mark.tier2
def test_joins_of_joins_are_counted_and_refused_before_they_are_built(tmp_path: Path) -> None:
    path = tmp_path / "card.yaml"
    path.write_text(joins(9, 10))
    with pytest.raises(InputError, match=r"motions.j5.parts .*at most 10000 motions, found 100000"):
        bc.load_scene(path)
    path.write_text(joins(2000, 1))
    with pytest.raises(InputError, match="joins are nested more than 50 deep"):
        bc.load_scene(path)
    path.write_text(
        joins(4, 10)
        + "".join(f"  k{k}: {{kind: join, parts: [{'j4' if k == 0 else f'k{k - 1}'}]}}\n" for k in range(40))
    )
    assert len(bc.load_scene(path).config.motions) == 45  # MOST_PARTS parts behind 40 joins
    assert MOST_PARTS == 10**4


@pytest.mark.tier2
def test_joins_in_place_count_too_and_cycles_stay_refused(tmp_path: Path) -> None:
    path = tmp_path / "card.yaml"
    part = "{kind: join, parts: [a, a, a, a, a, a, a, a, a, a]}"
    for _ in range(3):
        part = "{kind: join, parts: [" + ", ".join([part] * 10) + "]}"
    head = "urdf: planar_2r\nmotions:\n  b: {kind: dwell, position: [0, 0], duration: 1}\n"
    path.write_text(f"{head}  a: {{kind: join, parts: [b, b]}}\n  c: {part}\n")
    with pytest.raises(InputError, match="at most 10000 motions, found 20000"):
        bc.load_scene(path)
    path.write_text(
        f"{head}  a: {{kind: join, parts: [d]}}\n  d: {{kind: join, parts: [{{kind: join, parts: [a]}}]}}\n"
    )
    with pytest.raises(InputError, match="is joined to itself"):
        bc.load_scene(path)


def test_a_join_of_joins_moves_as_its_parts_one_after_the_other(tmp_path: Path) -> None:
    path = tmp_path / "card.yaml"
    path.write_text(joins(2, 3))
    config = bc.load_scene(path).config
    motion = config.motion(config.robot(), "j2")
    assert motion.time[-1] == pytest.approx(9.0, rel=1e-14)


def test_a_missing_key_among_thousands_is_told_in_a_short_sentence() -> None:
    with pytest.raises(InputError, match=r"'urdf' is missing.*\(5000 in all\)") as caught:
        Fields({f"k{k}": 1 for k in range(5000)}, "x.yaml").text("urdf")
    assert len(str(caught.value)) < 400
