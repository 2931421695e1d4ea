"""The page of a selection: what it says, what its table, plots and comparison do, and that names do nothing."""

import base64
import dataclasses
import json
import re
import zlib

import numpy as np
import pytest
from sample_selection import BARE, FULL, HARMONIC, PLANET, SILENT, STRONG, candidate, candidates, selection

from bellcrank.actuators.actuator_fields import KEYS
from bellcrank.actuators.conditions import Conditions
from bellcrank.errors import InputError
from bellcrank.replays.film.selection_film import LINK_OPACITY, STRIPES, film_of_selection
from bellcrank.replays.replay import replay
from bellcrank.reports.report import report
from bellcrank.reports.selection_data import MOST_SAMPLES, TOLERANCE, corner_rows, load_points, selection_data, thinned
from bellcrank.reports.selection_report import WORDS, choice_table, conditions_facts, selection_document
from bellcrank.sizing.selection.criteria import CriterionResult
from bellcrank.sizing.selection.load_reductions import reduce_loads
from bellcrank.sizing.selection.pair_detail import pair_detail

pytest_plugins = ("browser",)

HOSTILE = '</title><script>window.hacked = 1</script><img src=x onerror="window.hacked = 2"> \' & ж __proto__ \udcff'


@pytest.fixture(scope="module")
def chosen():
    return selection()


@pytest.fixture(scope="module")
def film(chosen):
    return film_of_selection(chosen)


def with_first(made, **changes):
    """The selection with fields of its first axis changed."""
    first, *others = made.axes
    return dataclasses.replace(made, axes=(dataclasses.replace(first, **changes), *others))


# ---- what it says


def test_a_choice_that_shows_everything_is_ok_and_one_that_does_not_says_what_is_unknown(chosen, film):
    partial = selection_document(chosen, film)
    assert partial.status == "Passes what is known" and partial.success and partial.partial
    assert partial.verdict[-1] == "Of the whole robot, supply power is unknown."
    shown = selection_document(dataclasses.replace(chosen, system=chosen.system[1:]), film)
    assert shown.status == "OK" and shown.success and not shown.partial
    assert shown.verdict == ("2 of 2 joints have a motor and gear.", "All criteria are met for shoulder, elbow.")


def test_nothing_that_fits_and_a_criterion_of_the_robot_that_is_exceeded_are_no_success(chosen, film):
    none = selection_document(with_first(chosen, chosen=None, advice="Take a larger gear."), film)
    assert none.status == "No choice" and not none.success and "Take a larger gear." in none.warnings
    assert none.verdict[:2] == ("1 of 2 joints have a motor and gear.", "Nothing in the catalogue can drive shoulder.")
    over = CriterionResult(name="supply power", use=1.2, verdict="exceeded", text="1200 W of 1000 W.")
    exceeded = selection_document(dataclasses.replace(chosen, system=(over,)), film)
    assert exceeded.status == "Exceeded" and exceeded.verdict[-1] == "The whole robot: 1200 W of 1000 W."


def test_the_choice_names_products_and_says_unknown_where_a_figure_is(chosen):
    table = choice_table(with_first(chosen, chosen=candidates()[3]))
    assert table.rows[0][:5] == (
        "shoulder",
        "Bolt S 40, 320 V",
        "Acme Unstated 1:80",
        "passes what is known",
        "voltage limit",
    )
    assert table.rows[0][6:10] == ("not judged", "unknown", "unknown", "unknown") and "mass unknown" in table.note
    assert table.rows[1][5:] == ("31 %", "not judged", "10.5", "2660 EUR", "9.5", "fits")


def test_the_choice_says_the_inertia_ratio_and_its_limit(chosen):
    one = candidates()[3]
    ratio = CriterionResult(name="inertia ratio", use=0.303, verdict="inside", text="3.03 times the rotor's inertia")
    table = choice_table(with_first(chosen, chosen=dataclasses.replace(one, criteria=(ratio,))))
    assert table.rows[0][6] == "3.03 of 10"
    unknown = dataclasses.replace(ratio, use=None, verdict="unknown")
    table = choice_table(with_first(chosen, chosen=dataclasses.replace(one, criteria=(unknown,))))
    assert table.rows[0][6] == "unknown"


def test_conditions_say_what_is_assumed_and_what_each_pass_chose(chosen):
    conditions = Conditions(
        voltage=48.0, ambient=40.0, assume={"gear.efficiency": 0.7, "motor.mass": 1.0}, momentary_loads={"elbow": 80.0}
    )
    rows = dict(conditions_facts(dataclasses.replace(chosen, conditions=conditions)).rows)
    assert rows["bus voltage"] == "48 V (given)" and rows["ambient temperature"] == "40 °C (given)"
    assert rows["voltage reserve for control"] == "10 %" and rows["rare loads"] == "elbow: 80 N m (given)"
    assert rows["assumed where not stated"] == "gear.efficiency = 0.7 (given); motor.mass = 1 (given)"
    assert rows["pass 2 of the feedback of masses"] == "s40+wave; strong+wave"
    without = dict(conditions_facts(chosen).rows)
    assert without["bus voltage"] == "each motor's nominal voltage" and "nothing" in without["assumed where not stated"]


def test_conditions_of_an_axis_follow_where_they_are_not_those_of_the_robot(chosen):
    elbow = chosen.conditions.updated({"voltage": 24.0, "safety_factor": 1.2}, "actuators.elbow")
    axes = (chosen.axes[0], dataclasses.replace(chosen.axes[1], conditions=elbow))
    rows = dict(conditions_facts(dataclasses.replace(chosen, axes=axes)).rows)
    assert rows["at elbow"] == "voltage 24 V (actuators.elbow)" and "at shoulder" not in rows


def test_every_condition_is_listed(chosen):
    assert len(conditions_facts(chosen).rows) == len(KEYS) + len(chosen.iterations)
    assert {field.name for field in dataclasses.fields(Conditions)} == {*WORDS, "assume", "momentary_loads", "sources"}


# ---- its data


def test_the_loads_that_decide_every_straight_limit_are_kept(chosen):
    rng = np.random.default_rng(3)
    for load in reduce_loads(tuple(one.axis for one in chosen.axes), chosen.cycles):
        for cycle in load.cycles:
            everything = np.column_stack([cycle.torque, cycle.speed, cycle.features[:, 2]])
            kept = load_points(cycle)
            assert len(kept) < 1100 < len(everything)
            largest = np.abs(everything).max(axis=0)
            for weights in rng.normal(size=(50, 3)) / largest:
                for braking in (1.0, 0.5):  # of the torque where the load drives, relative to where the motor drives
                    of_all, of_kept = (
                        np.abs(part @ weights - np.where(drives(part), 0.0, (1.0 - braking) * part[:, 0] * weights[0]))
                        for part in (everything, kept)
                    )
                    reach = TOLERANCE * np.linalg.norm(weights * largest)  # what load_points promises
                    assert of_all.max() - reach <= of_kept.max() <= of_all.max() * (1.0 + 1e-12)


@pytest.mark.tier2
@pytest.mark.parametrize("shape", ["ball", "disk", "needle", "box"])
def test_corners_of_any_shape_of_load_enclose_all_of_it(shape):
    points = np.random.default_rng(5).normal(size=(3000, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    points *= {"ball": 1.0, "disk": [1.0, 0.0, 1.0], "needle": [1.0, 0.0, 0.0], "box": 1.0}[shape]
    if shape == "box":
        points = np.clip(points, -0.3, 0.3) * [1e5, 1e-3, 2.0]
    rows = corner_rows(points)
    largest = np.abs(points).max(axis=0)
    ways = np.random.default_rng(6).normal(size=(2000, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    scaled = points / np.where(largest > 0.0, largest, 1.0)
    assert ((scaled @ ways.T).max(axis=0) - (scaled[rows] @ ways.T).max(axis=0)).max() <= TOLERANCE * 1.001
    assert len(rows) < {"ball": 3000, "disk": 200, "needle": 4, "box": 1600}[shape]


def thinned_samples(cycle):
    """The samples with which the points of a cycle begin."""
    return thinned(np.column_stack([cycle.torque, cycle.speed, cycle.features[:, 2]]), MOST_SAMPLES)


def drives(table):
    return table[:, 0] * table[:, 1] >= 0.0


def test_an_unknown_number_is_none_and_a_product_stands_once(chosen):
    data = json.loads(json.dumps(selection_data(chosen), allow_nan=False))
    first = data["axes"][0]
    assert [one["mass"] for one in first["candidates"]] == [7.4, 10.5, 13.2, None, None, 7.2]
    assert [motor["id"] for motor in data["motors"]] == ["s40", "strong", "bare"]
    assert first["candidates"][3]["shaft"]["leftOut"] == ["gear efficiency", "gear inertia"]
    assert first["candidates"][4]["cycles"][0]["rmsTorque"] is None
    assert [one["chosen"] for one in data["pareto"]] == [False, True, False, False, False]


def test_the_origin_of_the_figures_of_each_product_is_in_the_page(chosen):
    data = selection_data(chosen)
    pair = chosen.axes[0].chosen
    (motor,) = [one for one in data["motors"] if one["id"] == pair.motor.id]
    (gear,) = [one for one in data["gears"] if one["id"] == pair.gear.id]
    for product, one in ((pair.motor, motor), (pair.gear, gear)):
        for part in (product.quality.replace("_", " "), product.source, product.checked):
            assert part in one["origin"], (part, one)


def test_the_chosen_pair_is_listed_even_where_it_is_not_among_the_best(chosen):
    one = candidate(STRONG, SILENT, 0.7, unknown=2)
    data = selection_data(with_first(chosen, chosen=one))
    assert data["axes"][0]["chosen"] == 0 and len(data["axes"][0]["candidates"]) == 7
    assert data["gears"][data["axes"][0]["candidates"][0]["gear"]]["id"] == "silent"


# ---- the film


def test_the_cylinders_have_the_catalogue_size_and_lie_at_the_joint_along_its_axis(chosen, film):
    robot = chosen.inputs.mechanism.robot
    for number, axis in enumerate(chosen.axes):
        body = film.bodies[len(film.bodies) - len(chosen.axes) + number]
        joint = robot.urdf.joints[axis.axis.name]
        assert joint.rpy == (0.0, 0.0, 0.0)  # so that the joint's axis is that of its parent
        assert body.name == axis.axis.mount == joint.parent
        motor, gear = body.shapes
        assert motor.size == (axis.chosen.motor.diameter / 2, axis.chosen.motor.length)
        assert gear.size == (HARMONIC.diameter / 2, HARMONIC.length)
        apart = np.subtract(gear.pose[:3], motor.pose[:3])
        point, direction = np.array(joint.xyz), np.array(joint.axis)
        assert np.linalg.norm(np.cross(apart, direction)) < 1e-12
        assert np.linalg.norm(apart) == pytest.approx((motor.size[1] + gear.size[1]) / 2)
        whole = np.array([motor.pose[:3] - direction * motor.size[1] / 2, gear.pose[:3] + direction * gear.size[1] / 2])
        np.testing.assert_allclose(whole.mean(axis=0), point, atol=1e-12)
    assert all(s.colour[3] <= LINK_OPACITY for body in film.bodies[:-2] for s in body.shapes)
    assert [layer.name for layer in film.layers] == ["links", "shoulder: S 40 + W-40-100", "elbow: S 80 + W-40-100"]


def test_the_axis_of_the_cylinders_is_that_of_the_joint_in_the_world(chosen, film):
    robot = chosen.inputs.mechanism.robot
    for body, axis in zip(film.bodies[-2:], chosen.axes, strict=True):
        x, y, z, w = body.shapes[0].pose[3:]
        along = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
        joint = robot.urdf.joints[axis.axis.name]
        assert joint.rpy == (0.0, 0.0, 0.0)  # so that the joint's axis is that of its parent
        np.testing.assert_allclose(along, joint.axis, atol=1e-12)


def test_a_product_of_unknown_size_is_striped(chosen):
    made = film_of_selection(with_first(chosen, chosen=candidates()[4]))
    body = made.bodies[-2]
    assert len(body.shapes) == STRIPES + 1 and body.shapes[0].colour == body.shapes[STRIPES - 1].colour
    gaps = np.diff([np.linalg.norm(s.pose[:3]) for s in body.shapes[:2]])
    assert abs(gaps[0]) > 1.5 * body.shapes[0].size[1]  # there is room between two rings


def test_an_actuator_on_another_link_is_drawn_there(chosen):
    axis = chosen.axes[0]
    mount = {"mount": "link_2", "mount_point": (0.1, 0.2, 0.3), "mount_direction": (1.0, 0.0, 0.0)}
    moved = with_first(chosen, axis=dataclasses.replace(axis.axis, **mount))
    body = film_of_selection(moved).bodies[-2]
    ends = [body.shapes[0].pose[0] - body.shapes[0].size[1] / 2, body.shapes[1].pose[0] + body.shapes[1].size[1] / 2]
    assert body.name == "link_2" and np.mean(ends) == pytest.approx(0.1) and body.shapes[0].pose[1:3] == (0.2, 0.3)


def test_a_replay_of_a_selection_needs_no_report(chosen, tmp_path):
    page = replay(chosen, tmp_path / "arm.html")
    text = page.read_text("utf-8")
    assert "<title>planar_2r: selection</title>" in text and "Motors and gears" in text and 'id="selection"' not in text


def test_a_selection_without_its_motions_cannot_be_shown(chosen):
    with pytest.raises(InputError, match=r"selection of planar_2r: it does not hold its motions; make it with bellc"):
        film_of_selection(dataclasses.replace(chosen, inputs=None))


# ---- in the browser


@pytest.fixture(scope="module")
def written(chosen, tmp_path_factory):
    return report(chosen, tmp_path_factory.mktemp("selection") / "arm")


@pytest.fixture(scope="module")
def page(written, open_page):
    return open_page(written, size=(1280, 800))


def column(page, name):
    """The texts of a column of the table of candidates."""
    number = page.do(
        "[...document.querySelectorAll('.candidates thead th')].findIndex((th) => th.textContent.startsWith(x))", name
    )
    cells = f".candidates tbody td:nth-child({number + 1})"
    return page.tab.locator(cells).evaluate_all("(cells) => cells.map((cell) => cell.firstChild.textContent)")


def header(page, name):
    return page.tab.locator(f".candidates thead button:text-is('{name}')")


@pytest.mark.tier2
def test_the_page_opens_without_a_request_or_an_error_and_shows_the_chosen_pair(page):
    assert page.clean and page.tab.title() == "planar_2r"
    assert page.tab.locator(".verdict .word").inner_text() == "Passes what is known"
    assert page.tab.locator("#pair h3").inner_text() == "Bolt S 40, 320 V + Wave W-40-100"
    assert page.tab.locator("[role=tab]").all_inner_texts() == ["●\nshoulder", "●\nelbow"]


@pytest.mark.tier2
def test_a_header_sorts_both_ways_with_unknown_values_last(page):
    before = column(page, "motor")
    header(page, "mass [kg]").click()
    assert column(page, "mass") == ["7.2", "7.4", "10.5", "13.2", "unknown", "unknown"]
    header(page, "mass [kg]").press("Enter")
    assert column(page, "mass") == ["13.2", "10.5", "7.4", "7.2", "unknown", "unknown"]
    sorts = page.do("[...document.querySelectorAll('.candidates thead th')].map((th) => th.ariaSort)")
    assert sorts.count("descending") == 1 and sorts.count("none") == 8
    header(page, "tier").press("Space")
    assert column(page, "tier")[0].startswith("●") and column(page, "tier")[-1].startswith("✕")
    header(page, "motor").click()
    assert column(page, "motor") == sorted(before)
    header(page, "largest utilisation [%]").click()
    assert column(page, "largest")[-1] == "1420"


@pytest.mark.tier2
def test_filters_by_text_tier_maker_and_by_what_is_shown(page):
    rows = page.tab.locator(".candidates tbody tr")
    text, tier, maker = (page.tab.get_by_label(name, exact=True) for name in ("Filter by text", "Tier", "Maker"))
    shown = page.tab.get_by_label("only all criteria shown")
    text.fill("acme w-40")
    assert rows.count() == 2 and page.tab.locator(".filters output").inner_text() == "2 of 6 pairs"
    text.fill("no such")
    assert rows.inner_text() == "no pair matches the filter"
    text.fill("")
    tier.select_option("fails")
    assert rows.count() == 1
    tier.select_option("")
    maker.select_option("Wave")
    assert rows.count() == 3
    maker.select_option("")
    shown.check()
    assert rows.count() == 2
    shown.uncheck()
    assert rows.count() == 6 and page.clean


@pytest.mark.tier2
def test_hovering_shows_a_pair_until_the_pointer_leaves_and_a_press_keeps_it(page):
    name = page.tab.locator("#pair h3")
    rows = page.tab.locator(".candidates tbody tr")
    page.tab.locator("[role=tab]").nth(1).click()
    before = name.inner_text()
    assert before == "Acme S 80, 320 V + Wave W-40-100"
    row = rows.filter(has_text="P 1:50")
    row.hover()
    assert name.inner_text() == "Acme S 80, 320 V + Acme P 1:50"
    page.tab.mouse.move(2, 2)
    assert name.inner_text() == before
    row.locator("td").nth(3).click()
    page.tab.mouse.move(2, 2)
    assert name.inner_text() == "Acme S 80, 320 V + Acme P 1:50"
    row.press("Home")
    assert name.inner_text() != "Acme S 80, 320 V + Acme P 1:50"
    page.tab.keyboard.press("ArrowDown")
    assert page.do("document.activeElement.matches('tr.current:nth-child(2)')")
    page.tab.locator("[role=tab]").first.click()


@pytest.mark.tier2
def test_the_plane_shows_the_load_at_the_shaft_as_python_computes_it(page, chosen):
    for number, axis in enumerate(chosen.axes):
        loads = reduce_loads(tuple(one.axis for one in chosen.axes), chosen.cycles)[number]
        for rank, one in enumerate(axis.candidates):
            drawn = page.do("b.selection.axes[x[0]].candidates[x[1]].detail().cycles", [number, rank])
            detail = pair_detail(chosen, axis, one)
            for cycle, reduced, seen in zip(detail.cycles, loads.cycles, drawn, strict=True):
                whole = np.column_stack([cycle.speed, cycle.torque])
                points = np.column_stack([seen["speed"], seen["torque"]])
                scale = np.abs(whole).max(axis=0)
                samples = points[: len(thinned_samples(reduced))] / scale
                apart = np.abs(samples[:, None] - whole[None] / scale).max(axis=2).min(axis=1)
                assert apart.max() < 1e-3, (axis.axis.name, one.id)  # numbers are sent with five digits
                np.testing.assert_allclose(np.abs(points).max(axis=0), scale, rtol=1e-3)
                assert seen["rmsTorque"] == (pytest.approx(cycle.rms_torque, rel=1e-4) if cycle.rms_torque else None)


@pytest.mark.tier2
def test_the_marks_of_the_plane_are_at_their_values(page):
    """The diamond of the RMS torque is where the ticks of the axes say."""
    seen = page.do(
        """(() => {
          const plot = document.querySelector("#pair .plane svg");
          const ticks = [...plot.querySelectorAll(".tick")].map((t) => [Number(t.textContent.replace("−", "-")),
            Number(t.getAttribute("x")), Number(t.getAttribute("y")), t.getAttribute("text-anchor")]);
          const d = plot.querySelector(".diamond").getAttribute("d").match(/-?[\\d.]+/g).map(Number);
          return { ticks, x: d[0] + 6, y: d[1], cycle: b.selection.axes[0].candidates[0].detail().cycles[0] };
        })()"""
    )
    across = np.array([tick[:2] for tick in seen["ticks"] if tick[3] == "middle"])
    up = np.array([[tick[0], tick[2] - 4] for tick in seen["ticks"] if tick[3] == "end"])
    to = lambda table, value: np.polyval(np.polyfit(table[:, 0], table[:, 1], 1), value)  # noqa: E731
    assert seen["x"] == pytest.approx(to(across, seen["cycle"]["meanSpeed"] * 30 / np.pi), abs=0.5)
    assert seen["y"] == pytest.approx(to(up, seen["cycle"]["rmsTorque"]), abs=0.5)


@pytest.mark.tier2
def test_bars_have_the_length_of_the_utilisation_and_a_press_tells_the_load_and_the_limit(page):
    page.tab.locator(".candidates tbody tr", has_text="direct drive").locator("td").nth(3).click()
    bars = page.tab.locator("#pair .uses li")
    over = bars.first
    assert over.get_attribute("class") == "exceeded" and "▲ over" in over.inner_text() and "1420 %" in over.inner_text()
    assert "bellcrank select … --keep shoulder=" in page.tab.locator("#pair .figures").inner_text()
    page.tab.locator(".candidates tbody tr", has_text="Unstated").locator("td").nth(3).click()
    widths = page.do(
        """[...document.querySelectorAll("#pair .uses li")].map((li) => {
          const width = (name) => li.querySelector(name).getBoundingClientRect().width;
          return [li.className, li.querySelector(".value").textContent, width(".fill") / width(".bar-track")];
        })"""
    )
    assert widths[0][:2] == ["inside", "48 %"] and widths[0][2] == pytest.approx(0.48 * 0.8, abs=0.01)
    assert [each[1] for each in widths[2:]] == ["unknown (40 %)"] * 4 + ["note"]
    assert bars.first.locator(".sentence").inner_text() == "voltage limit: 0.48 of 1"  # the one that binds
    button, sentence = bars.nth(1).locator("button"), bars.nth(1).locator(".sentence")
    assert button.get_attribute("aria-expanded") == "false" and not sentence.is_visible()
    button.press("Enter")
    assert button.get_attribute("aria-expanded") == "true" and sentence.is_visible()
    unknown = page.do("getComputedStyle(document.querySelector('#pair .unknown .fill')).backgroundImage")
    assert "repeating-linear-gradient" in unknown


@pytest.mark.tier2
def test_the_temperature_is_drawn_with_its_limit_or_said_to_be_unknown(page):
    temperature = page.tab.locator("#pair .temperature-part")
    page.tab.locator(".candidates tbody tr", has_text="P 1:50").locator("td").nth(3).click()
    assert temperature.locator("path.winding").count() == 2 and "winding limit 140 °C" in temperature.inner_text()
    page.tab.locator(".candidates tbody tr", has_text="Bare").locator("td").nth(3).click()
    assert "not stated: resistance, torque constant, thermal resistance" in temperature.inner_text()


@pytest.mark.tier2
def test_two_marked_pairs_stand_side_by_side_and_a_third_replaces_the_first(page):
    sides = page.tab.locator("#comparison .sides h3")
    assert sides.all_inner_texts() == ["Bolt S 40, 320 V + Wave W-40-100", "Acme S 80, 320 V + Wave W-40-100"]
    page.tab.get_by_label("compare Acme S 80, 320 V + Acme P 1:50").check()
    assert sides.all_inner_texts() == ["Acme S 80, 320 V + Wave W-40-100", "Acme S 80, 320 V + Acme P 1:50"]
    boxes = [box.bounding_box() for box in page.tab.locator("#comparison .sides .pair").all()]
    assert boxes[0]["y"] == boxes[1]["y"] and boxes[0]["x"] + boxes[0]["width"] <= boxes[1]["x"]
    assert page.tab.locator("#comparison .plane").count() == 2
    table = page.tab.locator("#comparison table tbody tr", has_text="mass")
    assert table.inner_text().split("\t") == ["mass", "10.5 kg", "13.2 kg"]
    page.tab.get_by_label("compare Acme S 80, 320 V + Acme P 1:50").uncheck()
    assert "Mark two pairs" in page.tab.locator("#comparison").inner_text()
    page.tab.get_by_label("compare Bolt S 40, 320 V + Wave W-40-100").check()
    assert sides.count() == 2


@pytest.mark.tier2
def test_a_tap_on_the_pareto_picture_tells_the_combination(written, open_page):
    page = open_page(written, size=(390, 844), has_touch=True)
    marks, told = page.tab.locator(".combination-mark"), page.tab.locator(".combination")
    assert marks.count() == 5 and "17.9 kg" in told.inner_text() and "– the choice" in told.inner_text()
    lightest_load = page.tab.get_by_role("button", name="mass 21 kg")
    lightest_load.tap()
    assert "mass 21 kg, largest utilisation 31 %, loss 19 W, cost 5320" in told.inner_text()
    assert told.locator("dd").all_inner_texts() == ["Acme S 80, 320 V + Wave W-40-100"] * 2
    lightest_load.focus()
    page.tab.keyboard.press("ArrowRight")
    page.tab.keyboard.press("ArrowRight")
    assert "mass unknown" in told.inner_text() and page.clean


@pytest.mark.tier2
@pytest.mark.parametrize("size", [(390, 844), (1280, 800)])
def test_nothing_is_wider_than_the_screen_or_cut_off(written, open_page, size):
    page = open_page(written, size=size)
    assert page.do("document.documentElement.scrollWidth") <= size[0] and page.clean
    cut = page.do(
        """[...document.querySelectorAll(`h2, h3, p, dd, dt, button, .sentence, figcaption, .plot-legend span,
          .criterion, .value`)].filter((e) => e.offsetParent && !e.closest(".wide, .table-scroll, #main, .axis-tabs")
          && e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).display !== "inline").map((e) => e.textContent)"""
    )
    assert cut == []
    beyond = page.do(
        """[...document.querySelectorAll(".svg-plot text")].filter((t) => {
          const [a, b] = [t.getBoundingClientRect(), t.closest("svg").getBoundingClientRect()];
          const beside = a.left < b.left - 1 || a.right > b.right + 1;
          return a.width && (beside || a.top < b.top - 1 || a.bottom > b.bottom + 1);
        }).map((t) => t.textContent)"""
    )
    assert beyond == []


@pytest.mark.tier2
def test_every_axis_of_every_plot_has_a_unit(page):
    labels = page.tab.locator(".svg-plot .axis").evaluate_all("(all) => all.map((each) => each.textContent)")
    assert len(labels) >= 10 and all(re.search(r"\[.+\]$", label) for label in labels)


@pytest.mark.tier2
def test_on_paper_each_joint_has_its_plots_and_its_first_candidates(written, open_page):
    page = open_page(written, size=(1280, 900))
    pdf = page.tab.pdf(format="A4")
    assert len(pdf) > 40_000 and page.clean
    page.tab.emulate_media(media="print")
    assert not page.tab.locator("#chooser").is_visible() and not page.tab.locator("#main").is_visible()
    sections = page.tab.locator("#paper-pairs > section")
    assert sections.locator("h2").all_inner_texts() == ["Joint shoulder", "Joint elbow", "Candidates"]
    assert sections.first.locator(".svg-plot").count() == 2 and sections.last.locator("table").count() == 2
    assert sections.last.locator("tbody tr").count() == 12
    assert sections.first.locator(".sentence").first.is_visible() and page.tab.locator("#still img").is_visible()


@pytest.mark.tier2
def test_hostile_names_are_shown_and_do_nothing(chosen, open_page, tmp_path):
    motor = dataclasses.replace(FULL, id=HOSTILE, model=HOSTILE, maker="__proto__", currency=HOSTILE)
    gear = dataclasses.replace(PLANET, id="constructor", model=HOSTILE, maker=HOSTILE)
    one = dataclasses.replace(
        candidate(motor, gear, 0.5, unknown=1),
        binding=HOSTILE,
        fit=HOSTILE,
        criteria=(CriterionResult(name=HOSTILE, use=0.5, verdict="inside", text=HOSTILE),),
    )
    first = chosen.axes[0]
    hostile = dataclasses.replace(
        with_first(
            chosen, axis=dataclasses.replace(first.axis, name=HOSTILE), chosen=one, candidates=(one,), advice=HOSTILE
        ),
        robot=HOSTILE,
        proof=HOSTILE,
        pareto_proof=HOSTILE,
        warnings=(HOSTILE,),
        iterations=((HOSTILE,),),
        cycles=tuple(dataclasses.replace(cycle, name=HOSTILE) for cycle in chosen.cycles),
        system=one.criteria,
        pareto=(chosen.pareto[0]._replace(pairs=(HOSTILE, "toString")),),
    )
    page = open_page(report(hostile, tmp_path / "hostile.html"), size=(390, 844))
    assert page.clean and page.do("window.hacked === undefined")
    assert page.do("document.documentElement.scrollWidth") <= 390
    page.tab.locator(".candidates tbody tr td").nth(3).click()
    page.tab.locator("#pair .use").first.click()
    page.tab.get_by_label("Maker", exact=True).select_option("__proto__")
    assert page.tab.locator("#pair h3").inner_text().count("<script>") == 2 and page.clean
    assert page.do("window.hacked === undefined && document.querySelectorAll('img[src=x]').length === 0")


@pytest.mark.tier2
def test_a_joint_without_candidates_and_an_empty_pareto_front_are_said(chosen, open_page, tmp_path):
    nothing = dataclasses.replace(
        with_first(chosen, chosen=None, candidates=(), counts=(("fails", 0),), advice="Add larger motors."), pareto=()
    )
    page = open_page(report(nothing, tmp_path / "nothing.html"), size=(1280, 800))
    assert page.clean and page.tab.locator("#pair").inner_text() == "There is no candidate."
    assert "Add larger motors." in page.tab.locator("#axis-summary").inner_text()
    assert page.tab.locator("[role=tab]").first.inner_text().startswith("✕")
    assert "no Pareto picture" in page.tab.locator("#pareto").inner_text()
    page.tab.locator("[role=tab]").nth(1).click()
    assert page.tab.locator(".candidates tbody tr").count() == 6 and page.clean


@pytest.mark.tier2
def test_links_and_motors_can_be_hidden_in_the_view(page):
    layers = page.do("b.layers()")
    assert [layer["name"] for layer in layers if layer["group"] == "Motors and gears"] == [
        "shoulder: S 40 + W-40-100", "elbow: S 80 + W-40-100",
    ]  # fmt: skip
    before = page.do("b.capture()")
    number = next(k for k, layer in enumerate(layers) if layer["name"].startswith("elbow"))
    page.do("b.showLayer(x, false)", number)
    assert page.do("b.capture()") != before
    page.do("b.showLayer(x, true)", number)
    assert page.do("b.capture()") == before


@pytest.mark.tier2
def test_the_data_of_two_thousand_pairs_stays_small(chosen):
    motors = [
        dataclasses.replace(FULL, id=f"m{k}", model=f"M {k}", rotor_inertia=1e-4 * (1 + k / 50)) for k in range(100)
    ]
    gears = [dataclasses.replace(HARMONIC, id=f"g{k}", ratio=50.0 + k) for k in range(10)]
    many = tuple(
        candidate(motor, gear, 0.2 + 0.0007 * (k + 100 * j), loss=10.0 + k + 0.37 * j)
        for j, gear in enumerate(gears)
        for k, motor in enumerate(motors)
    )
    axes = tuple(dataclasses.replace(axis, candidates=many, chosen=many[0]) for axis in chosen.axes)
    from bellcrank.reports.selection_data import encoded_selection

    text = encoded_selection(dataclasses.replace(chosen, axes=axes))
    assert len(text) < 1.2e6
    assert len(json.loads(zlib.decompress(base64.b64decode(text)))["axes"][0]["candidates"]) == 1000


@pytest.mark.tier2
def test_sample_has_a_pair_of_every_kind():
    assert {one.tier for one in candidates()} == {"all criteria shown", "passes what is known", "fails"}
    assert BARE.resistance is None and SILENT.efficiency is None and PLANET.efficiency_curve is not None


# ---- two selections over each other


@pytest.fixture(scope="module")
def of_two(chosen, tmp_path_factory):
    """The page of a selection and of another one, with a stronger motor at the shoulder and none at the elbow."""
    shoulder, elbow = with_first(chosen, chosen=candidates()[1]).axes
    other = dataclasses.replace(
        chosen, robot=HOSTILE, axes=(shoulder, dataclasses.replace(elbow, chosen=None)), inputs=chosen.inputs
    )
    return report(chosen, tmp_path_factory.mktemp("two") / "two.html", over=other)


@pytest.mark.tier2
@pytest.mark.parametrize(("size", "scheme"), [((1280, 800), "light"), ((390, 844), "dark")])
def test_two_selections_stand_side_by_side_for_each_joint(of_two, open_page, size, scheme):
    page = open_page(of_two, size=size, color_scheme=scheme)
    assert page.clean and page.do("window.hacked === undefined")
    box = page.tab.locator("#comparison")
    cells = "[...[...row.children].map((cell) => cell.textContent), row.querySelectorAll('mark').length]"
    found = box.locator("tbody tr").evaluate_all(f"(rows) => rows.map((row) => {cells})")
    rows = {name: tuple(others) for name, *others in found}
    assert rows["mass"] == ("7.4 kg", "10.5 kg", 2) and rows["fit"] == ("fits", "fits", 0)
    assert rows["voltage limit"] == ("62 %", "31 %", 2) and "inertia ratio" not in rows  # a note is not compared
    assert box.locator(".plane").count() == 2
    ticks = "[...plane.querySelectorAll('.tick')].map((each) => each.textContent)"
    planes = box.locator(".plane").evaluate_all(f"(planes) => planes.map((plane) => {ticks})")
    assert planes[0] == planes[1] and len(planes[0]) > 4  # the same axes
    page.tab.get_by_role("tab", name="elbow").click()
    assert "nothing fits" in box.locator("thead").inner_text() and box.locator(".plane").count() == 1
    assert page.do("document.documentElement.scrollWidth") <= size[0] and page.clean
    page.tab.emulate_media(media="print")
    assert not box.is_visible() and page.tab.locator("#paper-pairs .plane").count() == 3
