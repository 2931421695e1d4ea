"""What the README shows is what happens."""

import re
from pathlib import Path

import pytest

from bellcrank.cli import main

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


def test_the_sizing_example_runs(capsys):
    exec(compile(blocks("python")[0], "README.md", "exec"), {})
    assert float(capsys.readouterr().out) == pytest.approx(45, abs=5)


def test_the_simulation_example_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(compile(blocks("python")[1], "README.md", "exec"), {})
    first, second, third = capsys.readouterr().out.splitlines()
    status, slide = first.split()
    assert status == "finished"
    assert float(slide) == pytest.approx(6.70749476, abs=1e-7)  # A. Ghosal's lecture 18, integrated independently
    assert second
    drift, error = map(float, third.split())
    assert drift < 1e-8
    assert 0 < error < 1e-6
    assert {path.name for path in tmp_path.iterdir()} == {"pendulum.npz", "pendulum.csv", "pendulum.png"}


def test_the_scene_is_simulated(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("scene.yaml").write_text(blocks("yaml")[1])
    assert main(["simulate", "scene.yaml", "--no-plots"]) == 0
    assert "event" in capsys.readouterr().out


def test_the_card_and_the_motion_are_sized(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    config, (motion,) = blocks("yaml")[0], blocks("csv")
    Path("arm.yaml").write_text(config)
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
