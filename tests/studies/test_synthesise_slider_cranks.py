"""Slider-cranks through given points, with given poses and given functions: found again, and by Newton's method."""

import json

import numpy as np
import pytest
from random_linkages import curve_distance, length_distance, random_function, random_slider_crank
from scipy.optimize import minimize

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.studies.synthesis.linkage import SliderCrank
from bellcrank.studies.synthesis.slider_crank import SliderCranks

PATH = [(0.5, 1.1), (0.2, 1.0), (0.05, 0.75), (0.0, 0.5), (0.03, 0.3), (0.15, 0.2), (0.3, 0.4), (0.5, 0.7), (0.6, 1.0)]
SHARE = np.linspace(0.0, 1.0, 41)
SQUARE = np.c_[2.0 * SHARE, 0.3 - 0.2 * SHARE**2]  # rad, m


def by_newton(linkage, angles):
    """Coupler points (n, 2), positions of the slider along the guide (n,) from the pivot's foot and the coupler's
    angles (n,) from the guide, by Newton's method on the loop, each posture from the one before.
    """
    guide = np.exp(1j * linkage.ground_angle)
    end, tip = linkage.postures(angles[:1])
    coupler = np.angle((tip - end) / guide)[0]
    place = (tip[0] - complex(*linkage.pivot)) / guide
    assert place.imag == pytest.approx(linkage.offset, abs=1e-12)
    place, points, places, turned = place.real, [], [], []
    for angle in angles:
        crank = linkage.crank * np.exp(1j * angle)
        for _ in range(30):
            gap = crank + linkage.coupler * np.exp(1j * coupler) - place - 1j * linkage.offset
            columns = np.array([1j * linkage.coupler * np.exp(1j * coupler), -1.0 + 0.0j])
            step = np.linalg.solve(np.array([columns.real, columns.imag]), -np.array([gap.real, gap.imag]))
            coupler, place = coupler + step[0], place + step[1]
        assert abs(gap) < 1e-12 * (linkage.coupler + abs(linkage.offset))
        point = complex(*linkage.pivot) + guide * (crank + complex(*linkage.point) * np.exp(1j * coupler))
        points.append((point.real, point.imag))
        places.append(place)
        turned.append(coupler)
    return np.array(points), np.array(places), np.array(turned)


@pytest.mark.parametrize("timed", [True, False])
def test_slider_cranks_are_found_again_from_their_own_coupler_points(timed) -> None:
    for k in range(3):
        target = random_slider_crank(np.random.default_rng([41, k]), timed)
        found = bc.synthesise("slider_crank", target.points, target.angles if timed else None, transmission_angle=0)
        assert curve_distance(target.linkage, found.best) < 1e-8


@pytest.mark.tier2
@pytest.mark.parametrize("timed", [True, False])
def test_most_of_forty_slider_cranks_are_found_again(timed) -> None:
    good = 0
    for k in range(40):
        target = random_slider_crank(np.random.default_rng([42, k]), timed)
        found = bc.synthesise("slider_crank", target.points, target.angles if timed else None, transmission_angle=0)
        good += curve_distance(target.linkage, found.best) < 1e-8
    assert good >= 38


@pytest.mark.parametrize("timed", [True, False])
def test_slider_cranks_are_found_again_from_the_poses_of_their_couplers(timed, tmp_path) -> None:
    for k in range(3):
        target = random_slider_crank(np.random.default_rng([43, k]), timed)
        turned = np.angle(target.linkage.directions(target.angles)) + 0.7
        found = bc.synthesise(
            "slider_crank", target.points, target.angles if timed else None, directions=turned, transmission_angle=0
        )
        assert found.rms_turn < 1e-10
        for name, length in target.linkage.lengths.items():  # no cognate: its coupler turns otherwise
            assert found.best.lengths[name] == pytest.approx(length, rel=1e-8, abs=1e-9)
        scene = bc.load_scene(found.write_config(tmp_path / f"{k}.yaml"))
        run = bc.simulate(scene, samples=2)
        place, rotation = scene.robot.frame_pose("coupler_point", run.position[0])
        assert rotation[:2, 0] == pytest.approx([np.cos(turned[0]), np.sin(turned[0])], abs=1e-7)
        assert place[:2] == pytest.approx(target.points[0], abs=1e-7)


@pytest.mark.parametrize("count", [4, pytest.param(40, marks=pytest.mark.tier2)])
def test_slider_cranks_are_found_again_from_their_function(count) -> None:
    good = 0
    for k in range(count):
        own, pairs = random_function(np.random.default_rng([44, k]), True)
        best = bc.synthesise("slider_crank", function=pairs, transmission_angle=0).best
        good += length_distance(own, best) < 1e-8
        places = by_newton(best, best.angles)[1]
        assert places - best.output_offset == pytest.approx(pairs[:, 1], abs=1e-8)
    assert good >= 0.95 * count


@pytest.mark.parametrize("least", [0.0, 50.0])
def test_each_slider_crank_assembles_through_the_whole_turn_by_newtons_method_and_keeps_its_limits(least) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    found = bc.synthesise("slider_crank", PATH, "36 deg", transmission_angle=np.deg2rad(least))
    function = bc.synthesise("slider_crank", function=SQUARE, transmission_angle=np.deg2rad(least))
    for one in (*found.linkages[:4], *function.linkages[:4]):
        points, _, turned = by_newton(one, turn)
        assert np.abs(points - one.path(turn)).max() < 1e-9
        assert points[-1] == pytest.approx(points[0], abs=1e-9)
        assert one.crank + abs(one.offset) < one.coupler and one.assembles
        between = np.arccos(np.abs(np.sin(turned)).max())
        assert between == pytest.approx(one.transmission_angle, abs=1e-2) and between >= np.deg2rad(least) - 1e-4
        worst = np.arccos((one.crank + abs(one.offset)) / one.coupler)
        assert one.transmission_angle == pytest.approx(worst, abs=1e-3) and worst >= np.deg2rad(least) - 1e-6
    for one in found.linkages:
        gaps = by_newton(one, one.angles)[0] - PATH
        assert (gaps**2).sum() == pytest.approx(one.error, rel=1e-9)
        assert np.diff(one.angles) == pytest.approx(np.deg2rad(36.0))
    for one in function.linkages:
        gaps = by_newton(one, one.angles)[1] - one.output_offset - SQUARE[:, 1]
        assert (gaps**2).sum() == pytest.approx(one.error, rel=1e-6) and abs(gaps.mean()) < 1e-9
    if least:
        assert any("at its limit" in note for note in (*found.notes, *function.notes))


@pytest.mark.tier2
def test_no_local_search_of_another_kind_finds_a_slider_crank_nearer_to_a_function() -> None:
    found = bc.synthesise("slider_crank", function=SQUARE, transmission_angle="50 deg")
    rng = np.random.default_rng(3)

    def error(unknown):
        coupler, offset, start, side = np.exp(unknown[0]), unknown[1], unknown[2], 1.0
        one = SliderCrank(crank=1.0, coupler=coupler, offset=offset, pivot=(0.0, 0.0), ground_angle=0.0,
                          angles=SQUARE[:, 0] + start, branch=side)  # fmt: skip
        if not one.assembles or (1.0 + abs(offset)) / coupler > np.cos(np.deg2rad(50.0)):
            return np.inf
        columns = np.c_[np.ones(41), one.output(one.angles)]
        return np.linalg.lstsq(columns, SQUARE[:, 1], rcond=None)[1][0]

    best = np.inf
    starts = np.c_[rng.uniform(0.5, 3.0, 1000), rng.uniform(-8.0, 8.0, 1000), rng.uniform(0.0, 2.0 * np.pi, 1000)]
    errors = np.array([error(start) for start in starts])
    for k in np.argsort(errors)[:10]:
        options = {"maxiter": 3000, "maxfev": 3000, "xatol": 1e-10, "fatol": 1e-18}
        best = min(best, minimize(error, starts[k], method="Nelder-Mead", options=options).fun)
    assert best == pytest.approx(found.error, rel=1e-4)


def test_every_shape_within_the_bounds_turns_fully_and_keeps_its_transmission_angle() -> None:
    rng, least = np.random.default_rng(2), np.deg2rad(35.0)
    kind = SliderCranks(least)
    shape = kind.shapes(rng.uniform(size=(200, 2)))
    shape[::4, 1], shape[1::4, 1], shape[2::4, 0] = 1.0, -1.0, kind.bounds[0][0]
    for coupler, offset in kind.ratios(shape, np.ones(200)):
        one = SliderCrank(
            crank=1.0, coupler=coupler, offset=offset, pivot=(0.0, 0.0), ground_angle=0.0, angles=np.zeros(1)
        )
        assert one.assembles and one.transmission_angle > least - 1e-9


def test_the_scene_moves_the_coupler_point_along_the_path_and_replays(tmp_path) -> None:
    found = bc.synthesise("slider_crank", PATH, "36 deg")
    scene = bc.load_scene(found.write_config(tmp_path / "linkage.yaml"))
    assert list(scene.parameters) == ["crank_length", "coupler_length", "offset"]
    run = bc.simulate(scene, samples=37)
    assert run.constraint_residual() < 1e-8
    crank = run.joint("crank").position
    assert crank[-1] - crank[0] == pytest.approx(2.0 * np.pi)
    assert np.abs(run.output("point")[:, :2] - found.best.path(crank)).max() < 1e-8
    assert np.abs(run.joint("slider").position - found.best.output(crank)).max() < 1e-8
    assert bc.replay(run, tmp_path / "page.html").stat().st_size > 1000
    assert bc.size(scene).joint("crank").peak_torque > 0.0
    assert len(found.plot(tmp_path / "picture.png").axes) == 1
    longer = bc.simulate(scene, samples=2, overrides={"parameters.offset": 0.9 * found.best.offset})
    assert longer.constraint_residual() < 1e-8


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_scene_of_a_function_has_it_as_positions_of_its_joints(sign, tmp_path) -> None:
    pairs = SQUARE * [1.0, sign]
    found = bc.synthesise("slider_crank", function=pairs)
    run = bc.simulate(bc.load_scene(found.write_config(tmp_path / "linkage.yaml")), samples=41)
    crank, slider = run.joint("crank").position, run.joint("slider").position
    assert crank[[0, -1]] == pytest.approx(pairs[[0, -1], 0])
    gaps = slider - sign * (0.3 - 0.2 * (0.5 * crank) ** 2)
    assert np.abs(gaps).max() == pytest.approx(np.abs(found.output_differences()).max(), rel=0.05)
    assert run.constraint_residual() < 1e-8 and found.rms_output < 2e-4
    assert np.abs(run.output("output") - slider).max() < 1e-12


def test_a_slider_crank_on_the_line_of_the_pivot_moves_by_the_textbooks_formula() -> None:
    crank = np.linspace(0.0, 1.9 * np.pi, 24)
    slider = 0.05 * np.cos(crank) + np.sqrt(0.2**2 - (0.05 * np.sin(crank)) ** 2)
    best = bc.synthesise("slider_crank", function=np.c_[crank, slider]).best
    assert best.lengths == pytest.approx({"crank": 0.05, "coupler": 0.2, "offset": 0.0}, abs=1e-9)
    assert best.output_offset == pytest.approx(0.0, abs=1e-9)
    assert np.sin(0.5 * best.input_offset) == pytest.approx(0.0, abs=1e-8)


def test_few_points_are_said_to_be_few() -> None:
    found = bc.synthesise("slider_crank", [(0, 0), (1, 0.2), (1.5, 1), (0.4, 1.1)], transmission_angle=0)
    assert found.best.assembles and "so few points do not determine a linkage" in " ".join(map(str, found.notes))


def test_the_command_finds_slider_cranks_by_option_and_by_the_column_of_the_slider(
    tmp_path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "path.csv").write_text("\n".join(["x [m],y [m]", *(f"{x},{y}" for x, y in PATH)]))
    assert main(["synthesise", "path.csv", "--linkage", "slider_crank", "--timing", "36 deg", "--no-plots"]) == 0
    assert "slider-cranks" in capsys.readouterr().out
    written = json.loads((tmp_path / "path_synthesis/synthesis.json").read_text())
    assert written["linkage"] == "slider_crank" and "offset" in written["linkages"][0]
    rows = [f"{np.rad2deg(x)},{1000.0 * y}" for x, y in SQUARE]
    (tmp_path / "square.csv").write_text("\n".join(["crank [deg],slider [mm]", *rows]))
    assert main(["synthesise", "square.csv"]) == 0
    assert capsys.readouterr().out.startswith("RMS difference [m]  largest [m]  crank [m]  coupler [m]  offset [m]")
    scene = bc.load_scene(tmp_path / "square_synthesis/linkage.yaml")
    assert scene.parameters["offset"].value == pytest.approx(bc.synthesise("slider_crank", function=SQUARE).best.offset)
    assert main(["synthesise", "square.csv", "--linkage", "four_bar"]) == 2
    assert "has a column 'slider', which a four_bar does not have" in capsys.readouterr().err
