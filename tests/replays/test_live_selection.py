"""The page of a selection computes: the motor and gear that its reader chooses for each joint are judged as Python
judges them.
"""

import shlex
from dataclasses import replace

import numpy as np
import pytest
import yaml

import bellcrank as bc
from bellcrank.actuators.catalogue.catalogue import Catalogue, load_catalogue
from bellcrank.cli import main
from bellcrank.replays.film.selection_film import film_of_selection
from tests.replays.test_live_sizing import NO_VIEW, compare, found_of, page_of

pytest_plugins = ("browser",)


def sized(selection, folder):
    """The sizing of what was selected."""
    return bc.size(selection.write_config(folder / "written.yaml"))


# ---- without a browser


@pytest.fixture(scope="module")
def pendulum():
    return bc.select("geared_pendulum")


def test_page_of_a_selection_has_its_best_pairs_and_the_loads_with_their_masses(pendulum, tmp_path):
    live = film_of_selection(pendulum, live=None).live.content
    (choice,) = (one for one in live["settings"] if "options" in one)
    candidates = [each.id for each in pendulum.axis("shoulder").candidates]
    assert live["choices"]["joints"][0]["pairs"] == candidates[: len(choice["options"])]
    assert 2 <= len(choice["options"]) <= 5 and choice["value"] == 0.0
    assert live["stored"]["figures"][0] == pytest.approx(sized(pendulum, tmp_path).joint("shoulder").peak_torque)
    assert not [one for one in live["settings"] if one["group"].startswith("payload 2")]  # the motor's body is none


def test_page_of_a_selection_says_why_it_only_replays():
    robot = bc.load_robot("geared_pendulum")
    motion = bc.load_scene("geared_pendulum").motion("lift_and_return")
    film = film_of_selection(bc.select(robot, [motion]), live=None)
    assert film.live is None and not film.charts
    assert any("replays the selection" in note and "robot configuration" in note for note in film.notes)
    assert film_of_selection(bc.select("geared_pendulum"), live=False).live is None


# ---- in a browser


@pytest.fixture(scope="module", params=["geared_pendulum", "ur5"])
def live_page(request, open_page, tmp_path_factory):
    path = page_of(bc.select(request.param), tmp_path_factory.mktemp("page"))
    return request.param, open_page(path, size=(1280, 800), script=NO_VIEW)


def chosen_at_random(page, rng):
    """Another motor and gear of each joint."""
    options = page.do("b.live.options")
    return [[k, int(rng.integers(0, count))] for k, count in enumerate(options) if count]


@pytest.mark.tier2
class TestAgainstPython:
    @pytest.mark.parametrize("seed", range(2))
    def test_chosen_motors_and_gears_are_judged_as_python_judges_them(self, live_page, seed, tmp_path):
        name, page = live_page
        page.do("b.live.reset()")
        assert page.do("b.live.agreement") < 1e-6
        changes = chosen_at_random(page, np.random.default_rng(seed))
        payload = [k for k, one in enumerate(page.do("b.live.settings")) if one["path"] == "payloads.1.mass"]
        assert page.do("b.live.set(x)", [*changes, *([k, 2.2] for k in payload)])
        text = yaml.safe_load(page.do("b.live.yaml()")["text"])
        selection = bc.select(name, keep=text["keep"], overrides=text.get("overrides"))
        assert {one.axis.name: one.chosen.id for one in selection.axes} == text["keep"]
        sizing = sized(selection, tmp_path)
        compare(found_of(page), sizing)
        assert page.clean

    def test_copied_command_keeps_the_pairs(self, live_page, tmp_path, capsys):
        name, page = live_page
        page.do("b.live.reset()")
        changes = chosen_at_random(page, np.random.default_rng(5))
        page.do("b.live.set(x)", changes)
        words = shlex.split(page.do("b.live.command()")["text"])
        assert words[:3] == ["bellcrank", "select", name]
        main([*words[1:], "--no-plots", "--out", str(tmp_path / "out")])
        printed = capsys.readouterr().out
        kept = [word.partition("=")[2] for word, before in zip(words[1:], words, strict=False) if before == "--keep"]
        assert len(kept) == len([k for k in page.do("b.live.options") if k]) and printed
        rows = (tmp_path / "out" / "selection.json").read_text()
        assert all(part in rows for pair in kept for part in pair.split("+"))


@pytest.mark.tier2
class TestHandling:
    def test_a_choice_changes_bar_title_and_limits_and_goes_back(self, live_page):
        _, page = live_page
        page.do("b.live.reset()")
        place = next(k for k, count in enumerate(page.do("b.live.options")) if count)
        setting = page.do("b.live.settings")[place]
        chooser = page.tab.get_by_label(f"motor and gear: {setting['name']}", exact=True)
        stored = page.do("b.live.result")
        chooser.select_option(index=1)
        page.do("new Promise(requestAnimationFrame)")
        assert page.do("b.live.values")[place] == 1
        assert setting["name"] in page.tab.locator("#live-bar .chips").inner_text()
        assert page.do("b.live.result") != stored
        page.tab.get_by_role("button", name="Undo").click()
        assert page.do("b.live.result") == stored and page.clean

    @pytest.mark.parametrize("value", ["99", "-1", "0.5", "NaN", "", "<script>alert(1)</script>", "1e999"])
    def test_a_choice_that_there_is_not_is_refused_with_a_sentence(self, live_page, value):
        _, page = live_page
        page.do("b.live.reset()")
        before = page.do("b.live.values")
        place = next(k for k, count in enumerate(page.do("b.live.options")) if count)
        page.do("(location.hash = '#set=' + encodeURIComponent(x), 1)", f"#{place}={value}")
        message = page.tab.locator(".live-message")
        message.wait_for(state="visible")
        assert "motor and gear" in message.inner_text()
        assert page.do("b.live.values") == before
        page.do("b.live.set([])")
        assert page.clean


HOSTILE = '<img src=x onerror="window.hacked=1">\'</script><script>hacked=2</script>;$(touch hacked)`'


@pytest.mark.tier2
def test_hostile_names_of_products_are_text(open_page, tmp_path):
    products = load_catalogue()
    motors = [replace(one, model=HOSTILE, maker=HOSTILE) for one in products.motors if one.id == "yaskawa_sgm7j_04a"]
    motors += [replace(motors[0], id="another: one#", model=HOSTILE + "2")]
    gears = [replace(one, model=HOSTILE) for one in products.gears if one.id == "beckhoff_npt025_ma_40"]
    selection = bc.select("geared_pendulum", catalogue=Catalogue(tuple(motors), tuple(gears)))
    page = open_page(page_of(selection, tmp_path), size=(1280, 800))
    assert page.do("b.live.options")[0] >= 2
    assert page.do("b.live.set([[0, 1]])") and HOSTILE in page.tab.locator("#live-bar .chips").inner_text()
    assert HOSTILE in page.tab.locator("#live-panel select").first.inner_text()
    assert "No command line gives these values" in page.do("b.live.command()")["error"]  # not of the bundled catalogue
    keep = yaml.safe_load(page.do("b.live.yaml()")["text"])["keep"]["shoulder"]
    assert keep in [one.id for one in selection.axis("shoulder").candidates]
    assert page.do("window.hacked") is None and page.do("document.querySelectorAll('#live-bar img').length") == 0
    assert page.clean


@pytest.mark.tier2
def test_computing_adds_at_most_150_kb_to_the_page_of_the_ur5(tmp_path):
    sizing = bc.size("ur5")
    live, static = (bc.replay(sizing, tmp_path / f"{live}.html", live=live).stat().st_size for live in (True, False))
    assert live - static < 150_000
    assert page_of(bc.select("ur5"), tmp_path).stat().st_size - static < 150_000
