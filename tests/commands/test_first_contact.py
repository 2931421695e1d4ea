"""What a newcomer meets first: bellcrank alone, demo, doctor and completion, and a clear word where a part is wrong."""

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys

import pytest

from bellcrank.cli import main
from bellcrank.codegen import tracer
from bellcrank.commands import doctor as doctor_command
from bellcrank.commands.demo import DEMONSTRATIONS
from bellcrank.commands.parser import COMMANDS
from bellcrank.errors import BellcrankError, InputError
from bellcrank.robot import catalog


def doctor(capsys):
    """Exit code, and the text in one line a paragraph."""
    status = main(["doctor"])
    text = capsys.readouterr().out
    return status, re.sub(r"\n {4,}", " ", text)


def test_bellcrank_alone_says_in_ten_lines_what_it_can_do(capsys):
    assert main([]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 10 and max(map(len, lines)) <= 120
    named = {match for line in lines for match in re.findall(r"^  bellcrank (\w+)", line)}
    assert {"size", "simulate", "demo", "doctor"} <= named <= set(COMMANDS)


def test_an_unknown_command_or_value_suggests_the_nearest(capsys):
    for given, expected in {
        ("sizee", "x"): "unknown command 'sizee'; did you mean 'size'? (expected: size, select",
        ("select", "x", "--objective", "masss"): "unknown value 'masss'; did you mean 'mass'? (expected: mass, cost",
    }.items():
        with pytest.raises(SystemExit, match="2"):
            main(list(given))
        assert expected in capsys.readouterr().err


# ---- doctor


def test_doctor_finds_nothing_wrong_here_and_names_versions_processor_and_cache(capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("BELLCRANK_CACHE", str(tmp_path))
    status, text = doctor(capsys)
    assert status == 0
    for subject in ("bellcrank", "Python", "packages", "casadi", "extensions", "processor", "compiling", "cache"):
        assert re.search(rf"^  {subject} ", text, re.MULTILINE), subject
    assert importlib.metadata.version("casadi") in text and str(tmp_path) in text
    assert "numbers at a time" in text and "planar_2r was traced" in text


def test_another_casadi_than_that_of_the_build_is_a_fault_with_its_remedy(capsys, monkeypatch):
    real = importlib.metadata.version
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "3.6.0" if name == "casadi" else real(name))
    status, text = doctor(capsys)
    assert status == 1
    assert re.search(r"^! casadi +casadi 3\.6\.0 is installed", text, re.MULTILINE)
    assert f"! casadi: pip install casadi=={tracer.CASADI_VERSION}" in text
    assert "! compiling: mend casadi first" in text and "does not work: 2 fault(s)" in text


def test_a_casadi_that_cannot_be_loaded_is_a_fault_with_its_remedy(tmp_path):
    """A fresh process, which finds a package casadi without its library before the real one."""
    (tmp_path / "casadi").mkdir()
    (tmp_path / "casadi" / "__init__.py").write_text(
        "raise ImportError('libcasadi.so: cannot open shared object file')"
    )
    paths = [str(tmp_path), *([os.environ["PYTHONPATH"]] if "PYTHONPATH" in os.environ else [])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, "-m", "bellcrank", "doctor"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    text = re.sub(r"\n {4,}", " ", done.stdout)
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert re.search(r"^! casadi .*libcasadi\.so: cannot open", text, re.MULTILINE)
    assert f"! casadi: pip install --force-reinstall casadi=={tracer.CASADI_VERSION}" in text


def test_tracing_with_another_casadi_is_refused_before_its_library_is_called(monkeypatch):
    real = importlib.metadata.version
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "3.7.2" if name == "casadi" else real(name))
    tracer.extension.cache_clear()
    with pytest.raises(BellcrankError, match=r"casadi 3\.7\.2 is installed.*built with casadi .*pip install casadi=="):
        tracer.extension()
    monkeypatch.undo()
    assert tracer.extension() is not None


def test_a_cache_that_cannot_be_written_is_told_apart_and_does_not_stop_the_work(capsys, tmp_path, monkeypatch):
    place = tmp_path / "file"
    place.write_text("not a folder")
    monkeypatch.setenv("BELLCRANK_CACHE", str(place))
    status, text = doctor(capsys)
    assert status == 0
    assert re.search(rf"^- cache +is not used.*{place}", text, re.MULTILINE)
    assert "- cache: let BELLCRANK_CACHE name a folder" in text
    assert not re.search("^! ", text, re.MULTILINE)


def test_a_missing_browser_is_told_apart_and_does_not_stop_the_work(capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    status, text = doctor(capsys)
    assert status == 0
    assert re.search("^- browser +none of chromium", text, re.MULTILINE)
    assert "- browser: install one" in text and "- cache" not in text


def test_a_package_that_is_missing_or_out_of_range_is_a_fault(monkeypatch):
    monkeypatch.setattr(
        doctor_command,
        "_requirements",
        lambda: [("numpy", "numpy>=99", ""), ("no-such-package", "no-such-package>=1", ""), ("scipy", "scipy", "")],
    )
    found = {it.subject: it for it in doctor_command._packages()}
    assert found["numpy"].state == "fault" and "expected: numpy>=99" in found["numpy"].text
    assert found["no-such-package"].text == "is not installed"
    assert found["packages"].text.startswith("scipy ")


def test_without_example_robot_data_only_its_robots_are_missing(monkeypatch):
    """The rest works: the package holds no more than robots."""
    monkeypatch.setattr(
        doctor_command, "_requirements", lambda: [("example-robot-data", "example-robot-data>=6,<7", "")]
    )
    monkeypatch.setattr(doctor_command, "_installed", lambda name: None)
    assert [it.state for it in doctor_command._packages()] == ["missing", "ok"]
    monkeypatch.setattr(catalog, "example_folders", lambda: ())
    monkeypatch.setattr(catalog, "_examples", dict)  # it is kept for the whole process
    with pytest.raises(InputError, match=r"unknown robot 'ur5'.*pip install example-robot-data"):
        catalog.find_urdf("ur5")


def test_a_fault_of_one_look_does_not_hide_the_others(monkeypatch):
    def broken():
        raise RuntimeError("broken")

    monkeypatch.setattr(doctor_command, "_processor", broken)
    found = {it.subject: it for it in doctor_command.findings()}
    assert found["processor"].state == "fault" and "broken" in found["processor"].text
    assert found["compiling"].state == "ok"


# ---- completion


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_prints_a_script_with_every_command(shell, capsys):
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    assert all(name in script for name in COMMANDS) and "four_bar" in script
    if program := shutil.which(shell):
        subprocess.run([program, "-n"], input=script, text=True, check=True)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["si"], {"size", "simulate"}),
        (["simulate", "four"], {"four_bar"}),
        (["size", "--payl"], {"--payload"}),
        (["completion", ""], {"bash", "zsh", "fish", "tcsh"}),
        (["simulate", "four_bar", "--solver", "R"], {"RK45", "RK4", "Radau"}),
        (["sweep", "four_bar", "--method", ""], {"sobol", "latin", "random"}),
        (["size", "planar_2r", "--motion", "mot"], {"motion.csv"}),
        (["plot", "run", "--out", "mot"], {"motion.csv"}),
    ],
)
def test_bash_completes_commands_names_and_options(words, expected, capsys, tmp_path):
    main(["completion", "bash"])
    (tmp_path / "motion.csv").touch()
    script = tmp_path / "completion.bash"
    script.write_text(capsys.readouterr().out)
    line = " ".join(f"'{word}'" for word in ["bellcrank", *words])
    ask = f"""
        source {script}
        COMP_WORDS=({line}); COMP_CWORD={len(words)}; COMPREPLY=()
        $(complete -p bellcrank | sed 's/.*-F \\([^ ]*\\).*/\\1/') bellcrank "${{COMP_WORDS[-1]}}" "${{COMP_WORDS[-2]}}"
        printf '%s\\n' "${{COMPREPLY[@]}}"
    """
    out = subprocess.run(["bash", "-c", ask], capture_output=True, text=True, check=True, cwd=tmp_path).stdout
    assert {word.strip() for word in out.splitlines()} == expected


# ---- demo


@pytest.mark.tier2
def test_demo_writes_a_gallery_whose_pages_are_there(capsys, tmp_path):
    out = tmp_path / "gallery"
    assert main(["demo", "--out", str(out)]) == 0
    index = (out / "index.html").read_text(encoding="utf-8")
    pages = set(re.findall(r'(?:src|href)="([^"]+)"', index))
    assert pages == {file.name for file in out.iterdir()} - {"index.html"}
    assert len(re.findall("<iframe ", index)) == len(DEMONSTRATIONS)
    assert "energy drift" in index and "tightest margin" in index
    assert str(out / "index.html") in capsys.readouterr().out


def test_demo_refuses_a_place_that_is_a_file_before_it_computes(capsys, tmp_path):
    place = tmp_path / "file"
    place.write_text("")
    assert main(["demo", "--out", str(place)]) == 2
    assert "--out" in capsys.readouterr().err
