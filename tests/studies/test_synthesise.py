"""Four-bars through given points: a classical path, linkages from their own coupler points, and their scenes."""

import json

import numpy as np
import pytest
from random_four_bars import curve_distance, random_target

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import InputError
from bellcrank.studies.synthesis.four_bar import coupler_curve, fit, lengths_of, shape_bounds

# The 18 points of the classical timed path, m; the crank turns by 20 deg from one to the next. As collected by
# Nguyen-Van et al., Symmetry 14 (2022) 381, whose best error of linkages is 0.0161 m².
PATH = [
    (0.5, 1.1), (0.4, 1.1), (0.3, 1.1), (0.2, 1.0), (0.1, 0.9), (0.05, 0.75), (0.02, 0.6), (0.0, 0.5), (0.0, 0.4),
    (0.03, 0.3), (0.1, 0.25), (0.15, 0.2), (0.2, 0.3), (0.3, 0.4), (0.4, 0.5), (0.5, 0.7), (0.6, 0.9), (0.6, 1.0),
]  # fmt: skip
BEST = 0.009799  # m²: the least error known of a multi-start search that requires assembly and a crank


def by_newton(linkage, angles):
    """Coupler points (n, 2) by Newton's method on the loop, each posture from the one before: the same branch."""
    ground = linkage.ground * np.exp(1j * linkage.ground_angle)
    start, tip = linkage.postures(angles[:1])
    coupler, rocker = np.angle(tip - start)[0], np.angle(tip - complex(*linkage.pivot) - ground)[0]
    found = []
    for angle in angles:
        crank = linkage.crank * np.exp(1j * (angle + linkage.ground_angle))
        for _ in range(30):
            gap = crank + linkage.coupler * np.exp(1j * coupler) - ground - linkage.rocker * np.exp(1j * rocker)
            columns = np.array(
                [1j * linkage.coupler * np.exp(1j * coupler), -1j * linkage.rocker * np.exp(1j * rocker)]
            )
            step = np.linalg.solve(np.array([columns.real, columns.imag]), -np.array([gap.real, gap.imag]))
            coupler, rocker = coupler + step[0], rocker + step[1]
        assert abs(gap) < 1e-10 * linkage.ground
        point = complex(*linkage.pivot) + crank + complex(*linkage.point) * np.exp(1j * coupler)
        found.append((point.real, point.imag))
    return np.array(found)


@pytest.mark.parametrize(
    "seed", [0, 1, pytest.param(2, marks=pytest.mark.tier2), pytest.param(3, marks=pytest.mark.tier2)]
)
def test_the_classical_18_points_are_passed_as_near_as_is_known(seed) -> None:
    found = bc.synthesise("four_bar", PATH, "20 deg", transmission_angle=0, seed=seed)
    assert found.error <= BEST
    for linkage in found.linkages:
        assert linkage.assembles
        gaps = by_newton(linkage, linkage.angles) - PATH
        assert (gaps**2).sum() == pytest.approx(linkage.error, rel=1e-9)
        assert np.diff(linkage.angles) == pytest.approx(np.deg2rad(20.0))


def test_each_linkage_assembles_through_the_whole_turn_by_newtons_method() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    for linkage in bc.synthesise("four_bar", PATH, "20 deg").linkages[:4]:
        again = by_newton(linkage, turn)
        assert np.abs(again - linkage.path(turn)).max() < 1e-9
        assert again[-1] == pytest.approx(again[0], abs=1e-9)
        links = sorted([linkage.ground, linkage.crank, linkage.coupler, linkage.rocker])
        assert links[0] == linkage.crank and links[0] + links[3] < links[1] + links[2]


def test_the_transmission_angle_is_kept_and_said_where_it_decides() -> None:
    found = bc.synthesise("four_bar", PATH, "20 deg", transmission_angle="40 deg")
    assert all(np.rad2deg(linkage.transmission_angle) >= 40.0 - 1e-4 for linkage in found.linkages)
    assert any("at its limit" in note for note in found.notes)
    free = bc.synthesise("four_bar", PATH, "20 deg", transmission_angle=0)
    assert free.error < found.error


@pytest.mark.parametrize("timed", [True, False])
def test_linkages_are_found_again_from_their_own_coupler_points(timed) -> None:
    for k in range(3):
        target = random_target(np.random.default_rng([11, k]), timed)
        timing = target.angles if timed else None
        found = bc.synthesise("four_bar", target.points, timing, transmission_angle=0)
        assert curve_distance(target.linkage, found.best) < 1e-8


@pytest.mark.tier2
@pytest.mark.parametrize(("timed", "share"), [(True, 0.95), (False, 0.8)])
def test_most_of_forty_linkages_are_found_again(timed, share) -> None:
    good = 0
    for k in range(40):
        target = random_target(np.random.default_rng([12, k]), timed)
        found = bc.synthesise("four_bar", target.points, target.angles if timed else None, transmission_angle=0)
        good += curve_distance(target.linkage, found.best) < 1e-8
    assert good >= share * 40


def test_a_clockwise_crank_is_found_from_falling_angles() -> None:
    target = random_target(np.random.default_rng(5), True)
    found = bc.synthesise("four_bar", target.points[::-1], "-18 deg", transmission_angle=0)
    assert curve_distance(target.linkage, found.best) < 1e-8
    assert (np.diff(found.best.angles) < 0.0).all()


def test_derivatives_of_the_fit_are_those_of_differences() -> None:
    rng, least, step = np.random.default_rng(0), 0.3, 1e-6
    lower, upper = shape_bounds(least)
    shape = lower + (upper - lower) * rng.uniform(0.2, 0.8, (4, 3))
    crank, branch = rng.uniform(0.0, 6.0, (4, 18)), np.array([1.0, -1.0, 1.0, -1.0])
    points = rng.normal(size=18) + 1j * rng.normal(size=18)
    found = fit(shape, crank, branch, points, least)

    def model(shape, crank):
        links = lengths_of(shape, least).links
        return np.array([coupler_curve(links[k], branch[k], found.placement[k], crank[k]) for k in range(len(shape))])

    for column, move in enumerate([None, *np.eye(3)]):
        if move is None:
            change = model(shape, crank + step) - model(shape, crank - step)
        else:
            change = model(shape + step * move, crank) - model(shape - step * move, crank)
        assert np.abs(change / (2.0 * step) + found.slopes[:, :, column]).max() < 1e-6


def test_the_scene_moves_the_coupler_point_along_the_path_and_replays(tmp_path) -> None:
    found = bc.synthesise("four_bar", PATH, "20 deg")
    scene = bc.load_scene(found.write_config(tmp_path / "linkage.yaml"))
    run = bc.simulate(scene, samples=37)
    assert run.constraint_residual() < 1e-8
    crank = run.joint("crank").position
    assert crank[-1] - crank[0] == pytest.approx(2.0 * np.pi)
    assert np.abs(run.output("point")[:, :2] - found.best.path(crank)).max() < 1e-8
    assert bc.replay(run, tmp_path / "page.html").stat().st_size > 1000
    assert bc.size(scene).joint("crank").peak_torque > 0.0


def test_the_same_seed_gives_the_same_linkages() -> None:
    first, second = (bc.synthesise("four_bar", PATH, "20 deg", seed=4) for _ in range(2))
    assert first.as_dict() == second.as_dict()


def test_the_command_reads_points_with_units_and_writes_the_scene(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    rows = [f"{1000.0 * x},{y},{20 * k}" for k, (x, y) in enumerate(PATH)]
    (tmp_path / "path.csv").write_text("\n".join(["x [mm],y [m],crank [deg]", *rows]))
    assert main(["synthesise", "path.csv", "--no-plots", "--transmission-angle", "0"]) == 0
    assert "crank-rockers" in capsys.readouterr().out
    folder = tmp_path / "path_synthesis"
    written = json.loads((folder / "synthesis.json").read_text())
    assert 18 * written["rms_distance"] ** 2 <= BEST
    assert bc.load_scene(folder / "linkage.yaml").parameters["crank_length"].value == written["linkages"][0]["crank"]
    assert main(["synthesise", "path.csv", "--timing", "20 deg"]) == 2
    assert "has a column 'crank' already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("named", "message"),
    [
        ({"linkage": "six_bar"}, "unknown choice 'six_bar'"),
        ({"points": PATH[:3]}, "argument 'points': expected 4 to 500 points"),
        ({"points": [(1.0, 1.0)] * 6}, "points that differ"),
        ({"points": [(1e8 + 0.001 * x, y) for x, y in 1e-3 * np.array(PATH)]}, "far from the origin, rounding"),
        ({"points": 1e200 * np.array(PATH)}, "coordinates up to 1e+09 m, found 1.1e+200 m"),
        ({"points": [*PATH[:-1], (float("nan"), 1.0)]}, "found nan at entry 17, 0"),
        ({"points": [1.0, 2.0]}, "an array of shape (n, 2)"),
        ({"timing": "25 deg"}, "stay within one turn, found 0 to 425 deg"),
        ({"timing": "20 mm"}, "argument 'timing': expected an angle in rad"),
        ({"timing": [0.0, 1.0]}, "18 numbers"),
        ({"transmission_angle": "90 deg"}, "an angle from 0 to less than 90 deg"),
        ({"transmission_angle": "30 kg"}, "argument 'transmission_angle': expected an angle in rad"),
        ({"seed": -1}, "argument 'seed': expected a whole number of at least 0"),
    ],
)
def test_bad_input_is_one_sentence(named, message) -> None:
    given = {"linkage": "four_bar", "points": PATH, "timing": "20 deg"} | named
    with pytest.raises(InputError) as caught:
        bc.synthesise(**given)
    assert message in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x [m]\n1\n2\n", "there is no column 'y [m]'"),
        ("x [m],y [kg]\n1,2\n", "column 'y' is in 'kg'"),
        ("x [m],y [m]\n1,\n", "expected a number, found an empty cell"),
        ("x [m],y [m],z [m]\n1,2,3\n", "unknown column 'z'"),
        ("", "the file is empty; expected a header 'x [m],y [m]' and rows of points"),
        ("x [m],y [m]\n", "path.csv: expected 4 to 500 points, found 0"),
        ("x [m],y [m],crank [deg]\n1,2,0\n2,3,0\n4,5,3\n7,1,4\n", "path.csv: column 'crank': expected angles that"),
    ],
)
def test_a_wrong_file_of_points_is_one_sentence(text, message, tmp_path, capsys) -> None:
    (tmp_path / "path.csv").write_text(text)
    assert main(["synthesise", str(tmp_path / "path.csv"), "--out", str(tmp_path / "o")]) == 2
    assert message in capsys.readouterr().err


def test_points_that_no_linkage_passes_in_order_are_said_in_words_exit_code_and_json(tmp_path, capsys) -> None:
    (tmp_path / "path.csv").write_text("x [m],y [m]\n" + "0,0\n1,1\n0,1\n1,0\n" * 4)
    assert main(["synthesise", str(tmp_path / "path.csv"), "--out", str(tmp_path / "o")]) == 1
    assert "no four-bar was found that passes the points in their order" in capsys.readouterr().err
    written = json.loads((tmp_path / "o/synthesis.json").read_text())
    assert written["linkages"] == [] and "no four-bar was found" in written["status"]
