"""`bellcrank modes`: what it prints and writes, its exit codes, and the page."""

import json
import re

import numpy as np
import pytest
from scipy.io import loadmat

from bellcrank.cli import main
from tests.support.benchmark_bicycle import REAR_RADIUS, published_eigenvalues, write_bicycle

pytest_plugins = ("browser",)


def run(capsys, *arguments):
    code = main(["modes", *map(str, arguments)])
    output = capsys.readouterr()
    return code, output.out, output.err


@pytest.mark.tier2
def test_a_stable_scene_with_root_loci(tmp_path, capsys):
    out = tmp_path / "out"
    vary = "forces.spring.stiffness=5:45:5"
    code, text, _ = run(capsys, "spring_pendulum", "--at", "equilibrium", "--vary", vary, "--out", out)
    assert code == 0 and text.startswith("Spring pendulum: equilibrium, stable\nposition q: 0, 6.308\n")
    assert {path.name for path in out.iterdir()} == {
        "modes.json", "modes.mat", "modes.html", "root_loci.png", "root_loci.csv", "root_loci.json",
    }  # fmt: skip
    data = json.loads((out / "root_loci.json").read_text())
    assert data["values"] == [5.0, 15.0, 25.0, 35.0, 45.0]
    # along the spring λ² = −k/m, m = 2 kg
    for value, row in zip(data["values"], data["eigenvalues"], strict=True):
        assert np.abs(np.array([im for _, im in row]) - np.sqrt(value / 2.0)).min() < 1e-12
    assert len((out / "root_loci.csv").read_text().splitlines()) == 6
    page = (out / "modes.html").read_text(encoding="utf-8")
    assert "Stable" in page and '<a href="#t=6&amp;play=1">2</a>' in page and "Eigenvalues over forces" in page
    assert loadmat(out / "modes.mat")["A"].shape == (4, 4)


def test_an_unstable_scene_exits_with_1(tmp_path, capsys):
    code, text, _ = run(capsys, "pendulum", "--set", "initial.swing=179 deg", "--out", tmp_path, "--no-page")
    assert code == 1 and re.search(r"unstable: mode \d grows", text) and not (tmp_path / "modes.html").exists()


@pytest.mark.tier2
def test_the_modes_that_grow_are_named_and_the_page_fits_a_phone(tmp_path, capsys, open_page):
    code, text, _ = run(capsys, "furuta", "--out", tmp_path)
    assert code == 1 and "unstable: modes 1, 2 grow" in text
    page = open_page(tmp_path / "modes.html", size=(390, 844))
    assert page.clean and "2 of 4 modes grow" in page.tab.locator(".verdict").inner_text()
    assert page.do("document.documentElement.scrollWidth") <= 390


def test_a_moment_of_a_motion_exits_with_1(tmp_path, capsys):
    code, text, _ = run(capsys, "planar_2r_swing", "--at", "0.5 s", "--out", tmp_path)
    assert code == 1 and "not steady" in text and "say nothing of stability" in text
    assert json.loads((tmp_path / "modes.json").read_text())["stable"] is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--at", "equilbrium"], "--at: unknown operating point 'equilbrium'; did you mean 'equilibrium'?"),
        (["--at", "1.5", "--vary", "initial.swing=0:1:3"], "--vary: root loci require a steady operating point"),
        (["--vary", "initial.swing=normal(0, 1)"], "found a distribution"),
        (["--input", "swung"], "unknown joint 'swung'"),
        (["--period", "2", "--vary", "initial.swing=0:1:3"], "--period: a periodic motion begins"),
    ],
)
def test_invalid_input_exits_with_2(arguments, message, tmp_path, capsys):
    code, _, error = run(capsys, "pendulum", *arguments, "--out", tmp_path / "out")
    assert code == 2 and message in error and "Traceback" not in error


def test_floquet_multipliers_of_a_period(tmp_path, capsys):
    small = float(2.0 * np.pi / np.sqrt(9.81))
    changes = ["--set", "initial.swing=1e-6 deg"]
    code, text, _ = run(capsys, "pendulum", "--period", repr(small), *changes, "--out", tmp_path)
    assert code == 0 and "Floquet multipliers" in text
    assert json.loads((tmp_path / "modes.json").read_text())["kind"] == "periodic"


@pytest.mark.tier2
def test_the_modes_of_the_bicycle_move_on_their_page(tmp_path, capsys):
    """Positions of the film stay on the floor: the page is made of postures that satisfy the constraints."""
    from bellcrank.analysis.linearise import linearise
    from bellcrank.replays.film.posture_films import SECONDS, film_of_modes
    from bellcrank.scene.scene import load_scene

    scene = load_scene(write_bicycle(tmp_path, 5.0))
    linear = linearise(scene)
    film = film_of_modes(scene, linear)
    assert [event.time for event in film.events] == [k * SECONDS for k in range(len(linear.modes))]
    wheel = [body.name for body in film.bodies].index("rear_wheel")
    heights = film.poses[:, wheel, 2]
    assert heights.max() <= REAR_RADIUS + 1e-9 and heights.min() < REAR_RADIUS - 1e-4  # it leans
    found = [mode.eigenvalue for mode in linear.modes]
    assert all(min(abs(x - y) for y in found) < 1e-10 for x in published_eigenvalues(5.0) if x.imag >= 0.0)
