"""Reports: the verdict first, everything escaped, no error under the page's policy, and paper with a picture."""

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.cli import main
from bellcrank.errors import InputError
from bellcrank.present.plot_style import literal, new_figure, svg_of
from bellcrank.replays.replay import NotebookPage, film_of
from bellcrank.reports.report import document_html, report
from bellcrank.reports.run_report import run_document
from bellcrank.reports.sizing_report import sizing_document
from bellcrank.simulation.trajectory.run_plot import run_pages

pytest_plugins = ("browser",)

HOSTILE = '</title><script>window.hacked = 1</script><img src=x onerror="window.hacked = 2"> \' & ж __proto__'
ARM = f"""
name: {json.dumps(HOSTILE)}
urdf: planar_2r
gravity: [0, -9.81, 0]
initial: {{shoulder: 0.3, elbow: 0.5}}
simulate: {{duration: 2, samples: 101}}
"""
STOP = "events: [{name: <b>low</b>, when: {joint: shoulder, position: -2 rad}, stop: true}]"


def simulated(folder, config, **options):
    (folder / "arm.yaml").write_text(config, encoding="utf-8")
    return bc.simulate(folder / "arm.yaml", **options)


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    return simulated(tmp_path_factory.mktemp("scene"), ARM + STOP)


@pytest.fixture(scope="module")
def sizing():
    robot = bc.load_robot("planar_2r", gravity=(0, -9.81, 0))
    rest = bc.waypoints(robot, [0.0, 1.0], [{"elbow": 0.0}, {"elbow": 0.05}], name="slow")
    swing = bc.waypoints(robot, [0.0, 2.0], [{"elbow": 0.0}, {"elbow": 1.0}], name="fast")
    return bc.size(robot, [rest, swing])


# ---- what it says


def test_a_sound_run_is_ok_and_says_by_how_much_and_what_was_run(stopped):
    document = run_document(stopped)
    assert document.success and document.status == "OK" and not document.warnings
    assert (
        "event '<b>low</b>' ended the run" in document.verdict[0]
        and "the relative energy error is" in document.verdict[1]
    )
    assert document.about[2].startswith("auto, rtol")
    assert document.about[-2:] == (f"bellcrank {bc.__version__}", dict(document.parts[-2].rows)["written on"])
    assert document.still.time == stopped.time[-1] and "<b>low</b>" in document.still.caption
    (events,) = (part for part in document.parts if part.title == "Events")
    assert events.rows[0][-1] == "ended the run" and float(events.rows[0][2]) == pytest.approx(-2.0, abs=1e-6)


@pytest.mark.tier2
def test_energy_out_of_balance_is_no_ok_and_warned_of(tmp_path):
    coarse = simulated(tmp_path, ARM, solver="RK4", step=0.2)
    document = run_document(coarse)
    assert not document.success and document.status == "Warnings"
    assert "The run is not known" in document.verdict[1]  # its error is of the size of the motion
    assert any("the energy balance is violated" in text for text in document.warnings)


def test_rows_that_are_no_numbers_are_no_ok_and_the_still_stands_before_them(stopped):
    state = stopped.state.copy()
    state[20:] = np.nan
    document = run_document(dataclasses.replace(stopped, state=state))
    assert not document.success and document.warnings[0].startswith(f"from {stopped.time[20]:.6g} s on")
    assert document.still.time == stopped.time[19]


@pytest.mark.tier2
def test_a_constraint_reports_its_largest_force_which_is_the_multipliers(tmp_path):
    run = bc.simulate("four_bar", samples=101)
    document = run_document(run)
    (forces,) = (part for part in document.parts if part.title == "Constraint forces")
    largest = np.abs(run.multipliers).max(axis=0)
    assert [abs(float(row[1].split()[0])) for row in forces.rows] == pytest.approx(largest, rel=1e-5)
    assert report(run, tmp_path / "page").stat().st_size < 0.7e6


@pytest.mark.tier2
def test_a_sizing_shows_the_moment_of_its_largest_power_in_the_film_of_all_motions(sizing):
    document = sizing_document(sizing, film_of(sizing))
    peak = sizing.supply_peak
    assert peak.motion == "fast" and document.still.time == pytest.approx(1.0 + peak.time, abs=0.01)
    assert document.status == "OK" and "All inside" in document.verdict[0]


@pytest.mark.tier2
def test_a_limit_that_is_exceeded_is_the_verdict_and_the_still(sizing):
    robot, motions, _ = sizing.inputs
    weak = {"elbow": bc.Actuator(ratio=1, rated_torque=0.1, peak_torque=0.2, rated_speed=50.0, max_speed=100.0)}
    document = sizing_document(found := bc.size(robot, motions, weak), film_of(found))
    assert document.status == "Exceeded" and not document.success and document.verdict[0] == "EXCEEDED: 3 limits"
    assert document.verdict[1:] == found.exceeded
    assert "elbow exceeds its motor's" in document.still.caption


@pytest.mark.tier2
def test_a_page_and_a_report_count_all_that_is_exceeded(sizing):
    robot, motions, _ = sizing.inputs
    weak = {"elbow": bc.Actuator(ratio=1, rated_torque=0.1, peak_torque=0.2, rated_speed=50.0, max_speed=100.0)}
    found = bc.size(robot, motions, weak)
    film = film_of(found)
    assert len(found.exceeded) == 3 and film.facts[0][0] == "verdict"
    assert film.facts[0][1] == f"3 limits exceeded; the first: {found.exceeded[0]}"
    assert tuple(value for name, value in film.facts if name == "exceeded") == found.exceeded[1:]
    assert "EXCEEDED: 3 limits" in "".join(document_html(sizing_document(found, film)))


@pytest.mark.tier2
def test_a_report_of_a_sizing_holds_its_inputs_under_headings_of_words(tmp_path):
    config = (
        "name: Loaded\nurdf: geared_pendulum\ngravity: [0, -9.81, 0]\n"
        "friction: {shoulder: {viscous: 0.25, coulomb: 0.75}}"
        "\nframes: {hook: {link: %s, xyz: [0, 0, 0]}}\npayloads: [{mass: 1.75, frame: hook, cg: [0.01, 0.02, 0.03]}]\n"
        "motions: {lift_slowly: {kind: waypoints, times: [0, 2.5], positions: [{}, {shoulder: 1}]}}\n"
        "actuators: {shoulder: {ratio: 87.5, efficiency: 0.83, rotor_inertia: 3.1e-5, gear_inertia: 1.7e-6, "
        "rated_torque: 1.23, peak_torque: 4.56, rated_speed: 2900 rpm, max_speed: 4100 rpm, "
        "safety_factor: 1.35, motor_efficiency: 0.91}}"
    )
    link = bc.load_robot("geared_pendulum").urdf.joints["shoulder"].child
    (tmp_path / "loaded.yaml").write_text(config % link, encoding="utf-8")
    sizing = bc.size(tmp_path / "loaded.yaml", mass_tolerance=0.15)
    document = sizing_document(sizing, film_of(sizing))
    text = "".join(document_html(document))
    for value in (
        "geared_pendulum.urdf", "(0, -9.81, 0) m/s²", "1.75 kg @ hook, centre of gravity at (0.01, 0.02, 0.03) m",
        "±15 %", "0.25 N m s/rad", "0.75 N m", "87.5", "0.83", "1.23", "4.56", "2900", "4100", "3.1e-05", "1.7e-06",
        "1.35", "0.91", "lift_slowly", "2.5",
    ):  # fmt: skip
        assert value in text, value
    titles = [part.title for part in document.parts]
    assert "Motion 'lift_slowly' over time" in titles and "Torque and speed at the motor shafts" in titles
    assert not any("_" in title.replace("lift_slowly", "") or ".png" in title for title in titles)


def test_a_report_of_a_run_holds_its_inputs(stopped):
    text = "".join(document_html(run_document(stopped)))
    assert "planar_2r.urdf" in text and "(0, -9.81, 0) m/s²" in text and "effort limit" in text
    assert "Robot and scene" in [part.title for part in run_document(stopped).parts]


def test_a_report_needs_a_result(sizing, tmp_path):
    with pytest.raises(InputError, match="motion 'fast' has no result to report; size it first"):
        report(sizing.inputs[1][1], tmp_path / "x.html")
    with pytest.raises(
        InputError,
        match="report: argument 'source': expected a run, a motion, a fastest motion, a sizing, "
        "a selection, or the path of a run, found",
    ):
        report({}, tmp_path / "x.html")
    assert not list(tmp_path.iterdir())


# ---- pictures for paper


@pytest.mark.tier2
def test_the_pages_of_plots_hold_each_panel_once_and_are_the_same_each_time(stopped):
    titles = lambda pages: [axis.get_title(loc="left") for page in pages for axis in page.axes]  # noqa: E731
    (whole,), apart = run_pages(stopped, 100), run_pages(stopped, 2)
    assert len(apart) > 1 and all(len(page.axes) <= 2 for page in apart) and titles(apart) == titles([whole])
    svg = svg_of(whole)
    assert svg == svg_of(run_pages(stopped, 100)[0]) and "rad/s" in svg and not re.search(r"20\d\d-\d\d-\d\d", svg)


def test_rounding_a_picture_leaves_its_texts_alone(stopped):
    (page,) = run_pages(stopped, 100)
    page.axes[0].set_title("0.123456789")
    assert "0.123456789" in svg_of(page)


# ---- in the browser


def test_names_in_pictures_are_neither_mathematics_nor_hidden():
    figure = new_figure(4.0, 3.0)
    axis = figure.subplots()
    axis.plot([0.0, 1.0], label=literal("_j1 $\\frac$ \udcff"))
    axis.legend()
    assert "_j1 $\\frac$ ?" in svg_of(figure)


def test_names_are_escaped_in_all_of_the_report(stopped):
    text = "".join(document_html(run_document(stopped)))
    assert "<script" not in text and "<b>" not in text and "<img src=x" not in text and "&lt;b&gt;low" in text


@pytest.fixture(scope="module")
def written(stopped, tmp_path_factory):
    return report(stopped, tmp_path_factory.mktemp("report") / "stopped")


@pytest.mark.tier2
def test_on_a_screen_the_verdict_comes_first_and_nothing_runs_but_the_page(written, open_page):
    page = open_page(written, size=(1280, 900))
    assert page.clean and page.do("window.hacked === undefined") and page.do("b.time") == 0.0
    top = lambda selector: page.tab.locator(selector).first.bounding_box()["y"]  # noqa: E731
    assert top(".verdict") < top("#view") < top(".facts")
    assert page.tab.locator(".verdict .word").inner_text() == "OK"
    assert not page.tab.locator(".paper").first.is_visible()


@pytest.mark.tier2
def test_on_a_phone_nothing_is_wider_than_the_screen(written, open_page):
    page = open_page(written, size=(390, 844))
    assert page.do("document.documentElement.scrollWidth") <= 390 and page.clean


@pytest.mark.tier2
def test_on_paper_the_moment_and_the_plots_stand_for_what_moves(written, stopped, open_page):
    page = open_page(written, size=(1280, 900))
    page.tab.wait_for_function("document.querySelector('#still img').complete")
    page.tab.emulate_media(media="print")
    assert page.tab.locator("#still").is_visible() and not page.tab.locator("#main").is_visible()
    page.do("(b.seek(b.end), document.querySelector('#still img').decode())")
    assert page.do("document.querySelector('#still img').naturalWidth") > 300
    assert page.tab.locator("#still figcaption").inner_text().startswith(f"At {stopped.time[-1]:.6g} s")
    plots = page.tab.locator("figure.paper > img[src^='data:image/svg']")
    assert plots.count() == len(run_pages(stopped))
    assert page.do("[...document.images].every((image) => image.complete && image.naturalWidth > 0)")
    widths = page.do("[...document.querySelectorAll('table')].map((t) => t.scrollWidth - t.parentElement.clientWidth)")
    assert max(widths) <= 0 and len(page.tab.pdf(format="A4")) > 20_000


@pytest.mark.tier2
def test_two_notebook_frames_on_one_page_draw_at_full_width_without_an_error(stopped, open_page, tmp_path):
    from bellcrank.replays.page.page import page_html

    frame = NotebookPage(page_html(film_of(stopped)))._repr_html_()
    (tmp_path / "host.html").write_text(f"<!doctype html><body>{frame}<p>and</p>{frame}</body>", encoding="utf-8")
    page = open_page(tmp_path / "host.html", size=(900, 1400), wait=False)
    inner = page.tab.frames[1:]
    for each in inner:
        each.wait_for_function("window.bellcrank?.ready")
        each.evaluate("() => window.bellcrank.ready")
    assert len(inner) == 2 and {each.evaluate("innerWidth") for each in inner} == {884}
    assert all(each.evaluate("window.hacked === undefined") for each in inner)
    assert not page.errors


@pytest.mark.tier2
def test_a_report_lists_forces_with_their_numbers_and_the_terminal_says_what_the_page_warns_of(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    assert main(["report", "spring_pendulum"]) == 0
    assert "warning: link 'arm': moves with a joint and has no mass" in capsys.readouterr().out
    run = bc.simulate("spring_pendulum", 0.2, overrides={"forces.spring.stiffness": "25 N/m"})
    (table,) = (part for part in run_document(run).parts if part.title == "Forces and controllers")
    ((name, kind, where, numbers),) = table.rows
    assert (name, kind, where) == ("spring", "joint_spring", "joint 'slide'") and "stiffness 25 N/m" in numbers
    Path("arm.yaml").write_text(
        "urdf: planar_2r\nforces: [{name: pull, kind: wrench, frame: tip, force: [0, -50, 0]}]\n"
        "motions: {swing: {kind: waypoints, times: [0, 1], positions: [{elbow: 0}, {elbow: 1}]}}\n"
    )
    assert main(["report", "arm.yaml", "--size"]) == 0
    assert "wrench" in Path("arm_report.html").read_text() and "force.y -50 N" in Path("arm_report.html").read_text()
