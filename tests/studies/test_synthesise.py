"""Four-bars through given points: a classical path, linkages from their own coupler points, and their scenes."""

import json

import numpy as np
import pytest
from random_linkages import curve_distance, random_target

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import InputError
from bellcrank.studies.synthesis.four_bar import CrankRockers
from bellcrank.studies.synthesis.placement import PointTask
from bellcrank.studies.synthesis.slider_crank import SliderCranks

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


@pytest.mark.parametrize("timed", [True, False])
def test_linkages_are_found_again_from_the_poses_of_their_couplers(timed, tmp_path) -> None:
    for k in range(3):
        target = random_target(np.random.default_rng([21, k]), timed)
        own, turned = target.linkage, np.angle(target.linkage.directions(target.angles)) + 0.7
        timing = target.angles if timed else None
        found = bc.synthesise("four_bar", target.points, timing, directions=turned, transmission_angle=0)
        assert found.rms_turn < 1e-10
        for name in ("crank", "coupler", "rocker", "ground"):  # no cognate: its coupler turns otherwise
            assert getattr(found.best, name) == pytest.approx(getattr(own, name), rel=1e-9)
        scene = bc.load_scene(found.write_config(tmp_path / f"{k}.yaml"))
        run = bc.simulate(scene, samples=2)
        _, rotation = scene.robot.frame_pose("coupler_point", run.position[0])
        assert rotation[:2, 0] == pytest.approx([np.cos(turned[0]), np.sin(turned[0])], abs=1e-7)


def test_poses_that_no_linkage_takes_are_a_compromise_of_places_and_turns_that_newtons_method_confirms() -> None:
    points = [(0.0, 0.0), (0.3, 0.35), (0.8, 0.5), (1.3, 0.3), (1.5, -0.1), (0.7, -0.3)]
    turned = np.deg2rad([0.0, 10.0, 25.0, 30.0, 20.0, 5.0])
    found = bc.synthesise("four_bar", points, directions=turned)
    free = bc.synthesise("four_bar", points)
    best, size = found.best, np.sqrt(np.var(np.array(points), axis=0).sum())
    assert found.error > free.error and found.rms_turn > 0.0
    gaps = by_newton(best, best.angles) - points
    end, tip = best.postures(best.angles)
    turns = np.angle((tip - end) * np.exp(1j * (best.turn - turned)))
    assert (gaps**2).sum() == pytest.approx(best.error, rel=1e-9)
    assert (turns**2).sum() == pytest.approx(best.turn_error, rel=1e-9) and abs(np.sin(turns).sum()) < 1e-9
    others = [one.error + size**2 * one.turn_error for one in found.linkages]
    assert others == sorted(others)
    assert "RMS turn [deg]" in found.table() and found.as_dict()["rms_turn"] == found.rms_turn


def test_four_points_which_many_linkages_pass_are_passed_and_the_result_says_so() -> None:
    found = bc.synthesise("four_bar", [(0, 0), (1, 0.2), (1.5, 1), (0.4, 1.1)], directions=[0.0, 0.2, 0.5, 0.3])
    assert found.best.assembles and "so few points do not determine a linkage" in " ".join(map(str, found.notes))


def test_a_clockwise_crank_is_found_from_falling_angles() -> None:
    target = random_target(np.random.default_rng(5), True)
    found = bc.synthesise("four_bar", target.points[::-1], "-18 deg", transmission_angle=0)
    assert curve_distance(target.linkage, found.best) < 1e-8
    assert (np.diff(found.best.angles) < 0.0).all()


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("of", [CrankRockers, SliderCranks])
def test_derivatives_of_the_fit_are_those_of_differences(of, turned) -> None:
    rng, step = np.random.default_rng(0), 1e-6
    kind = of(0.3)
    lower, upper = kind.bounds
    shape = lower + (upper - lower) * rng.uniform(0.2, 0.8, (4, len(lower)))
    crank, branch = rng.uniform(0.0, 6.0, (4, 18)), np.array([kind.branches[k % len(kind.branches)] for k in range(4)])
    points = rng.normal(size=18) + 1j * rng.normal(size=18)
    task = PointTask(kind, points, np.exp(1j * rng.normal(size=18)) if turned else None)
    found = task.fit(shape, crank, branch)

    def model(shape, crank):
        ways = kind.turning(shape, crank, branch, False).directions
        pivot, by_crank, by_coupler = (found.placement[:, k, None] for k in range(3))
        whole = pivot + by_crank * np.exp(1j * crank) + by_coupler * ways
        return np.concatenate([whole, found.placement[:, 3:] * ways], axis=1) if turned else whole

    assert np.abs(task.targets - model(shape, crank) - found.residual).max() < 1e-12
    for column, move in enumerate([None, *np.eye(len(lower))]):
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


@pytest.mark.parametrize("linkage", ["four_bar", "slider_crank"])
def test_no_link_is_longer_than_the_limit_and_a_linkage_at_it_is_said_to_be_there(linkage) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    leaf = np.c_[0.3 * np.cos(turn), 0.15 * np.sin(turn) + 0.05 * np.sin(2.0 * turn)]
    free = bc.synthesise(linkage, leaf, "30 deg")
    limit = 0.8 * max(map(abs, free.best.lengths.values()))
    limited = bc.synthesise(linkage, leaf, "30 deg", longest=limit)
    longest = [max(map(abs, each.lengths.values())) for each in limited.linkages]
    assert max(longest) <= limit and limited.error >= free.error and limited.best.assembles
    said = "at its limit, where the search stops" in str(limited.notes)
    assert said == (longest[0] > 0.99 * limit) and limited.as_dict()["longest"] == pytest.approx(limit)
    with pytest.raises(bc.BellcrankError, match=r"with links of at most 0\.01 m"):
        bc.synthesise(linkage, leaf, "30 deg", longest=0.01)


def test_a_limit_of_links_that_is_no_length_or_belongs_to_no_points_is_refused() -> None:
    for wrong in (0.0, "-1 m", "3 kg", "x", float("nan")):
        with pytest.raises(InputError, match="argument 'longest'"):
            bc.synthesise("four_bar", [(0, 0), (1, 0.2), (1.5, 1), (1, 1.5)], longest=wrong)
    with pytest.raises(InputError, match="cannot be combined with 'longest'"):
        bc.synthesise("four_bar", function=[(0, 0), (0.5, 0.2), (1, 0.5), (1.2, 0.7)], longest=1.0)
