"""The page of a run computes: what it says of changed values in a real browser is what Python says of them."""

import re

import numpy as np
import pytest

import bellcrank as bc
from bellcrank.config.yaml_file import read_value
from bellcrank.replays.film.run_film import film_of_run
from tests.replays.test_live_sizing import NO_VIEW

pytest_plugins = ("browser",)
RUNS = ("four_bar", "spring_pendulum", "rolling_disk", "planar_2r_swing")


def overrides_of(page):
    """What the page's YAML says."""
    text = page.do("b.live.yaml()")["text"]
    lines = [re.split(r": ", line, maxsplit=1) for line in text.split("\n") if text]
    return {path: read_value(value, path) for path, value in lines}


@pytest.fixture(scope="module", params=RUNS)
def live_run(request, open_page, tmp_path_factory):
    path = bc.replay(bc.simulate(request.param), tmp_path_factory.mktemp("page") / "page.html", live=True)
    return request.param, open_page(path, size=(1280, 800), script=NO_VIEW)


@pytest.mark.tier2
class TestAgainstPython:
    def test_the_run_of_the_file_is_computed_again(self, live_run):
        _, page = live_run
        assert page.do("b.live.agreement") < 1e-6
        assert page.clean

    @pytest.mark.parametrize("seed", range(2))
    def test_random_values_give_the_run_that_python_gives(self, live_run, seed):
        name, page = live_run
        page.do("b.live.reset()")
        rng, settings, values = np.random.default_rng(seed), page.do("b.live.settings"), page.do("b.live.values")
        scale, changes = float(rng.uniform(0.9, 1.1)), []
        for k, (one, value) in enumerate(zip(settings, values, strict=True)):
            if one["group"] == "parameters":  # lengths of a linkage, all alike, so that it assembles
                changes.append([k, scale * value])
            elif one["group"].startswith("Baumgarte"):
                changes.append([k, float(rng.uniform(0, 20))])
            elif "guess" not in one["group"] and (rng.random() < 0.6 or k == 0):
                changes.append([k, float(value + rng.uniform(-0.05, 0.05) * max(abs(value), 0.1))])
        assert page.do("b.live.set(x)", changes), page.do("b.live.message")
        found, overrides = page.do("b.live.result"), overrides_of(page)
        kept = [*range(0, len(found["time"]) - 1, 100), -1]
        time, state = np.array(found["time"])[kept], np.array(found["state"]).reshape(len(found["time"]), -1)[kept]
        run = bc.simulate(name, overrides=overrides)
        assert found["status"] == str(run.status)
        assert found["end"] == pytest.approx(run.time[-1], abs=1e-8)
        assert [n for n, _ in found["events"]] == [event.name for event in run.events]
        assert [t for _, t in found["events"]] == pytest.approx([event.time for event in run.events], abs=1e-8)
        run = bc.simulate(name, overrides=overrides, times=time[:-1])
        rows = [k for k, t in enumerate(time) if t in run.time]
        mine = run.state[[run.time.tolist().index(time[k]) for k in rows]]
        # rounding differs, and a run amplifies it; its own error is estimated as 1e-8 to 1e-6
        assert np.abs(state[rows] - mine).max() < 1e-6 * np.abs(mine).max()
        assert len(rows) > 8 and page.clean


@pytest.fixture(scope="module")
def four_bar(open_page, tmp_path_factory):
    path = bc.replay(bc.simulate("four_bar"), tmp_path_factory.mktemp("page") / "page.html", live=True)
    return path, open_page(path, size=(1280, 800), script=NO_VIEW)


@pytest.mark.tier2
class TestHandling:
    def test_an_impossible_start_and_numbers_out_of_range_are_said_and_the_last_run_is_kept(self, four_bar):
        _, page = four_bar
        page.do("b.live.reset()")
        before = page.do("b.live.result.end")
        for value, message in ((9.0, "the constraints cannot be satisfied at the start"), (1e300, "")):
            assert not page.do("b.live.set([[0, x]])", value)
            text = page.do("b.live.message")
            assert message in text and "the last values are kept" in text and "NaN" not in text
            assert page.do("b.live.result.end") == before and page.do("b.live.values")[0] == 1.241
        assert page.clean

    def test_a_worker_that_dies_is_said_and_the_next_change_starts_another(self, four_bar):
        _, page = four_bar
        page.do("b.live.reset()")
        page.do("b.live.patience = 1")
        page.do("b.live.kill()")
        assert not page.do("b.live.set([[5, 0.1]])")
        assert "worker" in page.do("b.live.message")
        page.do("b.live.patience = 20")
        assert page.do("b.live.set([[5, 0.1]])") and page.do("b.live.result.end") < 12.27

    def test_the_command_of_a_changed_run_is_copied_and_the_address_keeps_it(self, four_bar, open_page):
        path, page = four_bar
        page.do("b.live.reset()")
        assert page.do("b.live.set([[5, 0.25]])")
        assert page.do("b.live.command()")["text"] == (
            "bellcrank simulate four_bar --set 'initial.velocity.crank=0.25'"
        )
        again = open_page(path, page.do("location.hash"), size=(1280, 800), script=NO_VIEW)
        assert again.do("b.live.values")[5] == 0.25
        assert again.do("b.live.result.end") == page.do("b.live.result.end")


@pytest.mark.parametrize(("name", "reason"), [("furuta", "dry friction, stops, drives"), ("rolling_disk_b", "")])
def test_a_run_that_a_page_does_not_compute_says_why(name, reason):
    film = film_of_run(bc.simulate(name), live=None)
    assert (film.live is None) is bool(reason)
    assert not reason or any("replays the run" in note and reason in note for note in film.notes)
