"""Regular expressions take a time that grows as their input does, whatever somebody writes into it."""

import importlib
import pkgutil
import re
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import bellcrank
from bellcrank.config.fields import parse_number
from bellcrank.present.plot_style import _BREAK
from bellcrank.replays.geometry.meshes import named_files
from bellcrank.robot.formats.urdf_elements import NUMBER
from bellcrank.scene.scene import load_scene
from bellcrank.studies.designs.axes import parse_axis, read_axis

# what patterns begin with or repeat; each text of them ends with what spoils a match
PIECES = [
    " ", "\n", "\r", "1", "a", "_", "[", "[ ", "x[", "] [", "<", "<?xml", "encoding=", "encoding ", "encoding='", " =",
    '"', "\\", '\\"', ' d="', ".", "1.", "_tool", "_end", "solid", "\n solid", "\n ", "x ", " \n", " position q",
    "<mimic ", "history_a", ".csv", "1e", "-", "{{", "{{a", "\x1b[A", "é",
]  # fmt: skip
STARTS, END = ["", "1 x", "<?xml ", "x ["], "\0!"
SIZE = 20_000  # characters: quadratic searches of a few of these take minutes, linear ones of all some seconds
SCRIPT = f"""
    import re, resource, sys
    resource.setrlimit(resource.RLIMIT_CPU, (int(sys.argv[1]), int(sys.argv[1]) + 1))
    for pattern, flags in eval(sys.stdin.read()):
        print(pattern, file=sys.stderr, flush=True)
        compiled = re.compile(pattern, flags)
        for piece in {PIECES!r}:
            for start in {STARTS!r}:
                text = start + (piece * {SIZE})[:{SIZE}] + {END!r}
                text = text.encode() if isinstance(pattern, bytes) else text
                compiled.search(text), compiled.fullmatch(text)
            compiled.sub(text[:0], text)
"""


def come_to_their_end(patterns, seconds):
    """Searches long texts for patterns, (pattern, flags) each, in a process with a limit of CPU time, s."""
    script, given = textwrap.dedent(SCRIPT), repr([(p, int(flags)) for p, flags in patterns])
    command = [sys.executable, "-c", script, str(seconds)]
    return subprocess.run(command, input=given, capture_output=True, text=True, timeout=600)


@pytest.mark.tier2
def test_every_pattern_of_the_package_comes_to_its_end_on_long_texts():
    found = set()
    for module in pkgutil.walk_packages(bellcrank.__path__, "bellcrank."):
        if "._" not in module.name:
            for value in vars(importlib.import_module(module.name)).values():
                if isinstance(value, re.Pattern):
                    found.add((value.pattern, value.flags))
    assert len(found) >= 15
    done = come_to_their_end(found, 120)
    assert done.returncode == 0, done.stderr[-300:]


@pytest.mark.tier2
def test_patterns_that_are_not_linear_do_not_come_to_their_end():
    """These were in the package, for numbers with units and for the lines of a picture."""
    for pattern in (r"([-+]?(?:\d+\.?\d*))\s*(.*?)\s*\Z", r"\s*\n"):
        assert come_to_their_end([(pattern, re.DOTALL)], 2).returncode == -signal.SIGXCPU


def test_patterns_stand_in_modules_by_name_where_the_test_above_finds_them():
    written = re.compile(r"\bre\.(?!compile|Pattern|Match|[A-Z]+\b)\w+\(")
    for file in Path(bellcrank.__path__[0]).rglob("*.py"):
        assert not written.search(file.read_text(encoding="utf-8")), file


@pytest.mark.parametrize("count", [10**5, 10**6])
def test_long_texts_are_read_or_refused(count):
    for text in ("1 x" + " " * count + "y", "1" * count + "x", " " * count, "." * count):
        with pytest.raises(ValueError, match="expected"):
            parse_number(text, "rad")
        assert NUMBER.fullmatch(text) is None
    with pytest.raises(bellcrank.InputError):
        read_axis(load_scene("four_bar"), "crank_length", parse_axis("crank_length=1 x" + " " * count + "y")[1])
    assert named_files(b"map_Kd " + b" " * count, ".mtl") == ()
    assert named_files(b"map_Kd " + b"a " * (count // 2), ".mtl") == (("a " * (count // 2))[:-1],)
    assert named_files(b"mtllib " + b" " * count + b"x", ".obj") == ("x",)
    dae = b"<COLLADA><ref>" + b" " * count + b"a" + b" " * count + b"</ref></COLLADA>"
    assert named_files(dae, ".dae") == ("a",)


def test_lines_of_a_picture_are_folded_as_before_also_with_many_blanks():
    text = "a  \n\n \t b c  d\n"
    assert _BREAK.sub(" ", text) == re.sub(r"\s*\n\s*", " ", text) == "a b c  d "
    assert _BREAK.sub(" ", "a" + " " * 10**6 + "b") == "a" + " " * 10**6 + "b"
