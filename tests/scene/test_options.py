"""Numbers and values on the command line: ASCII digits only, within a range, and refused by the option's name."""

import itertools
import math
import random
import subprocess
import sys

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.config.fields import parse_number
from bellcrank.config.units import decimal_number, split_number, whole_number
from bellcrank.config.yaml_file import read_value
from bellcrank.errors import InputError
from bellcrank.scene.overrides import parse_assignment
from bellcrank.studies.designs.axes import parse_axis
from bellcrank.studies.sweep import sweep
from bellcrank.studies.sweep_plan import SampleRequest, plan_sweep

FOREIGN = ["²", "٣", "１２", "1_000", "½", "Ⅷ", "一", "0x10", "1e", "1..2", "--1", "+-1", "", " ", "e5", "1,5"]


@pytest.mark.parametrize("text", FOREIGN)
def test_only_ascii_digits_make_a_number(text):
    assert whole_number(text) is None
    with pytest.raises(ValueError, match=r"number|convert"):
        decimal_number(text)
    with pytest.raises(ValueError, match="number"):
        parse_number(text, "")


def test_numbers_of_texts_are_those_of_float_and_int():
    draw = random.Random(3)
    for _ in range(500):
        value = draw.choice([-1, 1]) * draw.random() * 10.0 ** draw.randint(-320, 308)
        text = draw.choice([repr(value), f"{value:+.3e}", f" {value!r} "])
        assert decimal_number(text) == float(text) == parse_number(text, "")
        assert split_number(f"{text} deg") == (float(text), "deg")
        count = draw.randrange(-(10**30), 10**30)
        assert whole_number(f" {count:+d}") == count
    assert decimal_number("\u00a01.5\u00a0") == 1.5  # as spreadsheets write it
    assert whole_number("1" * 5000) > 10**99 and whole_number("-" + "9" * 5000) < -(10**99)
    assert whole_number("0" * 5000 + "7") == 7
    assert split_number("1" * 5000) == (math.inf, "")


WRONG = ["²00", "٣", "1_000", "nan", "inf", "-inf", "1e400", "-1", "0", "", "x", "1" * 5000, "1e", "[1]"]
OPTIONS = [
    ("simulate", "--samples", "1e12"),
    ("simulate", "--duration", ""),
    ("simulate", "--step", ""),
    ("simulate", "--rtol", ""),
    ("simulate", "--atol", ""),
    ("sweep --vary crank_length=1.2,1.3", "--threads", "100000"),
    ("replay --gif x.gif", "--fps", "60"),
    ("replay --gif x.gif", "--speed", ""),
    ("replay --mp4 x.mp4", "--fps", "61"),
    ("size", "--mass-tolerance", "1"),
    ("bench", "--repeats", "10000000"),
    ("bench --dynamics", "--samples", "1e3"),
]


@pytest.mark.parametrize(("command", "option", "more"), OPTIONS)
def test_a_wrong_number_is_refused_by_the_name_of_its_option(command, option, more, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    name, *rest = command.split()
    subject = [] if name == "bench" else ["planar_2r" if name == "size" else "four_bar"]
    allowed = {"--mass-tolerance": {"0"}}.get(option, set())
    for text in [text for text in [*WRONG, more] if text not in allowed]:
        if not text and text is more:
            continue
        assert main([name, *subject, *rest, f"{option}={text}"]) == 2, text
        said = capsys.readouterr().err
        assert said.startswith(f"bellcrank: {option} ") and said.count("\n") == 1 and len(said) < 400, said
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "text", ["²00x300", "300x²00", "300", "300x", "x300", "63x300", "300x4097", "1_0x300", "300x30x3"]
)
def test_a_window_is_two_whole_numbers_of_pixels(text, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["replay", "pendulum", "--png", "a.png", f"--window={text}"]) == 2
    assert capsys.readouterr().err.startswith(f"bellcrank: --window '{text}': expected WIDTHxHEIGHT")


def test_a_film_of_a_number_of_frames_that_no_integer_holds_is_refused():
    from bellcrank.replays.page.rendering import MOST_FRAMES, _frame_count

    for speed in (5e-324, 1e-300, 1e-3):
        with pytest.raises(InputError, match="frames, the most is 5000"):
            _frame_count("a.gif", 10.0, speed, 15.0)
    assert _frame_count("a.gif", 10.0, 1.0, 15.0) == 151 and _frame_count("a.gif", 0.0, 1.0, 15.0) == 2
    assert _frame_count("a.gif", MOST_FRAMES - 1.0, 1.0, 1.0) == MOST_FRAMES


YAML = [
    "!!int ''", "!!int 'x'", "!!float ''", "!!bool foo", "!!binary '*é'", "*nothing", "{", "[" * 500,
    "1" * 5000, "!unknown x", "a: b: c", "\x00", "'", "%TAG ! x", "<<: 5", "!!python/name:os.system",
]  # fmt: skip


@pytest.mark.parametrize("text", YAML)
def test_what_is_no_yaml_on_a_command_line_is_one_sentence(text):
    for read in (
        lambda: read_value(text, "here"),
        lambda: parse_assignment(f"name={text}"),
        lambda: parse_axis(f"crank_length={text}"),
    ):
        with pytest.raises(InputError) as refused:
            read()
        assert "\n" not in str(refused.value) and len(str(refused.value)) < 400


def test_a_name_that_looks_like_a_date_stays_a_text():
    assert parse_assignment("name=2020-99-99") == ("name", "2020-99-99")
    assert parse_assignment("name=2020-01-01T25:61:61Z") == ("name", "2020-01-01T25:61:61Z")
    with pytest.raises(InputError, match="crank_length"):
        sweep("four_bar", dict([parse_axis("crank_length=2020-99-99")]))


@pytest.mark.parametrize("value", [b"text", {1, 2}, frozenset()])
def test_what_yaml_cannot_hold_is_no_override(value):
    with pytest.raises(InputError, match="override 'name'"):
        bc.load_scene("pendulum").with_overrides({"name": value})


def test_a_grid_too_large_to_keep_is_refused_before_it_is_made(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    many = ["--vary=crank_length=1.2:1.3:1000000", "--vary=initial.crank=1:2:1000000"]
    assert main(["sweep", "four_bar", *many]) == 2
    assert "the grid has 1000000000000 designs" in capsys.readouterr().err
    for count in ("1000000000000", "1" * 5000, "1e3", "0", "-1", "²", "٣", "1_0", "1.5"):
        assert main(["sweep", "four_bar", f"--vary=crank_length=1.2:1.3:{count}"]) == 2
        said = capsys.readouterr().err
        assert said.startswith("bellcrank: --vary '") and len(said) < 400
    with pytest.raises(InputError, match="at most 1000000 values"):
        sweep("four_bar", {"crank_length": itertools.count(1)})
    with pytest.raises(InputError, match="threads"):
        sweep("four_bar", {"crank_length": [1.2, 1.3]}, threads=100_000)
    monkeypatch.setattr("bellcrank.memory.free_memory", lambda: 10**9)
    with pytest.raises(
        InputError, match=r"5000000 designs need about 2.08 GB of memory, 1 GB are free; at most 2403846 fit"
    ):
        sweep(
            "four_bar",
            {"crank_length": np.linspace(1.2, 1.3, 50_000), "initial.crank": [f"{k} deg" for k in range(100)]},
        )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ends", ["1e309:1", "1:-1e309", "-1e308:1e308"])
def test_ends_of_a_range_that_doubles_cannot_hold_are_refused(ends):
    with pytest.raises(InputError, match="finite ends"):
        parse_axis(f"crank_length={ends}:3")


def test_a_range_of_one_value_has_one_end():
    assert parse_axis("crank_length=1.2:1.2:1")[1].numbers.tolist() == [1.2]
    with pytest.raises(InputError, match="count must be at least 2"):
        parse_axis("crank_length=1.2:1.3:1")


def test_one_value_of_a_parameter_is_enough_to_check_it_and_the_values_of_other_paths_are_counted():
    scene = bc.load_scene("four_bar").with_overrides({"simulate.duration": 0.01, "simulate.samples": 2})
    seen = []
    result = sweep(scene, {"crank_length": [1.21, 1.22, 1.23]}, checking=lambda done, of: seen.append((done, of)))
    assert seen == [(0, 3)] and result.complete
    seen.clear()
    sweep(scene, {"simulate.rtol": [1e-6, 1e-7, 1e-8]}, checking=lambda done, of: seen.append((done, of)))
    assert seen == [(0, 3), (1, 3), (2, 3)]
    seen.clear()
    plan_sweep(scene, {"initial.crank": "0.01:0.02:1000000"}, SampleRequest(), lambda done, of: seen.append((done, of)))
    assert seen[-1] == (63, 64)  # of very many values some are tried
    with pytest.raises(InputError, match=r"rtol.*\(64 values of this axis were tried, and none is accepted\)"):
        sweep(scene, {"simulate.rtol": "2:3:100000"})
    with pytest.raises(InputError, match="changes the equations"):
        sweep(scene, {"gravity": [[0, 0, 0], [0, 0, -9.81]]})


@pytest.mark.tier2
def test_where_the_system_starts_few_threads_these_run_all_designs():
    """A thread takes 8 MB of addresses for its stack, and std::thread throws where there is no room for them."""
    script = (
        "import resource, bellcrank as bc\n"
        "scene = bc.load_scene('four_bar', {'simulate.duration': 0.01, 'simulate.samples': 2})\n"
        "vary = {'crank_length': '1.2:1.3:20000'}\n"
        "known = bc.sweep(scene, vary, threads=1)\n"
        "size = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        "resource.setrlimit(resource.RLIMIT_AS, (size + 500_000_000,) * 2)\n"
        "found = bc.sweep(scene, vary, threads=1000)\n"
        "assert (found.column('end.crank') == known.column('end.crank')).all()\n"
        "print(len(found))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout) == (0, "20000\n"), done.stderr[-2000:]


def test_values_of_a_grid_are_all_combinations_the_last_axis_fastest():
    scene = bc.load_scene("four_bar").with_overrides({"simulate.duration": 0.01, "simulate.samples": 2})
    result = sweep(scene, {"crank_length": [1.21, 1.22], "initial.crank": ["1 deg", "2 deg", "3 deg"]}, threads=1000)
    expected = list(itertools.product([1.21, 1.22], [1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(result.values, expected)


@pytest.mark.tier2
def test_what_is_chosen_of_a_configuration_sizes_as_the_configuration():
    scene = bc.load_scene("planar_2r")
    motions = [scene.motion(name) for name in scene.motions]
    assert bc.size(scene.robot, motions, scene.actuators).joints == bc.size("planar_2r").joints
    assert bc.size(scene, scene.motions[:1]).motions == scene.motions[:1]
    with pytest.raises(InputError, match="nowhere"):
        bc.size(scene, ["nowhere"])


@pytest.mark.parametrize("name", ["a" * 5000, "a" * 300, "x\x1b[31my", "x\ny", "x\u202ey", "\udcff", "a/" * 3000, "\0"])
def test_a_name_of_any_letters_is_told_in_one_short_line_without_control_characters(
    name, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    commands = (
        ["check", name], ["simulate", name], ["size", "planar_2r", f"--motion={name}"], ["report", name],
        ["simulate", "pendulum", f"--set={name}=1"], ["sweep", "four_bar", f"--vary={name}=1,2"],
        ["simulate", "pendulum", f"--frame={name}"], ["size", "planar_2r", f"--payload=1@{name}"], ["verify", name],
    )  # fmt: skip
    for command in commands:
        assert main(command) == 2, command[:2]
        said = capsys.readouterr().err
        assert said.startswith("bellcrank: ") and said.count("\n") == 1 and len(said) < 1300
        assert not {"\x1b", "\u202e", "\0"} & set(said)
