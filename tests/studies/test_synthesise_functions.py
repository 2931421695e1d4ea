"""Four-bars whose rocker's angle is a function of the crank's: against Freudenstein's equation and Newton's method."""

import json

import numpy as np
import pytest
from random_linkages import length_distance, random_function
from scipy.optimize import minimize

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import BellcrankError, InputError
from bellcrank.studies.synthesis.four_bar import FourBarsOverRange
from bellcrank.studies.synthesis.linkage import FourBar
from bellcrank.studies.synthesis.placement import FunctionTask
from bellcrank.studies.synthesis.slider_crank import SliderCranks

# y = log10 x, 1 <= x <= 2, over 60 deg of the crank and 90 deg of the rocker, by the methods of F. Freudenstein,
# Approximate synthesis of four-bar linkages, Trans. ASME 77 (1955) 853-861.
SHARE = np.linspace(0.0, 1.0, 61)
LOGARITHM = np.c_[np.deg2rad(60.0) * SHARE, np.deg2rad(90.0) * np.log10(1.0 + SHARE) / np.log10(2.0)]


def ratios(linkage):
    """Freudenstein's K1, K2 and K3 of K1 cos ψ − K2 cos θ + K3 = cos(θ − ψ)."""
    ground, crank, coupler, rocker = (linkage.lengths[name] for name in ("ground", "crank", "coupler", "rocker"))
    last = (crank**2 - coupler**2 + rocker**2 + ground**2) / (2.0 * crank * rocker)
    return ground / crank, ground / rocker, last


def by_freudenstein(first, second, third, crank, near):
    """The rocker's angles (n,) of Freudenstein's equation at crank angles (n,), on the branch that is nearest."""
    across, ahead = -np.sin(crank), first - np.cos(crank)
    between = np.arccos((second * np.cos(crank) - third) / np.hypot(across, ahead))
    both = [np.arctan2(across, ahead) + side * between for side in (1.0, -1.0)]
    gaps = [np.abs(np.angle(np.exp(1j * (each - near)))) for each in both]
    chosen = int(gaps[1].max() < gaps[0].max())
    return both[chosen]


def rocker_by_newton(linkage, angles):
    """The rocker's angles (n,) by Newton's method on the loop, each posture from the one before: the same branch; and
    the transmission angles (n,).
    """
    end, tip = linkage.postures(angles[:1])
    coupler, rocker = np.angle(tip - end)[0], np.angle(tip - linkage.rocker_pivot)[0]
    found, between = [], []
    for angle in angles:
        for _ in range(30):
            gap = (
                linkage.crank * np.exp(1j * angle)
                + linkage.coupler * np.exp(1j * coupler)
                - linkage.ground
                - linkage.rocker * np.exp(1j * rocker)
            )
            columns = np.array(
                [1j * linkage.coupler * np.exp(1j * coupler), -1j * linkage.rocker * np.exp(1j * rocker)]
            )
            step = np.linalg.solve(np.array([columns.real, columns.imag]), -np.array([gap.real, gap.imag]))
            coupler, rocker = coupler + step[0], rocker + step[1]
        assert abs(gap) < 1e-10 * linkage.coupler
        found.append(rocker)
        between.append(abs(np.angle(np.exp(1j * (coupler - rocker)))))
    return np.array(found), np.minimum(between, np.pi - np.array(between))


def wrapped(angles):
    return np.angle(np.exp(1j * np.asarray(angles)))


def test_four_bars_are_found_again_from_their_own_function() -> None:
    for k in range(3):
        own, pairs = random_function(np.random.default_rng([31, k]), False)
        found = bc.synthesise("four_bar", function=pairs, transmission_angle=0)
        assert length_distance(own, found.best) < 1e-8 and found.best.branch == own.branch
        assert wrapped(found.best.angles - own.angles) == pytest.approx(np.zeros(20), abs=1e-8)


@pytest.mark.tier2
def test_most_of_forty_four_bars_are_found_again_from_their_function() -> None:
    cases = [random_function(np.random.default_rng([32, k]), False) for k in range(40)]
    best = [bc.synthesise("four_bar", function=pairs, transmission_angle=0).best for _, pairs in cases]
    assert sum(length_distance(own, one) < 1e-8 for (own, _), one in zip(cases, best, strict=True)) >= 38
    full = [own.turns_fully for own, _ in cases]
    assert 5 < sum(full) < 35  # both kinds
    assert [one.turns_fully for one in best] == full


@pytest.mark.parametrize("least", [0.0, 45.0])
def test_the_error_of_the_logarithm_is_that_of_freudensteins_equation_and_of_newtons_method(least) -> None:
    found = bc.synthesise("four_bar", function=LOGARITHM, transmission_angle=np.deg2rad(least))
    for one in found.linkages[:3]:
        given = LOGARITHM[:, 1] + one.output_offset
        crank = LOGARITHM[:, 0] + one.input_offset
        for output in (by_freudenstein(*ratios(one), crank, given), rocker_by_newton(one, crank)[0]):
            gaps = wrapped(output - given)
            assert (gaps**2).sum() == pytest.approx(one.error, rel=1e-5)
            assert abs(gaps.mean()) < 1e-9  # the best offset
        fine = np.linspace(crank[0], crank[-1], 301)
        assert np.rad2deg(rocker_by_newton(one, fine)[1].min()) == pytest.approx(
            np.rad2deg(one.transmission_angle), abs=1e-3
        )
        assert np.rad2deg(one.transmission_angle) >= least - 1e-4
    errors = [one.error for one in found.linkages]
    assert errors == sorted(errors) and found.rms_output == np.sqrt(errors[0] / 61)


@pytest.mark.parametrize("least", [0.0, 30.0])
def test_freudensteins_precision_points_and_his_least_squares_are_no_nearer_to_the_logarithm(least) -> None:
    best = bc.synthesise("four_bar", function=LOGARITHM, transmission_angle=np.deg2rad(least)).best
    crank, rocker = LOGARITHM[:, 0] + best.input_offset, LOGARITHM[:, 1] + best.output_offset
    rows, sides = np.c_[np.cos(rocker), -np.cos(crank), np.ones(61)], np.cos(crank - rocker)
    precision = [4, 30, 56]  # Chebyshev's spacing: shares 0.067, 0.5 and 0.933 of the range
    for chosen in (precision, slice(None)):
        solved = np.linalg.lstsq(rows[chosen], sides[chosen], rcond=None)[0]
        gaps = wrapped(by_freudenstein(*solved, crank, rocker) - rocker)
        assert chosen is not precision or np.abs(gaps[precision]).max() < 1e-9
        squares = ((gaps - gaps.mean()) ** 2).sum()
        assert best.error < squares < 1000.0 * best.error


@pytest.mark.tier2
@pytest.mark.parametrize("least", [30.0, 45.0])
def test_no_local_search_of_another_kind_finds_a_better_logarithm_within_the_limit(least) -> None:
    found = bc.synthesise("four_bar", function=LOGARITHM, transmission_angle=np.deg2rad(least))
    rng = np.random.default_rng(0)

    def error(unknown, branch):
        ground, coupler, rocker = np.exp(unknown[:3])
        one = FourBar(
            ground=ground, crank=1.0, coupler=coupler, rocker=rocker, branch=branch, pivot=(0.0, 0.0), ground_angle=0.0,
            angles=LOGARITHM[:, 0] + unknown[3], of_range=True,
        )  # fmt: skip
        if not one.assembles or one.transmission_angle < np.deg2rad(least):
            return np.inf
        gaps = wrapped(one.output(one.angles) - LOGARITHM[:, 1])
        gaps = wrapped(gaps - np.angle(np.exp(1j * gaps).sum()))
        return ((gaps - gaps.mean()) ** 2).sum()

    best = np.inf
    for branch in (1.0, -1.0):
        starts = np.c_[rng.uniform(-3.0, 3.0, (2000, 3)), rng.uniform(0.0, 2.0 * np.pi, 2000)]
        errors = np.array([error(start, branch) for start in starts])
        for k in np.argsort(errors)[:8]:
            options = {"maxiter": 3000, "maxfev": 3000, "xatol": 1e-10, "fatol": 1e-16}
            best = min(best, minimize(error, starts[k], (branch,), method="Nelder-Mead", options=options).fun)
    assert best > found.error * (1.0 - 1e-6)
    assert best < 100.0 * found.error  # the searches of the test come near


def test_a_rocker_that_turns_fully_is_found_and_the_result_says_whether_the_crank_does() -> None:
    drag = FourBar(
        ground=1.0, crank=3.0, coupler=2.5, rocker=3.2, branch=1.0, pivot=(0.0, 0.0), ground_angle=0.0,
        angles=np.deg2rad(np.linspace(10.0, 360.0, 30)), of_range=True,
    )  # fmt: skip
    output = drag.output(drag.angles)
    assert output[-1] - output[0] > np.deg2rad(300.0)
    found = bc.synthesise("four_bar", function=np.c_[drag.angles, output + 7.0], transmission_angle="20 deg")
    assert length_distance(drag, found.best) < 1e-8 and found.best.turns_fully
    assert not any("does not turn fully" in note for note in found.notes)
    turned, _ = rocker_by_newton(found.best, np.linspace(0.0, 2.0 * np.pi, 361))
    assert turned[-1] - turned[0] == pytest.approx(2.0 * np.pi)
    part = bc.synthesise("four_bar", function=LOGARITHM)
    assert not part.best.turns_fully and any("does not turn fully" in note for note in part.notes)


@pytest.mark.parametrize("span", [1.0, -3.0, 6.2])
@pytest.mark.parametrize("of", [FourBarsOverRange, SliderCranks])
def test_derivatives_of_functions_are_those_of_differences(of, span) -> None:
    rng, step = np.random.default_rng(1), 1e-6
    kind = of(0.02)
    lower = kind.bounds[0]
    shape = kind.shapes(rng.uniform(0.1, 0.9, (200, len(lower))))
    crank = rng.uniform(0.0, 6.0, (200, 1)) + np.linspace(0.0, span, 9)
    branch = np.resize(kind.branches, 200)
    task = FunctionTask(kind, 0.1 * rng.normal(size=9))
    there = np.flatnonzero(np.isfinite(task.fit(shape, crank, branch, slopes=False).residual).all(axis=1))[:40]
    assert len(there) == 40
    shape, crank, branch = shape[there], crank[there], branch[there]
    found = task.fit(shape, crank, branch)
    factor = 1.0 if kind.angular else found.placement[:, 1, None]
    for column, move in enumerate([None, *np.eye(len(lower))]):
        by, turn = (0.0 * lower, step) if move is None else (step * move, 0.0)
        after, before = (kind.output(shape + s * by, crank + s * turn, branch, False).value for s in (1.0, -1.0))
        change = wrapped(after - before) if kind.angular else after - before
        error = np.abs(factor * change / (2.0 * step) + found.slopes[:, :, column])
        assert (error < 1e-5 * (1.0 + np.abs(found.slopes[:, :, column]))).mean() > 0.99  # the least distance has kinks


def test_every_shape_within_the_bounds_assembles_in_its_range_and_keeps_its_transmission_angle() -> None:
    rng, least = np.random.default_rng(2), np.deg2rad(25.0)
    kind = FourBarsOverRange(least)
    shape = kind.shapes(rng.uniform(size=(400, 3)))
    shape[::4, 2], shape[1::4, 2], shape[2::4, 1] = 0.0, 1.0, 1.0
    crank = rng.uniform(0.0, 6.0, (400, 1)) + np.linspace(0.0, 1.0, 5) * rng.uniform(-6.2, 6.2, (400, 1))
    links, _ = kind.links(shape, crank)
    there = np.isfinite(links).all(axis=1)
    assert 100 < there.sum() < 400
    for (ground, coupler, rocker), angles in zip(links[there], crank[there], strict=True):
        one = FourBar(
            ground=ground, crank=1.0, coupler=coupler, rocker=rocker, branch=1.0, pivot=(0.0, 0.0), ground_angle=0.0,
            angles=angles, of_range=True,
        )  # fmt: skip
        assert one.assembles and one.transmission_angle > least - 1e-9


def test_the_scene_has_the_function_as_positions_of_its_joints_and_is_sized_and_replayed(tmp_path) -> None:
    pairs = LOGARITHM + np.array([0.5, -0.2])
    found = bc.synthesise("four_bar", function=pairs)
    scene = bc.load_scene(found.write_config(tmp_path / "linkage.yaml"))
    run = bc.simulate(scene, samples=37)
    assert run.constraint_residual() < 1e-8
    crank = run.joint("crank").position
    assert crank[[0, -1]] == pytest.approx(pairs[[0, -1], 0])
    wanted = -0.2 + np.deg2rad(90.0) * np.log10(1.0 + (crank - 0.5) / np.deg2rad(60.0)) / np.log10(2.0)
    gaps = run.output("output") - wanted
    assert np.abs(gaps).max() == pytest.approx(np.abs(found.output_differences()).max(), rel=0.05)
    assert np.abs(run.joint("rocker").position - found.best.output(crank + found.best.input_offset)).max() < 1e-8
    assert bc.replay(run, tmp_path / "page.html").stat().st_size > 1000
    assert bc.size(scene).joint("crank").peak_torque > 0.0
    assert len(found.plot(tmp_path / "picture.png").axes) == 2
    rows = np.genfromtxt(found.to_csv(tmp_path / "pairs.csv"), delimiter=",", skip_header=1)
    assert rows[:, 2] - rows[:, 1] == pytest.approx(found.output_differences(), abs=1e-12)


def test_a_result_has_a_distance_or_a_difference() -> None:
    function = bc.synthesise("four_bar", function=LOGARITHM)
    points = bc.synthesise("four_bar", [(0, 0), (1, 0.2), (1.5, 1), (1, 1.5), (0, 1)], "72 deg")
    with pytest.raises(BellcrankError, match="use rms_output"):
        _ = function.rms_distance
    for read in (lambda: points.rms_output, points.output_differences):
        with pytest.raises(BellcrankError, match="points are given"):
            read()
    assert function.as_dict()["rms_distance"] is None and points.as_dict()["rms_output"] is None


def test_the_command_reads_a_function(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    rows = [f"{x},{y}" for x, y in np.rad2deg(LOGARITHM)]
    (tmp_path / "log.csv").write_text("\n".join(["crank [deg],rocker [deg]", *rows]))
    assert main(["synthesise", "log.csv", "--transmission-angle", "40 deg"]) == 0
    printed = capsys.readouterr().out
    assert printed.splitlines()[0].startswith("RMS difference [deg]  largest [deg]  ground [m]")
    written = json.loads((tmp_path / "log_synthesis/synthesis.json").read_text())
    again = bc.synthesise("four_bar", function=LOGARITHM, transmission_angle="40 deg").rms_output
    assert written["rms_output"] == pytest.approx(again, rel=1e-9)
    assert written["linkages"][0]["turns_fully"] is False and written["points"] is None
    assert (tmp_path / "log_synthesis/synthesis.png").stat().st_size > 1000
    assert main(["synthesise", "log.csv", "--timing", "20 deg"]) == 2
    assert "has a column 'crank' already" in capsys.readouterr().err
    assert main(["synthesise", "log.csv", "--linkage", "slider_crank"]) == 2
    assert "has a column 'rocker', which a slider_crank does not have" in capsys.readouterr().err


def test_a_function_that_no_four_bar_can_follow_is_said_in_words_and_exit_code(tmp_path, capsys) -> None:
    rows = [f"{x},{y}" for x, y in np.rad2deg(LOGARITHM)]
    (tmp_path / "log.csv").write_text("\n".join(["crank [deg],rocker [deg]", *rows]))
    given = ["synthesise", str(tmp_path / "log.csv"), "--out", str(tmp_path / "o"), "--transmission-angle", "89.9 deg"]
    assert main(given) == 1
    assert "no four-bar was found that assembles in the range of the function" in capsys.readouterr().err
    assert json.loads((tmp_path / "o/synthesis.json").read_text())["linkages"] == []


PAIRS = [(0.0, 0.0), (0.5, 0.1), (1.0, 0.3), (1.5, 0.4)]


@pytest.mark.parametrize(
    ("named", "message"),
    [
        ({"function": None}, "argument 'points': expected points, or argument 'function', found neither"),
        ({"points": PAIRS}, "argument 'function': it cannot be combined with 'points'"),
        ({"timing": 0.1}, "it cannot be combined with 'timing'"),
        ({"directions": [1.0]}, "it cannot be combined with 'directions'"),
        ({"function": PAIRS[:3]}, "argument 'function': expected 4 to 500 pairs, found 3"),
        (
            {"function": PAIRS[::-1] + PAIRS},
            "expected angles of the crank that rise, or fall, and stay within one turn",
        ),
        ({"function": [(2.0 * x, y) for x, y in PAIRS] + [(7.0, 1.0)]}, "found 0 to 401.07 deg"),
        ({"function": [(x, 2.0) for x, _ in PAIRS]}, "argument 'function': expected outputs that differ"),
        ({"function": [(x, 1e10) for x, _ in PAIRS]}, "expected numbers up to 1e+09, found 1e+10"),
        ({"function": [1.0, 2.0]}, "an array of shape (n, 2)"),
    ],
)
def test_bad_functions_are_one_sentence(named, message) -> None:
    with pytest.raises(InputError) as caught:
        bc.synthesise(**({"linkage": "four_bar", "function": PAIRS} | named))
    assert message in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("rocker [deg]\n1\n2\n", "there is no column 'crank [deg]'"),
        ("crank [deg],slider [deg]\n1,2\n", "column 'slider' is in 'deg'"),
        ("crank [deg],rocker [deg],x [m]\n1,2,3\n", "column 'x' cannot be combined with 'rocker'"),
        ("crank [deg],rocker [deg],slider [m]\n1,2,3\n", "column 'slider' cannot be combined with 'rocker'"),
        ("crank [deg],rocker [deg]\n0,1\n1,2\n", "pairs.csv: expected 4 to 500 pairs, found 2"),
    ],
)
def test_a_wrong_file_of_a_function_is_one_sentence(text, message, tmp_path, capsys) -> None:
    (tmp_path / "pairs.csv").write_text(text)
    assert main(["synthesise", str(tmp_path / "pairs.csv"), "--out", str(tmp_path / "o")]) == 2
    assert message in capsys.readouterr().err
