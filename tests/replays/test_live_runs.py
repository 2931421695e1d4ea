"""The page of a run computes: what it says of changed values in a real browser is what Python says of them."""

import re
from pathlib import Path
from types import SimpleNamespace
from xml.sax.saxutils import quoteattr

import casadi
import numpy as np
import pytest
import yaml

import bellcrank as bc
from bellcrank.config.yaml_file import read_value
from bellcrank.dynamics.equations.system import system_parameters
from bellcrank.replays.film.run_film import film_of_run
from bellcrank.simulation import live_simulation
from tests.replays.test_live_sizing import NO_VIEW

pytest_plugins = ("browser",)
RUNS = ("four_bar", "spring_pendulum", "rolling_disk", "planar_2r_swing")


def overrides_of(page):
    """What the page's YAML says."""
    text = page.do("b.live.yaml()")["text"]
    lines = [re.split(r": ", line, maxsplit=1) for line in text.split("\n") if text]
    return {path: read_value(value, path) for path, value in lines}


def random_changes(page, rng):
    """Pairs of a number of a setting and a value, with which the scenes start."""
    settings, values = page.do("[b.live.settings, b.live.values]")
    scale, changes = float(rng.uniform(0.9, 1.1)), []
    for k, (one, value) in enumerate(zip(settings, values, strict=True)):
        if one["group"] == "parameters":  # lengths of a linkage, all alike, so that it assembles
            changes.append([k, scale * value])
        elif one["group"].startswith("Baumgarte"):
            changes.append([k, float(rng.uniform(0, 20))])
        elif "guess" not in one["group"] and (rng.random() < 0.6 or k == 0):
            changes.append([k, float(value + rng.uniform(-0.05, 0.05) * max(abs(value), 0.1))])
    return changes


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
        assert page.do("b.live.set(x)", random_changes(page, np.random.default_rng(seed))), page.do("b.live.message")
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


@pytest.mark.tier2
def test_the_run_of_the_file_is_translucent_behind_a_changed_one(four_bar, open_page):
    page = open_page(four_bar[0], size=(640, 480))
    (ghost,) = (k for k, layer in enumerate(page.do("b.layers()")) if layer["group"] == "Run of the file")

    def seen(on):
        page.do("b.showLayer(x[0], x[1])", [ghost, on])
        return page.do("b.capture()")

    page.do("b.seek(11)")
    assert seen(True) == seen(False)
    assert page.do("b.live.set([[5, 0.4]])"), page.do("b.live.message")
    with_ghost, without = seen(True), seen(False)
    assert with_ghost != without
    page.do("b.seek(1e9)")  # the run of the file has ended before or later: it rests, and the page draws on
    assert seen(True) != seen(False)
    page.do("b.live.reset()")
    assert seen(True) == seen(False) and page.clean


@pytest.mark.tier2
def test_gains_of_a_run_without_stabilisation_give_the_residuals_of_python(open_page, tmp_path):
    text = (Path(__file__).parents[2] / "docs" / "theory" / "baumgarte.md").read_text(encoding="utf-8")
    (tmp_path / "turning.yaml").write_text(re.search(r'```yaml title="turning.yaml"\n(.*?)```', text, re.DOTALL)[1])
    path = bc.replay(bc.simulate(tmp_path / "turning.yaml"), tmp_path / "page.html", live=True)
    page = open_page(path, size=(1280, 800), script=NO_VIEW)
    assert page.do("b.live.agreement") < 1e-6
    first = next(k for k, one in enumerate(page.do("b.live.settings")) if one["name"] == "alpha")
    assert page.tab.get_by_label("Baumgarte's gains in place of none: alpha", exact=True).is_visible()

    def residual():
        row = page.tab.locator("#live-panel tr", has_text=re.compile(r"largest residual \[m\]$|residual \[m\]")).first
        return float(row.locator("td").last.inner_text())

    drift = residual()
    for alpha, beta in ((1.0, 1.0), (0.0, 5.0), (20.0, 20.0)):
        assert page.do("b.live.set(x)", [[first, alpha], [first + 1, beta]]), page.do("b.live.message")
        run = bc.simulate(tmp_path / "turning.yaml", overrides=overrides_of(page))
        # Between the rows of the run the page sees larger ones.
        assert 0.5 < residual() / run.constraint_residuals["m"].max() < 2.0 and residual() < 0.02 * drift
    assert page.clean


@pytest.mark.parametrize(("name", "reason"), [("furuta", "dry friction, stops, drives"), ("rolling_disk_b", "")])
def test_a_run_that_a_page_does_not_compute_says_why(name, reason):
    film = film_of_run(bc.simulate(name), live=None)
    assert (film.live is None) is bool(reason)
    assert not reason or any("replays the run" in note and reason in note for note in film.notes)


@pytest.mark.tier2
def test_a_run_ends_before_a_hinge_is_turned_over_as_in_python(open_page, tmp_path, monkeypatch):
    def turned(scene, system):
        found = kernels(scene, system)
        inputs = [casadi.SX.sym(name, len(each)) for name, each in zip("txup", sizes(system, scene), strict=True)]
        found["cosines"] = SimpleNamespace(
            graph=live_simulation._graph(casadi.Function("way", inputs, [3.0 - inputs[0]]))
        )
        return found

    def sizes(system, scene):
        return np.zeros(1), np.zeros(system.size), scene.signals_at(np.zeros(1))[0], system_parameters(scene)

    kernels = live_simulation._kernels
    monkeypatch.setattr(live_simulation, "_kernels", turned)
    path = bc.replay(bc.simulate("bricard"), tmp_path / "page.html", live=True)
    page = open_page(path, script=NO_VIEW)
    found = page.do("b.live.result")
    assert found["status"] == "turned_over" and 2.98 < found["end"] < 3.0 and found["time"][-1] == found["end"]
    assert "replays only" in page.tab.locator("#live-panel").inner_text()  # the run of the file has not ended there


HOSTILE = '<img src=x onerror="hacked=1">\'</script><script>hacked=2</script>;$(touch hacked)`'


@pytest.fixture(scope="module")
def hostile(open_page, tmp_path_factory):
    """The page of a pendulum whose scene, joint, spring and event have a name that is markup."""
    folder = tmp_path_factory.mktemp("hostile")
    urdf = f"""<robot name="r"><link name="world"/><link name="arm"><inertial><origin xyz="0.3 0 0"/><mass value="2"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name={quoteattr(HOSTILE)} type="revolute"><parent link="world"/><child link="arm"/><axis xyz="0 1 0"/>
      <limit effort="50" velocity="9" lower="-9" upper="9"/></joint></robot>"""
    (folder / "arm.urdf").write_text(urdf)
    scene = {
        "name": HOSTILE, "urdf": "arm.urdf", "initial": {HOSTILE: 0.5},
        "forces": [{"name": HOSTILE, "kind": "joint_spring", "joint": HOSTILE, "stiffness": 3.0}],
        "parameters": {"load": {"value": 2.0, "sets": ["link.arm.mass"]}},
        "events": [{"name": HOSTILE, "when": {"joint": HOSTILE, "position": 0.1}}],
        "simulate": {"duration": 2.0},
    }  # fmt: skip
    (folder / "scene.yaml").write_text(yaml.safe_dump(scene))
    path = bc.replay(bc.simulate(folder / "scene.yaml"), folder / "page.html", live=True)
    return open_page(path, size=(1280, 800), script=NO_VIEW)


@pytest.mark.tier2
class TestHostile:
    def test_names_run_no_script(self, hostile):
        page = hostile
        assert any(HOSTILE in one["name"] + one["group"] for one in page.do("b.live.settings"))
        assert page.do("b.live.set([[0, b.live.values[0] * 1.1]])"), page.do("b.live.message")
        page.do("[b.live.command(), b.live.yaml()]")
        assert HOSTILE in page.tab.locator("#panel").inner_text()
        assert page.do("window.hacked") is None and page.do("document.querySelectorAll('img').length") == 0
        assert page.clean

    @pytest.mark.parametrize(
        "text", ["NaN", "1e999", "-1e999", "", "abc", "0x", "1;2", "<img src=x onerror=window.hacked=3>", "1e300"]
    )
    def test_fields_refuse_what_is_no_number_in_range_with_a_sentence(self, hostile, text):
        page = hostile
        page.do("b.live.reset()")
        before = page.do("b.live.values")
        fields = page.tab.locator("#live-panel .number")
        for k in range(fields.count()):
            field = fields.nth(k)
            field.evaluate("(e) => { e.closest('details').open = true; }")
            field.fill(text)
            page.tab.keyboard.press("Tab")
            message = page.tab.locator(".live-message")
            message.wait_for(state="visible")
            assert page.do("b.live.settings")[k]["name"] in message.inner_text()
            assert page.do("b.live.values") == before
            page.do("b.live.set([])")
        assert page.do("window.hacked") is None and page.clean

    def test_extremes_are_computed_or_refused(self, hostile):
        page = hostile
        for k in range(len(page.do("b.live.values"))):
            for value in (1e9, -1e9, 5e-324):
                page.do("b.live.reset()")
                if not page.do("b.live.set([[x[0], x[1]]])", [k, value]):
                    assert "the last values are kept" in page.do("b.live.message")
                assert np.isfinite(page.do("b.live.result.state")).all()
        assert page.clean

    def test_addresses_that_are_wrong_are_said(self, hostile):
        page = hostile
        page.do("b.live.reset()")
        page.do("(location.hash = '#set=<script>window.hacked=4</script>=1&set=__proto__=2&set=%23999=NaN', 1)")
        message = page.tab.locator(".live-message")
        message.wait_for(state="visible")
        assert "which this page does not have" in message.inner_text() and "__proto__" in message.inner_text()
        assert page.do("window.hacked") is None and page.clean
