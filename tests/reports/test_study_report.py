"""The page of a study: what it says, and that a click on the map shows that design, with its own link lengths."""

import dataclasses
import io
import json
import math

import numpy as np
import pytest
from designs_of_linkage import linkage_sweep
from PIL import Image

import bellcrank as bc
from bellcrank.errors import InputError
from bellcrank.replays.film.design_film import TOLERANCE, film_of_designs
from bellcrank.reports import study_data
from bellcrank.reports.document import Still
from bellcrank.reports.study_data import DEFAULT_VIEW, encoded_study, live_study, representative_rows, study_film
from bellcrank.reports.study_report import study_document, write_study
from bellcrank.studies.designs.samples import Sample, SensitivitySample
from bellcrank.studies.results.study_columns import StudyColumns

pytest_plugins = ("browser",)

LENGTHS = (0.9, 1.05, 1.2, 1.23)
QUICK = {"simulate.samples": 201}
HOSTILE = '</script><script>window.hacked = 1</script><img src=x onerror="window.hacked = 2"> \' & ж __proto__ \udcff'


@pytest.fixture(scope="module")
def grid():
    """Four cranks, of which the two short ones never lock, by three couplers, of which the last closes no loop."""
    return linkage_sweep({"crank_length": list(LENGTHS), "coupler_length": [1.19, 1.2, 3.9]}, overrides=QUICK)


@pytest.fixture(scope="module")
def drawn():
    """A sample of 160 independent designs."""
    vary = {"crank_length": "normal(1.235 m, 2 mm)", "coupler_length": "normal(1.2 m, 1 mm)"}
    return linkage_sweep(vary, Sample(160, "random", 4), QUICK)


@pytest.fixture(scope="module")
def page(open_page, grid, tmp_path_factory):
    path = write_study(grid, tmp_path_factory.mktemp("study") / "study.html")
    return open_page(path, size=(1280, 900))


# ---- the film


def test_every_design_of_a_film_closes_its_loop_and_has_its_own_link_lengths():
    scene = bc.load_scene("four_bar", QUICK)
    runs = [bc.simulate(scene.with_overrides({"crank_length": length})) for length in LENGTHS]
    film = film_of_designs(runs, title="Linkage")
    number = {body.name: k for k, body in enumerate(film.film.bodies)}
    crank, coupler, apex, other = (number[name] for name in ("crank_link", "coupler_link", "coupler_tip", "rocker_tip"))
    for length, run, motion in zip(LENGTHS, runs, film.motions, strict=True):
        places = motion.poses[:, :, :3]
        np.testing.assert_allclose(np.linalg.norm(places[:, coupler] - places[:, crank], axis=1), length, atol=1e-9)
        np.testing.assert_allclose(places[:, apex], places[:, other], atol=0.1 * film.film.error_bound)
        # along the link the URDF's length of 1.241 m becomes the design's; across it nothing changes
        np.testing.assert_allclose(motion.stretch[crank], np.diag([length / 1.241, 1.0, 1.0]), atol=1e-12)
        np.testing.assert_allclose(motion.stretch[coupler], np.eye(3), atol=1e-12)
        # between the frames of the film bodies are within its tolerance of the run's rows
        shown = np.stack([np.interp(run.time, motion.time, places[:, coupler, c]) for c in range(2)], axis=1)
        angle = run.position[:, run.robot.joint("crank").q]
        truth = length * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        assert np.linalg.norm(shown - truth, axis=1).max() <= film.film.error_bound * 1.01
    assert film.film.time[-1] == max(motion.time[-1] for motion in film.motions)
    assert film.film.error_bound < 5.0 * TOLERANCE
    with pytest.raises(InputError, match="at least one design with a motion"):
        film_of_designs([], title="Nothing")


@pytest.mark.tier2
def test_sized_designs_are_shown_along_their_first_motion():
    sizings = [bc.size("geared_pendulum", overrides={"gravity": [0, 0, g]}) for g in (-9.81, -3.7)]
    film = film_of_designs([sizing.inputs for sizing in sizings], title="Pendulum")
    motion = sizings[0].inputs.motions[0]
    assert [each.time[-1] - each.time[0] for each in film.motions] == [motion.duration] * 2
    np.testing.assert_array_equal(film.motions[0].poses, film.motions[1].poses)


# ---- its data


def test_designs_with_extremes_and_medians_come_first_and_others_are_spread_evenly():
    values = np.random.default_rng(0).permutation(1000.0 + np.arange(5000.0))
    rows = representative_rows([values], np.arange(5000), 200)
    assert len(rows) == len(set(rows.tolist())) == 200
    assert values[rows[:3]].tolist() == [3500.0, 1000.0, 5999.0]
    gaps = np.diff(np.sort(rows))
    assert gaps.max() < 3 * 5000 / 200
    few = representative_rows([np.array([np.nan, 2.0, 1.0])], np.array([1, 2]), 200)
    assert sorted(few.tolist()) == [1, 2]


def test_a_page_holds_as_many_motions_as_fit(grid, monkeypatch):
    film = study_film(grid, grid.default_measures, title="Linkage")
    assert len(film.rows) == 8  # of 12; the others cannot be assembled
    whole, arrays, count = encoded_study(grid, film, grid.default_measures, [])
    assert count == 8 and len(json.loads(whole)["motions"]) == 8
    monkeypatch.setattr(study_data, "LARGEST", len(arrays) // 2)
    text, fewer, count = encoded_study(grid, film, grid.default_measures, [])
    assert 1 <= count < 8 and len(fewer) <= len(arrays) // 2
    assert f"nearest of {count} designs" in json.loads(text)["hint"]


# ---- what it says


def document_of(sweep, limits=()):
    from bellcrank.studies.results.sweep_statistics import sweep_sensitivity, sweep_statistics

    statistics = sweep_statistics(sweep) if sweep.space.sample is not None else None
    found = [statistics.exceedance(limit) for limit in limits]
    several = isinstance(sweep.space.sample, SensitivitySample)
    return study_document(
        sweep,
        "Linkage",
        Still(0.0, ""),
        sweep.default_measures,
        found,
        statistics,
        sweep_sensitivity(sweep) if several else None,
    )


@pytest.mark.tier2
def test_a_grid_tells_ranges_and_what_failed(grid):
    document = document_of(grid)
    assert document.status == "8 failed" and document.partial
    assert document.verdict[0] == "12 designs over crank_length, coupler_length: 4 reached their target."
    titles = [part.title for part in document.parts]
    assert titles == ["Measures over the designs", "Parameters", "Statuses", "Made with"]
    statuses = document.parts[2].rows
    assert [row[:2] for row in statuses] == [("event", "4"), ("duration", "4"), ("infeasible", "4")]
    assert statuses[1][2] == "it did not lock" and statuses[2][2]


@pytest.mark.tier2
def test_a_sample_tells_probabilities_with_their_intervals(drawn):
    document = document_of(drawn, ["lock.time > 13 s", "lock.time < 12 s"])
    count, other = (
        int(beyond.sum()) for beyond in (drawn.column("lock.time") > 13.0, drawn.column("lock.time") < 12.0)
    )
    assert (
        document.status == (f"A limit is exceeded with a probability of {100.0 * max(count, other) / 160:.3g} %")
        and document.partial
    )
    assert document.verdict[1].startswith(f"lock.time > 13 s: probability {100.0 * count / 160:.3g} % (95 % interval ")
    limits = document.parts[0]
    assert limits.rows[0][3:] == (f"{count} of 160", "every design has it")
    assert limits.note == "Intervals: Clopper-Pearson, 160 independent designs."
    assert any("median" in line and "lock.crank" in line for line in document.verdict)


@pytest.mark.tier2
def test_a_sample_within_its_limits_is_in_order(drawn):
    document = document_of(drawn, ["lock.time > 100 s"])
    assert document.status == "OK" and not document.partial


@pytest.mark.tier2
def test_sobol_indices_are_told_in_words_and_numbers():
    vary = {"crank_length": "normal(1.235 m, 2 mm)", "coupler_length": "normal(1.2 m, 0.1 mm)"}
    sweep = linkage_sweep(vary, SensitivitySample(2, 4, 16, 1), QUICK)
    document = document_of(sweep)
    assert any("crank_length explains" in line and "larger total index" in line for line in document.verdict)
    table = next(part for part in document.parts if part.title == "Sobol indices" and hasattr(part, "rows"))
    assert table.rows[0][0] == "lock.time: crank_length" and "16 scramblings of 4 Sobol points" in table.note


def test_limits_of_a_grid_are_refused(grid, tmp_path):
    with pytest.raises(InputError, match="'crank_length' has values and no distribution"):
        write_study(grid, tmp_path / "page.html", limits=["lock.time > 13 s"])
    with pytest.raises(InputError, match=r"unknown measure 'lock.tine'; did you mean 'lock.time'"):
        write_study(grid, tmp_path / "page.html", measures=["lock.tine"])


# ---- the page in a browser


@pytest.mark.tier2
def test_a_click_on_the_map_shows_that_design(page, grid):
    assert page.clean and page.do("b.study.shown.length") == 8
    marks = np.array([page.do("b.study.pixel(x)", k) for k in range(8)])
    for k in (2, 5, 7):
        place = np.floor(marks[k])  # browsers report whole pixels, and two marks may be one pixel apart
        page.tab.mouse.click(*place.tolist())
        design = page.do("b.study.shown[x]", int(np.hypot(*(marks - place).T).argmin()))
        assert page.do("b.study.current") == design and page.do("b.playing")
        page.do("(b.pause(), b.seek(5.0))")
        crank_length = grid.values[design, 0]
        scene = grid.scene.with_overrides(
            dict(zip(("crank_length", "coupler_length"), grid.values[design], strict=True))
        )
        run = bc.simulate(scene, times=[0.0, 5.0])
        angle = run.position[-1, run.robot.joint("crank").q]
        tip = page.do("b.pose(2)")[:3]
        np.testing.assert_allclose(tip[:2], crank_length * np.array([math.cos(angle), math.sin(angle)]), atol=1e-2)
        text = page.tab.inner_text(".design-facts")
        status = grid.columns.statuses[grid.columns.status[design]]
        assert f"Design {design}: {status}" in text and f"{crank_length:g} m" in text
    assert page.clean


@pytest.mark.tier2
def test_the_crank_is_drawn_with_the_length_of_the_design(page, grid):
    """The pixels of the crank alone end at its design's length."""
    page.do("b.layers().forEach((layer, k) => b.showLayer(k, false))")
    for body in (0, 2, 3):
        page.do("b.showBody(x, false)", body)
    for length in (0.9, 1.23):
        row = next(r for r in page.do("b.study.shown") if grid.values[r, 0] == length)
        page.do("(b.study.show(b.study.shown.indexOf(x)), b.pause(), b.seek(5.0), b.draw(), null)", row)
        pose = np.array(page.do("b.pose(1)"))
        turn = 2.0 * math.atan2(pose[5], pose[6])
        along = np.array([math.cos(turn), math.sin(turn), 0.0])
        box = page.tab.locator("#pane").bounding_box()
        image = np.asarray(Image.open(io.BytesIO(page.tab.screenshot())).convert("RGB"), dtype=float)

        def colour(share, pose=pose, along=along, box=box, image=image, length=length):
            x, y = page.do("b.project(x)", (pose[:3] + share * length * along).tolist())
            return image[round(box["y"] + y), round(box["x"] + x)]

        behind = colour(1.08)
        inside = [colour(share) for share in (0.3, 0.6, 0.97)]
        assert all(np.abs(each - behind).max() > 40.0 for each in inside), (length, inside, behind)
        assert np.abs(colour(1.05) - behind).max() < 15.0
    for body in (0, 2, 3):
        page.do("b.showBody(x, true)", body)


@pytest.mark.tier2
def test_a_design_that_failed_tells_its_reason(page, grid):
    row = next(row for row, status in enumerate(grid.status) if status == "infeasible")
    columns = page.tab.locator(".map-choices select")
    assert columns.count() == 3
    paths = page.tab.locator(".absent")
    assert paths.count() == 1
    box = page.tab.locator(".design-map svg").bounding_box()
    crosses = page.do("document.querySelector('.absent').getAttribute('d')").split("M")[1:]
    assert len(crosses) == len(grid.reasons)
    place = sorted(grid.reasons).index(row)
    x, y = (float(number) + 3.0 for number in crosses[place].split("l")[0].split())
    scale = box["width"] / float(page.do("document.querySelector('.design-map svg').getAttribute('width')"))
    page.tab.mouse.click(box["x"] + scale * x, box["y"] + scale * y)
    text = page.tab.inner_text(".design-facts")
    assert f"Design {row}: infeasible" in text and grid.reasons[row][:40] in text
    assert page.clean


@pytest.mark.tier2
def test_names_and_reasons_do_nothing_in_the_page(open_page, grid, tmp_path):
    rename = {"lock.time": HOSTILE, "lock.crank": "lock.crank"}
    columns = StudyColumns(
        statuses=(HOSTILE, "duration", "infeasible"),
        status=grid.columns.status,
        measures={rename[name]: values for name, values in grid.columns.measures.items()},
        reasons=dict.fromkeys(grid.reasons, HOSTILE),
    )
    hostile = dataclasses.replace(
        grid,
        columns=columns,
        units={rename[name]: unit for name, unit in grid.units.items()},
        candidates=tuple(rename.values()),
    )
    page = open_page(write_study(hostile, tmp_path / "study.html", title=HOSTILE), size=(1000, 700))
    assert page.do("window.hacked") is None and page.clean
    assert "window.hacked = 1" in page.tab.inner_text(".design-facts")


@pytest.mark.tier2
def test_a_large_sample_fits_a_page(open_page, drawn, tmp_path):
    path = write_study(drawn, tmp_path / "study.html", limits=["lock.time > 13 s"])
    assert path.stat().st_size < 5_000_000
    page = open_page(path, size=(1280, 900))
    assert page.do("b.study.shown.length") == 160 and page.clean
    page.tab.select_option(".map-choices select >> nth=1", label="lock.time")
    assert page.tab.locator(".design-map .limit").count() == 1 and page.clean
    assert page.tab.locator(".drawn img").count() == 1


# ---- a page that computes

COMPUTED = (
    "new Promise((done) => { const wait = setInterval(() => b.live.busy || (clearInterval(wait), done()), 20); })"
)


@pytest.mark.tier2
def test_a_page_computes_the_designs_of_a_sweep_of_sizings_and_those_between(open_page, tmp_path):
    vary = {"upper_arm": [0.9, 1.1], "spring_preload": [100.0, 250.0]}
    sweep = bc.sweep("balanced_arm", vary, size=True)
    page = open_page(bc.report(sweep, tmp_path / "live.html", live=True), size=(1280, 900))
    assert page.do("b.study.current") is None and page.do("b.live.agreement") < 1e-9
    peaks = ("shoulder.peak_torque", "elbow.peak_torque")
    for row in range(4):
        page.do("b.study.show(x)", row)
        page.do(COMPUTED)
        assert page.do("b.study.current") == row
        found = page.do("b.live.result.figures")[:2]
        assert found == pytest.approx([sweep.column(name)[row] for name in peaks], rel=1e-9)
    names = page.do("b.live.settings.map(({ name }) => name)")
    assert page.do("b.live.set(x)", [[names.index("upper_arm"), 0.97], [names.index("spring_preload"), 180.0]])
    assert page.do("b.study.current") is None  # it stands between the designs
    alone = bc.size("balanced_arm", overrides={"upper_arm": 0.97, "spring_preload": 180.0})
    figures = [alone.joint(name).peak_torque for name in ("shoulder", "elbow")]
    assert page.do("b.live.result.figures")[:2] == pytest.approx(figures, rel=1e-9)
    assert "those of the study" in page.tab.locator("#live-bar").inner_text() and page.clean


@pytest.mark.tier2
def test_a_page_computes_the_runs_of_a_sweep(open_page, tmp_path):
    sweep = bc.sweep("four_bar", {"crank_length": [1.225, 1.24], "coupler_length": [1.2]})
    page = open_page(bc.report(sweep, tmp_path / "runs.html", live=True), size=(390, 844))
    page.do("b.study.show(0)")
    page.do(COMPUTED)
    assert page.do("b.study.current") == 0
    assert page.do("b.live.result.time.at(-1)") == pytest.approx(sweep.column("lock.time")[0], abs=1e-8)
    assert page.tab.evaluate("document.documentElement.scrollWidth") == 390 and page.clean


def test_durations_and_ratios_are_settings_of_a_page_and_other_axes_are_refused(tmp_path):
    vary = {"motions.elbow_up.duration": [5.0, 10.0], "actuators.shoulder.ratio": [120, 160]}
    sweep = bc.sweep("planar_2r", vary, size=True)
    made = live_study(sweep, title="Arm", view=DEFAULT_VIEW)
    assert [(one["factor"], one["inverse"]) for one in made.settings] == [(10.0, True), (1.0, False)]
    settings = made.film.live.content["settings"]
    paths = [settings[one["setting"]]["path"] for one in made.settings]
    assert paths == ["motions.elbow_up.speed_factor", "actuators.shoulder.ratio"]
    other = bc.sweep("planar_2r", {"link.link_2.mass": [1.0, 2.0]}, size=True)
    with pytest.raises(InputError, match=r"'link\.link_2\.mass' is none of the values that a page can change"):
        bc.report(other, tmp_path / "refused.html", live=True)
    assert not (tmp_path / "refused.html").exists()
