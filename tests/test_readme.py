"""What the README shows is what happens."""

import re
from pathlib import Path

import pytest

from bellcrank.cli import main

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


def test_the_python_example_runs(capsys):
    (script,) = blocks("python")
    exec(compile(script, "README.md", "exec"), {})
    assert float(capsys.readouterr().out) == pytest.approx(45, abs=5)


def test_the_card_and_the_motion_are_sized(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (card,), (motion,) = blocks("yaml"), blocks("csv")
    Path("arm.yaml").write_text(card)
    Path("motion.csv").write_text(motion)
    assert main(["size", "arm.yaml", "--no-plots"]) in (0, 1)
    text = capsys.readouterr().out
    assert all(name in text for name in ("circle", "reach", "swing", "cycle"))
    assert main(["size", "planar_2r", "--motion", "motion.csv", "--no-plots"]) in (0, 1)
    assert Path("planar_2r_sizing/history_motion.csv").exists()


def test_every_command_it_names_exists(capsys):
    for command in re.findall(r"^\| `bellcrank (\w+)", README, re.MULTILINE):
        with pytest.raises(SystemExit) as ended:
            main([command, "--help"])
        assert ended.value.code == 0
